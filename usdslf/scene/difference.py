"""Difference: what is not the same in two states of a shot; which meshes moved, and the space they leave and take.

The space is that of a few groups of neighbouring triangles, so that a ray or a place is compared with few.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields, is_dataclass
from enum import Enum
from typing import Any

import numpy as np
from numpy.typing import NDArray

from usdslf.scene.records import F64, Material, Scene

GROUPS = 16  # and three more at most
MaterialsSeen = tuple[Sequence[Material], NDArray[Any]]  # and which each triangle has
TABLE = 1 << 22  # pairs that there may be, to be looked up in a table
WORTH = 0.75  # share of its solid angle that the quarters of a group may have, to be groups


@dataclass(frozen=True)
class Space:
    """Spheres and boxes about k groups of triangles."""

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
            if not len(space.low):
                continue
            rows = np.flatnonzero(_near_box(space.low.min(0), space.high.max(0), position, reach))
            for low, high in zip(space.low, space.high, strict=True):
                found[rows] |= _near_box(low, high, position[rows], reach[rows])
        return found


class Why(Enum):
    """Kinds of reasons for elements of one frame to be none of another, as what is said of that frame."""

    OTHER_ORIGIN = "lies so far elsewhere that its positions are told from another origin"
    OTHER_MESHES = "shows other meshes"
    OTHER_MATERIALS = "shows other materials"
    OTHER_OPACITY = "has another opacity"
    OTHER_TRIANGLES = "cuts {} into other triangles"
    OTHER_MATERIAL = "shows {} in another material"
    OTHER_CUT_OUT = "shifts what {} is seen through by"
    STRETCHED = "stretches a surface to {} times its area"


@dataclass(frozen=True)
class Afresh:
    """Why elements have to be placed afresh; as words, it ends "frame 2 ..."."""

    why: Why
    what: str = ""

    def __str__(self) -> str:
        return self.why.value.format(self.what)


def why_not_comparable(before: Scene, after: Scene) -> Afresh | None:
    """Returns why elements of one frame can not be those of another; None where they can."""
    if before.origin != after.origin:
        return Afresh(Why.OTHER_ORIGIN)
    if [m.path for m in before.meshes] != [m.path for m in after.meshes]:
        return Afresh(Why.OTHER_MESHES)
    if len(before.materials) != len(after.materials):
        return Afresh(Why.OTHER_MATERIALS)
    if any(_opacity(a) != _opacity(b) for a, b in zip(before.materials, after.materials, strict=True)):
        return Afresh(Why.OTHER_OPACITY)
    for a, b in zip(before.meshes, after.meshes, strict=True):
        if not np.array_equal(a.triangles, b.triangles):
            return Afresh(Why.OTHER_TRIANGLES, a.path)
        if not np.array_equal(a.material_of_triangle, b.material_of_triangle):
            return Afresh(Why.OTHER_MATERIAL, a.path)
        seen_through = any(not after.materials[m].is_opaque for m in np.unique(b.material_of_triangle))
        if seen_through and not look_alike((a.uvs, a.primvars), (b.uvs, b.primvars)):
            return Afresh(Why.OTHER_CUT_OUT, a.path)
    return None


def is_same_but_for_reflectance(before: Scene, after: Scene) -> bool:
    """Tells whether two compositions of a shot have the same geometry, lights, glow and opacity, triangle by triangle.

    Materials may be others and more of them: then elements, what they see and the light on them are the same.
    """
    a, b = before.triangles, after.triangles
    if before.origin != after.origin:
        return False
    if not all(look_alike(getattr(a, name), getattr(b, name)) for name in ("positions", "normals", "mesh")):
        return False
    if not (look_alike(before.lights, after.lights) and look_alike(before.cameras, after.cameras)):
        return False
    for old, new in ((before.materials[i], after.materials[j]) for i, j in pairs_in(a.material, b.material)):
        if _opacity(old) != _opacity(new) or not look_alike(old.emissive_color, new.emissive_color):
            return False
    clear = np.array([not m.is_opaque for m in after.materials], bool)
    varies = np.array([not isinstance(m.emissive_color, np.ndarray) for m in after.materials], bool)
    return all(
        look_alike((before.meshes[i].uvs, before.meshes[i].primvars), (after.meshes[i].uvs, after.meshes[i].primvars))
        for i in np.unique(b.mesh[(clear | varies)[b.material]])
    )


def pairs_in(some: NDArray[np.integer], others: NDArray[np.integer]) -> NDArray[np.int64]:
    """Returns the different pairs (k, 2) of two lists of numbers (n,), 0 and above, in their order.

    `np.unique` is slower by far, of rows and of packed numbers, and holds Python's lock meanwhile.
    """
    if not len(some):
        return np.zeros((0, 2), np.int64)
    wide = np.int64(others.max()) + 1
    packed = some.astype(np.int64) * wide + others
    if (size := int(packed.max()) + 1) <= TABLE:
        is_there = np.zeros(size, bool)
        is_there[packed] = True
        packed = np.flatnonzero(is_there)
    else:
        packed = np.sort(packed)
        packed = packed[np.diff(packed, prepend=-1) > 0]
    return np.stack([packed // wide, packed % wide], 1)


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
    first, last = (_space(s.triangles.positions[meshes[s.triangles.mesh]]) for s in (before, after))
    return Moved(meshes, first, last)


def materials_seen(scene: Scene) -> MaterialsSeen:
    """Returns what a look can change of a scene."""
    return scene.materials, scene.triangles.material


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


def _near_box(low: F64, high: F64, position: NDArray, reach: NDArray) -> NDArray[np.bool_]:
    away = np.maximum(np.maximum(low - position, position - high), 0)
    near: NDArray[np.bool_] = (away * away).sum(1) <= np.asarray(reach, np.float64) ** 2
    return near


def _space(corners: NDArray) -> Space:
    """Groups triangles (n, 3, 3), quartering the largest group while that is worth it."""
    c = corners.astype(np.float64)
    c = c[np.isfinite(c).all((1, 2))]  # others are met by no ray
    groups = [_Group.of(c)] if len(c) else []
    final: list[_Group] = []
    while groups and len(groups) + len(final) < GROUPS:
        largest = groups.pop(int(np.argmax([g.radius for g in groups])))
        quarters = [quarter for half in largest.halves() for quarter in half.halves() or [half]]
        if quarters and sum(g.radius**2 for g in quarters) < WORTH * largest.radius**2:
            groups += quarters
        else:
            final.append(largest)
    final += groups
    return Space(
        np.array([g.centre for g in final]).reshape(-1, 3),
        np.array([g.radius for g in final]),
        np.array([g.low for g in final]).reshape(-1, 3),
        np.array([g.high for g in final]).reshape(-1, 3),
    )


@dataclass(frozen=True)
class _Group:
    corners: F64  # (n, 3, 3)
    low: F64
    high: F64
    centre: F64
    radius: float

    @staticmethod
    def of(corners: F64) -> _Group:
        low, high = corners.min((0, 1)), corners.max((0, 1))
        centre = 0.5 * (low + high)
        return _Group(corners, low, high, centre, float(np.linalg.norm(corners - centre, axis=2).max()))

    def halves(self) -> list[_Group]:
        """Two groups, across where this is widest; none where all of it is at one place."""
        middle = self.corners.mean(1)
        axis = int(np.argmax(np.ptp(middle, axis=0)))
        along = middle[:, axis]
        lower = along < 0.5 * (along.min() + along.max())
        return [_Group.of(self.corners[lower]), _Group.of(self.corners[~lower])] if lower.any() else []
