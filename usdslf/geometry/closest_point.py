"""The point of a triangle, or of many, that is nearest to a point in space.

nearest_on_triangles(corners, points, pair=None) -> Nearest
triangles_within(corners, points, reach) -> (pairs of point and triangle)
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass
from itertools import chain
from weakref import ReferenceType, ref

import numpy as np
from numpy.typing import NDArray

from usdslf.progress import in_blocks, tell
from usdslf.sampling.nearest import tree_of
from usdslf.scene.records import F64

BLOCK = 1024  # points that are looked at between two words of progress
CHUNK = 4_000_000  # pairs of point and triangle that are looked at together


@dataclass(frozen=True)
class Nearest:
    """The nearest surface point of each of n points."""

    triangle: NDArray[np.int64]  # (n,) row of `corners`
    barycentric: F64  # (n, 2)
    distance: F64  # (n,) inf where there is no triangle


def nearest_on_triangles(corners: NDArray, points: NDArray, pair: NDArray | None = None) -> Nearest:
    """Finds the nearest point on T triangles for each of n points.

    The surface is no further than the nearest corner or centre; triangles whose sphere comes as near are solved
    exactly.  Points that are corners, as those of a mesh are, lie on the first triangle that has them.

    Args:
        corners: (T, 3, 3); triangles with corners that are not finite are never nearest.
        points: (n, 3).
        pair: (T,) the one point that each triangle is compared with; None: every triangle with every point.
    """
    given = corners
    corners, points = np.asarray(corners, np.float64), np.asarray(points, np.float64)
    n = len(points)
    if pair is not None:
        return _best_of_pairs(n, np.asarray(pair), np.arange(len(corners)), corners, points)
    is_new = np.ones(n, bool)
    is_new[1:] = (points[1:] != points[:-1]).any(1)
    if not is_new.all():  # a dab is a point twice
        once, again = nearest_on_triangles(given, points[is_new]), np.cumsum(is_new) - 1
        return Nearest(once.triangle[again], once.barycentric[again], once.distance[again])
    spheres = next((found for of, found in tuple(_SEARCHED) if of() is given), None)
    if spheres is None:
        usable = np.flatnonzero(np.isfinite(corners).all((1, 2)))
        if not len(usable):
            return _best_of_pairs(n, np.zeros(0, int), np.zeros(0, int), corners, points)
        spheres = _Spheres(usable, corners[usable])
        if given.base is None:  # and no part of another array, which nobody holds
            _SEARCHED.append((ref(given), spheres))
    rounding = 1e-9 * (np.abs(spheres.marks).max() + np.abs(points).max(initial=0))
    out = Nearest(np.zeros(n, np.int64), np.zeros((n, 2)), np.full(n, np.inf))
    for rows in in_blocks(n, BLOCK):
        near, mark = spheres.tree.query(points[rows])
        is_corner = (near == 0) & (mark >= len(spheres.number))
        corner, rest = rows.start + np.flatnonzero(is_corner), rows.start + np.flatnonzero(~is_corner)
        out.triangle[corner], out.barycentric[corner] = spheres.with_corners(points[corner])
        out.distance[corner] = 0
        point, triangle = spheres.that_may_be_nearest(points[rest], near[~is_corner] + rounding)
        best = _best_of_pairs(len(rest), point, triangle, corners, points[rest])
        out.triangle[rest], out.barycentric[rest], out.distance[rest] = best.triangle, best.barycentric, best.distance
    return out


_SEARCHED: deque[tuple[ReferenceType[NDArray], _Spheres]] = deque(maxlen=3)
"""What was searched last: a scene's triangles for each stroke, those of a material; they never change."""


