"""The paper's closed forms for two parameters, and radiance from columns, in float64."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .reflectance import columns

F64 = NDArray[np.float64]


def normal_equations(basis: ArrayLike, wanted: ArrayLike, weight: ArrayLike) -> tuple[F64, F64]:
    """C = A' W A (2, 2) and d = A' W b (2,) of rows A (n, 2), b (n,), W (n,)."""
    a, b, w = (np.asarray(x, float) for x in (basis, wanted, weight))
    return a.T @ (w[:, None] * a), a.T @ (w * b)


def both(c: F64, d: F64) -> F64:
    """Nguyen et al. 2013, Eq. 3: diffuse and specular."""
    det = c[0, 0] * c[1, 1] - c[0, 1] * c[1, 0]
    return np.array([c[1, 1] * d[0] - c[0, 1] * d[1], c[0, 0] * d[1] - c[1, 0] * d[0]]) / det


def diffuse_only(c: F64, d: F64, specular: float) -> float:
    """Nguyen et al. 2013, Eq. 5: diffuse, the specular reflectance as it is."""
    above = c[0, 0] * (d[0] - c[0, 1] * specular) + c[1, 0] * (d[1] - c[1, 1] * specular)
    return float(above / (c[0, 0] ** 2 + c[1, 0] ** 2))


def specular_only(c: F64, d: F64, diffuse: float) -> float:
    """Nguyen et al. 2013, Eq. 6: specular, the diffuse reflectance as it is."""
    above = c[0, 1] * (d[0] - c[0, 0] * diffuse) + c[1, 1] * (d[1] - c[1, 0] * diffuse)
    return float(above / (c[0, 1] ** 2 + c[1, 1] ** 2))


def columns_of_suns(model: str, roughness: float, frame: F64, eye: F64, towards: F64, light: F64) -> F64:
    """Columns (n, 4, 3) at points of frames (n, 3, 3) seen from directions (n, 3), lit by parallel light.

    towards (k, 3), world; light (k, 3) irradiance at normal incidence.
    """
    e = np.einsum("nij,nj->ni", frame, eye)[:, None]
    l = np.einsum("nij,kj->nki", frame, towards)
    value = columns(model, roughness, np.broadcast_to(e, l.shape), l)
    return np.einsum("nkc,kr->ncr", value, light)


def radiance(model: str, column: F64, d: ArrayLike, f0: ArrayLike, f90: ArrayLike) -> F64:
    """Radiance (n, 3) from columns (n, 4, 3) and parameters (3,) or (n, 3)."""
    d, f0, f90 = (np.asarray(x, float) for x in (d, f0, f90))
    x, y, a, b = (column[:, k] for k in range(4))
    if model == "phong":
        return d * x + f0 * a
    return d * ((1 - f0) * x + (1 - f90) * y) + f0 * a + f90 * b
