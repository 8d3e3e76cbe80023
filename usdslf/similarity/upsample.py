"""Upsampling: changes that are known at elements -> texels, vertices or pixels, with their detail kept.

Joint bilateral: what is interpolated are deltas, so the detail that is there stays, and the kernel has a term in
appearance beside position and normal: what looked alike changes alike, and nothing leaks over an edge of a texture.

    dr(x) = sum_y k dr(y) / sum_y k,     k = exp(-|x - y|^2 / 2 h^2) <n_x, n_y>+^2 exp(-|r_x - r_y|^2 / 2 r^2)

over the NEAREST elements y; h is the distance between elements.

Source: Nguyen et al. 2013, 6.5 and figure 13; Kopf et al. 2007.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from usdslf.progress import in_blocks
from usdslf.sampling.nearest import tree_of
from usdslf.scene.records import F64
from usdslf.similarity.similarity import Places
from usdslf.threads import thread_count

if TYPE_CHECKING:
    from scipy.spatial import cKDTree

NEAREST = 16
APPEARANCE_STEP = 0.06  # of d, F0 and roughness together
BLOCK = 1 << 13  # places at a time
FLOOR = 1e-12  # of a kernel: where nothing near looks alike, what is near still counts


def upsample(
    x: Places, known: Places, values: ArrayLike, spacing: float, appearance: bool = True, nearest: int = NEAREST
) -> F64:
    """Returns changes (n, C) at places from those (m, C) at elements.

    Args:
        spacing: h [stage units].
        appearance: False: position and normal only.
    """
    v = np.asarray(values, np.float64).reshape(len(known), -1)
    index, k = upsampling_weights(x, known, spacing, appearance, nearest)
    return np.einsum("nk,nkc->nc", k, v[index])


def upsampling_weights(
    x: Places, known: Places, spacing: float, appearance: bool = True, nearest: int = NEAREST
) -> tuple[NDArray[np.int64], F64]:
    """Returns which elements (n, k) each place takes its change from, and their weights (n, k), 1 in all."""
    count = min(nearest, len(known))
    tree = tree_of(known.position)
    looks = appearance and bool(
        np.ptp(known.reflectance, axis=0).any() or (x.reflectance != known.reflectance[0]).any()
    )
    index, k = np.empty((len(x), count), np.int64), np.empty((len(x), count))
    for rows in in_blocks(len(x), BLOCK):
        index[rows], k[rows] = _weights(x.rows(rows), known, tree, spacing, looks, count)
    return index, k


def _weights(
    x: Places, known: Places, tree: cKDTree, spacing: float, appearance: bool, count: int
) -> tuple[NDArray[np.int64], F64]:
    """The same of a block."""
    distance, index = tree.query(x.position, count, workers=thread_count())
    distance, index = distance.reshape(len(x), count), index.reshape(len(x), count)
    k = np.exp(-0.5 * np.minimum((distance / spacing) ** 2, 40.0))
    turned = np.einsum("ni,nki->nk", x.normal.astype(np.float64), known.normal[index].astype(np.float64))
    k = k * np.maximum(turned, 0) ** 2
    if appearance:
        other = ((x.reflectance[:, None].astype(np.float64) - known.reflectance[index]) ** 2).sum(-1)
        k = k * np.exp(-0.5 * np.minimum(other / APPEARANCE_STEP**2, 200.0))
    k = k + FLOOR * np.exp(-0.5 * np.minimum(((distance - distance[:, :1]) / spacing) ** 2, 40.0))
    return index, k / k.sum(1, keepdims=True)
