"""A look that is written elsewhere: what it names by relative paths, and the textures that go with it.

    move_paths(layer, before, after) -> None             relative paths, seen from another folder
    carry_textures(layer, look, out) -> list[Path]       copies of the baked textures that it names, beside `out`
"""

from __future__ import annotations

import os
import shutil
from collections.abc import Callable
from pathlib import Path

from pxr import Sdf

from usdslf.errors import AuthorError
from usdslf.replacing import replacing
from usdslf.usd.files import relative_path
from usdslf.usd.layer.baked_files import textures_folder
from usdslf.usd.look_data import KEY, our_data


def move_paths(layer: Sdf.Layer, before: Path, after: Path) -> None:
    """Changes what a layer names relative to its folder so that it means the same in another one.

    Args:
        before, after: folders.
    """
    if os.path.realpath(before) == os.path.realpath(after):
        return

    def moved(path: str) -> str:
        if not path or os.path.isabs(path) or "://" in path or not path.startswith("."):
            return path
        return relative_path(os.path.join(before, path), after)

    _change_assets(layer, moved)
    layer.subLayerPaths = [moved(p) for p in layer.subLayerPaths]
    data = our_data(layer.customLayerData)
    data |= {name: moved(str(data[name])) for name in ("shot", "strokes") if name in data}
    layer.customLayerData = {**layer.customLayerData, KEY: data}


def carry_textures(layer: Sdf.Layer, look: Path, out: Path) -> list[Path]:
    """Copies the textures that were baked for a look, and that a layer still names, to the folder of another look.

    Args:
        layer: names them as seen from `out`'s folder; its paths become those of the copies.
        look: that the textures stand beside.

    Raises: AuthorError where one cannot be written.
    """
    source, target = textures_folder(look).resolve(), textures_folder(out)
    found: list[Path] = []

    def carried(path: str) -> str:
        file = (out.parent / path).resolve()
        if file.parent != source:
            return path
        files = sorted(source.glob(file.name.replace("<UDIM>", "[0-9]" * 4))) if "<UDIM>" in file.name else [file]
        for each in files:
            if each.is_file():
                target.mkdir(exist_ok=True)
                with replacing(target / each.name, AuthorError) as temporary:
                    shutil.copyfile(each, temporary)
                found.append(target / each.name)
        return relative_path(target.resolve() / file.name, out.parent)

    _change_assets(layer, carried)
    return list(dict.fromkeys(found))


def _change_assets(layer: Sdf.Layer, change: Callable[[str], str]) -> None:
    paths: list[Sdf.Path] = []
    layer.Traverse(Sdf.Path.absoluteRootPath, lambda p: paths.append(p) if p.IsPropertyPath() else None)
    for path in paths:
        spec = layer.GetAttributeAtPath(path)
        if spec and isinstance(spec.default, Sdf.AssetPath) and spec.default.path:
            spec.default = Sdf.AssetPath(change(spec.default.path))
