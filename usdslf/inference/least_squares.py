"""Least squares within bounds, of few unknowns."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from usdslf.scene.records import F64

RIDGE = 1e-9  # of the mean square of a column, which keeps parallel columns apart


def bounded_least_squares(a: F64, b: F64, low: F64, high: F64) -> F64:
    """Returns x (k,) that lowers |a x - b|^2 within bounds; see `bounded_solutions`.

    Args:
        a, b: (m, k) and (m,), m >= k.
        low, high: (k,), low <= high.
    """
    return bounded_solutions((a.T @ a)[None], (a.T @ b)[None], low, high)[0]


def bounded_solutions(
    normal: F64, right: F64, low: F64, high: F64, asked: NDArray[np.bool_] | None = None
) -> F64:  # fmt: skip
    """Returns x (J, k) that lower x normal x / 2 - right x within bounds, J problems at once.

    What leaves the bounds is fixed there and the rest solved again.  What was fixed is not let go again, so that k
    rounds are enough; where several unknowns of columns that are far from orthogonal meet their bounds, the least
    square within them may be a little lower.

    Args:
        normal, right: (J, k, k) and (J, k): of columns and what they are to make.
        low, high: (k,) or (J, k), low <= high.
        asked: (J, k) which unknowns there are, the others are 0; None: all.
    """
    count, k = right.shape
    free = np.ones((count, k), bool) if asked is None else asked.copy()
    x: F64 = np.clip(np.zeros((count, k)), low, high)
    eye = np.eye(k)
    size = np.diagonal(normal, axis1=1, axis2=2)
    for _ in range(k):
        ridge = RIDGE * ((size * free).sum(1) / np.maximum(free.sum(1), 1) + 1e-30)
        left = normal * (free[:, :, None] & free[:, None]) + eye * np.where(free, ridge[:, None], 1)[:, None]
        held = np.where(free, 0, x)
        wanted = np.where(free, right - (normal @ held[..., None])[..., 0], x)
        x = np.asarray(np.linalg.solve(left, wanted[..., None])[..., 0], np.float64)
        out = free & ((x < low) | (x > high))
        x = np.clip(x, low, high)
        if not out.any():
            break
        free &= ~out
    return x
