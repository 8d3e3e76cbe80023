"""Texture store: what is kept of textures, within limits.

    small (4 MiB of pixels at most)   in memory, the latest 256 MiB
    large and tiled                   tiles are read when they are looked up, never the whole file
    large and not tiled               decoded once, in bands, into a tiled copy on disk; then as above

Tiles lie in OpenImageIO's ImageCache, 1024 MiB at most.  `$USDSLF_TEXTURE_MB` sets another limit; small
textures then get a quarter of it on top.  The tiled copies lie in $TMPDIR, the latest 32 GiB, and are needed
because a picture without tiles can only be read from its beginning: fifty of them would be decoded again
for every block of pixels that is rendered.
"""

from __future__ import annotations

import contextlib
import logging
import os
import threading
import weakref
from collections import OrderedDict
from dataclasses import dataclass, field
from functools import lru_cache

import numpy as np
import OpenImageIO as oiio
from numpy.typing import NDArray

from usdslf.color import Color
from usdslf.scene.records import F32
from usdslf.textures.declared import channels_of, space_of
from usdslf.textures.files import (
    TILE,
    bands,
    check_corners,
    file_of,
    is_eight_bit,
    is_tiled,
    open_image,
    picked,
    stamp_of,
    write_tiled_copy,
)
from usdslf.textures.texels import Texels, four_channels

MEMORY_MB = 1024.0  # of tiles
SMALL = 4 << 20  # [bytes] of pixels: a texture up to this size is kept whole
_DISK = 32 << 30  # [bytes] of tiled copies
_log = logging.getLogger(__name__)


def memory_mb() -> float:
    """Returns the limit of all tiles in memory [MiB]."""
    try:
        return max(16.0, float(os.environ.get("USDSLF_TEXTURE_MB", "")))
    except ValueError:
        return MEMORY_MB


@dataclass(frozen=True)
class Coding:
    """How stored pixels become working-space values: by `table` (256, C), or by a conversion."""

    space: str
    color: Color
    is_eight_bit: bool
    table: F32 | None

    def decode(self, raw: NDArray) -> F32:
        """Returns values (..., C) of stored pixels (..., C)."""
        if self.table is not None:
            return self.table[raw, np.arange(raw.shape[-1])]
        values = raw.astype(np.float32)
        if self.is_eight_bit:
            values /= np.float32(255)
        if raw.shape[-1] >= 3:
            return self.color.to_working(values, self.space)
        if not self.color.is_data(self.space):
            values[..., :1] = self.color.to_working(np.repeat(values[..., :1], 3, -1), self.space)[..., :1]
        return values


