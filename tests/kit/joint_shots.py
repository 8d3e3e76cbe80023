"""One asset under several lamps: a plane with one material, with a float64 model of what an eye sees of it."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from kit.lit_plane import Inputs, Lamp, dabs, seen_under
from kit.stage_parts import StageBuilder
from pxr import Gf, Usd, UsdGeom, UsdLux

from usdslf.strokes.stroke import Stroke

MATERIAL = "/World/mtl/paint"


def write_asset(folder: Path, before: Inputs) -> Path:
    """A plane of 4 x 4 at z = 0 and its material, alone in `asset.usda`."""
    folder.mkdir(parents=True, exist_ok=True)
    b = StageBuilder(folder)
    diffuse, specular, roughness = before
    look = b.material(
        "paint", useSpecularWorkflow=1.0, diffuseColor=diffuse, specularColor=specular, roughness=roughness
    )  # fmt: skip
    b.plane("floor", 4.0, 4.0, look, axis="Z")
    target = folder / "asset.usda"
    b.stage.GetRootLayer().Export(str(target))
    return target


def write_shot(folder: Path, asset: Path, lamp: Lamp) -> Path:
    """A shot that references the asset at /set/thing and has a lamp."""
    folder.mkdir(parents=True, exist_ok=True)
    target = folder / "shot.usda"
    target.unlink(missing_ok=True)
    stage = Usd.Stage.CreateNew(str(target))
    UsdGeom.SetStageUpAxis(stage, "Y")
    UsdGeom.SetStageMetersPerUnit(stage, 1.0)
    top = UsdGeom.Xform.Define(stage, "/set")
    stage.SetDefaultPrim(top.GetPrim())
    thing = UsdGeom.Xform.Define(stage, "/set/thing")
    thing.GetPrim().GetReferences().AddReference(f"../{asset.name}")
    light = UsdLux.RectLight.Define(stage, "/set/lamp")
    light.CreateWidthAttr(lamp.size[0])
    light.CreateHeightAttr(lamp.size[1])
    light.CreateIntensityAttr(1.0)
    light.CreateColorAttr(Gf.Vec3f(*lamp.power))
    light.AddTranslateOp().Set(Gf.Vec3d(*lamp.at))
    stage.GetRootLayer().Save()
    return target


def painted(points: np.ndarray, lamp: Lamp, after: Inputs, **other: object) -> Stroke:
    """What the plane is to look like under a lamp, exactly, at points of it."""
    return dabs(points, seen_under(lamp, points, after), np.array(lamp.eye), **other)


# ---- cases in which each shot alone is wrong or ambiguous -----------------------------------------------------------
BEFORE: Inputs = ((0.25, 0.25, 0.25), (0.06, 0.06, 0.06), 0.25)
AFTER: dict[str, Inputs] = {
    "diffuse": ((0.4, 0.275, 0.325), BEFORE[1], BEFORE[2]),
    "darker": ((0.15, 0.15, 0.15), BEFORE[1], BEFORE[2]),
    "specular": (BEFORE[0], (0.2, 0.2, 0.2), BEFORE[2]),
    "glossiness": (BEFORE[0], BEFORE[1], 0.45),
}
LAMPS = {
    "high": Lamp((-0.8, -0.4, 1.3)),
    "side": Lamp((1.6, -1.2, 0.9)),
    "back": Lamp((0.9, 1.5, 1.0)),
    "over": Lamp((0.2, 0.1, 1.5)),
    "wide": Lamp((-0.8, -0.4, 1.3), (2.4, 2.0), (1.0, 0.9, 0.8)),
    "red": Lamp((0.4, -0.9, 1.2), power=(4.0, 1.2, 0.6)),
}
RINGS = {"ring6": (6, 0.0, 0.35), "ring4": (4, 0.1, 0.2), "tight": (4, 0.0, 0.06)}  # dabs, centre, radius
CASES = (  # dabs, what changed, both lamps
    ("ring6", "darker", "side", "wide"),
    ("ring4", "darker", "high", "back"),
    ("tight", "darker", "high", "red"),
    ("tight", "darker", "over", "wide"),
    ("ring4", "diffuse", "high", "side"),
    ("ring4", "diffuse", "wide", "red"),
    ("tight", "diffuse", "back", "wide"),
    ("ring4", "specular", "back", "over"),
    ("ring6", "glossiness", "over", "wide"),
    ("tight", "glossiness", "high", "wide"),
)


def ring(name: str) -> np.ndarray:
    """Places (n, 3) of dabs on a circle."""
    count, x, radius = RINGS[name]
    angle = np.linspace(0, 2 * np.pi, count, endpoint=False)
    return np.stack([x + radius * np.cos(angle), radius * np.sin(angle), 0 * angle], 1)
