"""What the layers that usdslf writes take over from the shot, so that they open alone and validate.

    copy_shot_metadata(stage, layer) -> None     units, axis and time; not the default prim
    default_prim_name(stage) -> str              the shot's, or its first root prim that is drawn
    shot_files(stage) -> set[Path]               files that must never be written to
"""

from __future__ import annotations

from pathlib import Path

from pxr import Sdf, Usd, UsdGeom

# Metadata of a root layer that its sublayers do not pass on.
_TIME = ("startTimeCode", "endTimeCode", "timeCodesPerSecond", "framesPerSecond")
ROOT_ONLY = (
    *("colorConfiguration", "colorManagementSystem", "expressionVariables", "framePrecision"),
    *("kilogramsPerUnit", "renderSettingsPrimPath", "autoPlay", "playbackMode"),
)


def copy_shot_metadata(stage: Usd.Stage, layer: Sdf.Layer, names: tuple[str, ...] = ()) -> None:
    """Writes the shot's units, up axis and time metadata into `layer`, and `names` where the shot has them.

    Units and axis are written even where the shot leaves them to fallbacks: validators ask for them.
    """
    root = layer.pseudoRoot
    root.SetInfo("metersPerUnit", UsdGeom.GetStageMetersPerUnit(stage))
    root.SetInfo("upAxis", UsdGeom.GetStageUpAxis(stage))
    source = stage.GetRootLayer().pseudoRoot
    for name in (*_TIME, *names):
        if source.HasInfo(name):
            root.SetInfo(name, source.GetInfo(name))


def default_prim_name(stage: Usd.Stage) -> str:
    """Returns the name of the shot's default prim, or of its first root prim that is drawn, or ""."""
    prim = stage.GetDefaultPrim()
    if prim and prim.GetPath().IsRootPrimPath():
        return prim.GetName()
    roots = stage.GetPseudoRoot().GetChildren()
    drawn = [p for p in roots if p.IsA(UsdGeom.Imageable)] or roots
    return drawn[0].GetName() if drawn else ""


def shot_files(stage: Usd.Stage) -> set[Path]:
    """Returns the files of all layers that the shot uses."""
    layers = [layer for layer in stage.GetUsedLayers() if layer.realPath]
    return {Path(layer.realPath).resolve() for layer in layers}
