"""Near elements: what the cells of a lookup name, the nearest first, in agreement and not behind a wall."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from usdslf.progress import in_blocks
from usdslf.rays import LIFT, see_each_other
from usdslf.sampling.blue_noise import surface_coordinates
from usdslf.sampling.nearest import tree_of
from usdslf.scene.records import F32

if TYPE_CHECKING:
    from usdslf.elements.elements import Elements
    from usdslf.rays import RayTracer

NONE = np.uint32(0xFFFFFFFF)
PER_ENTRY = 8  # elements an entry names
ASKED = 10  # elements that are considered for them
BATCH = 16384
NORMAL_WEIGHT = 1.0  # spacings for a normal turned by one radian
AGREES = 0.35  # least cosine between the normals of a point and its elements, where there is a choice


def near_elements(
    tracer: RayTracer,
    elements: Elements,
    element_group: NDArray,
    position: NDArray,
    normal: NDArray,
    face: NDArray,
    group: NDArray,
    spacing: NDArray,
) -> tuple[NDArray[np.uint32], NDArray[np.float32]]:
    """Names the elements (n, PER_ENTRY) near cells: nearest first, those in agreement and in sight only.

    Returns also: (n,) how far from a cell's centre that was looked at, at most.
    """
    asked = np.zeros(len(spacing), bool)
    asked[group] = True
    own = np.flatnonzero(asked[element_group])  # elements of other groups are no answer
    count = len(own)
    if not len(group):
        return np.zeros((0, PER_ENTRY), np.uint32), np.zeros(0, np.float32)
    groups = np.concatenate([element_group[own], group])
    both = surface_coordinates(
        np.concatenate([elements.position[own], position]),
        np.concatenate([elements.normal[own], normal]),
        groups,
        spacing[groups],
        NORMAL_WEIGHT,
    )
    k = min(ASKED, count)
    reach = np.linalg.norm(np.ptp(both[:, :-1], axis=0)) + 1.0  # of a group: others are not looked at
    tree = tree_of(both[:count])
    near = np.empty((len(position), k), np.int64)
    for rows in in_blocks(len(position), BATCH):
        asked_for = both[count:][rows]
        near[rows] = tree.query(asked_for, k, distance_upper_bound=reach, workers=tracer.threads)[1].reshape(-1, k)
    found = near < count
    near = own[np.where(found, near, 0)]
    out = np.full((len(position), PER_ENTRY), NONE, np.uint32)
    far = np.zeros(len(position), np.float32)
    position, normal, face = (a.astype(np.float32) for a in (position, normal, face))
    for rows in in_blocks(len(position), BATCH):
        same = found[rows] & (element_group[near[rows]] == group[rows, None])
        out[rows], far[rows] = _in_sight(tracer, elements, near[rows], same, position[rows], normal[rows], face[rows])
    return out, far


def _in_sight(
    tracer: RayTracer,
    elements: Elements,
    near: NDArray,
    same: NDArray,
    position: F32,
    normal: F32,
    face: F32,
) -> tuple[NDArray[np.uint32], NDArray[np.float32]]:
    """Sorts near elements (n, k) by distance and keeps those (n, PER_ENTRY) that agree and are in sight.

    Returns also: (n,) how far from the position that was looked at.
    """
    cosine = np.where(same, (elements.normal[near] * normal[:, None]).sum(2), np.float32(-np.inf))
    best = cosine.max(1, keepdims=True)
    good = same & (cosine >= np.minimum(AGREES, best - 0.25))
    gap = elements.position[near] - position[:, None]
    gap2 = (gap * gap).sum(2)

    # Elements behind a wall are left out where others are in sight.
    row, column = np.nonzero(good)
    e = near[row, column]
    far = (1 + LIFT) * np.sqrt(np.where(good, gap2, np.float32(0)).max(1, initial=0))
    seen = good.copy()
    seen[row, column] = see_each_other(
        tracer, position[row], face[row], elements.position[e], elements.geometric_normal[e]
    )
    good = np.where(seen.any(1, keepdims=True), seen, good)

    gap2 = np.where(good, gap2, np.float32(np.inf))
    order = np.argsort(gap2, 1, kind="stable")[:, :PER_ENTRY]
    out = np.full((len(near), PER_ENTRY), NONE, np.uint32)
    out[:, : order.shape[1]] = np.where(
        np.isfinite(np.take_along_axis(gap2, order, 1)), np.take_along_axis(near, order, 1), int(NONE)
    )
    return out, far
