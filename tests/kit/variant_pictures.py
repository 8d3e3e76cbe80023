"""What Hydra draws of alternatives that travel: balls whose materials are local, referenced and in an instance.

Imported where the pxr that draws has been chosen.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
from kit.look_stages import author, change_of
from kit.reviewed_looks import RED, write_shot
from pxr import Gf, Sdf, Usd, UsdGeom

from usdslf import Shot
from usdslf.usd.author.variants import AS_IT_WAS, variants_in
from usdslf.usd.layer.shown_paths import ALTERNATIVES

COLOR, ROUGH = (0.1, 0.4, 0.3), 0.15
PAINTED = {"/World/ball": ("/World/ball", "/World/other"), "/World/one/body": (), "/World/three/body": ()}
PLACES = {"ball": -5.0, "other": -3.0, "one": -1.0, "two": 1.0, "three": 3.0, "crate": 5.0}
Draw = Callable[[Shot], np.ndarray]


def variant_pictures(folder: Path, draw: Draw) -> dict[str, np.ndarray]:
    """Pictures of two selections of a look, and of the shots that they are to look like.

    Args:
        draw: of a shot, from a camera that is the same for all.
    """
    folder.mkdir()
    stage = write_shot(folder)
    for name, x in PLACES.items():
        UsdGeom.Xformable(stage.GetPrimAtPath(f"/World/{name}")).AddTranslateOp().Set(Gf.Vec3d(x, 0, 0))
    stage.GetRootLayer().Save()
    best, rivals = [], {}
    for number, (prim, users) in enumerate(PAINTED.items()):
        best.append(change_of(stage, prim, "diffuse", COLOR, targets=users or (prim,)))
        rivals[number] = [change_of(stage, prim, "glossiness", roughness=ROUGH, targets=users or (prim,))]
    author(stage, folder, *best, rivals=rivals)
    return {
        "selected diffuse": draw(_shot(_selected(folder, "diffuse"))),
        "selected as it was": draw(_shot(_selected(folder, AS_IT_WAS))),
        "plain painted": draw(_shot(_plainly(folder))),
        "plain shot": draw(_shot(Usd.Stage.Open(str(folder / "shot.usda")))),
    }


def _shot(stage: Usd.Stage) -> Shot:
    return Shot.open(stage, elements=64)


def _over(folder: Path, *files: str) -> Usd.Stage:
    root = Sdf.Layer.CreateAnonymous(".usda")
    root.subLayerPaths = [str(folder / f) for f in (*files, "shot.usda")]
    stage = Usd.Stage.Open(root)
    UsdGeom.SetStageUpAxis(stage, "Z")
    UsdGeom.SetStageMetersPerUnit(stage, 1)
    return stage


def _selected(folder: Path, name: str) -> Usd.Stage:
    """What any program does: another selection, in a layer over look and shot."""
    stage = _over(folder, "look.usda")
    for material in variants_in(Sdf.Layer.FindOrOpen(str(folder / "look.usda"))):
        assert stage.GetPrimAtPath(material).GetVariantSet(ALTERNATIVES).SetVariantSelection(name)
    return stage


def _plainly(folder: Path) -> Usd.Stage:
    """The same colours where the materials are, without a look: the one instance is none any more."""
    stage = _over(folder)
    stage.GetPrimAtPath("/World/one").SetInstanceable(False)
    for material in (RED, "/World/one/mtl/paint", "/World/three/mtl/paint"):
        stage.GetPrimAtPath(f"{material}/pbr").GetAttribute("inputs:diffuseColor").Set(Gf.Vec3f(*COLOR))
    return stage
