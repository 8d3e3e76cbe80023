"""Layers on disk: written whole or not at all, and the files that they name.

    write_layer(layer, path) -> None                           a USD layer; same layer, same bytes
    check_layer_place(path) -> None                            whether there can be one
    assets_of(layer) -> list[str]                              what its attributes name
    relative_path(target, folder) -> str                       "./..." with forward slashes
"""

from __future__ import annotations

import os
from pathlib import Path

from pxr import Sdf

from usdslf.errors import AuthorError
from usdslf.replacing import check_place, replacing
from usdslf.usd.border import reading


def write_layer(layer: Sdf.Layer, path: str | os.PathLike[str]) -> None:
    """Writes a layer to `path`; a layer that is already open from there sees the new content.

    Raises:
        AuthorError: as `replacing`, or the suffix is none of USD's.
    """
    path = Path(path)
    check_layer_place(path)
    with replacing(path, AuthorError) as temporary:
        temporary.touch()  # says why, if nothing can be written here
        with reading(path, AuthorError, "choose another place"):
            if not layer.Export(str(temporary)):
                raise OSError("the disk may be full or the folder read-only")
    opened = Sdf.Layer.Find(str(path.resolve())) or Sdf.Layer.Find(str(path))
    if opened:
        opened.Reload(force=True)


def check_layer_place(path: Path) -> None:
    """Raises AuthorError where no layer can be: another suffix, no folder, a folder itself, or no right to write."""
    if path.suffix not in (".usda", ".usd", ".usdc"):
        raise AuthorError(f"{path} cannot be written: layers end in .usda, .usd or .usdc; choose another name")
    check_place(path, AuthorError)


def relative_path(target: str | os.PathLike[str], folder: str | os.PathLike[str]) -> str:
    """Returns `target` as seen from `folder`, as an asset path that USD anchors to the layer."""
    target, folder = os.path.realpath(target), os.path.realpath(folder)
    try:
        relative = os.path.relpath(target, folder)
    except ValueError:  # another drive
        return Path(target).as_posix()
    relative = Path(relative).as_posix()
    return relative if relative.startswith("../") else f"./{relative}"


def assets_of(layer: Sdf.Layer) -> list[str]:
    """Returns the asset paths that the attributes of a layer name, at default time and in samples."""
    found: list[str] = []

    def visit(path: Sdf.Path) -> None:
        spec = layer.GetAttributeAtPath(path) if path.IsPropertyPath() else None
        if spec is None:
            return
        samples = (layer.QueryTimeSample(path, t) for t in layer.ListTimeSamplesForPath(path))
        found.extend(v.path for v in (spec.default, *samples) if isinstance(v, Sdf.AssetPath))

    layer.Traverse(Sdf.Path.absoluteRootPath, visit)
    return found
