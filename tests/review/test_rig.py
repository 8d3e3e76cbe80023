"""The light that nobody painted in: a key out of doors, a lamp in rooms, also where those have a window."""

from __future__ import annotations

from pathlib import Path

import pytest
from kit.stage_parts import StageBuilder, ball, rectangle

from usdslf.review.rig import held_out_rig
from usdslf.shot import Shot

WALLS = {  # of a room of 4 x 4 x 4 about the origin, a corner and two sides each
    "floor": ((-2, -2, -2), (4, 0, 0), (0, 0, 4)),
    "ceiling": ((-2, 2, -2), (4, 0, 0), (0, 0, 4)),
    "left": ((-2, -2, -2), (0, 4, 0), (0, 0, 4)),
    "right": ((2, -2, -2), (0, 4, 0), (0, 0, 4)),
    "behind": ((-2, -2, 2), (4, 0, 0), (0, 4, 0)),
}


def shot_of(folder: Path, walls: tuple[str, ...]) -> Shot:
    """A ball, seen from inside of walls; what the camera looks at has no wall."""
    b = StageBuilder(folder)
    paint = b.material("paint", diffuseColor=(0.5, 0.5, 0.5))
    b.mesh("ball", ball(0.5), paint)
    for name in walls:
        b.mesh(name, rectangle(*WALLS[name]), paint)
    b.camera((0, 0, 1.8), (0, 0, 0))
    return Shot.open(str(b.save()), elements=64)


@pytest.mark.parametrize(
    ("walls", "kinds"),
    [((), ["distant", "dome"]), (("floor",), ["distant", "dome"]), (tuple(WALLS), ["sphere"])],
    ids=["alone", "on a floor", "in a room with a window"],
)
def test_the_light_reaches_what_is_seen(tmp_path: Path, walls: tuple[str, ...], kinds: list[str]) -> None:
    shot = shot_of(tmp_path, walls)
    lights, words = held_out_rig(shot, shot.camera())
    assert [x.kind for x in lights] == kinds and words
