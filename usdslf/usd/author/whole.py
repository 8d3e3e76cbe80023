"""Whole: a look is written whole, or the folder is as it was before, whether work fails or is cancelled.

whole_or_as_before(look, review_root) -> context manager, yields sentences     filled where the block ends well
"""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from pxr import Sdf, Tf

from usdslf.progress import undisturbed
from usdslf.replacing import replacing
from usdslf.usd.layer.baked_files import baked_files, drop_unused, textures_folder


@contextmanager
def whole_or_as_before(
    look: str | os.PathLike[str], review_root: str | os.PathLike[str] | None = None
) -> Iterator[list[str]]:
    """Puts look and review root back, or takes them away, and new textures too, where the block ends with an error.

    Where it ends well, textures that the look no longer names are deleted.

    Args:
        look: its file; one that stands there already is a look.
        review_root: a layer that is written too.

    Yields: a list that takes a sentence for what cannot be deleted.
    """
    path, folder = Path(look), textures_folder(look)
    files = [path] if review_root is None else [path, Path(review_root)]
    earlier = {file: file.read_bytes() if file.is_file() else None for file in files}
    named = _layer_of(path) if earlier[path] else None
    had_folder, textures = folder.is_dir(), baked_files(folder)
    said: list[str] = []
    try:
        yield said
    except BaseException:
        with undisturbed():
            for file, content in earlier.items():
                _put_back(file, content)
            for texture in baked_files(folder) - textures:
                texture.unlink(missing_ok=True)
            if not had_folder:
                with suppress(OSError):  # there is none, or somebody else has put something there
                    folder.rmdir()
        raise
    said += drop_unused(named, baked_files(folder) - textures, path)


def _layer_of(file: Path) -> Sdf.Layer | None:
    """A layer as it is on disk, nothing where there is no reading it."""
    try:
        return Sdf.Layer.OpenAsAnonymous(str(file))
    except Tf.ErrorException:
        return None


def _put_back(file: Path, content: bytes | None) -> None:
    """Gives a file its earlier content, or takes it away; a layer that is open from there sees that."""
    if content is None:
        file.unlink(missing_ok=True)
    elif not file.is_file() or file.read_bytes() != content:
        with replacing(file) as temporary:
            temporary.write_bytes(content)
        if opened := Sdf.Layer.Find(str(file.resolve())):
            opened.Reload(force=True)
