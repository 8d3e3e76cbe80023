"""Frames about a direction."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

F64 = NDArray[np.float64]


def tangents(normal: NDArray, sign: NDArray | None = None) -> tuple[F64, F64]:
    """Returns two unit vectors (3, n) that complete unit vectors (3, n) to right-handed frames, without a branch.

    Args:
        sign: (n,) of z, 1 or -1, for callers that tell the two zeros apart; None: 1 for both.

    Source: Duff et al. 2017, Building an orthonormal basis, revisited.
    """
    x, y, z = np.asarray(normal, np.float64)
    s = np.where(z < 0, -1.0, 1.0) if sign is None else sign
    a = -1 / (s + z)
    b = x * y * a
    return np.stack([1 + s * x * x * a, s * b, -s * x]), np.stack([b, s + y * y * a, -y])


def frames_about(normal: NDArray) -> NDArray[np.float32]:
    """Returns frames (n, 3, 3), rows tangent, bitangent, normal, about unit normals (n, 3)."""
    t, b = tangents(np.asarray(normal).T)
    return np.stack([t.T, b.T, normal], 1).astype(np.float32)
