"""One level of Catmull-Clark, all vertices at once, float64; without creases and corners.

    face   mean of its corners
    edge   (ends + beside) / 4; on a boundary the middle
    vertex Q / n + 2 R / n + (n - 3) P / n; on a boundary 3/4 P + 1/8 (its two neighbours there); where only
           one face meets it stays

Source: Catmull and Clark 1978; the boundary as in DeRose, Kass, Truong 1998.  `subdivide.py` is the slow twin.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True)
class Refined:
    """Quads of one level: of each corner of each face one, in their order."""

    values: NDArray  # (n, k) vertices: old ones, edges, faces
    indices: NDArray  # (q, 4): corner, next edge, face, edge before
    parent: NDArray  # (q,) face of the cage


def refine(values: NDArray, indices: NDArray, counts: NDArray) -> Refined:
    """Returns one level of a mesh.

    Args:
      values: (V, k) positions, and whatever is to be smoothed as they are.
      indices: (C,) vertices of the corners, face by face.
      counts: (F,) corners of each face.
    """
    face = np.repeat(np.arange(len(counts)), counts)
    following, before = neighbours(counts)
    ends = np.sort(np.stack([indices, indices[following]], 1), 1)
    edges, edge = np.unique(ends, axis=0, return_inverse=True)
    edge = edge.reshape(-1)
    centre = _sums(face, values[indices], len(counts)) / counts[:, None]
    beside = np.bincount(edge, minlength=len(edges))
    middle = values[edges].mean(1)
    edge_points = np.where(
        (beside == 2)[:, None], (2 * middle + _sums(edge, centre[face], len(edges))) / 4, middle
    )
    vertices = len(values)
    uses = np.bincount(indices, minlength=vertices)
    q = _sums(indices, centre[face], vertices) / np.maximum(uses, 1)[:, None]
    ring, at = np.concatenate([edges[:, 0], edges[:, 1]]), np.concatenate([np.arange(len(edges))] * 2)
    n = np.maximum(np.bincount(ring, minlength=vertices), 1)[:, None]
    r = _sums(ring, middle[at], vertices) / n
    smooth = q / n + 2 * r / n + (n - 3) * values / n
    is_boundary = (beside != 2)[at]
    borders = np.bincount(ring[is_boundary], minlength=vertices)[:, None]
    along = _sums(ring[is_boundary], middle[at][is_boundary], vertices)
    # 3/4 P + 1/8 (A + B) = 1/2 P + 1/4 (the two middles)
    moved = np.where(borders == 0, smooth, np.where(borders == 2, values / 2 + along / 4, values))
    moved = np.where(uses[:, None] == 0, values, moved)
    moved = np.where((uses[:, None] == 1) & (borders > 0), values, moved)
    new = np.concatenate([moved, edge_points, centre])
    edge_index = vertices + edge
    quads = np.stack([indices, edge_index, vertices + len(edges) + face, edge_index[before]], 1)
    return Refined(new, quads, face)


def refine_corners(values: NDArray, counts: NDArray) -> NDArray:
    """Returns face-varying values (4 C, k) of the quads, linear within each face."""
    face = np.repeat(np.arange(len(counts)), counts)
    following, before = neighbours(counts)
    centre = _sums(face, values, len(counts)) / counts[:, None]
    quads = [values, (values + values[following]) / 2, centre[face], (values + values[before]) / 2]
    return np.stack(quads, 1).reshape(-1, values.shape[1])


def neighbours(counts: NDArray) -> tuple[NDArray, NDArray]:
    """Returns for each corner the next and the one before in its face, (C,) each."""
    first = np.repeat(np.cumsum(counts) - counts, counts)
    place = np.arange(len(first)) - first
    size = np.repeat(counts, counts)
    return first + (place + 1) % size, first + (place - 1) % size


def _sums(at: NDArray, values: NDArray, size: int) -> NDArray:
    return np.stack([np.bincount(at, values[:, k], minlength=size) for k in range(values.shape[1])], 1)
