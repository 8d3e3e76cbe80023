"""Trees of points for their nearest neighbours.

scipy is loaded where the first one is made, not before: its import takes longer than all else that a start loads, and
a shot whose parts are kept needs no tree.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from numpy.typing import ArrayLike

if TYPE_CHECKING:
    from scipy.spatial import cKDTree


def tree_of(points: ArrayLike) -> cKDTree:
    """Returns the tree of points (n, k), by Euclidean distance."""
    from scipy.spatial import cKDTree

    return cKDTree(points)
