"""A shot under a look that changes while it is looked at, as a stage for a renderer of USD.

    LiveStage.of(stage, scene)      composes a layer in memory over the shot, as a review root composes a look
        .show(look)                 what the look layer of a file says from now on; "" for nothing

The shot's own layers are never written to.  The content of the layer is replaced rather than the layer: who listens to
the stage (Hydra) hears of the opinions that differ, and composes nothing else anew.  Beneath the look lie, where the
shot lacks them: the program's stated default lights, and the schema that Hydra asks for on prims that bind materials.

Whoever draws the stage calls this on the same thread: a Usd.Stage must not be read while it is changed.
"""

from __future__ import annotations

import os
from dataclasses import dataclass, field
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from pxr import Gf, Sdf, Usd, UsdGeom, UsdLux, UsdShade, UsdUtils

from usdslf.errors import InputError
from usdslf.lights.defaults import default_lights
from usdslf.replacing import is_file
from usdslf.scene.records import Light, Scene
from usdslf.usd.border import quiet_usd, reading
from usdslf.usd.layer.wins import compose_over

LIGHTS = "/usdslf_default_lights"  # prim of the default lights; a shot has nothing of that name


@dataclass(frozen=True, eq=False)
class LiveStage:
    """A shot under a look.

    Attributes:
        stage: Usd.Stage of both; it belongs to whoever draws it.
        note: a sentence on the light that was added, "" where the shot's own shines.
        layer: Sdf.Layer in memory that holds the look.
        folder: of the picture of the default dome, for as long as the stage is drawn.
    """

    stage: Usd.Stage
    note: str
    layer: Sdf.Layer
    folder: TemporaryDirectory[str] | None = field(default=None, repr=False)

    @staticmethod
    def of(stage: Usd.Stage, scene: Scene) -> LiveStage:
        """Returns a stage of an empty look over a shot.

        Args:
            stage: of the shot; it is not changed.
            scene: what was read of it: says whether something shines.
        """
        layer, note, folder = Sdf.Layer.CreateAnonymous("look.usda"), "", None
        with quiet_usd():
            if (bindings := _undeclared_bindings(stage)) is not None:
                stage = compose_over(stage, bindings)
            if not scene.lights:
                lights, note = default_lights(scene)
                folder = TemporaryDirectory(prefix="usdslf-light-", ignore_cleanup_errors=True)
                stage = compose_over(stage, _layer_of(lights, Path(folder.name)))
            return LiveStage(compose_over(stage, layer), note, layer, folder)

    def close(self) -> None:
        """Removes what was written for it; nothing draws it any more."""
        if self.folder is not None:
            self.folder.cleanup()

    def show(self, look: str | os.PathLike[str] = "") -> None:
        """Puts the content of a look layer over the shot, in place of what was there.

        Args:
            look: its file, as it is on the disk now; "": none.

        Raises: InputError where it cannot be read; what was there stays.
        """
        name = os.fspath(look)
        with reading(name, InputError, "make a look with usdslf solve"):
            if not name:
                self.layer.TransferContent(Sdf.Layer.CreateAnonymous(".usda"))
                return
            if not is_file(name):
                raise InputError(f"there is no look layer {name}; make one with: usdslf solve")
            read = Sdf.Layer.OpenAsAnonymous(name)
            if read is None:
                raise InputError(f"{name} is not a readable USD file, make a look with usdslf solve")
            folder = os.path.dirname(os.path.realpath(name))
            UsdUtils.ModifyAssetPaths(read, lambda path: _anchored(path, folder))
            self.layer.TransferContent(read)


def _anchored(path: str, folder: str) -> str:
    """An asset path of a layer in a folder, for a layer that has none."""
    is_relative = path.startswith(("./", "../"))
    return os.path.normpath(os.path.join(folder, path)).replace(os.sep, "/") if is_relative else path


def _undeclared_bindings(stage: Usd.Stage) -> Sdf.Layer | None:
    """A layer that applies MaterialBindingAPI to prims that bind a material without it; None where all have it.

    Older files bind without, programs read them all the same, and so does this one; Hydra would show no material.
    """
    layer = Sdf.Layer.CreateAnonymous("bindings.usda")
    with Sdf.ChangeBlock():
        for prim in stage.Traverse():
            binds = any(r.GetName().startswith("material:binding") for r in prim.GetAuthoredRelationships())
            if binds and not prim.HasAPI(UsdShade.MaterialBindingAPI):
                spec = Sdf.CreatePrimInLayer(layer, prim.GetPath())
                spec.SetInfo("apiSchemas", Sdf.TokenListOp.Create(prependedItems=["MaterialBindingAPI"]))
    return None if layer.empty else layer


def _layer_of(lights: tuple[Light, ...], folder: Path) -> Sdf.Layer:
    """A layer that holds a distant and a dome light of even radiance; Storm shines with domes that have a picture."""
    picture = folder / "dome.hdr"
    layer = Sdf.Layer.CreateAnonymous("default_lights.usda")
    stage = Usd.Stage.Open(layer)
    UsdGeom.Scope.Define(stage, LIGHTS)
    for light in lights:
        path = f"{LIGHTS}/{light.kind}"
        made = (UsdLux.DomeLight if light.kind == "dome" else UsdLux.DistantLight).Define(stage, path)
        made.CreateIntensityAttr(1.0 if light.kind == "dome" else float(light.radiance[0]))
        if light.kind == "dome":  # which is seen without its intensity
            picture.write_bytes(_radiance_picture(light.radiance[0]))
            made.CreateTextureFileAttr(picture.as_posix())
        if light.kind == "distant":
            made.CreateAngleAttr(float(np.degrees(light.angle)))
        UsdGeom.Xformable(made).AddTransformOp().Set(Gf.Matrix4d(light.world_from_light.T.tolist()))
    return layer


def _radiance_picture(radiance: float) -> bytes:
    """A Radiance picture, 4 x 2 pixels of a grey radiance."""
    mantissa, exponent = np.frexp(radiance)
    pixel = bytes([round(float(mantissa) * 256)] * 3 + [int(exponent) + 128])
    return b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 2 +X 4\n" + pixel * 8
