"""What a written look shows: read through the whole reading path, from the shot with the look over it.

    stage_under(shot, look) -> Usd.Stage                      of a shot in a file or in memory
    scene_under(shot, look, frame, refine, ocio) -> Scene     the same, read
    kept_unless_whole(path)                                   a block that, where it fails, leaves the earlier look
"""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from pxr import Sdf, Tf, Usd

from usdslf.replacing import replacing
from usdslf.scene.records import Scene
from usdslf.usd.border import quiet_usd
from usdslf.usd.layer.baked_files import drop_unused
from usdslf.usd.layer.wins import compose_over
from usdslf.usd.look_data import is_look
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


@contextmanager
def kept_unless_whole(look: str | os.PathLike[str], said: list[str] | None = None) -> Iterator[None]:
    """Puts the look back that was there before, or none, where what is written in the block does not come to its end.

    Textures stay as long as one of the two may name them; those that none does are deleted.

    Args:
        look: its file.
        said: takes a sentence for textures that cannot be deleted.
    """
    path = Path(look)
    earlier = path.read_bytes() if path.is_file() else None
    before = _layer_of(path)
    try:
        yield
    except BaseException:
        tried = _layer_of(path)
        if earlier is None:
            path.unlink(missing_ok=True)
        else:
            with replacing(path) as temporary:
                Path(temporary).write_bytes(earlier)
        if tried:
            drop_unused(tried, before or Sdf.Layer.CreateAnonymous(".usda"), path)
        raise
    if before and (now := _layer_of(path)):
        found = drop_unused(before, now, path)
        if said is not None:
            said += found


def _layer_of(look: Path) -> Sdf.Layer | None:
    """The look as it is on disk; None where there is none."""
    try:
        layer = Sdf.Layer.OpenAsAnonymous(str(look)) if look.is_file() and look.stat().st_size else None
    except Tf.ErrorException:
        return None
    return layer if layer and is_look(layer) else None
