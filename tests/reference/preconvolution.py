"""Reflection matrices between the bins of the hemisphere in float64, and the paper's way to approximate them."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from .reflectance import columns, exponent_of, frame_about, half_vector, microfacets, mirror, phong, schlick
from .visibility import square_cells

F64 = NDArray[np.float64]
SIDE = 32


def hemisphere(square: F64) -> F64:
    """Concentric map of [-1, 1]^2 (n, 2) by its four wedges.  Shirley and Chiu 1997."""
    a, b = np.asarray(square, float).T
    r = np.maximum(np.abs(a), np.abs(b))
    safe = np.where(r > 0, r, 1)
    phi = np.select(
        [(a >= np.abs(b)), (b >= np.abs(a)), (-a >= np.abs(b))],
        [np.pi / 4 * b / safe, np.pi / 4 * (2 - a / safe), np.pi / 4 * (4 - b / safe)],
        np.pi / 4 * (6 + a / safe),
    )
    sine = r * np.sqrt(2 - r * r)
    return np.stack([sine * np.cos(phi), sine * np.sin(phi), 1 - r * r], 1)


def centres(side: int = SIDE) -> F64:
    """Directions (side^2, 3) of the bins' centres."""
    t = (np.arange(side) + 0.5) * 2 / side - 1
    return hemisphere(np.stack([np.tile(t, side), np.repeat(t, side)], 1))


def exact_row(model: str, roughness: float, row: int, side: int = SIDE) -> tuple[F64, F64]:
    """Weights A, B (side^2,) of all incoming bins for the centre of one outgoing bin.

    Sharp lobes by an even grid over their own distribution, so that every ray weighs about the same; wide ones by
    midpoints of the bins.
    """
    e = centres(side)[row]
    if roughness < 0.18:
        return _row_by_sampling(model, roughness, e, side)
    n = 12
    t = (np.arange(side * n) + 0.5) * 2 / (side * n) - 1
    l = hemisphere(np.stack([np.tile(t, side * n), np.repeat(t, side * n)], 1))
    value = columns(model, roughness, e, l)[:, 2:] * (2 * np.pi / len(l))
    bins = value.reshape(side, n, side, n, 2).sum((1, 3)).reshape(side * side, 2)
    return bins[:, 0], bins[:, 1]


def _row_by_sampling(model: str, roughness: float, e: F64, side: int, n: int = 320) -> tuple[F64, F64]:
    u, v = ((x.ravel() + 0.5) / n for x in np.meshgrid(np.arange(n), np.arange(n)))
    phi = 2 * np.pi * v
    if model == "phong":
        exponent = exponent_of(roughness)
        c = u ** (1 / (exponent + 1))
        density = (exponent + 1) / (2 * np.pi) * c**exponent
        l = _polar(c, phi) @ frame_about(mirror(e))
        up = l[:, 2] > 0
        l, density = l[up], density[up]
        weight = phong(0, 1, exponent, e, l)[:, 0] * l[:, 2] / density / n**2
        ramp = np.zeros(len(l))
    else:
        alpha = roughness**2
        tangent = alpha * np.sqrt(u / (1 - u))  # half vectors by D (N.H)
        h = _polar(1 / np.sqrt(1 + tangent**2), phi)
        l = 2 * (h @ e)[:, None] * h - e
        up = (l[:, 2] > 0) & (h @ e > 0)
        l, h = l[up], h[up]
        tan2 = tangent[up] ** 2
        density = alpha**2 / (np.pi * h[:, 2] ** 3 * (alpha**2 + tan2) ** 2) / (4 * (h @ e))
        assert np.allclose(half_vector(e, l), h, atol=1e-6)
        weight = microfacets(alpha, e, l) * l[:, 2] / density / n**2
        ramp = schlick(e, l)
    bins = square_cells(l, side)
    a, b = (np.bincount(bins, weight * r, side * side) for r in (1 - ramp, ramp))
    return a, b


def _polar(c: F64, phi: F64) -> F64:
    s = np.sqrt(np.maximum(1 - c * c, 0))
    return np.stack([s * np.cos(phi), s * np.sin(phi), c], 1)


def mip_lookups(light: F64, albedo: F64) -> list[F64]:
    """The paper's reflection of light (D,), once per level of the box-filtered map of the mirrored light (6.2).

    Bilinear look-ups at the centres of the fine bins, times the albedo (D,) of each outgoing bin.
    """
    level = light[::-1].reshape(SIDE, SIDE)
    out = []
    while True:
        n = len(level)
        x = np.clip((np.arange(SIDE) + 0.5) * n / SIDE - 0.5, 0, n - 1)
        low = np.minimum(x.astype(int), max(n - 2, 0))
        high, t = np.minimum(low + 1, n - 1), x - low
        rows = level[low] * (1 - t)[:, None] + level[high] * t[:, None]
        out.append((rows[:, low] * (1 - t) + rows[:, high] * t).ravel() * albedo)
        if n == 1:
            return out
        level = level.reshape(n // 2, 2, n // 2, 2).mean((1, 3))
