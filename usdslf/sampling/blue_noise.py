"""Blue noise: chooses well-spaced points among many candidates, on any number of surfaces at once.

Darts are thrown in parallel: among the candidates that are still free, one is taken when its random rank
is the lowest within the radius, and all others within the radius are no longer free.  When no more fit,
the radius shrinks and the throwing goes on until each group has its number, so early points are far
apart and late ones fill gaps.

Source: Mitchell 1987 and McCool and Fiume 1992, Hierarchical Poisson disk sampling distributions (the
shrinking radius); Luby 1986 (the parallel choice).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from usdslf.progress import tell
from usdslf.sampling.nearest import tree_of

HEXAGONAL = np.sqrt(2 / np.sqrt(3))  # distance of the densest packing of unit cells
RADII = (0.86, 0.80, 0.74, 0.66, 0.55, 0.4)  # of HEXAGONAL; about 0.8 is the best that can be filled
NORMAL_WEIGHT = 0.6  # opposite faces of a thin slab count as 1.2 spacings apart
GROUP_GAP = 64.0


def surface_coordinates(
    position: NDArray, normal: NDArray, group: NDArray, spacing: NDArray, weight: float = NORMAL_WEIGHT
) -> NDArray[np.float64]:
    """Coordinates (n, 7) whose distance is that along the surface, in spacings, and larger between groups than in them.

    Args:
        position: (n, 3).
        normal: (n, 3) unit.
        group: (n,) points of different groups are far apart.
        spacing: (n,) of the point's group, in units of position.
        weight: distance in spacings for a normal turned by one radian.
    """
    p = np.asarray(position, np.float64)
    p = (p - p.mean(0)) / spacing[:, None] if len(p) else p
    gap = GROUP_GAP + (np.linalg.norm(np.ptp(p, axis=0)) if len(p) else 0.0)  # groups may be spread all over the scene
    return np.concatenate([p, normal * weight, (group * gap)[:, None]], 1)


def choose_blue_noise(
    coordinates: NDArray, group: NDArray, quota: NDArray, rng: np.random.Generator
) -> NDArray[np.int64]:
    """Chooses `quota[g]` candidates of each group g, well spaced.

    Args:
        coordinates: (n, k) in units of the spacing that the quota gives, from `surface_coordinates`.
        group: (n,) into quota.
        quota: (groups,) how many to choose; all of a group's candidates where it has fewer.

    Returns: sorted indices of the chosen candidates.
    """
    n = len(coordinates)
    rank = rng.permutation(n)
    chosen = np.zeros(n, bool)
    left = np.minimum(quota, np.bincount(group, minlength=len(quota))).astype(np.int64)
    first, second = _near_pairs(coordinates, RADII[0] * HEXAGONAL, rank)
    gap2 = ((coordinates[first] - coordinates[second]) ** 2).sum(1)
    for radius in (*(HEXAGONAL * r for r in RADII), 0.0):
        if not (left > 0).any():
            break
        inside = gap2 < radius**2
        first, second, gap2 = first[inside], second[inside], gap2[inside]
        free = ~chosen & (left[group] > 0)
        free[first[chosen[second]]] = False
        free[second[chosen[first]]] = False
        a, b = first, second
        while free.any():
            live = free[a] & free[b]
            a, b = a[live], b[live]
            lowest = free.copy()
            lowest[b] = False
            take = _within_quota(np.flatnonzero(lowest), group, rank, left)
            chosen[take] = True
            left -= np.bincount(group[take], minlength=len(left))
            free[take] = False
            free[b[chosen[a]]] = False
            free &= left[group] > 0
            tell()
    return np.flatnonzero(chosen)


def _near_pairs(coordinates: NDArray, radius: float, rank: NDArray) -> tuple[NDArray, NDArray]:
    """Returns the pairs of points (k,), (k,) within the radius, that of the lower rank first."""
    if not len(coordinates):
        return np.zeros(0, np.int32), np.zeros(0, np.int32)
    pairs = tree_of(coordinates).query_pairs(radius, output_type="ndarray")
    a, b = pairs[:, 0].astype(np.int32), pairs[:, 1].astype(np.int32)
    swap = rank[a] > rank[b]
    return np.where(swap, b, a), np.where(swap, a, b)


def _within_quota(take: NDArray, group: NDArray, rank: NDArray, left: NDArray) -> NDArray:
    """Keeps of each group's candidates as many as are left to choose, lowest rank first."""
    take = take[np.lexsort((rank[take], group[take]))]
    g = group[take]
    starts = np.searchsorted(g, np.arange(len(left)))
    return take[np.arange(len(take)) - starts[g] < left[g]]
