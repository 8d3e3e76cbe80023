"""Texels: an image in memory, and how it is looked up.

Coordinates are those of USD: st (0, 0) is the lower left corner of the picture, and texel centres lie at
(i + 0.5) / size.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from usdslf.scene.records import F32

WRAPS = ("black", "clamp", "repeat", "mirror")
EDGE = 1e-5  # st this far outside 0..1 still counts as inside for wrap mode black


@dataclass(frozen=True)
class Texels:
    """One image in memory.

    `values` (H, W, C) are code values where `table` (256, C) converts them, else working-space pixels.
    """

    values: NDArray
    table: F32 | None = None

    @property
    def shape(self) -> tuple[int, int, int]:
        """(H, W, C)."""
        height, width, channels = self.values.shape
        return height, width, channels

    def at(self, y: NDArray, x: NDArray) -> F32:
        """Returns texels (n, 4): grey is spread over rgb, a missing alpha is 1."""
        v = self.values[y, x]
        out = v.astype(np.float32) if self.table is None else self.table[v, np.arange(v.shape[-1])]
        return four_channels(out)

    def rows(self, top: int, bottom: int) -> F32:
        """Returns texels (bottom - top, W, 4) of whole rows, as `at` does."""
        y, x = np.indices((bottom - top, self.shape[1])).reshape(2, -1)
        return self.at(y + top, x).reshape(bottom - top, self.shape[1], 4)


class Lookup(Protocol):
    """An image whose texels can be looked up."""

    @property
    def shape(self) -> tuple[int, int, int]:
        """(H, W, C)."""
        ...

    def at(self, y: NDArray, x: NDArray) -> F32:
        """Returns texels (n, 4)."""
        ...


def bilinear(texels: Lookup, st: NDArray[np.float64], wrap_s: str, wrap_t: str) -> F32:
    """Returns texels (n, 4) interpolated at st (n, 2)."""
    out: NDArray
    height, width = texels.shape[:2]
    x0, x1, fx, in_s = _neighbours(st[:, 0], width, wrap_s)
    y0, y1, fy, in_t = _neighbours(1.0 - st[:, 1], height, wrap_t)
    if width == height == 1:
        out = texels.at(y0, x0)
    else:
        # One look-up for all four, so that a tile is fetched once.
        found = texels.at(np.concatenate([y0, y0, y1, y1]), np.concatenate([x0, x1, x0, x1]))
        a, b, c, d = found.reshape(4, -1, 4)
        upper = a * (1 - fx) + b * fx
        lower = c * (1 - fx) + d * fx
        out = upper * (1 - fy) + lower * fy
    if not (in_s.all() and in_t.all()):
        out = out * (in_s & in_t)[:, None]
    return np.asarray(out, np.float32)


def _neighbours(s: NDArray[np.float64], size: int, wrap: str) -> tuple[NDArray, NDArray, F32, NDArray]:
    """Returns the two texels beside each coordinate, the weight (n, 1) of the second, and what is inside."""
    inside = np.ones(len(s), bool)
    if wrap == "repeat":
        s = s - np.floor(s)
    elif wrap == "mirror":
        s = 1 - np.abs(1 - np.mod(s, 2))
    else:
        inside = (s >= -EDGE) & (s <= 1 + EDGE) if wrap == "black" else inside
        s = np.clip(s, 0, 1)
    x = s * size - 0.5
    low = np.floor(x)
    weight = (x - low).astype(np.float32)[:, None]
    i0 = low.astype(np.int64)
    i1 = i0 + 1
    if wrap == "repeat":
        return i0 % size, i1 % size, weight, inside
    return np.clip(i0, 0, size - 1), np.clip(i1, 0, size - 1), weight, inside


def st_of_format(format: str, d: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
    """Returns where directions (n, 3) lie in a mirrored ball, an angular map or a vertical cross.

    Ball and angular map look along -Z from the front, which is +Z in the middle of the picture; the cross
    has +Y on top, then -X +Z +X side by side, -Y, and -Z (upside down) at the bottom.
    """
    inside = np.ones(len(d), bool)
    radial = np.hypot(d[:, 0], d[:, 1])
    unit = d[:, :2] / np.maximum(radial, 1e-12)[:, None]
    if format == "angular":
        r = np.arccos(np.clip(d[:, 2], -1, 1)) / np.pi
        return 0.5 + 0.5 * unit * r[:, None], inside
    if format == "mirroredBall":
        r = np.sqrt(np.clip(0.5 * (1 - d[:, 2]), 0, 1))  # sin of half the angle to +Z
        return 0.5 + 0.5 * unit * r[:, None], inside
    axis = np.abs(d).argmax(1)
    major = np.take_along_axis(d, axis[:, None], 1)[:, 0]
    side = major >= 0
    a = d / np.maximum(np.abs(major), 1e-12)[:, None]
    x, y, z = a.T
    # middle of the face in the 3 x 4 grid (from the lower left), and the position on it in -1..1
    column = np.where(axis == 0, np.where(side, 2, 0), 1)
    row = np.select([(axis == 1) & side, axis == 1, (axis == 2) & ~side], [3, 1, 0], 2)
    u = np.select([axis == 0], [np.where(side, -z, z)], x)
    v = np.select([(axis == 1) & side, axis == 1, (axis == 2) & ~side], [-z, z, -y], y)
    return np.stack([(column + 0.5 + 0.5 * u) / 3, (row + 0.5 + 0.5 * v) / 4], -1), inside


def four_channels(v: F32) -> F32:
    """Returns (n, 4) of (n, 1..4): grey is spread over rgb, a missing alpha is 1."""
    count = v.shape[-1]
    if count == 4:
        return v
    out = np.ones((len(v), 4), np.float32)
    out[:, :3] = v[:, :1] if count < 3 else v
    if count == 2:
        out[:, 3] = v[:, 1]
    return out
