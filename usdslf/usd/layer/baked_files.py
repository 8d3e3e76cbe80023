"""Texture files that were baked for a look layer: those that it no longer names are taken away.

    textures_folder(look) -> Path                        where they are, beside it
    baked_files(folder) -> set[Path]                     those in it
    drop_unused(earlier, new, look) -> list[str]         deletes; a sentence for what stays and why

A file goes only if the look named it before or it is new, the look does not name it now, its name is one of ours, and
no other USD layer beside the look names it: a copy of a look that was kept keeps its textures.
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


def baked_files(folder: Path) -> set[Path]:
    """Returns the files in a folder that have names of ours."""
    return {folder.resolve() / n for n in os.listdir(folder) if _OURS.match(n)} if folder.is_dir() else set()


def drop_unused(earlier: Sdf.Layer | None, new: set[Path], look: Path) -> list[str]:
    """Deletes the textures that a look does not name, of those that it named earlier and those that are new.

    Args:
        earlier: its earlier state.
        new: files in its folder of textures.
        look: its file, written already.
    """
    folder = textures_folder(look).resolve()
    before = _assets(earlier, look.parent) if earlier else set()
    before = {p for p in before if p.parent == folder and _OURS.match(p.name)}
    named = _assets(Sdf.Layer.OpenAsAnonymous(str(look)), look.parent)
    unused = (before | new) - named - {file for name in named if "<UDIM>" in name.name for file in _files(name)}
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
