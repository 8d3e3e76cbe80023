"""Unsharp masking of a surface light field, summed directly in float64: no bins, no sphere, no lists of neighbours."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

F64 = NDArray[np.float64]


def near_weights(position: F64, area: F64, radius: float) -> F64:
    """Weights (N, N) of what surrounds each place: area (1 - (r / R)^2)^2 for r < R."""
    r = np.linalg.norm(position[:, None] - position[None], axis=2) / radius
    return np.where(r < 1, area[None] * (1 - r * r) ** 2, 0)


def masked_light(
    radiance: Callable[[int, F64], F64], weights: F64, normal: F64, direction: F64, amount: float
) -> F64:
    """max(L + amount (L - B), L / (1 + amount)), B the mean of what a far-off eye sees of the surroundings.

    Args:
        radiance: of an element in world directions (D, 3): (D, 3) channels.
        weights: (N, N).
        normal: (N, 3).
        direction: (N, D, 3) world directions that are asked of each element, on its upper side.

    Returns: (N, D, 3).
    """
    out = np.empty(direction.shape)
    for i, w in enumerate(direction):
        total, size = np.zeros(w.shape), np.zeros(len(w))
        for j in np.flatnonzero(weights[i]):
            share = weights[i, j] * np.maximum(w @ normal[j], 0)
            total += share[:, None] * radiance(int(j), w)
            size += share
        own = radiance(i, w)
        blurred = np.where(size[:, None] > 0, total / np.maximum(size, 1e-300)[:, None], own)
        out[i] = np.maximum(own + amount * (own - blurred), own / (1 + amount))
    return out
