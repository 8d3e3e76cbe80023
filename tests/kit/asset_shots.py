"""Shots of the real assets beside the repository: a small stage over each, with a camera and a light.

The asset is a sublayer, so that its prims keep their paths; instanced ones are referenced, twice or more.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pxr import Gf, Sdf, Usd, UsdGeom, UsdLux, UsdShade

CAMERA = "/shot_camera"
DOME = "/shot_dome"
ASPECT = 4 / 3


@dataclass(frozen=True)
class View:
    """Where a camera stands, about the middle of what it looks at."""

    azimuth: float  # degrees about up, 0 from the front (+Z of a Y-up stage, -Y of a Z-up one)
    elevation: float  # degrees
    distance: float = 1.0  # 1: a sphere about the bounds fills the height
    look_at: tuple[float, float, float] = (0.5, 0.5, 0.5)  # of the bounds
    fov: float = 28.0  # degrees, vertical


@dataclass(frozen=True)
class Shot:
    """An asset as it is shown."""

    name: str
    asset: str  # file below the assets
    view: View | str  # or the path of a camera of the asset
    hdri: str = ""  # file below the assets; "": the asset's own lights
    turn: float = 0.0  # degrees, of the dome
    intensity: float = 1.0
    variants: tuple[tuple[str, str, str], ...] = ()  # prim, set, choice
    copies: tuple[tuple[float, float, float], ...] = ()  # places (of the bounds' size) of instances of `root`
    root: str = ""  # prim that is instanced

    @property
    def camera(self) -> str:
        """Path of the camera in the stage that is built."""
        return self.view if isinstance(self.view, str) else CAMERA


STUDIO, COURTYARD, APARTMENT = "hdri/studio_1k.hdr", "hdri/courtyard_1k.exr", "hdri/apartment_1k.hdr"
SHIP = "dutch_ship_polyhaven/dutch_ship_medium.usdc"
MAYA = "preview_surface_mayausd"
CARS = "vehicles_usdwg/USD_Mini_Car_Kit/assets/vehicles/vehicleVariants.usda"

SHOTS = {
    s.name: s
    for s in (
        Shot("avocado", "avocado/avocado.usda", View(25, 15, 0.8), STUDIO, 30, 0.4),
        Shot("ship", SHIP, View(35, 8, 0.8), COURTYARD, 60),
        Shot("hull", SHIP, View(40, 12, 0.35, (0.42, 0.5, 0.2)), APARTMENT, 120),
        Shot("sails", SHIP, View(-30, 5, 0.45, (0.5, 0.5, 0.6)), COURTYARD, 200),
        Shot("rigging", SHIP, View(60, 15, 0.3, (0.5, 0.5, 0.35)), APARTMENT),
        Shot("fancy_teapot", "teapot_usdwg/Teapot.usd", View(60, 20, 0.75), APARTMENT, 40, 1.0,
             (("/Teapot", "modelVariant", "Fancy"),)),
        Shot("teapot", "teapot_usdwg/Teapot.usd", View(60, 20, 0.75), APARTMENT, 40),
        Shot("car", CARS, View(40, 20, 0.75), COURTYARD, 20),
        Shot("fleet", SHIP, View(30, 20, 0.9), COURTYARD, 60,
             copies=((0, 0, 0), (0.5, 0.9, 0)), root="/root"),
        Shot("teapots_instanced", "teapots_instanced_usdwg/assets/teapot/teapot.usd", View(30, 30, 0.7), APARTMENT,
             copies=((0, 0, 0), (0.7, 0, 0.6), (-0.5, 0, 0.9)), root="/teapot"),
        Shot("opacity", f"{MAYA}/UsdPreviewSurface/TestOpacityThreshold.usda", View(10, 15, 0.75), COURTYARD),
        Shot("panels", f"{MAYA}/multipleMaterialsAssignment/MultipleMaterialsAssignment.usda", View(10, 5, 0.8),
             APARTMENT, 90),
        Shot("shaderball", "shaderball_usdwg/standard_shader_ball_scene.usda", "/standard_shader_ball_scene/camera"),
        Shot("cornell_box", "cornell_box/cornell-box.usda", "/cornell_box/camera/camera"),
        Shot("living_room", "living_room_godot/living_room.usda", "/root/Camera3D/Camera3D"),
    )
}  # fmt: skip


def build_shot(
    shot: Shot, assets: Path, folder: Path, changes: dict[str, Any] | None = None, only: str = ""
) -> Path:
    """Writes the stage of a shot and returns its path.

    Args:
      shot: what is shown.
      assets: folder of the assets.
      folder: where the stage is written.
      changes: value of each attribute path of the asset that is overridden.
      only: path of the copy that alone is overridden, no instance any more; "": all.
    """
    folder.mkdir(parents=True, exist_ok=True)
    asset = assets / shot.asset
    inner = folder / "asset.usda"
    _over_asset(inner, asset, shot, {} if only else changes or {})
    stage = Usd.Stage.CreateNew(str(folder / "stage.usda"))
    source = Usd.Stage.Open(str(inner))
    UsdGeom.SetStageUpAxis(stage, UsdGeom.GetStageUpAxis(source))
    UsdGeom.SetStageMetersPerUnit(stage, UsdGeom.GetStageMetersPerUnit(source))
    if source.HasAuthoredTimeCodeRange():
        stage.SetStartTimeCode(source.GetStartTimeCode())
        stage.SetEndTimeCode(source.GetEndTimeCode())
    if shot.copies:
        low, high = bounds(source)
        for i, place in enumerate(shot.copies):
            copy = UsdGeom.Xform.Define(stage, f"/shot_copy{i}")
            copy.AddTranslateOp().Set(Gf.Vec3d(*(np.array(place) * (high - low)).tolist()))
            copy.AddRotateXYZOp().Set(Gf.Vec3f(0, 0, 0))
            copy.GetPrim().GetReferences().AddReference("./asset.usda", shot.root)
            copy.GetPrim().SetInstanceable(True)
    else:
        stage.GetRootLayer().subLayerPaths.append("./asset.usda")
    if only:
        stage.GetPrimAtPath(only).SetInstanceable(False)
        for attribute, value in (changes or {}).items():
            _override(stage, Sdf.Path(attribute.replace(shot.root, only, 1)), value)
    if isinstance(shot.view, View):
        _add_camera(stage, shot.view)
    if shot.hdri:
        _add_dome(stage, shot, assets)
    stage.GetRootLayer().Save()
    return folder / "stage.usda"


def bounds(stage: Usd.Stage) -> tuple[NDArray, NDArray]:
    """Returns the lower and upper corner (3,) of all that is drawn."""
    cache = UsdGeom.BBoxCache(Usd.TimeCode.EarliestTime(), ["default", "render"])
    box = cache.ComputeWorldBound(stage.GetPseudoRoot()).ComputeAlignedRange()
    return np.array(box.GetMin()), np.array(box.GetMax())


def _over_asset(path: Path, asset: Path, shot: Shot, changes: dict[str, Any]) -> None:
    layer = Sdf.Layer.CreateNew(str(path))
    layer.subLayerPaths.append(str(asset))
    layer.Save()
    stage = Usd.Stage.Open(layer)
    below = Usd.Stage.Open(str(asset))
    UsdGeom.SetStageUpAxis(stage, UsdGeom.GetStageUpAxis(below))
    UsdGeom.SetStageMetersPerUnit(stage, UsdGeom.GetStageMetersPerUnit(below))
    if below.HasAuthoredTimeCodeRange():
        stage.SetStartTimeCode(below.GetStartTimeCode())
        stage.SetEndTimeCode(below.GetEndTimeCode())
    for prim, name, choice in shot.variants:
        stage.GetPrimAtPath(prim).GetVariantSet(name).SetVariantSelection(choice)
    for attribute, value in changes.items():
        _override(stage, Sdf.Path(attribute), value)
    layer.Save()


def _override(stage: Usd.Stage, path: Sdf.Path, value: Any) -> None:
    """Sets an input of a shader; one that was connected is cut off."""
    shader = UsdShade.Shader(stage.GetPrimAtPath(path.GetPrimPath()))
    if not shader:
        raise ValueError(f"{path}: no shader there, changes name inputs of shaders")
    name = path.name.removeprefix("inputs:")
    kinds = {"scale": Sdf.ValueTypeNames.Float4, "bias": Sdf.ValueTypeNames.Float4}
    shade_input = shader.GetInput(name)
    if not shade_input:
        kind = kinds.get(name, Sdf.ValueTypeNames.Color3f if isinstance(value, tuple) else Sdf.ValueTypeNames.Float)
        shade_input = shader.CreateInput(name, Sdf.ValueTypeNames.Int if isinstance(value, int) else kind)
    if shade_input.HasConnectedSource():
        raise ValueError(f"{path} is connected: change its texture's scale and bias")
    rows = {3: Gf.Vec3f, 4: Gf.Vec4f}
    shade_input.Set(rows[len(value)](*value) if isinstance(value, tuple) else value)


def _add_camera(stage: Usd.Stage, view: View) -> None:
    low, high = bounds(stage)
    target = Gf.Vec3d(*(low + (high - low) * np.array(view.look_at)).tolist())
    radius = float(np.linalg.norm(high - low)) / 2
    distance = view.distance * radius / math.sin(math.radians(view.fov) / 2)
    a, e = math.radians(view.azimuth), math.radians(view.elevation)
    right, front, above = math.cos(e) * math.sin(a), math.cos(e) * math.cos(a), math.sin(e)
    is_z_up = UsdGeom.GetStageUpAxis(stage) == "Z"
    way = Gf.Vec3d(right, -front, above) if is_z_up else Gf.Vec3d(right, above, front)
    up = Gf.Vec3d(0, 0, 1) if is_z_up else Gf.Vec3d(0, 1, 0)
    camera = UsdGeom.Camera.Define(stage, CAMERA)
    camera.CreateFocalLengthAttr(35.0)
    vertical = 2 * 35.0 * math.tan(math.radians(view.fov) / 2)
    camera.CreateVerticalApertureAttr(vertical)
    camera.CreateHorizontalApertureAttr(vertical * ASPECT)
    camera.CreateClippingRangeAttr(Gf.Vec2f(1e-3 * radius, 100 * radius))
    eye = target + way * distance
    camera.AddTransformOp().Set(Gf.Matrix4d().SetLookAt(eye, target, up).GetInverse())


def _add_dome(stage: Usd.Stage, shot: Shot, assets: Path) -> None:
    dome = UsdLux.DomeLight.Define(stage, DOME)
    dome.CreateTextureFileAttr(str(assets / shot.hdri))
    dome.CreateTextureFormatAttr("latlong")
    dome.CreateIntensityAttr(shot.intensity)
    if UsdGeom.GetStageUpAxis(stage) == "Z":
        dome.AddRotateXOp().Set(90.0)
    dome.AddRotateYOp().Set(shot.turn)
