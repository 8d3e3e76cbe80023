"""What a written look shows: read through the whole reading path, from the shot with the look over it.

    scene_under(shot, look, frame, refine, ocio) -> Scene     of a shot in a file or in memory
    kept_unless_whole(path)                                   a block whose AuthorError leaves the earlier look
"""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from pxr import Sdf, Usd

from usdslf.errors import AuthorError
from usdslf.replacing import replacing
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
        layer = Sdf.Layer.FindOrOpen(os.fspath(look))
        layer.Reload(force=True)  # another process may have written it, or this one under USD's cache
        return read_scene(compose_over(shot, layer), frame, refine=refine, ocio=ocio)


@contextmanager
def kept_unless_whole(look: str | os.PathLike[str]) -> Iterator[None]:
    """Puts the look back that was there before, or none, where what is written in the block is refused."""
    path = Path(look)
    earlier = path.read_bytes() if path.is_file() else None
    try:
        yield
    except AuthorError:
        if earlier is None:
            path.unlink(missing_ok=True)
        else:
            with replacing(path) as temporary:
                Path(temporary).write_bytes(earlier)
        raise
