"""What light on a point reflects towards an eye, by quadrature over the light, in float64."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .reflectance import albedo, columns, frame_about

F64 = NDArray[np.float64]


def light_directions(kind: str, shape: tuple[float, ...], at: ArrayLike, point: F64, n: int) -> tuple[F64, F64]:
    """Directions (m, 3) from a point to all of a light, and their solid angles (m,), by midpoints.

    rect (width, height) and disk (radius,) face -z about `at`; sphere (radius,) about `at`; distant (full angle,)
    has the direction towards it in `at`.
    """
    at = np.asarray(at, float)
    mid = (np.arange(n) + 0.5) / n
    u, v = (x.ravel() for x in np.meshgrid(mid, mid))
    if kind in ("rect", "disk"):
        if kind == "rect":
            offset = np.stack([(u - 0.5) * shape[0], (v - 0.5) * shape[1], 0 * u], 1)
            area = np.full(n * n, shape[0] * shape[1] / n**2)
        else:
            r, phi = u * shape[0], 2 * np.pi * v
            offset = np.stack([r * np.cos(phi), r * np.sin(phi), 0 * u], 1)
            area = r * (shape[0] / n) * (2 * np.pi / n)
        to = at + offset - point
        r2 = (to**2).sum(1)
        l = to / np.sqrt(r2)[:, None]
        return l, area * np.maximum(l[:, 2], 0) / r2
    axis = at if kind == "distant" else at - point
    distance = np.linalg.norm(axis)
    cone = shape[0] / 2 if kind == "distant" else np.arcsin(shape[0] / distance)
    c, phi = 1 - u * (1 - np.cos(cone)), 2 * np.pi * v
    s = np.sqrt(1 - c * c)
    local = np.stack([s * np.cos(phi), s * np.sin(phi), c], 1)
    return local @ frame_about(axis / distance), np.full(n * n, 2 * np.pi * (1 - np.cos(cone)) / n**2)


def columns_of_light(model: str, roughness: float, normal: ArrayLike, eye: ArrayLike, l: F64, solid_angle: F64) -> F64:
    """Columns X, Y, A, B (4,) of radiance 1 from directions (m, 3), world, for an eye in direction `eye`."""
    frame = frame_about(normal)
    e = frame @ (np.asarray(eye, float) / np.linalg.norm(eye))
    local = l @ frame.T
    up = local[:, 2] > 0
    return solid_angle[up] @ columns(model, roughness, np.broadcast_to(e, local[up].shape), local[up])


def columns_of_dome(model: str, roughness: float, normal: ArrayLike, eye: ArrayLike) -> F64:
    """The same for radiance 1 from everywhere."""
    cosine = float(np.dot(normal, eye) / np.linalg.norm(eye))
    return albedo(model, roughness, cosine, rings=96)[0]
