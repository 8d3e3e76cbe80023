"""Least squares for one element from its columns, bin by bin, in float64: the normal equations are never formed."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

F64 = NDArray[np.float64]


def model(columns: F64, d: F64, f0: F64, f90: F64) -> F64:
    """Radiance (D, 3) of UsdPreviewSurface from columns (4, D, 3) X, Y, A, B."""
    x, y, a, b = columns
    return d * ((1 - f0) * x + (1 - f90) * y) + f0 * a + f90 * b


def fit_freely(columns: F64, wanted: F64, d: F64, f0: F64, f90: F64, what: tuple[str, ...], is_grey: bool) -> F64:
    """Parameters (6,), d and F0, of least misfit within 0..1 by trust regions, starting from the present ones."""
    free = np.array([name in what for name in ("diffuse", "specular")])
    size = 1 if is_grey else 3
    start = np.concatenate([d if free[0] else [], f0[:size] if free[1] else []])

    def unpacked(p: F64) -> tuple[F64, F64]:
        p = list(p)
        dd = np.array(p[:3]) if free[0] else d
        ff = np.broadcast_to(p[3 if free[0] else 0 :], 3) if free[1] else f0
        return dd, ff

    found = least_squares(
        lambda p: (model(columns, *unpacked(p), f90) - wanted).ravel(), np.clip(start, 1e-6, 1 - 1e-6),
        bounds=(0, 1), xtol=1e-14, ftol=1e-14, gtol=1e-14,
    )  # fmt: skip
    return np.concatenate(unpacked(found.x))