@dataclass(frozen=True, eq=False)
class PagedTexels:
    """An image whose tiles are read when they are looked up; the same look-ups as Texels."""

    file: str  # tiled, or such that the cache tiles it
    origin: tuple[int, int]  # (x, y) of the first pixel
    shape: tuple[int, int, int]  # (H, W, C)
    coding: Coding
    channels: tuple[int, ...]  # of the file that are looked up
    copy_bytes: int = 0  # of the copy on disk that belongs to this image alone
    _troubles: list[str] = field(default_factory=list)

    def at(self, y: NDArray, x: NDArray) -> F32:
        """Returns texels (n, 4): grey is spread over rgb, a missing alpha is 1.

        Raises:
            OSError: a tile cannot be read.
        """
        raw = np.empty((len(y), self.shape[2]), np.uint8 if self.coding.is_eight_bit else np.float32)
        columns = -(-self.shape[1] // TILE)
        tile = (y // TILE) * columns + x // TILE
        order = np.argsort(tile, kind="stable")
        numbers, first = np.unique(tile[order], return_index=True)
        for number, places in zip(numbers, np.split(order, first[1:]), strict=False):
            top, left = int(number) // columns * TILE, int(number) % columns * TILE
            pixels = self._read(top, min(top + TILE, self.shape[0]), left, min(left + TILE, self.shape[1]))
            raw[places] = pixels[y[places] - top, x[places] - left]
        return four_channels(self.coding.decode(raw))

    def rows(self, top: int, bottom: int) -> F32:
        """Returns texels (bottom - top, W, 4) of whole rows, as `at` does."""
        raw = self._read(top, bottom, 0, self.shape[1])
        values = four_channels(self.coding.decode(raw.reshape(-1, self.shape[2])))
        return values.reshape(bottom - top, self.shape[1], 4)

    def _read(self, top: int, bottom: int, left: int, right: int) -> NDArray:
        kind = oiio.UINT8 if self.coding.is_eight_bit else oiio.FLOAT
        x, y = self.origin
        cache = _tiles()
        pixels = None
        if not self._troubles:
            pixels = cache.get_pixels(self.file, 0, 0, x + left, x + right, y + top, y + bottom, 0, 1, kind)
        if pixels is None or np.size(pixels) < (bottom - top) * (right - left) * self.shape[2]:
            if not self._troubles:
                self._troubles.append(" ".join(str(cache.geterror()).split()) or "a tile cannot be read")
            raise OSError(self._troubles[0])
        return picked(np.asarray(pixels).reshape(bottom - top, right - left, -1), self.channels)


Image = Texels | PagedTexels


@dataclass
class _Kept:
    """Images by key, the ones used last, `limit` bytes of them at most; one at least."""

    limit: int
    images: OrderedDict[tuple, tuple[tuple[int, int], Image, int]] = field(default_factory=OrderedDict)
    total: int = 0

    def find(self, key: tuple, stamp: tuple[int, int]) -> Image | None:
        """Returns an image that is kept, None where there is none or its file has changed."""
        entry = self.images.get(key)
        if entry is None:
            return None
        if entry[0] != stamp:
            self.total -= self.images.pop(key)[2]
            return None
        self.images.move_to_end(key)
        return entry[1]

    def keep(self, key: tuple, stamp: tuple[int, int], image: Image, size: int) -> None:
        if key in self.images:
            self.total -= self.images.pop(key)[2]
        self.images[key] = (stamp, image, size)
        self.total += size
        while self.total > self.limit and len(self.images) > 1:
            self.total -= self.images.popitem(last=False)[1][2]


_lock = threading.Lock()
_loading: dict[tuple, threading.Lock] = {}
_failed: dict[tuple, tuple[tuple[int, int], str]] = {}
_small = _Kept(int(memory_mb() * (1 << 18)))
_large = _Kept(_DISK)


def load_image(path: str, color_space: str, color: Color) -> Image:
    """Returns an image that can be looked up; the same one while its file does not change.

    Raises:
        OSError: it cannot be read, with the reason; a file that failed is not read again until it changes.
    """
    stamp, key = stamp_of(path), (path, color_space, color)
    with _lock:
        turn = _loading.setdefault(key, threading.Lock())
    with turn:  # two threads that want one file read it once
        with _lock:
            failed = _failed.get(key)
            image = _small.find(key, stamp) or _large.find(key, stamp)
        if isinstance(image, PagedTexels) and image._troubles:
            raise OSError(image._troubles[0])
        if image is not None:
            return image
        if any(stamp) and failed and failed[0] == stamp:
            raise OSError(failed[1])
        try:
            image = _load(path, color_space, color)
        except OSError as e:
            with _lock:
                _failed[key] = (stamp, str(e))
            raise
        with _lock:
            if isinstance(image, PagedTexels):
                _large.keep(key, stamp, image, image.copy_bytes)
            else:
                _small.keep(key, stamp, image, image.values.nbytes)
    return image


def read_whole(path: str, color_space: str, color: Color) -> F32:
    """Returns all texels (H, W, C) in the working space, not kept.

    Raises:
        OSError: it cannot be read, with the reason.
    """
    image = open_image(path)
    try:
        spec = image.spec()
        used = channels_of(spec)
        coding = _coding_of(spec, path, color_space, color)
        out = np.empty((spec.height, spec.width, len(used)), np.float32)
        for top, pixels in bands(image, used):
            out[top : top + len(pixels)] = coding.decode(pixels)
    finally:
        image.close()
    return out


def say_damaged(path: str, why: str) -> None:
    """Says once that a file turned out damaged while it was looked up."""
    with _lock:
        key, stamp = (path,), stamp_of(path)
        if _failed.get(key, (None, ""))[0] == stamp:
            return
        _failed[key] = (stamp, why)
    _log.warning("texture %s is damaged (%s): its fallback is used", path, why)


# ---- loading ---------------------------------------------------------------------------------
def _load(path: str, color_space: str, color: Color) -> Image:
    image = open_image(path)
    try:
        spec = image.spec()
        used = channels_of(spec)
        coding = _coding_of(spec, path, color_space, color)
        shape = (spec.height, spec.width, len(used))
        if spec.height * spec.width * len(used) * spec.channel_bytes() <= SMALL:
            return _small_image(image, coding, shape, used)
        if is_tiled(spec):
            check_corners(image)
            file = file_of(path)
            _tiles().invalidate(file, True)
            return PagedTexels(file, (spec.x, spec.y), shape, coding, used)
        copy, size = write_tiled_copy(image, used)
    finally:
        image.close()
    if not copy:
        _log.warning("no room for a tiled copy of %s in $TMPDIR: it is read slowly", path)
        file = file_of(path)
        _tiles().invalidate(file, True)
        return PagedTexels(file, (spec.x, spec.y), shape, coding, used)
    paged = PagedTexels(copy, (0, 0), shape, coding, tuple(range(len(used))), size)
    weakref.finalize(paged, _forget, copy)
    return paged


def _small_image(
    image: oiio.ImageInput, coding: Coding, shape: tuple[int, int, int], used: tuple[int, ...]
) -> Texels:
    if coding.table is not None:
        codes = np.empty(shape, np.uint8)
        for top, pixels in bands(image, used):
            codes[top : top + len(pixels)] = pixels
        return Texels(codes, coding.table)
    values = np.empty(shape, np.float32)
    for top, pixels in bands(image, used):
        values[top : top + len(pixels)] = coding.decode(pixels)
    fits_half = np.abs(values).max(initial=0.0) < 6e4
    return Texels(values.astype(np.float16) if fits_half else values)


def _forget(file: str) -> None:
    """Removes the tiled copy of an image that nobody holds any more."""
    _tiles().invalidate(file, True)
    with contextlib.suppress(OSError):  # the whole folder has gone
        os.unlink(file)


@lru_cache(maxsize=1)
def _tiles() -> oiio.ImageCache:
    """The cache of tiles; it keeps pixels as they are in the file, and alpha apart."""
    cache = oiio.ImageCache(False)
    cache.attribute("max_memory_MB", memory_mb())
    cache.attribute("autotile", TILE)
    cache.attribute("forcefloat", 0)
    cache.attribute("unassociatedalpha", 1)
    return cache


def _coding_of(spec: oiio.ImageSpec, path: str, color_space: str, color: Color) -> Coding:
    """Returns how pixels are converted, or raises OSError where their colour space is unknown."""
    eight = is_eight_bit(spec)
    space, _ = space_of(color_space, spec, file_of(path))
    if not color.knows(space):
        raise OSError(f"its colour space {space!r} is unknown to {color.config_name}")
    channels = len(channels_of(spec))
    by_table = eight and (color.acts_per_channel(space) or channels < 3)
    return Coding(space, color, eight, _table(space, channels, color) if by_table else None)


def _table(space: str, channels: int, color: Color) -> F32:
    """Returns working-space values (256, channels) of all 8 bit codes; alpha is linear."""
    code = np.arange(256, dtype=np.float32) / np.float32(255)
    table = np.repeat(code[:, None], channels, 1)
    colors = 1 if channels < 3 else 3
    table[:, :colors] = color.to_working(np.repeat(code[:, None], 3, 1), space)[:, :colors]
    return table