class _Spheres:
    """The spheres about triangles, sorted by size: a single large one must not widen the search among small ones."""

    def __init__(self, number: NDArray, corners: F64) -> None:
        """Sorts the spheres of triangles (T, 3, 3), by `number` (T,) of each."""
        self.number, self.center = number, corners.mean(1)
        self.radius = np.linalg.norm(corners - self.center[:, None], axis=2).max(1)
        self.marks = np.concatenate([self.center, corners.reshape(-1, 3)])
        self.tree = tree_of(self.marks)
        tell()
        size = np.ceil(np.log2(np.maximum(self.radius, 1e-6 * self.radius.max() + 1e-300)))
        alike = [np.flatnonzero(size == one) for one in np.unique(size)]
        self.classes = [(rows, tree_of(self.center[rows]), self.radius[rows].max()) for rows in alike]

    def with_corners(self, points: F64) -> tuple[NDArray, F64]:
        """Number (n,) of the first triangle that has each point as a corner, and its barycentrics (n, 2) there."""
        found, count = self.tree.query_ball_point(points, 0.0), len(self.number)
        marks = np.fromiter(chain(*found), int)
        marks = np.where(marks < count, len(self.marks), marks)  # centres are no corners
        starts = np.cumsum([0, *(len(f) for f in found)])[:-1]
        first = np.minimum.reduceat(marks, starts) - count if len(points) else np.zeros(0, int)
        return self.number[first // 3], np.eye(3)[first % 3, 1:]

    def that_may_be_nearest(self, points: F64, enough: F64) -> tuple[NDArray, NDArray]:
        """Pairs of point (k,) and number (k,) of a triangle whose sphere comes as near as is enough (n,)."""
        point, triangle = [np.zeros(0, int)], [np.zeros(0, int)]
        for rows, tree, largest in self.classes:
            found = tree.query_ball_point(points, enough + largest)
            i = np.repeat(np.arange(len(points)), [len(f) for f in found])
            j = rows[np.fromiter(chain(*found), int)]
            near = np.linalg.norm(points[i] - self.center[j], axis=1) <= enough[i] + self.radius[j]
            point.append(i[near])
            triangle.append(self.number[j[near]])
        return np.concatenate(point), np.concatenate(triangle)


def triangles_within(corners: NDArray, points: NDArray, reach: NDArray) -> tuple[NDArray, NDArray]:
    """Returns the pairs of point and triangle that are within reach of each other.

    Args:
        corners: (T, 3, 3).
        points: (n, 3).
        reach: (n,) of each point.
    """
    corners, points = np.asarray(corners, np.float64), np.asarray(points, np.float64)
    center = corners.mean(1)
    radius = np.linalg.norm(corners - center[:, None], axis=2).max(1, initial=0)
    point, triangle = [np.zeros(0, int)], [np.zeros(0, int)]
    step = max(1, CHUNK // max(len(corners), 1))
    for start in range(0, len(points), step):
        rows = np.arange(start, min(len(points), start + step))
        gap = np.linalg.norm(points[rows][:, None] - center[None], axis=2)
        i, j = np.nonzero(gap <= radius + reach[rows][:, None])
        point.append(rows[i])
        triangle.append(j)
    p, t = np.concatenate(point), np.concatenate(triangle)
    near = _nearest_in_triangle(corners[t], points[p])[1] <= reach[p]
    return p[near], t[near]


def _best_of_pairs(n: int, point: NDArray, triangle: NDArray, corners: F64, points: F64) -> Nearest:
    uv, distance = _nearest_in_triangle(corners[triangle], points[point])
    order = np.lexsort((triangle, distance, point))
    first = order[np.unique(point[order], return_index=True)[1]]
    out = Nearest(np.zeros(n, np.int64), np.zeros((n, 2)), np.full(n, np.inf))
    out.triangle[point[first]] = triangle[first]
    out.barycentric[point[first]] = uv[first]
    out.distance[point[first]] = distance[first]
    return out


def _nearest_in_triangle(corners: F64, p: F64) -> tuple[F64, F64]:
    """Barycentrics (n, 2) of the nearest point of a triangle each (n, 3, 3), and its distance (n,).

    The foot of the perpendicular where it falls inside, else the best of the three edges.
    """
    a, b, c = corners[:, 0], corners[:, 1], corners[:, 2]
    ab, ac, ap = b - a, c - a, p - a
    d00, d01, d11 = (ab * ab).sum(1), (ab * ac).sum(1), (ac * ac).sum(1)
    d20, d21 = (ap * ab).sum(1), (ap * ac).sum(1)
    area2 = d00 * d11 - d01 * d01
    safe = np.where(area2 > 0, area2, 1)
    u, v = (d11 * d20 - d01 * d21) / safe, (d00 * d21 - d01 * d20) / safe
    inside = (area2 > 0) & (u >= 0) & (v >= 0) & (u + v <= 1)

    def along(start: F64, edge: F64) -> F64:
        length2 = (edge * edge).sum(1)
        return np.clip(((p - start) * edge).sum(1) / np.where(length2 > 0, length2, 1), 0, 1)

    s, t, w = along(a, ab), along(a, ac), along(b, c - b)
    zero = np.zeros_like(s)
    choices = np.stack([np.stack(c, -1) for c in ((u, v), (s, zero), (zero, t), (1 - w, w))])
    feet = a + choices[..., :1] * ab + choices[..., 1:] * ac
    gaps = np.linalg.norm(feet - p, axis=2)
    gaps[0, ~inside] = np.inf
    best = gaps.argmin(0)
    rows = np.arange(len(p))
    return choices[best, rows], gaps[best, rows]
