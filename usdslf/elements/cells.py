"""The cells that triangles are cut into, so that a place is found in constant time.

cell (i, j, upper) of (u, v):  i = floor(u n), j = floor(v n), upper: frac(u n) + frac(v n) > 1
its number:                    i (2 n - i) + 2 j + upper,  0 .. n^2 - 1
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from usdslf.runs import first_places, numbered

ENTRIES_PER_SPACING = 3.0  # cells that are closer may share their entry
SLIVER = 4096  # cells that a triangle may have whatever its area
MOST_CELLS = 500_000  # beside one for each triangle


def divide_triangles(corners: NDArray, area: NDArray, cell: NDArray) -> tuple[NDArray[np.int32], float]:
    """Returns divisions (T,) that make cells at most `cell` (T,) wide, wider where they are too many, and the slack."""
    slack = 1.0
    while True:
        n = _whole_divisions(wanted_divisions(corners, area, cell, slack))
        if (n.astype(np.int64) ** 2).sum() <= MOST_CELLS + len(n):
            return n, slack
        slack *= 0.8


def wanted_divisions(corners: NDArray, area: NDArray, cell: NDArray, slack: float) -> NDArray[np.float64]:
    """How often (T,) triangles are to be cut; slivers are cut by their area, and with less slack so are others."""
    c = corners.astype(np.float64)
    edges = np.linalg.norm(c - np.roll(c, 1, 1), axis=2)
    with np.errstate(invalid="ignore"):
        wanted = np.nan_to_num(edges.max(1, initial=0) / cell, posinf=1) if len(c) else np.zeros(0)
        fair = np.nan_to_num(np.sqrt(SLIVER + 30 * area / cell**2), posinf=1) if len(c) else np.zeros(0)
    found: NDArray[np.float64] = np.minimum(wanted, slack * fair)
    return found


def _whole_divisions(wanted: NDArray) -> NDArray[np.int32]:
    return np.clip(np.ceil(wanted), 1, 2048).astype(np.int32)


def steady_divisions(wanted: NDArray, before: NDArray) -> NDArray[np.int32]:
    """Divisions (n,) where they were nearly the same before: what turns is rounded otherwise."""
    same = (wanted <= 1.01 * before) & (wanted >= 0.99 * (before - 1))
    return np.where(same, before, _whole_divisions(wanted))


def cell_centres(number: NDArray, n: NDArray) -> NDArray[np.float64]:
    """Barycentrics (k, 2) of the centres of cells, by their number (k,) in triangles of n (k,) divisions."""
    n = n.astype(np.int64)
    i = np.floor(n - np.sqrt((n * n - number).astype(np.float64))).astype(np.int64)
    i -= i * (2 * n - i) > number
    i += (i + 1) * (2 * n - i - 1) <= number
    rest = number - i * (2 * n - i)
    third = (1 + rest % 2) / 3
    return np.stack([(i + third) / n, (rest // 2 + third) / n], 1)


def cell_of(bary: NDArray, n: NDArray) -> NDArray[np.uint32]:
    """Number (k,) of the cell that barycentrics (k, 2) lie in, in float32 as on the device."""
    size = n.astype(np.float32)
    u, v = np.maximum(bary[:, 0], 0) * size, np.maximum(bary[:, 1], 0) * size
    n = n.astype(np.int32)
    i = np.minimum(u.astype(np.int32), n - 1)
    j = np.minimum(v.astype(np.int32), n - 1 - i)
    upper = ((u - i) + (v - j) > 1) & (j < n - 1 - i)
    return (i * (2 * n - i) + 2 * j + upper).astype(np.uint32)


def share_cells(
    position: NDArray, normal: NDArray, owner: NDArray, spacing: NDArray
) -> tuple[NDArray[np.int64], NDArray[np.uint32]]:
    """Finds cells that are as good as the same: a third of the spacing apart, alike in normal and owner.

    Returns: one cell (entries,) for each entry, and the entry (n,) of each cell.
    """
    if not len(position):
        return np.zeros(0, np.int64), np.zeros(0, np.uint32)
    box = np.floor((position - position.min(0)) / (spacing[:, None] / ENTRIES_PER_SPACING)).astype(np.int64)
    turn = np.rint(normal * 1.5).astype(np.int64)
    key = owner.astype(np.int64).astype(np.uint64)
    for column in (*box.T, *turn.T):
        key = key * np.uint64(0x9E3779B97F4A7C15) + column.astype(np.uint64)
    names, entry = numbered(key)
    return first_places(entry, len(names)), entry.astype(np.uint32)


def interpolate(corners: NDArray, triangle: NDArray, bary: NDArray) -> NDArray[np.float64]:
    c = corners[triangle].astype(np.float64)
    return c[:, 0] + bary[:, :1] * (c[:, 1] - c[:, 0]) + bary[:, 1:] * (c[:, 2] - c[:, 0])
