"""Relative residuals: the one rule for how far radiance is from what was painted.

    residual = (radiance - target) / scale        scale = |target| + 0.1 mean + least

A tenth of the mean of what is compared keeps dark places from counting more than they are seen.  Radiance has three
channels; the mean goes over places and channels together.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from usdslf.scene.records import F64

SHARE_OF_MEAN = 0.1
LEAST = 1e-6  # radiance
BLACK = 1e-3  # share of what it covers, below which paint is black


def relative_scale(target: NDArray, mean: ArrayLike | None = None, least: float = LEAST) -> F64:
    """Returns what differences are divided by, shaped like the target (..., 3) [radiance], above 0.

    Args:
        mean: that the target is one of, broadcast against it; None: the target's own mean magnitude.
        least: that stands for a target that is black throughout.
    """
    size = np.abs(target)
    return size + SHARE_OF_MEAN * (size.mean() if mean is None else np.asarray(mean)) + least


def mean_by_stroke(target: NDArray, stroke: NDArray, covered: NDArray) -> F64:
    """Returns the mean target (n,) of the stroke of each dab, for `relative_scale`.

    Args:
        target: (n, 3).
        stroke: (n,) which stroke each dab is of.
        covered: (n, 3) radiance before any change; black paint is relative to that.
    """
    which, number = np.unique(stroke, return_inverse=True)
    mean = np.array([np.mean(target[stroke == s]) for s in which])
    seen = np.array([np.abs(covered[stroke == s]).mean() for s in which])
    return np.where(mean > BLACK * seen, mean, seen)[number.reshape(-1)]


def relative_rms(radiance: NDArray, target: NDArray, scale: NDArray) -> float:
    """Returns the root mean square of relative residuals of radiance (n, 3), 0 where it is as painted."""
    return float(np.sqrt(np.mean(((radiance - target) / scale) ** 2)))
