"""Which points of surfaces the texels of an image lie on: triangles drawn into texture space.

texel_points(uv, width, height, wrap_s, wrap_t) -> iterator of TexelPoints     in pieces of bounded size
nearest_covered(covered, free, border, wraps) -> (y, x, from_y, from_x)        for the rim around charts
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import distance_transform_edt

from usdslf.scene.records import F64

PIECE = 1 << 21  # texels at a time


@dataclass(frozen=True)
class TexelPoints:
    """Texels and where on triangles their centres lie.  n of them."""

    y: NDArray[np.int64]  # (n,) row, 0 on top
    x: NDArray[np.int64]  # (n,) column
    triangle: NDArray[np.int64]  # (n,) into the triangles that were given
    barycentric: F64  # (n, 2)


def texel_points(uv: F64, width: int, height: int, wrap_s: str, wrap_t: str) -> Iterator[TexelPoints]:
    """Yields the texels whose centres triangles cover, row by row of each triangle.

    Args:
        uv: (T, 3, 2) st of the corners; (0, 0) is the lower left; not finite: left out.
        wrap_s, wrap_t: where texels outside of the image lie: repeat and mirror bring them back into it, of
            clamp and black they are left out.
    """
    p = np.asarray(uv, np.float64) * [width, -height] + [0, height]
    e1, e2 = p[:, 1] - p[:, 0], p[:, 2] - p[:, 0]
    area = e1[:, 0] * e2[:, 1] - e1[:, 1] * e2[:, 0]
    usable = np.flatnonzero(np.isfinite(p).all((1, 2)) & (np.abs(area) > 1e-12))
    low, high = p[usable, :, 1].min(1), p[usable, :, 1].max(1)
    first, last = np.ceil(low - 0.5), np.ceil(high - 0.5)
    if wrap_t not in ("repeat", "mirror"):
        first, last = np.clip(first, 0, height), np.clip(last, 0, height)
    rows = (last - first).astype(np.int64)
    for a, b in _pieces(rows):
        triangle, row = _spread(usable[a:b], first[a:b].astype(np.int64), rows[a:b])
        left, right = _span(p[triangle], row + 0.5)
        x0, x1 = np.ceil(left - 0.5), np.ceil(right - 0.5)
        if wrap_s not in ("repeat", "mirror"):
            x0, x1 = np.clip(x0, 0, width), np.clip(x1, 0, width)
        columns = np.maximum(x1 - x0, 0).astype(np.int64)
        for c, d in _pieces(columns):
            span, x = _spread(np.arange(c, d), x0[c:d].astype(np.int64), columns[c:d])
            t, y = triangle[span], row[span]
            offset = np.stack([x + 0.5, y + 0.5], -1) - p[t, 0]
            u = (offset[:, 0] * e2[t, 1] - offset[:, 1] * e2[t, 0]) / area[t]
            v = (e1[t, 0] * offset[:, 1] - e1[t, 1] * offset[:, 0]) / area[t]
            bary = np.clip(np.stack([u, v], -1), 0, 1)
            yield TexelPoints(_wrapped(y, height, wrap_t), _wrapped(x, width, wrap_s), t, bary)


def nearest_covered(
    covered: NDArray[np.bool_], free: NDArray[np.bool_], border: int, wraps: tuple[bool, bool]
) -> tuple[NDArray, NDArray, NDArray, NDArray]:
    """Returns the free texels within `border` of covered ones, and the nearest covered one of each.

    Args:
        covered, free: (h, w).
        wraps: whether rows, columns go on at the other side of the image.
    """
    none = np.zeros(0, np.int64)
    at = np.nonzero(covered)
    if border <= 0 or not len(at[0]):
        return none, none, none, none
    axes = []
    for i, wrapped in enumerate(wraps):
        size = covered.shape[i]
        near = np.arange(at[i].min() - border, at[i].max() + border + 1)
        axes.append(near % size if wrapped else near[(near >= 0) & (near < size)])
    part = covered[np.ix_(*axes)]
    distance, (from_y, from_x) = distance_transform_edt(~part, return_indices=True)
    y, x = np.nonzero((distance > 0) & (distance <= border) & free[np.ix_(*axes)])
    return axes[0][y], axes[1][x], axes[0][from_y[y, x]], axes[1][from_x[y, x]]


def _span(corners: F64, y: F64) -> tuple[F64, F64]:
    """Returns where a horizontal line enters and leaves each triangle (n, 3, 2)."""
    left, right = np.full(len(y), np.inf), np.full(len(y), -np.inf)
    for i in range(3):
        a, b = corners[:, i], corners[:, (i + 1) % 3]
        crosses = (a[:, 1] <= y) != (b[:, 1] <= y)
        with np.errstate(divide="ignore", invalid="ignore"):
            x = a[:, 0] + (y - a[:, 1]) / (b[:, 1] - a[:, 1]) * (b[:, 0] - a[:, 0])
        left = np.where(crosses, np.minimum(left, x), left)
        right = np.where(crosses, np.maximum(right, x), right)
    inside = right >= left
    return np.where(inside, left, 0), np.where(inside, right, 0)


def _spread(
    what: NDArray[np.int64], start: NDArray[np.int64], count: NDArray[np.int64]
) -> tuple[NDArray, NDArray]:
    """Repeats each of `what` `count` times, beside start, start + 1, ..."""
    first = np.cumsum(count) - count
    return np.repeat(what, count), np.arange(count.sum()) - np.repeat(first - start, count)


def _pieces(count: NDArray[np.int64]) -> Iterator[tuple[int, int]]:
    """Yields ranges of entries that together hold about PIECE things."""
    ends = np.cumsum(count)
    a = 0
    while a < len(count):
        done = ends[a - 1] if a else 0
        b = max(int(np.searchsorted(ends, done + PIECE, "right")), a + 1)
        yield a, b
        a = b


def _wrapped(i: NDArray[np.int64], size: int, wrap: str) -> NDArray[np.int64]:
    if wrap == "mirror":
        i = i % (2 * size)
        return np.where(i < size, i, 2 * size - 1 - i)
    return i % size
