"""The bins of the hemisphere: an equal-area concentric map of 32 x 32 squares.

Bin `d = iy * 32 + ix` is the square cell (ix, iy) of [-1, 1]^2, mapped to the disk and from there to the
hemisphere with equal areas, so each bin holds 2 pi / D sr, box filtering is exact, and mirroring about the
normal is the permutation d -> D - 1 - d.  kernels/common.cl holds the device twin.

Source: Shirley and Chiu 1997, A low distortion map between disk and square.
"""

from __future__ import annotations

from functools import cache

import numpy as np
from numpy.typing import NDArray

SIDE = 32
D = SIDE * SIDE
SOLID_ANGLE = 2 * np.pi / D  # [sr] of one bin


def hemisphere_from_square(square: NDArray) -> NDArray:
    """Maps points of [-1, 1]^2 (n, 2) to unit vectors (n, 3) of the upper hemisphere, keeping areas."""
    a, b = np.moveaxis(np.asarray(square, np.float64), -1, 0)
    wide = np.abs(a) > np.abs(b)
    r = np.where(wide, a, b)
    safe = np.where(r == 0, 1, r)
    phi = np.where(wide, np.pi / 4 * b / safe, np.pi / 2 - np.pi / 4 * a / safe)
    s = r * np.sqrt(np.maximum(2 - r * r, 0))
    return np.stack([s * np.cos(phi), s * np.sin(phi), 1 - r * r], -1)


def square_from_hemisphere(local: NDArray) -> NDArray:
    """Maps unit vectors (n, 3) with z >= 0 back to [-1, 1]^2 (n, 2)."""
    x, y, z = np.moveaxis(np.asarray(local, np.float64), -1, 0)
    r = np.sqrt(np.clip(1 - z, 0, 1))
    wide = np.abs(x) > np.abs(y)
    big = np.where(wide, x, y)
    small = np.where(wide, y, x)
    first = np.where(big < 0, -r, r)
    second = first * 4 / np.pi * np.arctan(small / np.where(big == 0, 1, big))
    return np.stack([np.where(wide, first, second), np.where(wide, second, first)], -1)


@cache
def bin_directions(side: int = SIDE) -> NDArray[np.float64]:
    """Returns the local unit directions (side^2, 3) of the centres of the bins."""
    t = (np.arange(side) + 0.5) * 2 / side - 1
    x, y = np.meshgrid(t, t)
    out = hemisphere_from_square(np.stack([x.ravel(), y.ravel()], -1))
    out.flags.writeable = False
    return out


def bin_of(local: NDArray, side: int = SIDE) -> NDArray[np.int64]:
    """Returns the bin (n,) of each local direction (n, 3); directions below the horizon go to its rim."""
    local = np.asarray(local, np.float64)
    local = np.concatenate([local[..., :2], np.maximum(local[..., 2:], 0)], -1)
    norm = np.linalg.norm(local, axis=-1, keepdims=True)
    cell = (square_from_hemisphere(local / np.where(norm == 0, 1, norm)) + 1) * (side / 2)
    index: NDArray[np.int64] = np.clip(cell.astype(np.int64), 0, side - 1)
    return index[..., 1] * side + index[..., 0]
