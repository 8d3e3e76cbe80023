"""The weights of a roughness level as whole matrices."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from usdslf.light_field.preconvolution import LevelKernel, coarse_of_bin
from usdslf.sampling.hemisphere import D


def dense(level: LevelKernel) -> tuple[NDArray, NDArray]:
    """Returns the columns A and B of a level as full (D, D) matrices."""
    if level.fine_scale is not None:
        up, scale = coarse_of_bin(), level.fine_scale.astype(np.float64)
        return level.a[np.ix_(up, up)] / 4.0 * scale[:, :1], level.b[np.ix_(up, up)] / 4.0 * scale[:, 1:]
    assert level.first is not None and level.tap is not None
    row = np.repeat(np.arange(D), np.diff(level.first))
    out = np.zeros((2, D, D))
    out[0, row, level.tap], out[1, row, level.tap] = level.a, level.b
    return out[0], out[1]
