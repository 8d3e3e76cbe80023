"""Stages on which the renderer is held against a path tracer, and the measure of how far they are apart."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
from kit.stage_parts import StageBuilder, TextureInput, ball, box, checker, noise, rectangle, sky, teapot, torus, vase
from numpy.typing import NDArray
from pxr import Gf, UsdGeom, UsdLux
from scipy.ndimage import uniform_filter

CAMERA = "/World/camera"
DIFFUSE_LIMIT, GLOSSY_LIMIT = 0.05, 0.08  # mean relative error after averaging


def relative_error(picture: NDArray, truth: NDArray, box_size: int = 5) -> float:
    """Mean relative error of two pictures (h, w, 3) after box averaging.

    Each channel's error over the truth's, which is kept above 2 % of the picture's mean.
    """
    return float(error_map(picture, truth, box_size).mean())


def error_map(picture: NDArray, truth: NDArray, box_size: int = 5) -> NDArray:
    """Relative errors (h, w, 3), see `relative_error`."""
    size = (box_size, box_size, 1)
    a = uniform_filter(np.asarray(picture, np.float64), size, mode="nearest")
    b = uniform_filter(np.asarray(truth, np.float64), size, mode="nearest")
    return np.abs(a - b) / np.maximum(b, 0.02 * b.mean())


def _matte(builder: StageBuilder, name: str, color: object) -> str:
    return builder.material(name, diffuseColor=color, roughness=1.0, ior=1.0)


def _room(b: StageBuilder, floor: str) -> None:
    white = _matte(b, "white", (0.7, 0.7, 0.7))
    b.mesh("floor", rectangle((-2, 0, 2), (4, 0, 0), (0, 0, -4)), floor)
    b.mesh("ceiling", rectangle((-2, 3, -2), (4, 0, 0), (0, 0, 4)), white)
    b.mesh("back", rectangle((-2, 0, -2), (4, 0, 0), (0, 3, 0)), white)
    b.mesh("left", rectangle((-2, 0, 2), (0, 0, -4), (0, 3, 0)), _matte(b, "red", (0.63, 0.06, 0.05)))
    b.mesh("right", rectangle((2, 0, -2), (0, 0, 4), (0, 3, 0)), _matte(b, "green", (0.14, 0.45, 0.09)))
    b.camera((0, 1.5, 5.6), (0, 1.4, 0), 42)


def diffuse_room(folder: Path) -> Path:
    """Coloured walls bleed on matte boxes below an area light."""
    b = StageBuilder(folder)
    _room(b, _matte(b, "floor", (0.6, 0.6, 0.6)))
    b.mesh("tall", box(0.9, 1.7, 0.9), _matte(b, "tall", (0.7, 0.7, 0.7)), (-0.7, 0, -0.7), 20)
    b.mesh("short", box(0.9, 0.8, 0.9), _matte(b, "short", (0.6, 0.5, 0.2)), (0.7, 0, 0.5), -17)
    b.rect_light("lamp", (0, 2.95, 0), (0, 0, 0), 1.0, 1.0, (14.0, 13.0, 11.0))
    return b.save()


def glossy_room(folder: Path) -> Path:
    """A glossy floor and a shining ball in the room, lit by an area light and a small sphere."""
    b = StageBuilder(folder)
    _room(b, b.material("floor", diffuseColor=(0.3, 0.25, 0.2), roughness=0.3))
    b.mesh("ball", ball(0.6, 64), b.material("ball", diffuseColor=(0.1, 0.2, 0.6), roughness=0.15), (-0.8, 0, 0.2))
    gold = b.material("gold", diffuseColor=(1.0, 0.77, 0.34), metallic=1.0, roughness=0.35)
    b.mesh("vase", vase(1.3, 0.45), gold, (0.8, 0, 0))
    b.rect_light("lamp", (0, 2.95, -0.5), (0, 0, -0.5), 1.4, 0.7, (11.0, 10.0, 9.0))
    b.sphere_light("bulb", (1.4, 1.9, 1.2), 0.12, (5.0, 7.0, 9.0))
    return b.save()


def outdoors(folder: Path) -> Path:
    """Textured ground, a metal pot and a rubber ring under a sky and a sun, Z-up in centimetres."""
    b = StageBuilder(folder, "Z", 100.0)
    tiles = TextureInput(b.image("tiles.png", checker((0.8, 0.7, 0.6), (0.25, 0.3, 0.35), 12, 128)))
    b.image("sky.exr", sky(3, 64, 20.0))
    ground = b.material("ground", diffuseColor=tiles, roughness=0.6)
    b.mesh("ground", rectangle((-6, 0, 6), (12, 0, 0), (0, 0, -12)), ground)
    steel = b.material("steel", diffuseColor=(0.8, 0.8, 0.82), metallic=1.0, roughness=0.25)
    b.mesh("pot", teapot(1.4), steel, (-0.5, 0, 0), 25)
    b.mesh("ring", torus(), _matte(b, "rubber", (0.7, 0.2, 0.1)), (0.9, 0, 0.7))
    b.dome_light("sky", 1.0, (1, 1, 1), "sky.exr", 40.0)
    b.distant_light("sun", (-0.5, -1.0, -0.6), 0.53, 3.0)
    b.camera((0.4, 1.6, 4.2), (0.1, 0.4, 0), 36)
    return b.save()


def mirrors(folder: Path) -> Path:
    """Near-mirrors that show a noisy texture and each other, by a disk light and a faint dome."""
    b = StageBuilder(folder)
    cloth = TextureInput(b.image("cloth.png", noise((0.1, 0.2, 0.5), (0.9, 0.8, 0.4), 5)))
    b.mesh(
        "table",
        rectangle((-3, 0, 3), (6, 0, 0), (0, 0, -6), 2.0),
        b.material("cloth", diffuseColor=cloth, roughness=0.9),
    )
    b.mesh("wall", rectangle((-3, 0, -2), (6, 0, 0), (0, 4, 0)), _matte(b, "wall", (0.5, 0.35, 0.3)))
    chrome = b.material("chrome", diffuseColor=(0.9, 0.9, 0.92), metallic=1.0, roughness=0.03)
    b.mesh("ball", ball(0.55, 96), chrome, (-0.65, 0, 0))
    glaze = b.material(
        "glaze", useSpecularWorkflow=1, diffuseColor=(0.3, 0.04, 0.04), specularColor=(0.2, 0.2, 0.2), roughness=0.08
    )
    b.mesh("egg", ball(0.5, 96), glaze, (0.7, 0, 0.3))
    b.dome_light("sky", 0.25, (0.8, 0.9, 1.0))
    light = UsdLux.DiskLight.Define(b.stage, "/World/disk")
    light.CreateRadiusAttr(0.5)
    light.CreateIntensityAttr(14.0)
    light.AddTranslateOp().Set(Gf.Vec3d(1.2, 3.0, 1.5))
    light.AddRotateXYZOp().Set(Gf.Vec3f(-70, 25, 0))
    b.camera((0, 1.3, 4.0), (0, 0.5, 0), 36)
    return b.save()


def emissive(folder: Path) -> Path:
    """A closed room lit by an emissive panel only, with a metal ring and a plastic box."""
    b = StageBuilder(folder)
    _room(b, _matte(b, "floor", (0.5, 0.5, 0.55)))
    panel = b.material("panel", diffuseColor=(0.0, 0.0, 0.0), emissiveColor=(9.0, 8.0, 6.0), roughness=1.0, ior=1.0)
    b.mesh("panel", box(1.0, 0.04, 0.8), panel, (0, 2.9, 0.1))
    copper = b.material("copper", diffuseColor=(0.95, 0.6, 0.45), metallic=1.0, roughness=0.4)
    b.mesh("ring", torus(0.5, 0.2), copper, (-0.7, 0, 0.4))
    b.mesh(
        "block",
        box(0.8, 1.4, 0.8),
        b.material("block", diffuseColor=(0.2, 0.4, 0.6), roughness=0.4),
        (0.8, 0, -0.5),
        30,
    )
    return b.save()


def implicit(folder: Path) -> Path:
    """Spheres and a cube on a plane between a cylinder light, a wide sun and a white dome; an off-centre camera."""
    b = StageBuilder(folder)
    b.plane("ground", 8, 8, _matte(b, "ground", (0.5, 0.5, 0.5)))
    b.sphere("red", 0.5, b.material("red", diffuseColor=(0.6, 0.1, 0.08), roughness=0.5), (-0.8, 0.5, 0))
    b.sphere(
        "silver", 0.4, b.material("silver", diffuseColor=(0.9, 0.9, 0.9), metallic=1.0, roughness=0.2), (0.2, 0.4, 0.8)
    )
    b.cube("cube", (0.8, 0.8, 0.8), _matte(b, "blue", (0.15, 0.25, 0.6)), (0.9, 0, -0.2), 30)
    b.dome_light("sky", 0.3)
    b.distant_light("sun", (0.7, -1.0, -0.3), 8.0, 1.5)
    tube = UsdLux.CylinderLight.Define(b.stage, "/World/tube")
    tube.CreateRadiusAttr(0.05)
    tube.CreateLengthAttr(1.6)
    tube.CreateIntensityAttr(12.0)
    tube.AddTranslateOp().Set(Gf.Vec3d(-0.2, 1.6, -0.9))
    path = b.camera((0.3, 1.4, 4.0), (0.1, 0.4, 0), 34)
    camera = UsdGeom.Camera(b.stage.GetPrimAtPath(path))
    camera.CreateHorizontalApertureOffsetAttr(3.0)
    camera.CreateVerticalApertureOffsetAttr(-2.0)
    return b.save()


STAGES: dict[str, tuple[Callable[[Path], Path], float]] = {
    "diffuse_room": (diffuse_room, DIFFUSE_LIMIT),
    "glossy_room": (glossy_room, GLOSSY_LIMIT),
    "outdoors": (outdoors, GLOSSY_LIMIT),
    "mirrors": (mirrors, GLOSSY_LIMIT),
    "emissive": (emissive, GLOSSY_LIMIT),
    "implicit": (implicit, GLOSSY_LIMIT),
}
