"""A plane under a rect light, with a float64 model of what an eye sees of it: from a stage and a stroke to a report."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from kit.stage_parts import StageBuilder, Triple
from pxr import Gf, UsdLux
from reference import evidence as ref
from reference.solve import radiance

from usdslf.strokes.stroke import Stroke

Inputs = tuple[Triple, Triple, float]  # diffuse, specular, roughness
EYE = np.array([0.9, 0.5, 1.4])
LAMP, SIZE, POWER = np.array([-0.8, -0.4, 1.3]), (0.8, 0.5), np.array([4.0, 3.6, 3.0])
FLOOR = {"diffuse": (0.4, 0.3, 0.2), "specular": (0.05, 0.05, 0.05), "roughness": 0.3}


@dataclass(frozen=True)
class Lamp:
    """A rect light that shines down, and the eye of its shot."""

    at: Triple
    size: tuple[float, float] = (0.6, 0.5)
    power: Triple = (4.0, 3.6, 3.0)
    eye: Triple = (0.9, 0.5, 1.4)


def write_plane(folder: Path) -> Path:
    """A plane of 4 x 4 at z = 0, a rect light above that shines down, a camera."""
    b = StageBuilder(folder)
    look = b.material(
        "floor", useSpecularWorkflow=1.0, diffuseColor=FLOOR["diffuse"], specularColor=FLOOR["specular"],
        roughness=FLOOR["roughness"],
    )  # fmt: skip
    b.plane("floor", 4.0, 4.0, look, axis="Z")
    light = UsdLux.RectLight.Define(b.stage, "/World/lamp")
    light.CreateWidthAttr(SIZE[0])
    light.CreateHeightAttr(SIZE[1])
    light.CreateIntensityAttr(1.0)
    light.CreateColorAttr(Gf.Vec3f(*POWER))
    light.AddTranslateOp().Set(Gf.Vec3d(*LAMP))
    b.camera(tuple(EYE), (0, 0, 0))
    return b.save()


def seen(points: np.ndarray, diffuse: tuple, specular: tuple, roughness: float) -> np.ndarray:
    """Radiance (n, 3) of the plane from the eye, by quadrature over the lamp."""
    return seen_under(Lamp(tuple(LAMP), SIZE, tuple(POWER), tuple(EYE)), points, (diffuse, specular, roughness))


def seen_under(lamp: Lamp, points: np.ndarray, inputs: Inputs) -> np.ndarray:
    """Radiance (n, 3) of the plane from a lamp's eye, by quadrature over the lamp."""
    diffuse, specular, roughness = inputs
    columns = []
    for p in points:
        l, solid = ref.light_directions("rect", lamp.size, np.array(lamp.at), p, 64)
        eye = np.array(lamp.eye) - p
        columns.append(ref.columns_of_light("preview_surface", roughness, [0, 0, 1], eye, l, solid))
    light = np.array(columns)[..., None] * np.array(lamp.power)
    return radiance("preview_surface", light, diffuse, specular, (1, 1, 1))


def places() -> np.ndarray:
    """Dabs (16, 3) through the highlight and around it."""
    u, v = np.meshgrid(np.linspace(-0.35, 0.55, 4), np.linspace(-0.3, 0.4, 4))
    return np.stack([u.ravel(), v.ravel(), 0 * u.ravel()], 1)


def dabs(points: np.ndarray, colors: np.ndarray, eye: np.ndarray = EYE, **other: object) -> Stroke:
    """A stroke of one small dab at each point."""
    twice = lambda x: np.repeat(np.float32(x), 2, 0)  # noqa: E731
    n = len(points)
    return Stroke(
        "stroke_0001", twice(points), np.full(2 * n, 0.03, np.float32), twice(colors),
        np.tile(np.float32(eye), (2 * n, 1)), curve_counts=(2,) * n, **other,
    )  # fmt: skip
