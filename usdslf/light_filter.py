"""The filter that makes gathered light free of noise, and finds where it could not.

Samples of a picture lie on a grid of (height, width); a tile of it shares one low-discrepancy set (interleaved
sampling), and the mean over a window of the tile's size has all of it.  What is filtered is light without the
surface's colours, so textures stay; kernels/render.cl says which neighbours count.

Source: Keller and Heidrich 2001, Interleaved Sampling; Wald et al. 2002, Interactive Global Illumination.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from usdslf.gpu.device import Device
from usdslf.light_set import dot, luminance
from usdslf.scene import F32
from usdslf.shading import ShadingPoints, reflect

TILE = 8  # samples on a side that share one low-discrepancy set
LOBE_SHARE = 1.0  # mirror directions may differ by this many alphas, but no more than 0.15
NORMAL_COSINE = 0.985  # normals may differ by 10 degrees
NOISE = 0.03  # relative uncertainty of filtered light above which more samples are spent
REFINE_MOST = 8  # how many times as many
REFINE_BUDGET = 1.0  # of the samples of the first round, for all that is spent on refining
FEATURES = 13  # kernels/render.cl


class LightFilter:
    """Filters the light of points that lie at `rows` of a grid of samples."""

    def __init__(
        self, device: Device, grid: tuple[int, int], rows: NDArray[np.intp], points: ShadingPoints, kind: NDArray,
        pixel: F32, center: F32,
    ) -> None:  # fmt: skip
        """Prepares what neighbours are compared by.

        Args:
            grid: width and height in samples.
            rows: (n,) of the grid's rows of samples, one after the other.
            points: n of them.
            kind: (n,) materials; light is shared among equals only.
            pixel: (n,) size of a pixel's footprint there [stage units].
            center: (3,) subtracted from positions for the sake of precision.
        """
        self._device, self._grid, self._rows, self._points = device, grid, rows, points
        self._filter = device.kernel("render", "filter_light")
        self._noise = device.kernel("render", "window_noise")
        mirror = 2 * dot(points.normal, points.view)[:, None] * points.normal - points.view
        lean = np.maximum(np.abs(dot(points.geometric_normal, points.view)), 0.05)
        only_specular = points.lobes[:, 2] + points.lobes[:, 3] > 0.999
        columns = [
            points.position - center, points.normal, mirror, points.lobes[:, :1],
            (pixel * (0.5 + 0.1 / lean))[:, None], (2.0 * kind + only_specular)[:, None], np.ones((len(rows), 1)),
        ]  # fmt: skip
        self._features = np.full((grid[0] * grid[1], FEATURES), -1, np.float32)
        self._features[rows] = np.concatenate(columns, 1)

    def radiance(self, light: F32, window: int) -> F32:
        """Returns the radiance (n, 3) that the points make of light columns (n, 5, 3), filtered over a window."""
        out_d = self._device.empty((self._grid[0] * self._grid[1], 3), np.float32)
        inputs = self._on_grid(self._points.colors), self._on_grid(light.reshape(len(light), -1))
        self._run(self._filter, window, *inputs, out_d)
        return self._device.download(out_d)[self._rows]

    def uncertain_points(self, light: F32, rest: F32, place: NDArray) -> tuple[int, NDArray[np.intp]]:
        """Finds points whose filtered light is not certain enough.

        Args:
            light: columns (n, 5, 3).
            rest: (n, 3) radiance besides that.
            place: (n,) of each point in the tile.

        Returns: how many times as many samples they should get, and which of the n points.
        """
        colors = self._points.colors
        matte = luminance(reflect(colors, light * _DIFFUSE_ONLY))
        value = np.stack([matte, luminance(reflect(colors, light)) - matte], 1)
        out_d = self._device.empty((self._grid[0] * self._grid[1], 3), np.float32)
        inputs = self._on_grid(place.astype(np.uint32)), self._on_grid(value.astype(np.float32))
        self._run(self._noise, TILE, *inputs, out_d)
        mean, variance, count = self._device.download(out_d)[self._rows].T
        whole = mean + luminance(rest)
        error = np.sqrt(variance) / (whole + 0.05 * max(float(whole.mean()), 1e-12))
        alone = (count < TILE) & (value[:, 1] > 0.1 * whole)  # sharp reflections: nothing to judge by
        error = np.where(alone, np.maximum(error, 2 * NOISE), error)
        return worst_tiles(error, self._rows, self._grid)

    def set_weight(self, points: NDArray, weight: float) -> None:
        """Says how many times the usual samples some points have got."""
        self._features[self._rows[points], FEATURES - 1] = weight

    def _on_grid(self, values: NDArray) -> Any:
        grid = np.zeros((self._grid[0] * self._grid[1], *values.shape[1:]), values.dtype)
        grid[self._rows] = values
        return self._device.upload(grid)

    def _run(self, kernel: Any, window: int, *arrays: Any) -> None:
        width, height = self._grid
        whole_groups = -(-width // 16) * 16, -(-height // 4) * 4
        sizes = np.int32(width), np.int32(height), np.int32(window)
        limits = np.float32(LOBE_SHARE), np.float32(NORMAL_COSINE)
        kernel(whole_groups, (16, 4), *sizes, *limits, self._device.upload(self._features), *arrays)


_DIFFUSE_ONLY = np.array([1, 1, 0, 0, 0], np.float32)[:, None]


def worst_tiles(error: F32, rows: NDArray, grid: tuple[int, int]) -> tuple[int, NDArray[np.intp]]:
    """Chooses the points (of error (n,) at `rows` of the grid) that get more samples, by whole tiles.

    Returns: how many times as many samples, and which points: the worst tiles, as the budget allows.
    """
    across = -(-grid[0] // TILE)
    tile = (rows // grid[0] // TILE) * across + rows % grid[0] // TILE
    count = np.maximum(np.bincount(tile), 1)
    badness = np.sqrt(np.bincount(tile, error**2) / count)
    bad = np.flatnonzero(badness > NOISE)
    budget = REFINE_BUDGET * len(rows)
    times = REFINE_MOST
    while times > 2 and times * count[bad].sum() > budget:
        times //= 2
    bad = bad[np.argsort(-badness[bad])]
    bad = bad[np.cumsum(count[bad]) * times <= budget]
    chosen = np.zeros(len(count), bool)
    chosen[bad] = True
    return times, np.flatnonzero(chosen[tile])


def morton_place(x: NDArray, y: NDArray) -> NDArray[np.uint32]:
    """Returns the place of (x, y) < 256 on the Z-order curve: aligned squares are runs of indices."""
    out = np.zeros(np.shape(x), np.uint32)
    for bit in range(8):
        out |= ((x >> bit) & 1).astype(np.uint32) << np.uint32(2 * bit)
        out |= ((y >> bit) & 1).astype(np.uint32) << np.uint32(2 * bit + 1)
    return out
