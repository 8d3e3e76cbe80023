"""A shot under a look that changes while it is looked at, as a stage for a renderer of USD.

    LiveStage.of(stage, scene)      composes a layer in memory over the shot, as a review root composes a look
        .show(look)                 what the look layer of a file says from now on; "" for nothing

The shot's own layers are never written to.  The content of the layer is replaced rather than the layer: who listens to
the stage (Hydra) hears of the opinions that differ, and composes nothing else anew.  Where the shot has no
light that a rasterizer can shine with, the program's stated default lights lie beneath the look.

Whoever draws the stage calls this on the same thread: a Usd.Stage must not be read while it is changed.
"""

from __future__ import annotations

import os
from dataclasses import dataclass

import numpy as np
from pxr import Gf, Sdf, Usd, UsdGeom, UsdLux, UsdUtils

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
    """

    stage: Usd.Stage
    note: str
    layer: Sdf.Layer

    @staticmethod
    def of(stage: Usd.Stage, scene: Scene) -> LiveStage:
        """Returns a stage of an empty look over a shot.

        Args:
            stage: of the shot; it is not changed.
            scene: what was read of it: says whether something shines.
        """
        layer, note = Sdf.Layer.CreateAnonymous("look.usda"), ""
        with quiet_usd():
            if not scene.lights:
                lights, note = default_lights(scene)
                stage = compose_over(stage, _layer_of(lights))
            return LiveStage(compose_over(stage, layer), note, layer)

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


def _layer_of(lights: tuple[Light, ...]) -> Sdf.Layer:
    """A layer that holds a distant and a dome light of even radiance."""
    layer = Sdf.Layer.CreateAnonymous("default_lights.usda")
    stage = Usd.Stage.Open(layer)
    UsdGeom.Scope.Define(stage, LIGHTS)
    for light in lights:
        path = f"{LIGHTS}/{light.kind}"
        made = (UsdLux.DomeLight if light.kind == "dome" else UsdLux.DistantLight).Define(stage, path)
        made.CreateIntensityAttr(float(light.radiance[0]))
        if light.kind == "distant":
            made.CreateAngleAttr(float(np.degrees(light.angle)))
        UsdGeom.Xformable(made).AddTransformOp().Set(Gf.Matrix4d(light.world_from_light.T.tolist()))
    return layer
