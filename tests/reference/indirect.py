"""What a panel that parallel light meets sends to an eye by way of a receiver, in float64, by quadrature."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .reflectance import columns, frame_about, preview_surface

F64 = NDArray[np.float64]


def panel_columns(
    corner: ArrayLike, across: ArrayLike, up: ArrayLike, roughness: float, towards_light: ArrayLike,
    irradiance: float, receiver: dict, point: ArrayLike, normal: ArrayLike, eye: ArrayLike, n: int = 240,
) -> F64:  # fmt: skip
    """Returns what X, Y, A and B (4,) of the panel make of the receiver's radiance towards an eye.

    Args:
        corner, across, up: of the panel; its normal is across x up.
        towards_light: unit; `irradiance` is that of a surface across it.
        receiver: diffuse, f0, f90 (numbers) and roughness of a point with a normal.
    """
    corner, across, up, point, eye, light = (
        np.asarray(x, float) for x in (corner, across, up, point, eye, towards_light)
    )
    face = np.cross(across, up)
    area, face = np.linalg.norm(face), face / np.linalg.norm(face)
    u, v = (x.reshape(-1, 1) for x in np.meshgrid((np.arange(n) + 0.5) / n, (np.arange(n) + 0.5) / n))
    way = corner + u * across + v * up - point
    distance = np.linalg.norm(way, axis=1)
    way /= distance[:, None]
    solid = area / n**2 * np.maximum(-way @ face, 0) / distance**2
    # the panel's own columns, towards the receiver
    frame = frame_about(face)
    local_light = np.broadcast_to(frame @ light, way.shape)
    sent = irradiance * columns("preview_surface", roughness, -way @ frame.T, local_light)
    # and the receiver's reflection of it
    at = frame_about(normal)
    e = at @ ((eye - point) / np.linalg.norm(eye - point))
    l = way @ at.T
    f = preview_surface(
        receiver["diffuse"], receiver["f0"], receiver["f90"], receiver["roughness"], np.broadcast_to(e, l.shape), l
    )[:, 0]
    return (f * np.maximum(l[:, 2], 0) * solid) @ sent
