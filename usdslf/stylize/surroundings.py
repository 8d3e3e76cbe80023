"""Surroundings: which elements lie near each element and are not hidden from it by a wall, with their weights.

Near is near in space, on whatever gprim: a ball is set off from the floor that it stands on as well as a shadow
from the light beside it.  What counts within the radius R falls smoothly to nothing,

    w(r) = area (1 - (r / R)^2)^2                 r < R

and nothing on the other side of a wall or sheet counts: both places, lifted off their surfaces by a fifth of their
distance, must see each other.  Where more than MOST lie within R, a part of the elements stands for all of them.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from usdslf.elements.elements import Elements
from usdslf.rays import LIFT
from usdslf.sampling.nearest import tree_of
from usdslf.scene.records import F32, I32

if TYPE_CHECKING:
    from usdslf.rays import RayTracer

MOST = 128  # places that stand for the surroundings of an element, on the average


@dataclass(frozen=True)
class Surroundings:
    """Near elements of N elements, row by row: those of element i are `other[first[i] : first[i + 1]]`."""

    radius: float  # [stage units]
    first: I32  # (N + 1,)
    other: I32  # (K,) ascending within a row
    weight: F32  # (K,) > 0

    @property
    def count(self) -> NDArray[np.int64]:
        """How many places stand for the surroundings of each element (N,)."""
        return np.diff(self.first).astype(np.int64)


def find_surroundings(elements: Elements, tracer: RayTracer, radius: float, most: int = MOST) -> Surroundings:
    """Finds what lies within `radius` [stage units] of each element.

    Args:
        most: mean number of places for an element; a random part of all elements, the same for everyone, is looked
            at where there are more.
    """
    n = len(elements)
    tree = tree_of(elements.position)
    share = min(1.0, most * n / max(int(tree.count_neighbors(tree, radius)), 1))
    chosen = np.sort(np.random.default_rng(0).permutation(n)[: max(int(np.ceil(share * n)), 1)])
    pairs = tree.sparse_distance_matrix(tree_of(elements.position[chosen]), radius, output_type="ndarray")
    here, there = pairs["i"].astype(np.int64), chosen[pairs["j"]].astype(np.int64)
    weight = elements.area[there] * (1 - np.minimum(pairs["v"] / radius, 1) ** 2) ** 2
    keep = (weight > 0) & ~_hidden(elements, tracer, here, there)
    here, there, weight = here[keep], there[keep], weight[keep]
    order = np.lexsort((there, here))
    first = np.searchsorted(here[order], np.arange(n + 1))
    return Surroundings(
        radius, first.astype(np.int32), there[order].astype(np.int32), weight[order].astype(np.float32)
    )


def _hidden(elements: Elements, tracer: RayTracer, here: NDArray, there: NDArray) -> NDArray[np.bool_]:
    """Whether something stands between pairs (k,) of elements, asked once for both ways.

    Not `rays.see_each_other`, for which glass is a wall: between cells of one surface nothing is to be averaged across
    it.  Here what can be seen through lets surroundings count, by its opacity, as it lets their light through.
    """
    a, b = np.minimum(here, there), np.maximum(here, there)
    key, where = np.unique(a * len(elements) + b, return_inverse=True)
    a, b = key // len(elements), key % len(elements)
    p = elements.position.astype(np.float64)
    lift = LIFT * np.linalg.norm(p[b] - p[a], axis=1, keepdims=True)
    start = tracer.offset_points(p, elements.geometric_normal, elements.triangle)
    start_a = start[a] + (lift * elements.geometric_normal[a]).astype(np.float32)
    way = start[b] + (lift * elements.geometric_normal[b]).astype(np.float32) - start_a
    hidden: NDArray[np.bool_] = tracer.occluded(start_a, way, 1.0) & (a != b)
    return hidden[where]
