"""Stages of indirect strokes: what a ring or a wall sends to a floor that itself stays as it is.

`caustic`: a band that stands on a white floor under a low lamp, with a ball, a box and a wall about it.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from kit.stage_parts import StageBuilder, ball, box, lathe, rectangle

RING = "/World/mtl/ring"
DULL = {"diffuseColor": (0.55, 0.55, 0.55), "roughness": 0.5}
GOLDEN = {"diffuseColor": (0.95, 0.8, 0.4), "metallic": 1.0, "roughness": 0.12}
SILVER = {"diffuseColor": (0.95, 0.95, 0.95), "metallic": 1.0, "roughness": 0.12}


def build_caustic(folder: Path, ring: dict | None = None) -> Path:
    """Writes the ring's stage with some inputs of its material; returns the path of the file."""
    folder.mkdir(parents=True, exist_ok=True)
    b = StageBuilder(folder)
    floor = b.material("floor", diffuseColor=(0.65, 0.65, 0.65), roughness=0.9)
    wall = b.material("wall", diffuseColor=(0.5, 0.5, 0.55), roughness=0.9)
    clay = b.material("clay", diffuseColor=(0.5, 0.2, 0.12), roughness=0.6)
    blue = b.material("blue", diffuseColor=(0.12, 0.2, 0.5), roughness=0.5)
    look = b.material("ring", **(ring or DULL))
    b.mesh("floor", rectangle((-2, 0, 2), (4, 0, 0), (0, 0, -4)), floor)
    b.mesh("back", rectangle((-2, 0, -2), (4, 0, 0), (0, 1.5, 0)), wall)
    profile = np.array([[0.66, 0.0], [0.66, 0.26], [0.62, 0.26], [0.62, 0.0]])
    b.mesh("ring", lathe(np.repeat(profile, [1, 2, 2, 1], axis=0), 96), look)
    b.mesh("ball", ball(0.28), clay, (-1.15, 0, -0.4))
    b.mesh("box", box(0.4, 0.5, 0.4), blue, (1.15, 0, -0.5), 25.0)
    b.sphere_light("bulb", (1.5, 0.95, 1.5), 0.3, (50.0, 50.0, 50.0))
    b.dome_light("fill", 0.1, (0.9, 0.95, 1.0))
    b.camera((0.0, 2.2, 2.6), (0.0, 0.05, 0.0), 34)
    return b.save()
