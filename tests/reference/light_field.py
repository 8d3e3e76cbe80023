"""Light between surfaces in closed form, or as integral equations on fine grids, in float64."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .reflectance import columns, eye_at

F64 = NDArray[np.float64]


def closed_box(emission: float, reflectance: float) -> float:
    """Radiance inside any closed room of one diffuse material: E + rho E + rho^2 E + ..."""
    return emission / (1 - reflectance)


def infinite_plates(emission: tuple[float, float], reflectance: tuple[float, float]) -> tuple[float, float]:
    """Radiance of two endless diffuse plates: L1 = E1 + rho1 L2, L2 = E2 + rho2 L1."""
    (e1, e2), (r1, r2) = emission, reflectance
    return (e1 + r1 * e2) / (1 - r1 * r2), (e2 + r2 * e1) / (1 - r1 * r2)


def square_plates(
    side: float, gap: float, emission: tuple[float, float], reflectance: tuple[float, float], nodes: int = 24
) -> tuple[Callable[[ArrayLike], F64], Callable[[ArrayLike], F64]]:
    """Radiance of two parallel diffuse squares above each other, as functions of places (n, 2) from their centres.

    Nystroem's method on Gauss and Legendre's nodes: B(x) = E + rho / pi int gap^2 / r^4 B(y) dy.
    """
    t, w = np.polynomial.legendre.leggauss(nodes)
    t, w = t * side / 2, w * side / 2
    at = np.stack(np.meshgrid(t, t), -1).reshape(-1, 2)
    weight = np.outer(w, w).ravel()

    def carried(to: F64) -> F64:
        r2 = gap**2 + ((to[:, None] - at[None]) ** 2).sum(-1)
        return gap**2 / r2**2 / np.pi * weight

    g, n = carried(at), len(at)
    system = np.eye(2 * n)
    system[:n, n:], system[n:, :n] = -reflectance[0] * g, -reflectance[1] * g
    b = np.linalg.solve(system, np.repeat(np.asarray(emission, float), n))

    def of_plate(own: int) -> Callable[[ArrayLike], F64]:
        other = b[n:] if own == 0 else b[:n]
        return lambda at: emission[own] + reflectance[own] * carried(np.asarray(at, float)) @ other

    return of_plate(0), of_plate(1)


def inside_of_sphere(
    emission: float, diffuse: float, f0: float, f90: float, roughness: float, nodes: int = 64, sectors: int = 96
) -> Callable[[ArrayLike], F64]:
    """Radiance inside a sphere of one UsdPreviewSurface, as a function of the cosine of the outgoing direction.

    A chord meets the sphere at the same angle on both ends, so what arrives at an angle is what leaves at it:
    L(mu) = E + int int f(mu, mu', phi) mu' L(mu') dphi dmu', whatever the lobe.  Nodes in phi crowd about the
    plane of incidence.
    """
    t, w = np.polynomial.legendre.leggauss(nodes)
    mu, w = (t + 1) / 2, w / 2
    s, v = np.polynomial.legendre.leggauss(sectors)
    s, v = (s + 1) / 2, v / 2
    phi, v = np.pi * (1 - s**2), 2 * np.pi * 2 * s * v  # both halves
    share = np.array([diffuse * (1 - f0), diffuse * (1 - f90), f0, f90])
    light = eye_at(mu[:, None], phi[None])

    def carried(to: F64) -> F64:
        rows = [columns("preview_surface", roughness, eye_at(m), light) @ share @ v for m in to]
        return np.array(rows) * w

    field = np.linalg.solve(np.eye(nodes) - carried(mu), np.full(nodes, emission))
    return lambda cosine: emission + carried(np.atleast_1d(np.asarray(cosine, float))) @ field
