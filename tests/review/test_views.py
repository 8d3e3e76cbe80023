"""Views that nobody painted from look at what changes from inside of a room that is open in front."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from kit.stage_parts import StageBuilder, ball, rectangle

from usdslf.review.views import View, changed_triangles, held_out_views
from usdslf.shot import Shot

WALLS = {  # of a room of 4 x 4 x 4 about the origin without the side that the camera looks through
    "floor": ((-2, -2, 2), (4, 0, 0), (0, 0, -4)),
    "back": ((-2, -2, -2), (4, 0, 0), (0, 4, 0)),
    "left": ((-2, -2, 2), (0, 0, -4), (0, 4, 0)),
    "right": ((2, -2, -2), (0, 0, 4), (0, 4, 0)),
    "ceiling": ((-2, 2, -2), (4, 0, 0), (0, 0, 4)),
}


def test_a_room_is_not_looked_at_from_outside(tmp_path: Path) -> None:
    b = StageBuilder(tmp_path)
    paint = b.material("paint", diffuseColor=(0.5, 0.5, 0.5))
    b.mesh("ball", ball(0.5), paint)
    for name, parts in WALLS.items():
        b.mesh(name, rectangle(*parts), paint)
    b.camera((0, 0, 4.5), (0, 0, 0))
    shot = Shot.open(str(b.save()), elements=64)
    changed = changed_triangles(shot.scene, [m.path for m in shot.scene.meshes])
    views = held_out_views(shot, [View("camera", "stroke", shot.camera())], changed)
    eyes = np.array([v.camera.world_from_camera for v in views])[:, :3, 3]
    assert len(views) == 2 and (np.abs(eyes[:, :2]) < 2).all(), eyes  # beside a wall is behind it
