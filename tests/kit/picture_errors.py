"""How far a picture is from the path tracer's."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import uniform_filter


def relative_error(picture: NDArray, truth: NDArray, box_size: int = 5) -> float:
    """Mean relative error of two pictures (h, w, 3) after box averaging.

    Each channel's error over the truth's, which is kept above 2 % of the picture's mean.
    """
    return float(error_map(picture, truth, box_size).mean())


def error_map(picture: NDArray, truth: NDArray, box_size: int = 5) -> NDArray:
    """Relative errors (h, w, 3), see `relative_error`."""
    size = (box_size, box_size, 1)
    a = uniform_filter(np.asarray(picture, np.float64), size, mode="nearest")
    b = uniform_filter(np.asarray(truth, np.float64), size, mode="nearest")
    return np.abs(a - b) / np.maximum(b, 0.02 * b.mean())
