"""Texture files that were baked for a look layer: those that it no longer names are taken away.

    textures_folder(look) -> Path                        where they are, beside it
    drop_unused(earlier, layer, look) -> list[str]       deletes; a sentence for what stays and why

A file goes only if the look named it before and does not now, its name is one of ours, and no other USD layer beside
the look names it: a copy of a look that was kept keeps its textures.
"""

from __future__ import annotations

import os
import re
from collections.abc import Iterator
from pathlib import Path

from pxr import Sdf, Tf

from usdslf.usd.files import assets_of

_OURS = re.compile(r".+_[0-9a-f]{12}(\.<UDIM>)?\.exr$")
_LAYERS = (".usd", ".usda", ".usdc")


def textures_folder(look: str | os.PathLike[str]) -> Path:
    """Returns the folder that textures baked for a look go to, beside it."""
    return Path(look).with_suffix(".textures")


def drop_unused(earlier: Sdf.Layer, layer: Sdf.Layer, look: Path) -> list[str]:
    """Deletes the textures that an earlier state of a look named and its present one does not.

    Args:
        look: its file, written already.
    """
    folder = textures_folder(look).resolve()
    before = {p for p in _assets(earlier, look.parent) if p.parent == folder and _OURS.match(p.name)}
    unused = before - _assets(layer, look.parent)
    if not unused:
        return []
    for other in sorted(look.parent.iterdir()):
        if other.suffix in _LAYERS and other.is_file() and other.resolve() != look.resolve():
            try:
                unused -= _assets(Sdf.Layer.OpenAsAnonymous(str(other)), other.parent)
            except Tf.ErrorException:
                why = f"as {other} cannot be read and may name them"
                return [f"{len(unused)} textures in {folder.name} are no longer used by {look.name}; they stay, {why}"]
    for file in sorted(f for name in unused for f in _files(name)):
        try:
            file.unlink(missing_ok=True)
        except OSError as error:
            return [f"{file} is no longer used but cannot be deleted: {error.strerror or error}"]
    if folder.is_dir() and not any(folder.iterdir()) and not textures_folder(look).is_symlink():
        folder.rmdir()
    return []


def _assets(layer: Sdf.Layer, folder: Path) -> set[Path]:
    """The files that the attributes of a layer name; <UDIM> stays as it is."""
    return {Path(os.path.normpath((folder / path).resolve())) for path in assets_of(layer) if path}


def _files(name: Path) -> Iterator[Path]:
    if "<UDIM>" in name.name:
        yield from name.parent.glob(name.name.replace("<UDIM>", "[0-9]" * 4))
    else:
        yield name
