"""A look of many edits and strokes: a wall of tiles, each with a material, two edits and a stroke of its own."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from kit.look_stages import change_of
from kit.stage_parts import StageBuilder, rectangle
from pxr import Usd, UsdLux

from usdslf.strokes.stroke import Stroke
from usdslf.usd.author.author import author_look
from usdslf.usd.stroke_layer import write_strokes

EYE = np.array([0.0, 0.0, 3.0])


def write_many(folder: Path, tiles: int) -> tuple[Path, Path]:
    """Writes shot, strokes and look; a tile has two edits and one stroke of six dabs."""
    b = StageBuilder(folder)
    side = int(np.ceil(np.sqrt(tiles)))
    step = 2.0 / side
    corners = [(-1 + step * (i % side), -1 + step * (i // side), 0.0) for i in range(tiles)]
    for i, corner in enumerate(corners):
        look = b.material(f"tile_{i:03d}", diffuseColor=(0.5, 0.5, 0.5), roughness=0.5)
        b.mesh(f"tile_{i:03d}", rectangle(corner, (0.95 * step, 0, 0), (0, 0.95 * step, 0)), look)
    lamp = UsdLux.DistantLight.Define(b.stage, "/World/key")
    lamp.CreateIntensityAttr(160.0)
    lamp.CreateAngleAttr(5.0)
    lamp.AddRotateXOp().Set(-30.0)
    b.camera(tuple(EYE), (0, 0, 0))
    shot = b.save()
    stage = Usd.Stage.Open(str(shot))
    strokes = [_stroke(i, corner, step) for i, corner in enumerate(corners)]
    write_strokes(folder / "strokes.usda", strokes, stage)
    colors = np.random.default_rng(0).uniform(0.1, 0.7, (tiles, 3))
    changes = [
        change_of(
            stage, f"/World/tile_{i:03d}", "diffuse+glossiness", colors[i], roughness=0.2, strokes=(strokes[i].path,)
        )
        for i in range(tiles)
    ]
    author_look(stage, changes, folder / "look.usda", strokes_path=folder / "strokes.usda")
    return shot, folder / "look.usda"


def _stroke(number: int, corner: tuple[float, float, float], step: float) -> Stroke:
    share = np.linspace(0.2, 0.8, 6)
    points = np.stack([corner[0] + share * step, corner[1] + 0.5 * step + 0 * share, 0 * share], 1)
    return Stroke(
        f"stroke_{number:04d}", points.astype(np.float32), np.full(6, 0.1 * step, np.float32),
        np.full((6, 3), 0.4, np.float32), np.tile(EYE, (6, 1)).astype(np.float32),
        surfaces=(f"/World/tile_{number:03d}",),
    )  # fmt: skip
