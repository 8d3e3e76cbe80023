"""Frames about a direction."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    pass

def frames_about(normal: NDArray) -> NDArray[np.float32]:
    """Returns frames (n, 3, 3), rows tangent, bitangent, normal.  Source: Duff et al. 2017."""
    x, y, z = np.asarray(normal, np.float64).T
    s = np.where(z < 0, -1.0, 1.0)
    a = -1 / (s + z)
    b = x * y * a
    t = np.stack([1 + s * x * x * a, s * b, -s * x], -1)
    u = np.stack([b, s + y * y * a, -y], -1)
    return np.stack([t, u, normal], 1).astype(np.float32)
