"""Planes: a quantity of each dab, smoothed over its neighbours so that a gradient stays as it is up to its ends.

    planes(position, length, wanted, weight) -> values, slopes, leverage
    nearness(position, length) -> (n, n)

Source: Cleveland 1979 (locally weighted regression); Hastie and Tibshirani 1990 (leverage of a smoother).
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from usdslf.scene.records import F64

TILT = 1e-4  # that planes are held against across what was painted, where no dab says how they lie
KEPT = 5  # lengths of one stroke, that all parameters are smoothed over


def nearness(position: NDArray, length: float) -> F64:
    """Returns how near dabs (n, 3) are to each other (n, n), 0..1: a Gaussian of a length; not to be written to."""
    return _neighbourhoods(np.asarray(position, np.float64).tobytes(), length)[1]


def planes(position: NDArray, length: float, wanted: F64, weight: F64) -> tuple[F64, F64, F64]:
    """Returns local planes through what each dab wants.

    Args:
        position: (n, 3).
        length: of smoothing, in the same units.
        wanted, weight: (n, C).

    Returns: values (n, C), slopes (n, C, 3) and leverage (n, C): how much of a value is the dab's own wish.
    """
    n, channels = wanted.shape
    p, k = _neighbourhoods(np.asarray(position, np.float64).tobytes(), length)
    # moments about the middle of all dabs, moved to each
    basis = np.concatenate([np.ones((n, 1)), p, p[:, [0, 0, 0, 1, 1, 2]] * p[:, [0, 1, 2, 1, 2, 2]]], 1)
    asked = (weight * wanted)[..., None] * basis[:, None, :4]
    sums = k @ np.concatenate([weight[..., None] * basis[:, None], asked], 2).reshape(n, -1)
    m0, m1, m2, r0, r1 = np.split(sums.reshape(n, channels, 14), [1, 4, 10, 11], axis=2)
    x = p[:, None]
    second = m2[..., [[0, 1, 2], [1, 3, 4], [2, 4, 5]]]
    crossed = x[..., :, None] * m1[..., None, :]
    second = second - crossed - crossed.swapaxes(2, 3) + m0[..., None] * x[..., :, None] * x[..., None, :]
    first = m1 - m0 * x
    normal = np.empty((n, channels, 4, 4))
    normal[..., 0, 0], normal[..., 0, 1:], normal[..., 1:, 0], normal[..., 1:, 1:] = m0[..., 0], first, first, second
    size = np.trace(normal, axis1=2, axis2=3)[..., None, None]
    normal = normal + np.diag([1e-9, TILT, TILT, TILT]) * (size + 1e-30)
    right = np.stack([np.concatenate([r0, r1 - r0 * x], 2), np.broadcast_to(np.eye(4)[0], (n, channels, 4))], 3)
    solved = np.linalg.solve(normal, right)  # (i, channel, 4, plane and the dab's own part)
    plane, own = solved[..., 0], solved[..., 0, 1]
    return plane[..., 0], plane[..., 1:] / length, own * weight  # K_ii = 1


@lru_cache(maxsize=KEPT)
def _neighbourhoods(position: bytes, length: float) -> tuple[F64, F64]:
    """Dabs (n, 3) about their middle in lengths, and how near each is to each: all parameters ask for it."""
    at = np.frombuffer(position, np.float64).reshape(-1, 3)
    p = (at - at.mean(0)) / length
    square = (p * p).sum(1)
    k = np.exp(np.minimum(p @ p.T - 0.5 * square[:, None] - 0.5 * square[None], 0))
    for x in (p, k):
        x.flags.writeable = False
    return p, k
