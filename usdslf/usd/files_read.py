"""Files read: which files a composed stage stands on, so that a run knows whether any of them changed.

    files_read(stage) -> FilesRead     layers, textures, tiles of UDIM sets, value clips; what is asked for and missing

A composition is a function of the contents of the layers that it used and of which others were not there: where these
stay, so does it.  Textures are all that the used layers name, also in variants that are not chosen.
"""

from __future__ import annotations

import glob
import os
import re
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any

from pxr import Ar, Sdf, Usd

from usdslf.textures.files import split_package
from usdslf.usd.border import reading
from usdslf.usd.files import assets_of

_CLIP_FILES = ("assetPaths", "manifestAssetPath")


@dataclass(frozen=True)
class FilesRead:
    """Files of a stage, sorted.

    Attributes:
        found: absolute paths on disk; of what lies in a package, the package.
        missing: absolute paths that are asked for and not there.
        patterns: globs that gave some of `found`: a file that matches one later is read too.
    """

    found: tuple[str, ...]
    missing: tuple[str, ...] = ()
    patterns: tuple[str, ...] = ()


def files_read(stage: Usd.Stage) -> FilesRead:
    """Returns the files that a stage stands on.

    Raises: StageError where USD cannot say.
    """
    named: list[str] = []
    patterns: list[str] = []
    with reading(stage.GetRootLayer().realPath):
        layers = [x for x in stage.GetUsedLayers(includeClipLayers=True) if x.realPath]
        for layer in layers:
            named.append(layer.realPath)
            for asset in dict.fromkeys([*assets_of(layer), *layer.GetCompositionAssetDependencies(), *_clips(layer)]):
                _add(layer, asset, named, patterns)
    for pattern in patterns:
        named += glob.glob(pattern)
    files = sorted({split_package(os.path.abspath(p))[0] for p in named if p})
    found = tuple(f for f in files if os.path.lexists(f) and not os.path.isdir(f))
    return FilesRead(found, tuple(f for f in files if not os.path.lexists(f)), tuple(sorted(set(patterns))))


def _add(layer: Sdf.Layer, asset: str, named: list[str], patterns: list[str]) -> None:
    """Adds where an asset path of a layer leads; of a set of tiles or clips, a glob."""
    if not asset or "`" in asset:  # an expression: the layers that it names are used ones
        return
    tiled = re.sub(r"<UDIM>|#+(?:\.#+)?", lambda m: "[0-9]" * 4 if m[0] == "<UDIM>" else "*", asset)
    if "://" in asset:
        return
    if tiled != asset and ("<UDIM>" in asset or not _resolved(layer, asset)):
        folder = os.path.dirname(layer.ComputeAbsolutePath(asset.replace("<UDIM>", "1001").replace("#", "0")))
        patterns.append(os.path.join(glob.escape(folder), os.path.basename(tiled)))
        return
    named.append(_resolved(layer, asset) or layer.ComputeAbsolutePath(asset))


def _resolved(layer: Sdf.Layer, asset: str) -> str:
    return str(Ar.GetResolver().Resolve(layer.ComputeAbsolutePath(asset)))


def _clips(layer: Sdf.Layer) -> Iterator[str]:
    """The files that the value clips of a layer name; templates of them as they are written."""
    found: list[str] = []

    def visit(path: Sdf.Path) -> None:
        spec = layer.GetPrimAtPath(path) if path.IsPrimPath() else None
        if spec is not None and spec.HasInfo("clips"):
            found.extend(_of_sets(spec.GetInfo("clips").values()))

    layer.Traverse(Sdf.Path.absoluteRootPath, visit)
    yield from found


def _of_sets(sets: Iterable[Any]) -> Iterator[str]:
    for each in sets:
        if not isinstance(each, Mapping):
            continue
        for key in _CLIP_FILES:
            value = each.get(key, ())
            yield from (p.path for p in ([value] if isinstance(value, Sdf.AssetPath) else value))
        if template := each.get("templateAssetPath", ""):
            yield str(template)
