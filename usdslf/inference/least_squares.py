"""Least squares within bounds, of few unknowns."""

from __future__ import annotations

import numpy as np

from usdslf.scene.records import F64

RIDGE = 1e-9  # of the mean square of a column, which keeps parallel columns apart


def bounded_least_squares(a: F64, b: F64, low: F64, high: F64) -> F64:
    """Returns x (k,) that lowers |a x - b|^2 within bounds: what leaves them is fixed there and the rest solved again.

    What was fixed is not let go again, so that k rounds are enough; where several unknowns of columns that are far
    from orthogonal meet their bounds, the least square within them may be a little lower.

    Args:
        a, b: (m, k) and (m,), m >= k.
        low, high: (k,), low <= high.
    """
    free = np.ones(len(low), bool)
    x = np.clip(np.zeros(len(low)), low, high)
    for _ in range(len(low)):
        if not free.any():
            break
        normal = a[:, free].T @ a[:, free]
        normal[np.diag_indices_from(normal)] += RIDGE * (np.trace(normal) / len(normal) + 1e-30)
        x[free] = np.linalg.solve(normal, a[:, free].T @ (b - a[:, ~free] @ x[~free]))
        out = free & ((x < low) | (x > high))
        x = np.clip(x, low, high)
        if not out.any():
            break
        free &= ~out
    return x
