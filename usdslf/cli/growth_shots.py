"""Shots that grow along one axis and stay what they are along all others.

    build_growing(axis, size, folder) -> Growing

Balls on a floor under a lamp and a constant dome; what grows is the count of elements, triangles, lights, strokes,
instances of one box, or textures of 4096 x 4096 texels.
"""

from __future__ import annotations

import os
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from usdslf.procedural.built_shot import BuiltShot, Inputs, Lamp, Part, View
from usdslf.procedural.shapes import ball, panel
from usdslf.textures.images import write_image
from usdslf.usd.build_stage import write_stage

ELEMENTS = 2000  # where they are not what grows
FEW_ELEMENTS = 500  # where light is sent round many times
SIDE = 5  # balls in a row, each of a material of its own
HALF = 2.0  # of the floor's side
TEXELS = 4096  # on a side of a texture
BOX = ((-1, -1, -1), (1, -1, -1), (1, 1, -1), (-1, 1, -1), (-1, -1, 1), (1, -1, 1), (1, 1, 1), (-1, 1, 1))
BOX_FACES = (0, 3, 2, 1, 4, 5, 6, 7, 0, 1, 5, 4, 1, 2, 6, 5, 2, 3, 7, 6, 3, 0, 4, 7)


@dataclass(frozen=True)
class Growing:
    """A shot of one size."""

    stage: Path
    elements: int = ELEMENTS
    strokes: int = 0


def build_growing(axis: str, size: int, folder: Path) -> Growing:
    """Writes the shot of a size along an axis into a folder."""
    return BUILDERS[axis](size, folder)


def _still(rows: int = 16) -> BuiltShot:
    """Balls of `rows` rows of quads on a floor."""
    rng = np.random.default_rng(3)
    materials: dict[str, Inputs] = {"floor": {"diffuseColor": (0.5, 0.48, 0.45), "roughness": 0.7}}
    parts = [Part("floor", panel((-HALF, 0, HALF), (2 * HALF, 0, 0), (0, 0, -2 * HALF)), "floor")]
    radius = 0.6 * HALF / SIDE
    for k in range(SIDE * SIDE):
        at = (np.array([k % SIDE, 0, k // SIDE]) + 0.5) * (2 * HALF / SIDE) - HALF
        color = tuple(float(round(c, 2)) for c in rng.uniform(0.1, 0.7, 3))
        materials[f"ball_{k}"] = {"diffuseColor": color, "roughness": (0.3, 0.5, 0.7)[k % 3]}
        parts.append(Part(f"ball_{k}", ball(radius, rows, 2 * rows).moved((at[0], radius, at[2])), f"ball_{k}"))
    lamps = (
        Lamp("lamp", "rect", (14.0, 13.0, 12.0), (0.5, 3.0, 1.0), (0, 0, 0), (0.8, 0.8)),
        Lamp("sky", "dome", (0.3, 0.35, 0.4)),
    )
    return BuiltShot("growing", materials, parts, lamps, (View("camera", (0.3, 3.2, 4.6), (0, 0, 0.2)),))


def _elements(size: int, folder: Path) -> Growing:
    return Growing(write_stage(_still(), folder), size)


def _triangles(size: int, folder: Path) -> Growing:
    rows = max(3, round((size / (4 * SIDE * SIDE)) ** 0.5))  # a ball has rows x 2 rows quads of two triangles
    return Growing(write_stage(_still(rows), folder))


def _lights(size: int, folder: Path) -> Growing:
    shot, rng = _still(), np.random.default_rng(4)
    lamps = [
        Lamp(f"lamp_{k}", ("rect", "disk", "sphere")[k % 3], (14.0 / size,) * 3, (x, 3.0, z), (x, 0, z), (0.5, 0.5))
        for k, (x, z) in enumerate(rng.uniform(-HALF, HALF, (size, 2)).round(3).tolist())
    ]
    return Growing(write_stage(replace(shot, lamps=lamps), folder))


def _strokes(size: int, folder: Path) -> Growing:
    return Growing(write_stage(_still(), folder), FEW_ELEMENTS, size)


def _instances(size: int, folder: Path) -> Growing:
    """Instanceable references to one box, in a layer over the balls."""
    write_stage(_still(), folder, "still.usda")
    rng = np.random.default_rng(5)
    place = rng.uniform((-HALF, 0.05, -HALF), (HALF, 1.5, HALF), (size, 3)).round(4)
    scale = round(0.3 * HALF / max(size, 1) ** (1 / 3) / 2, 5)
    points = ", ".join(f"({x}, {y}, {z})" for x, y, z in BOX)
    lines = [
        '#usda 1.0\n(\n    subLayers = [@./still.usda@]\n    defaultPrim = "growing"\n    upAxis = "Y"\n'
        "    metersPerUnit = 1\n)\n",
        'class "box"\n{\n    def Mesh "box"\n    {\n'
        f"        int[] faceVertexCounts = [{', '.join('4' * 6)}]\n"
        f"        int[] faceVertexIndices = [{', '.join(map(str, BOX_FACES))}]\n        point3f[] points = [{points}]\n"
        '        uniform token subdivisionScheme = "none"\n    }\n}\n',
        'def "boxes" (prepend apiSchemas = ["MaterialBindingAPI"])\n{\n'
        "    rel material:binding = </growing/materials/ball_0>\n",
    ]
    lines += [
        f'    def Xform "b{k}" (instanceable = true; prepend references = </box>)\n    {{\n'
        f"        double3 xformOp:translate = ({x}, {y}, {z})\n"
        f"        float3 xformOp:scale = ({scale}, {scale}, {scale})\n"
        '        uniform token[] xformOpOrder = ["xformOp:translate", "xformOp:scale"]\n    }\n'
        for k, (x, y, z) in enumerate(place.tolist())
    ]
    path = folder / "shot.usda"
    path.write_text("".join([*lines, "}\n"]), encoding="utf-8")
    return Growing(path)


def _textures(size: int, folder: Path) -> Growing:
    """Panels in the air, each with a picture of its own."""
    t = (np.arange(TEXELS, dtype=np.float32) + 0.5) / TEXELS
    y, x = np.meshgrid(t, t, indexing="ij")
    write_image(folder / "texture_0.png", np.stack([0.3 + 0.5 * x, 0.3 + 0.4 * y, 0.5 + 0.3 * np.sin(40 * x * y)], -1))
    shot = _still()
    side = int(np.ceil(np.sqrt(size)))
    materials, parts = dict(shot.materials), list(shot.parts)
    for k in range(size):
        if k:
            os.link(folder / "texture_0.png", folder / f"texture_{k}.png")
        cell = 2 * HALF / side
        corner = (-HALF + k % side * cell, 0.02 + 0.9, HALF - k // side * cell)
        materials[f"picture_{k}"] = {"diffuseColor": f"texture_{k}.png", "roughness": 0.6}
        shape = panel(corner, (0.8 * cell, 0, 0), (0, 0, -0.8 * cell))
        parts.append(Part(f"picture_{k}", shape, f"picture_{k}"))
    return Growing(write_stage(replace(shot, materials=materials, parts=parts), folder))


BUILDERS: dict[str, Callable[[int, Path], Growing]] = {
    "elements": _elements, "triangles": _triangles, "lights": _lights, "strokes": _strokes, "instances": _instances,
    "textures": _textures,
}  # fmt: skip
