"""Polygons -> triangles.

A face that is convex is split as a fan from its first corner, as Hydra does; a concave one by clipping
ears.  Triangles name *corners* (places in the flat list of face vertex indices), so that whatever is
known per corner can be looked up without further tables.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from usdslf.runs import distinct, owners
from usdslf.sampling.frames import tangents
from usdslf.scene.arrays import cross
from usdslf.scene.records import F64

I64 = NDArray[np.int64]

_EARS_AT_ONCE = 200_000  # corners of concave faces that are worked on together


def triangulate(points: F64, counts: I64, indices: I64) -> tuple[I64, I64, I64]:
    """Splits polygons into triangles, each polygon of n corners into n - 2.

    Args:
        points: positions (V, 3).
        counts: corners of each face (F,), each at least 3.
        indices: point of each corner (C,).
    Returns:
        corners (T, 3) of each triangle, in the winding of their face; the face (T,) of each triangle,
        ascending; its number (T,) within the face.
    """
    first = np.concatenate([[0], np.cumsum(counts)[:-1]]).astype(np.int64)
    number = counts - 2
    face = owners(number)
    start = np.concatenate([[0], np.cumsum(number)[:-1]]).astype(np.int64)
    within = np.arange(len(face)) - start[face]
    base = first[face]
    corners = np.stack([base, base + within + 1, base + within + 2], axis=1)

    concave = np.flatnonzero(_is_concave(points, counts, indices, first))
    for n in distinct(counts[concave]):
        of_size = concave[counts[concave] == n]
        step = max(1, _EARS_AT_ONCE // int(n))
        for i in range(0, len(of_size), step):
            some = of_size[i : i + step]
            ears = _clip_ears(_flatten(points[indices[first[some][:, None] + np.arange(n)]]))  # (m, n-2, 3)
            rows = start[some][:, None] + np.arange(n - 2)
            corners[rows] = ears + first[some][:, None, None]
    return corners, face, within


def _is_concave(points: F64, counts: I64, indices: I64, first: I64) -> NDArray[np.bool_]:
    """Whether a face (F,) turns against its Newell normal at some corner, by more than rounding."""
    out = np.zeros(len(counts), bool)
    for n in distinct(counts[counts > 3]):
        of_size = np.flatnonzero(counts == n)
        p = points[indices[first[of_size][:, None] + np.arange(n)]]  # (m, n, 3)
        edge = np.roll(p, -1, axis=1) - p
        turn = cross(np.roll(edge, 1, axis=1), edge)
        # Twice the vector area of a polygon is the sum of its fan's cross products.
        normal = cross(p[:, 1:-1] - p[:, :1], p[:, 2:] - p[:, :1]).sum(1)
        along = np.einsum("mni,mi->mn", turn, normal)
        out[of_size] = along.min(1) < -1e-9 * np.einsum("mi,mi->m", normal, normal)
    return out


def _flatten(p: F64) -> F64:
    """Projects polygons (m, n, 3) along their Newell normals; counter-clockwise coordinates (m, n, 2)."""
    p = p - p[:, :1]
    normal = cross(p, np.roll(p, -1, axis=1)).sum(1)
    length = np.linalg.norm(normal, axis=1, keepdims=True)
    normal = np.where(length > 0, normal / np.where(length > 0, length, 1), [0.0, 0.0, 1.0])
    x, y = (np.ascontiguousarray(v.T) for v in tangents(normal.T))
    return np.stack([np.einsum("mni,mi->mn", p, x), np.einsum("mni,mi->mn", p, y)], axis=2)


def _turn(a: F64, b: F64, c: F64) -> F64:
    """Twice the signed area of triangles a b c, each (..., 2)."""
    p, q = b - a, c - a
    return p[..., 0] * q[..., 1] - p[..., 1] * q[..., 0]


def _clip_ears(flat: F64) -> I64:
    """Triangulates simple polygons (m, n, 2), all at once; triangles (m, n-2, 3) of corner numbers.

    Each round clips the best shaped ear of every polygon and looks anew at the two corners beside it.
    Where no ear is left (a polygon that crosses itself) the best shaped corner is clipped all the same.
    """
    m, n, _ = flat.shape
    row = np.arange(m)
    left = np.tile(np.roll(np.arange(n), 1), (m, 1))
    right = np.tile(np.roll(np.arange(n), -1), (m, 1))
    uncut = np.ones((m, n), bool)
    score = np.stack([_score(flat, uncut, left[:, i], np.full(m, i), right[:, i]) for i in range(n)], axis=1)
    out = np.empty((m, n - 2, 3), np.int64)
    for k in range(n - 2):
        tip = np.where(uncut, score, -np.inf).argmax(1)
        before, after = left[row, tip], right[row, tip]
        out[:, k] = np.stack([before, tip, after], axis=1)
        uncut[row, tip] = False
        right[row, before] = after
        left[row, after] = before
        score[row, before] = _score(flat, uncut, left[row, before], before, after)
        score[row, after] = _score(flat, uncut, before, after, right[row, after])
    return out


def _score(flat: F64, uncut: NDArray[np.bool_], left: I64, tip: I64, right: I64) -> F64:
    """How good an ear (m,) each polygon's triangle left-tip-right is; -2 and below: none."""
    row = np.arange(len(flat))
    a, b, c = flat[row, left], flat[row, tip], flat[row, right]
    area = _turn(a, b, c)
    edges = ((b - a) ** 2).sum(1) + ((c - b) ** 2).sum(1) + ((a - c) ** 2).sum(1)
    shape = area / np.where(edges > 0, edges, 1)
    # A corner that lies inside, or on the new edge, forbids the ear; the ear's own places do not.
    p = flat
    inside = (
        (_turn(a[:, None], b[:, None], p) >= 0)
        & (_turn(b[:, None], c[:, None], p) >= 0)
        & (_turn(c[:, None], a[:, None], p) >= 0)
        & uncut
    )
    for own in (a, b, c):
        inside &= (p != own[:, None]).any(2)
    return np.where((area > 0) & ~inside.any(1), shape, shape - 3)
