"""Moved: which meshes are elsewhere at another frame, and the space that they leave and take.

Many meshes are told apart as GROUPS at most, by halves of their places, so that a ray or a place is compared with few.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields, is_dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from usdslf.scene import F64, Material, Scene
from usdslf.surface import is_opaque

GROUPS = 16


@dataclass(frozen=True)
class Space:
    """Spheres and boxes about k groups of meshes."""

    centre: F64  # (k, 3)
    radius: F64  # (k,)
    low: F64  # (k, 3)
    high: F64  # (k, 3)


@dataclass(frozen=True)
class Moved:
    """What moved between two frames of the same meshes."""

    meshes: NDArray[np.bool_]  # (M,) elsewhere or of another shape
    before: Space
    after: Space

    def is_within(self, position: NDArray, reach: NDArray) -> NDArray[np.bool_]:
        """Tells which places (n, 3) are within their reach (n,) of what moved, before or after."""
        found = np.zeros(len(position), bool)
        for space in (self.before, self.after):
            for low, high in zip(space.low, space.high, strict=True):
                away = np.maximum(np.maximum(low - position, position - high), 0)
                found |= (away * away).sum(1) <= np.asarray(reach, np.float64) ** 2
        return found


def why_not_comparable(before: Scene, after: Scene) -> str:
    """Returns why elements of one frame can not be those of another; "" where they can."""
    if [m.path for m in before.meshes] != [m.path for m in after.meshes]:
        return "shows other meshes"
    if len(before.materials) != len(after.materials):
        return "shows other materials"
    if any(_opacity(a) != _opacity(b) for a, b in zip(before.materials, after.materials, strict=True)):
        return "has another opacity"
    for a, b in zip(before.meshes, after.meshes, strict=True):
        if not np.array_equal(a.triangles, b.triangles):
            return f"cuts {a.path} into other triangles"
        if not np.array_equal(a.material_of_triangle, b.material_of_triangle):
            return f"shows {a.path} in another material"
        seen_through = any(not is_opaque(after.materials[m]) for m in np.unique(b.material_of_triangle))
        if seen_through and not look_alike((a.uvs, a.primvars), (b.uvs, b.primvars)):
            return f"shifts what {a.path} is seen through by"
    return ""


def find_moved(before: Scene, after: Scene) -> Moved:
    """Compares frames of which `why_not_comparable` has nothing to say."""
    pairs = list(zip(before.meshes, after.meshes, strict=True))
    meshes = np.array(
        [
            not (np.array_equal(a.positions, b.positions) and np.array_equal(a.corner_normals, b.corner_normals))
            for a, b in pairs
        ],
        bool,
    )
    which = np.flatnonzero(meshes)
    clouds = [[_finite(pairs[i][k].positions) for i in which] for k in (0, 1)]
    middle = np.array([0.5 * (p.min(0) + p.max(0)) for p in clouds[1]]).reshape(-1, 3)
    groups = _halves(middle, np.arange(len(which)), GROUPS) if len(which) else []
    spaces = [[np.concatenate([cloud[i] for i in group]) for group in groups] for cloud in clouds]
    return Moved(meshes, _space(spaces[0]), _space(spaces[1]))


def look_alike(before: Any, after: Any) -> bool:
    """Tells whether two records, or mappings, sequences and arrays of records, hold the same values."""
    if before is after:
        return True
    if is_dataclass(before) and type(before) is type(after):
        return all(look_alike(getattr(before, f.name), getattr(after, f.name)) for f in fields(before))
    if isinstance(before, Mapping) and isinstance(after, Mapping):
        return before.keys() == after.keys() and all(look_alike(before[k], after[k]) for k in before)
    if isinstance(before, (tuple, list)) and isinstance(after, (tuple, list)):
        return len(before) == len(after) and all(look_alike(a, b) for a, b in zip(before, after, strict=True))
    if isinstance(before, np.ndarray) or isinstance(after, np.ndarray):
        a, b = np.asarray(before), np.asarray(after)
        return np.array_equal(a, b, equal_nan=a.dtype.kind == b.dtype.kind == "f")
    return bool(before == after) or (before != before and after != after)  # nan is nan


def _opacity(m: Material) -> tuple[str, float, str]:
    """What says how far a material is seen through, for comparison."""
    return repr(m.opacity), m.opacity_threshold, m.opacity_mode


def _finite(points: NDArray) -> F64:
    """The points (n, 3) that are somewhere; the origin where none is."""
    p = points.astype(np.float64)
    p = p[np.isfinite(p).all(1)]
    return p if len(p) else np.zeros((1, 3))


def _halves(middle: F64, rows: NDArray, count: int) -> list[NDArray]:
    """Splits rows of middles (n, 3) into `count` groups of neighbours at most, across where they are widest."""
    if count < 2 or len(rows) < 2:
        return [rows]
    axis = int(np.argmax(np.ptp(middle[rows], axis=0)))
    order = rows[np.argsort(middle[rows, axis], kind="stable")]
    half = len(order) // 2
    return _halves(middle, order[:half], count // 2) + _halves(middle, order[half:], count // 2)


def _space(clouds: list[F64]) -> Space:
    low = np.array([p.min(0) for p in clouds]).reshape(-1, 3)
    high = np.array([p.max(0) for p in clouds]).reshape(-1, 3)
    centre = 0.5 * (low + high)
    radius = np.array([np.linalg.norm(p - c, axis=1).max() for p, c in zip(clouds, centre, strict=True)])
    return Space(centre, radius, low, high)
