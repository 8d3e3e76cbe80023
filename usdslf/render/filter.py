"""The filter that makes gathered light free of noise, and finds where it could not.

Samples of a picture lie on a grid of (height, width); a tile of it shares one low-discrepancy set (interleaved
sampling), and the mean over a window of the tile's size has all of it.  What is filtered is light without the
surface's colours, so textures stay; kernels/filter.cl says which neighbours count.

Reflections in smooth metal are sharper than the window.  A part of the window would hold a part of the set, another
one at each place of the tile, which shows as a grid of dots.  So such points have smaller tiles, and whole ones.

Source: Keller and Heidrich 2001, Interleaved Sampling; Wald et al. 2002, Interactive Global Illumination.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from usdslf.color import luminance
from usdslf.gpu.device import Device
from usdslf.lights.sources import dot
from usdslf.render.lobes import ShadingPoints, reflect
from usdslf.scene.records import F32

TILE = 8  # samples on a side that share one low-discrepancy set
NEAR_TILE = 4  # the same for lights that have a place: their shadows are blurred by no more
LOBE_SHARE = 1.0  # mirror directions may differ by this many alphas, but no more than WIDEST
FLAT_SHARE = 3.0  # the same for flat surfaces, whose tiles are whole: few rays would be wrong alike in all pixels
WIDEST = 0.15
FLAT = 0.25  # change of the normal, of that of the mirror direction, below which a surface is flat
SMALLEST_SET = 16  # points of a sequence: fewer do not hold every lobe as often as its chance says
NORMAL_COSINE = 0.985  # normals may differ by 10 degrees
NOISE = 0.03  # relative uncertainty of filtered light above which more samples are spent
REFINE_MOST = 8  # how many times as many
REFINE_BUDGET = 1.0  # of the samples of the first round, for all that is spent on refining
POSITION, NORMAL, MIRROR, ALPHA, PLANE_GAP = 0, 3, 6, 9, 10
CLASS, WEIGHT, TILE_SIDE, LOBE_WIDTH, FEATURES = 11, 12, 13, 14, 15
PLACES = {
    "POSITION": POSITION, "NORMAL": NORMAL, "MIRROR": MIRROR, "ALPHA": ALPHA, "PLANE_GAP": PLANE_GAP, "CLASS": CLASS,
    "WEIGHT": WEIGHT, "TILE": TILE_SIDE, "LOBE_WIDTH": LOBE_WIDTH, "FEATURES": FEATURES,
}  # fmt: skip
"""Where the features of a sample stand, and how many there are: build constants of kernels/filter.cl."""


@dataclass(frozen=True)
class SampleGrid:
    """Where points lie on a grid of samples of a picture."""

    width: int
    height: int
    rows: NDArray[np.intp]  # (n,) of the grid's rows of samples, one after the other
    antialias: int  # samples on a side of a pixel
    first_row: int = 0  # of the picture's samples, where the grid starts

    @property
    def count(self) -> int:
        """Samples of the grid."""
        return self.width * self.height


class LightFilter:
    """Filters the light of points that lie at `rows` of a grid of samples."""

    def __init__(
        self, device: Device, grid: SampleGrid, points: ShadingPoints, kind: NDArray, pixel: F32, center: F32, rays: int
    ) -> None:
        """Prepares what neighbours are compared by.

        Args:
            grid: where the points lie.
            points: n of them.
            kind: (n,) materials; light is shared among equals only.
            pixel: (n,) size of a pixel's footprint there [stage units].
            center: (3,) subtracted from positions for the sake of precision.
            rays: of each point.
        """
        self._device, self._points = device, points
        self._size, self._rows = (grid.width, grid.height), grid.rows
        self._filter = device.kernel("filter", "filter_light", **PLACES)
        self._noise = device.kernel("filter", "window_noise", **PLACES)
        mirror = 2 * dot(points.normal, points.view)[:, None] * points.normal - points.view
        lean = np.maximum(np.abs(dot(points.geometric_normal, points.view)), 0.05)
        only_specular = points.lobes[:, 2] + points.lobes[:, 3] > 0.999
        columns = [
            points.position - center, points.normal, mirror, points.lobes[:, :1],
            (pixel * (0.5 + 0.1 / lean))[:, None], (2.0 * kind + only_specular)[:, None], np.ones((len(points), 1)),
        ]  # fmt: skip
        self._features = np.full((grid.count, FEATURES), -1, np.float32)
        self._features[grid.rows, :TILE_SIDE] = np.concatenate(columns, 1)
        step, is_flat = mirror_steps(self._features, self._size)
        step, is_flat = step[grid.rows], is_flat[grid.rows]
        wide = np.minimum(np.where(is_flat, FLAT_SHARE, LOBE_SHARE) * points.lobes[:, 0], WIDEST)
        least = max(grid.antialias, 2 ** int(np.ceil(np.log2(SMALLEST_SET / rays) / 2)))
        # Diffuse light shares the rays of a mixture, and needs the whole tile.  On curved surfaces the window has
        # other shapes, and few samples would be the same for many pixels.
        may_shrink = only_specular & is_flat
        tile = np.where(may_shrink, tiles_within(wide / np.maximum(step, 1e-9), min(least, TILE)), TILE)
        self._features[grid.rows, TILE_SIDE], self._features[grid.rows, LOBE_WIDTH] = tile, wide
        self._mirrors = np.flatnonzero(may_shrink & (wide < WIDEST))
        y, x = np.divmod(grid.rows, grid.width)
        y += grid.first_row
        near = np.minimum(tile, NEAR_TILE)
        # of each point in its tile, and in the tile of lights that have a place
        self.place, self.near_place = (morton_place(x % t, y % t) for t in (tile, near))
        self._quarter = (self.place * 4 // (tile * tile).astype(np.uint32)).astype(np.uint32)

    def radiance(self, light: F32, window: int) -> F32:
        """Returns the radiance (n, 3) that the points make of light columns (n, 5, 3), filtered over a window."""
        out_d = self._device.empty((len(self._features), 3), np.float32)
        inputs = self._on_grid(self._points.colors), self._on_grid(light.reshape(len(light), -1))
        self._run(self._filter, window, *inputs, out_d)
        return self._device.download(out_d)[self._rows]

    def uncertain_points(self, light: F32, rest: F32) -> tuple[int, NDArray[np.intp]]:
        """Finds points whose filtered light is not certain enough.

        Args:
            light: columns (n, 5, 3).
            rest: (n, 3) radiance besides that.

        Returns: how many times as many samples they should get, and which of the n points.
        """
        colors = self._points.colors
        matte = luminance(reflect(colors, light * _DIFFUSE_ONLY))
        value = np.stack([matte, luminance(reflect(colors, light)) - matte], 1)
        out_d = self._device.empty((len(self._features), 3), np.float32)
        inputs = self._on_grid(self._quarter), self._on_grid(value.astype(np.float32))
        self._run(self._noise, TILE, *inputs, out_d)
        mean, variance, count = self._device.download(out_d)[self._rows].T
        whole = mean + luminance(rest)
        error = np.sqrt(variance) / (whole + 0.05 * max(float(whole.mean()), 1e-12))
        alone = (count < TILE) & (value[:, 1] > 0.1 * whole)  # sharp reflections: nothing to judge by
        error = np.where(alone, np.maximum(error, 2 * NOISE), error)
        # What few samples are wrong by is alike in the whole of a flat mirror: a part with more of them would show.
        at = self._mirrors
        _, mirror = np.unique(self._features[self._rows[at], CLASS], return_inverse=True)
        error[at] = np.sqrt(np.bincount(mirror, error[at] ** 2) / np.maximum(np.bincount(mirror), 1))[mirror]
        return worst_tiles(error, self._rows, self._size, 1 if (error[at] > NOISE).any() else 2)

    def set_weight(self, points: NDArray, weight: float) -> None:
        """Says how many times the usual samples some points have got."""
        self._features[self._rows[points], WEIGHT] = weight

    def _on_grid(self, values: NDArray) -> Any:
        grid = np.zeros((len(self._features), *values.shape[1:]), values.dtype)
        grid[self._rows] = values
        return self._device.upload(grid)

    def _run(self, kernel: Any, window: int, *arrays: Any) -> None:
        width, height = self._size
        whole_groups = -(-width // 16) * 16, -(-height // 4) * 4
        sizes = np.int32(width), np.int32(height), np.int32(window)
        kernel(whole_groups, (16, 4), *sizes, np.float32(NORMAL_COSINE), self._device.upload(self._features), *arrays)


_DIFFUSE_ONLY = np.array([1, 1, 0, 0, 0], np.float32)[:, None]


def mirror_steps(features: F32, grid: tuple[int, int]) -> tuple[F32, NDArray[np.bool_]]:
    """Returns how much the mirror direction changes from one sample of the grid to the next, and where it is flat.

    Both (height * width,).  On the side where it changes less, and along the axis where it changes more; inf where
    nothing is next to a sample.
    """
    f = features.reshape(grid[1], grid[0], FEATURES)
    turns: list[F32] = []
    steps: list[F32] = []
    for axis in (0, 1):
        a, b = (np.take(f, np.arange(k, f.shape[axis] - 1 + k), axis) for k in (0, 1))
        is_same = a[..., CLASS] == b[..., CLASS]
        is_same &= (a[..., NORMAL : NORMAL + 3] * b[..., NORMAL : NORMAL + 3]).sum(-1) > NORMAL_COSINE
        for columns, found in ((slice(NORMAL, NORMAL + 3), turns), (slice(MIRROR, MIRROR + 3), steps)):
            step = np.where(is_same, np.linalg.norm(a[..., columns] - b[..., columns], axis=-1), np.inf)
            step = np.pad(step, [(int(k == axis),) * 2 for k in (0, 1)], constant_values=np.inf)
            found.append(np.minimum(*(np.take(step, np.arange(k, f.shape[axis] + k), axis) for k in (0, 1))))
    turn, step = (np.maximum(*found).reshape(-1) for found in (turns, steps))
    return step, np.isfinite(turn) & (turn <= FLAT * step + 1e-6)


def tiles_within(reach: NDArray, least: int) -> NDArray[np.intp]:
    """Returns the tile's side for points which may share their specular light within `reach` samples."""
    tile = np.full(len(reach), least)
    while least < TILE:
        least *= 2
        tile[np.sqrt(2) * reach >= least] = least
    return tile


def worst_tiles(
    error: F32, rows: NDArray, grid: tuple[int, int], fewest: int = 2, budget: float = REFINE_BUDGET
) -> tuple[int, NDArray[np.intp]]:
    """Chooses the points (of error (n,) at `rows` of the grid) that get more samples, by whole tiles.

    At least `fewest` times as many go to each that does; with 1, all that need more get them.  The budget is
    in samples of the first round, for each of it.

    Returns: how many times as many samples, and which points: the worst tiles, as the budget allows.
    """
    across = -(-grid[0] // TILE)
    tile = (rows // grid[0] // TILE) * across + rows % grid[0] // TILE
    count = np.maximum(np.bincount(tile), 1)
    badness = np.sqrt(np.bincount(tile, error**2) / count)
    bad = np.flatnonzero(badness > NOISE)
    budget *= len(rows)
    times = REFINE_MOST
    while times > fewest and times * count[bad].sum() > budget:
        times //= 2
    bad = bad[np.argsort(-badness[bad], kind="stable")]
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
