"""Radiance of one glossy material in closed form, and how a path tracer is asked for the same."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from reference.pathtracer import Tracer

DIFFUSE, F0, ROUGHNESS = 0.6, 0.2, 0.35
MATERIAL = {
    "useSpecularWorkflow": 1.0,
    "diffuseColor": (DIFFUSE, 0.3, 0.0),
    "specularColor": (F0, 0.04, 1.0),
    "roughness": ROUGHNESS,
}


def brdf(n: NDArray, v: NDArray, l: NDArray) -> NDArray:
    """The textbook form (k, 3) for unit vectors; n and v (3,), l (k, 3)."""
    h = l + v
    h /= np.linalg.norm(h, axis=1, keepdims=True)
    nl, nv, nh = np.maximum(l @ n, 1e-12), float(v @ n), h @ n
    a2 = ROUGHNESS**4
    d = a2 / (np.pi * (nh**2 * (a2 - 1) + 1) ** 2)
    smith = 0.5 / (nl * np.sqrt(a2 + (1 - a2) * nv**2) + nv * np.sqrt(a2 + (1 - a2) * nl**2))
    f = ((1 - (h @ v)) ** 5)[:, None]
    fresnel = np.array(MATERIAL["specularColor"]) * (1 - f) + f
    return np.array(MATERIAL["diffuseColor"]) / np.pi * (1 - fresnel) + fresnel * (d * smith)[:, None]


def at(*angles_deg: float) -> NDArray:
    """Unit directions at angles from +Y towards +X."""
    a = np.radians(angles_deg)
    return np.stack([np.sin(a), np.cos(a), 0 * a], -1)


def mean_radiance(
    tracer: Tracer, target: tuple[float, ...], direction: NDArray, rays: int = 200_000
) -> NDArray:
    """Radiance (3,) leaving `target` along `direction`."""
    origin = np.broadcast_to(np.array(target) + 2 * direction, (rays, 3))
    return tracer.radiance(origin, np.broadcast_to(-direction, (rays, 3))).mean(0)
