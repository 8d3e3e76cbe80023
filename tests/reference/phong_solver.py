"""The paper's one-bounce solver for one element and one channel set, as equations 2 to 6 are printed, in float64.

Nothing is shared between levels or taken as a difference: A is built, C = A'WA and d = A'Wb are multiplied out, each
candidate is held in its bounds, and its residual is taken from A x - b itself.  Source: Nguyen et al. 2013, 5.3.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

F64 = NDArray[np.float64]
KINDS = ("none", "diffuse", "specular", "both")
PARALLEL = 1e-4  # sine^2 of the angle between the columns of A below which Eq. 3 has no solution


def stroke_weight(m: F64, sigma: float) -> F64:
    """The diagonal of W = I + sigma_m diag(m), Eq. 2."""
    return np.ones_like(m) + sigma * m


def equation_3(c: F64, d: F64) -> F64 | None:
    """Both free."""
    det = c[0, 0] * c[1, 1] - c[0, 1] * c[1, 0]
    if det <= PARALLEL * c[0, 0] * c[1, 1]:
        return None
    return np.array([(c[1, 1] * d[0] - c[0, 1] * d[1]) / det, (c[0, 0] * d[1] - c[1, 0] * d[0]) / det])


def equation_5(c: F64, d: F64, r_s: float) -> F64:
    """Specular fixed."""
    over = c[0, 0] * (d[0] - c[0, 1] * r_s) + c[1, 0] * (d[1] - c[1, 1] * r_s)
    return np.array([over / (c[0, 0] ** 2 + c[1, 0] ** 2), r_s])


def equation_6(c: F64, d: F64, r_d: float) -> F64:
    """Diffuse fixed."""
    over = c[0, 1] * (d[0] - c[0, 0] * r_d) + c[1, 1] * (d[1] - c[1, 0] * r_d)
    return np.array([r_d, over / (c[0, 1] ** 2 + c[1, 1] ** 2)])


def energy_preserving(x: F64, free: tuple[bool, bool]) -> F64:
    """Zero where it (3, 2) is negative; x1 + x2 <= 1 by scaling what is free, all channels alike."""
    x = np.where(free, np.maximum(x, 0), x)
    if all(free):
        return x / max(x.sum(1).max(), 1)
    for k in (0, 1):
        room = 1 - x[:, 1 - k]
        if free[k] and (x[:, k] > room).any():
            x[:, k] *= min(r / v for r, v in zip(room, x[:, k]) if v > r)
    return x


def candidates_of_level(
    light: F64, k_d: F64, k_s: F64, wanted: F64, weight: F64, r_d: F64, r_s: F64
) -> tuple[F64, F64]:
    """All four candidates of one level.

    light (D, 3) arriving; k_d, k_s (D, D) reflection matrices; wanted (D, 3); weight (D,); r_d, r_s (3,).
    Returns x (4, 3, 2) and residual (4,), infinite where Eq. 3 has no solution.
    """
    x, residual = np.tile(np.stack([r_d, r_s], 1), (4, 1, 1)), np.zeros(4)
    a = np.stack([k_d @ light, k_s @ light], 1)  # (D, 2, 3)
    for channel in range(3):
        w_a = weight[:, None] * a[..., channel]  # W A
        c, d = a[..., channel].T @ w_a, w_a.T @ wanted[:, channel]
        both = equation_3(c, d)
        x[1, channel], x[2, channel] = equation_5(c, d, r_s[channel]), equation_6(c, d, r_d[channel])
        if both is None:
            residual[3] = np.inf
        else:
            x[3, channel] = both
    for k, free in enumerate(((False, False), (True, False), (False, True), (True, True))):
        x[k] = energy_preserving(x[k], free)
        left = np.einsum("dkc,ck->dc", a, x[k]) - wanted
        residual[k] += (weight[:, None] * left**2).sum()
    return x, residual


def alpha(residual: F64, norm: str, weights: tuple[float, float, float] = (1, 5, 25)) -> tuple[int, int]:
    """Eq. 4: level and kind of the candidate of least residual; the last level is the own one, glossiness as it is."""
    best, price = (len(residual) - 1, 0), np.inf
    for level in range(len(residual)):
        for kind in range(4):
            freed = (kind in (1, 3)) + (kind in (2, 3)) + (level < len(residual) - 1)
            admitted = {"l0": freed <= 1, "l2": freed == 3, "mixed": True}[norm]
            factor = weights[max(freed, 1) - 1] if norm == "mixed" else 1
            if admitted and residual[level, kind] * factor < price:
                best, price = (level, kind), residual[level, kind] * factor
    return best


def diffuse_matrix(directions: F64) -> F64:
    """K_d (D, D) by the paper: cosines of what arrives; normalized so that a white surface returns all light."""
    cosine = directions[:, 2]
    return np.tile(cosine / cosine.sum(), (len(directions), 1))
