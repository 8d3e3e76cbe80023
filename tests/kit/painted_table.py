"""A small shot to paint on: a red ball and a grey one of one gloss on a table, a lamp, a camera."""

from __future__ import annotations

from pathlib import Path

from kit.stage_parts import StageBuilder

CAMERA = "/World/camera"
RED, GREY, TABLE = (0.5, 0.08, 0.06), (0.4, 0.4, 0.4), (0.5, 0.48, 0.45)
OPTIONS = {"elements": 300, "bounces": 2}
ON_RED = ((0.30, 0.50), (0.36, 0.52))  # places of the picture, 4 : 3, that show the red ball
BESIDE = (0.02, 0.03)  # sees nothing


def write_table(folder: Path) -> Path:
    """Writes the shot into a folder; returns its file."""
    b = StageBuilder(folder)
    red, grey, table = (
        b.material(name, diffuseColor=color, roughness=0.35)
        for name, color in (("red", RED), ("grey", GREY), ("table", TABLE))
    )
    b.sphere("red_ball", 0.5, red, (-0.65, 0.5, 0))
    b.sphere("other_red_ball", 0.25, red, (0.0, 0.25, 0.7))
    b.sphere("grey_ball", 0.5, grey, (0.65, 0.5, 0))
    b.plane("table", 6, 6, table)
    b.rect_light("lamp", (1.0, 3.0, 2.5), (0, 0.4, 0), 1.5, 1.5, (9.0, 9.0, 9.0))
    b.camera((0, 1.3, 4.2), (0, 0.45, 0), 34)
    return b.save()
