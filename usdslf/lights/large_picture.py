"""Large latlong pictures, made as small as what reads them can use."""

from __future__ import annotations

import numpy as np

from usdslf.scene.records import F32


def shining(pixels: F32) -> F32:
    """Returns pixels without what is not finite or below zero: black.  The same array where there is none."""
    if pixels.size and pixels.min() >= 0 and pixels.max() < np.inf:  # nan is neither
        return pixels
    return np.where(np.isfinite(pixels), np.maximum(pixels, 0), 0)


def reduced(pixels: F32, rows: int) -> F32:
    """Returns a latlong picture (H, W, 3) as means of square blocks, weighed by the solid angle of their rows.

    Args:
        pixels: returned as they are where they cannot be divided into blocks.
        rows: that are left at least.
    """
    height, width, channels = pixels.shape
    side = next((s for s in range(height // rows, 1, -1) if height % s == 0 and width % s == 0), 1)
    if side == 1:
        return pixels
    weight = np.cos(np.pi * (0.5 - (np.arange(height) + 0.5) / height)).reshape(-1, side).astype(np.float32)
    weight /= weight.sum(1, keepdims=True)
    out = np.empty((height // side, width // side, channels), np.float32)
    for row in range(height // side):
        block = pixels[row * side : (row + 1) * side]
        down = np.einsum("h,hwc->wc", weight[row], block)
        out[row] = down.reshape(-1, side, channels).mean(1)
    return out
