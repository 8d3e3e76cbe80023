"""Image files: opened, read in bands, laid out in tiles, by OpenImageIO.

Files inside .usdz packages and tiled copies of large files lie in this process's folder of temporary files.
"""

from __future__ import annotations

import io
import os
import re
import tempfile
import zipfile
import zlib
from collections.abc import Iterator
from functools import lru_cache
from pathlib import Path

import numpy as np
import OpenImageIO as oiio
from numpy.typing import NDArray

from usdslf.textures.temporary_files import folder

TILE = 64  # texels; side of the tiles that are read at a time
_MAX_TILE = 512  # larger tiles of a file are as costly as none
_RAW_PIXELS = {"oiio:UnassociatedAlpha": 1}  # rgb as stored, not multiplied by alpha
_BAND = 4 * TILE  # rows


def stamp_of(path: str) -> tuple[int, int]:
    """Time of last change and size, so that a changed file is read again; zeros where there is none."""
    try:
        status = os.stat(split_package(path)[0])
    except OSError:
        return 0, 0
    return status.st_mtime_ns, status.st_size


def file_of(path: str) -> str:
    """Returns a file on disk that holds an image, which may lie inside a package."""
    package, *inner = split_package(path)
    return _unpacked(package, tuple(inner), stamp_of(path)) if inner else path


def split_package(path: str) -> list[str]:
    """Returns the file on disk, then what lies inside of what: one name where a path leads into no package.

    As USD's resolver writes them: a.usdz[b.usdz[c.png]], with a backslash before brackets that belong to names.
    """
    found = []
    while inner := _bracketed(path):
        found.append(path[: -len(inner) - 2])
        path = inner
    found.append(path)
    return [found[0], *(re.sub(r"\\([\[\]])", r"\1", name) for name in found[1:])]


def _bracketed(path: str) -> str:
    """What stands between the last bracket of a path and the one that it closes, "" where it ends in none."""
    depth = 0
    for i in range(len(path) - 1, -1, -1):
        if path[i] in "[]" and path[i - 1 : i] != "\\":
            depth += 1 if path[i] == "]" else -1
        if depth <= 0:
            return path[i + 1 : -1] if path[i] == "[" and i else ""
    return ""


def open_image(path: str) -> oiio.ImageInput:
    """Opens an image, or raises OSError with the reason."""
    path = file_of(path)
    if not os.path.isfile(path):
        raise OSError("no such file")
    config = oiio.ImageSpec()
    for name, value in _RAW_PIXELS.items():
        config.attribute(name, value)
    image = oiio.ImageInput.open(path, config)
    if image is None:
        raise OSError(" ".join(str(oiio.geterror()).split()) or "unknown format")
    return image


def is_eight_bit(spec: oiio.ImageSpec) -> bool:
    """Whether pixels are code values of 8 bits."""
    return bool(spec.format == oiio.UINT8)


def is_tiled(spec: oiio.ImageSpec) -> bool:
    """Whether a small part of the image can be read without the rest."""
    return 0 < spec.tile_width <= _MAX_TILE and 0 < spec.tile_height <= _MAX_TILE


def bands(
    image: oiio.ImageInput, channels: tuple[int, ...], format: str | None = None
) -> Iterator[tuple[int, NDArray]]:
    """Yields (first row, pixels (rows, W, C)) from the top down: codes where they have 8 bits.

    Args:
        image: open.
        channels: which are read, C of them.
        format: of OpenImageIO; None: 8 bit codes as they are, all else float.

    Raises:
        OSError: the pixels cannot be read.
    """
    spec = image.spec()
    first, last = min(channels), max(channels) + 1
    kind = format or ("uint8" if is_eight_bit(spec) else "float")
    height = -(-_BAND // spec.tile_height) * spec.tile_height if spec.tile_height else _BAND
    for top in range(0, spec.height, height):
        rows = min(height, spec.height - top)
        y0, y1 = spec.y + top, spec.y + top + rows
        if spec.tile_width:
            x0, x1 = spec.x, spec.x + spec.width
            pixels = image.read_tiles(0, 0, x0, x1, y0, y1, spec.z, spec.z + 1, first, last, kind)
        else:
            pixels = image.read_scanlines(0, 0, y0, y1, spec.z, first, last, kind)
        if pixels is None or image.has_error:
            raise OSError(" ".join(str(image.geterror()).split()) or "the pixels cannot be read")
        block = np.asarray(pixels).reshape(rows, spec.width, last - first)
        yield top, picked(block, tuple(c - first for c in channels))


def picked(pixels: NDArray, channels: tuple[int, ...]) -> NDArray:
    """Returns some channels (..., C) of pixels, the same array where that is all of them."""
    if channels == tuple(range(pixels.shape[-1])):
        return pixels
    return np.ascontiguousarray(pixels[..., list(channels)])


def check_corners(image: oiio.ImageInput) -> None:
    """Reads the first and the last tile of a tiled image: what was cut off while it was written shows.

    Raises:
        OSError: a tile cannot be read.
    """
    spec = image.spec()
    across, down = (spec.width - 1) // spec.tile_width, (spec.height - 1) // spec.tile_height
    for column, row in ((0, 0), (across, down)):
        x, y = spec.x + column * spec.tile_width, spec.y + row * spec.tile_height
        if image.read_tile(x, y, spec.z, "float") is None or image.has_error:
            raise OSError(" ".join(str(image.geterror()).split()) or "its tiles cannot be read")


def write_tiled_copy(image: oiio.ImageInput, channels: tuple[int, ...]) -> tuple[str, int]:
    """Writes the pixels of an open image as they are into an uncompressed tiled file, a band at a time.

    Returns:
        The file and its size [bytes]; "" where the folder of temporary files is full.

    Raises:
        OSError: the image cannot be read.
    """
    spec = image.spec()
    kind = str(spec.format)
    is_code = kind in ("uint8", "uint16")
    kind = kind if is_code or kind == "half" else "float"
    handle, target = tempfile.mkstemp(".tif" if is_code else ".exr", "texture_", folder())
    os.close(handle)
    copy = oiio.ImageSpec(spec.width, spec.height, len(channels), kind)
    copy.tile_width = copy.tile_height = TILE
    copy.attribute("compression", "none")
    copy.attribute("oiio:UnassociatedAlpha", 1)
    output = oiio.ImageOutput.create(target)
    done = output is not None and output.open(target, copy)
    try:
        for top, pixels in bands(image, channels, kind):
            if output is not None and done:
                done = output.write_tiles(0, spec.width, top, top + len(pixels), 0, 1, pixels)
    except OSError:
        Path(target).unlink(missing_ok=True)
        raise
    if output is None or not (output.close() and done):
        Path(target).unlink(missing_ok=True)
        return "", 0
    return target, os.path.getsize(target)


@lru_cache(maxsize=256)
def _unpacked(package: str, inner: tuple[str, ...], stamp: tuple[int, int]) -> str:
    """Returns a file that holds what lies inside a .usdz package, or in one inside of that, and so on."""
    source: str | io.BytesIO = package
    for name in inner:
        try:
            with zipfile.ZipFile(source) as archive:
                data = archive.read(name)
        except (KeyError, ValueError, RuntimeError, EOFError, zlib.error, zipfile.BadZipFile) as e:
            raise OSError(f"{name} cannot be taken out of {package}: {e}") from None
        source = io.BytesIO(data)
    target = Path(tempfile.mkdtemp(dir=folder())) / Path(inner[-1]).name
    target.write_bytes(data)
    return str(target)
