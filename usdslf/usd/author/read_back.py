"""What a written look shows: read through the whole reading path, from the shot with the look over it.

    stage_under(shot, look) -> Usd.Stage                      of a shot in a file or in memory
    scene_under(shot, look, frame, refine, ocio) -> Scene     the same, read
"""

from __future__ import annotations

import os

from pxr import Sdf, Usd

from usdslf.scene.records import Scene
from usdslf.usd.border import quiet_usd
from usdslf.usd.layer.wins import compose_over
from usdslf.usd.read.read import read_scene


def scene_under(
    shot: Usd.Stage, look: str | os.PathLike[str], frame: float | None, refine: int = 1, ocio: str | None = None
) -> Scene:
    """Reads a shot with a look over it; what is in memory alone is composed there.

    Args:
        frame, refine, ocio: as of `read_scene`.
    """
    with quiet_usd():
        return read_scene(stage_under(shot, look), frame, refine=refine, ocio=ocio)


def stage_under(shot: Usd.Stage, look: str | os.PathLike[str]) -> Usd.Stage:
    """Composes a look over a shot, as it is on disk now."""
    with quiet_usd():
        layer = Sdf.Layer.FindOrOpen(os.fspath(look))
        layer.Reload(force=True)  # another process may have written it, or this one under USD's cache
        return compose_over(shot, layer)
