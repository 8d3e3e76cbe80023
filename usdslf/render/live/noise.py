"""How uncertain the light of a final picture's samples is, and which of them get more rays.

Samples of a tile draw other numbers in each frame, of the same surfaces; what the means of a tile over frames differ by
is noise, whatever is seen in the tile.  Where reflections are sharp the filter does not look at the whole tile, and a
pixel's own samples say it.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from usdslf.gpu.launch import GROUP, groups
from usdslf.gpu.shared import Shared
from usdslf.render.live import records as r
from usdslf.render.live.scene import Geometry
from usdslf.render.live.view import Rows, Window
from usdslf.scene.records import F32

NOISE = 0.03  # relative uncertainty of filtered light above which more samples are spent
REFINE_MOST = 8  # how many times as many
QUARTERED_ALPHA = 0.1  # sharper lobes may be seen by a part of a tile's samples
SHARP_TILE = 2  # samples on a side that judge sharp reflections
COMPLETED = 0.75  # frames complete each other's numbers: errors of n, at edges of shadows too, fall as n to this power
BUDGET = 0.25  # of the rays of all, that uncertain samples get more
DARK = 0.05  # of the mean luminance, that errors of less are compared with


class Noise:
    """Luminance of blocks of samples, frame by frame."""

    def __init__(self, geometry: Geometry, window: Window, rows: Rows, there: NDArray[np.uint32], frames: int) -> None:
        """Judges some rows of a window's grid by so many frames."""
        self._geometry, self._window, self._there, self._rows = geometry, window, there, rows
        self._frames, self._taken = frames, 0
        shapes = {side: (-(-window.height // side), -(-window.width // side)) for side in (r.TILE, SHARP_TILE)}
        self._sums = {
            side: Shared(geometry.device, (frames + 1, *shape), np.float32, is_clean=False)
            for side, shape in shapes.items()
        }  # the last is how many rows each block has
        filled = Shared(geometry.device, (window.count,), np.float32)
        filled.host[there] = 1
        filled.push()
        self._sum_up(filled, frames)

    def _sum_up(self, values: Shared, place: int) -> None:
        """Sums values (samples,) over blocks."""
        for side, sums in self._sums.items():
            n = sums.host[0].size
            self._geometry.kernel("live_still", "sum_blocks")(
                groups(n), (GROUP,), np.uint32(n), np.int32(self._window.width), np.int32(self._window.height),
                np.int32(side), np.uint32(place), values, sums,
            )  # fmt: skip

    def add(self, sent: Shared) -> None:
        """Takes the luminance (samples,) of a frame; 0 where nothing is."""
        self._sum_up(sent, self._taken)
        self._taken += 1

    def uncertain(self) -> tuple[int, NDArray[np.intp]]:
        """Returns how many times as many rays some rows should get, and which of those that are there."""
        nothing = 1, np.zeros(0, np.intp)
        if self._frames < 2 or not len(self._there):
            return nothing
        for sums in self._sums.values():
            sums.pull()
        errors = {side: self._error(side) for side in self._sums}
        self._rows.guide.pull()
        guide = self._rows.guide.host[self._there]
        is_mirror = guide[:, r.G_TILE] < r.TILE
        error = np.where(is_mirror | (guide[:, r.G_ALPHA] < QUARTERED_ALPHA), errors[SHARP_TILE], errors[r.TILE])
        # What few samples are wrong by is alike in the whole of a flat mirror: a part with more of them would show.
        y, x = np.divmod(self._there.astype(np.intp), self._window.width)
        tile = (y // r.TILE) * -(-self._window.width // r.TILE) + x // r.TILE
        unit = np.where(is_mirror, tile.max() + 1 + guide[:, r.G_CLASS].astype(np.intp), tile)
        return worst_units(error, unit, 1 if (error[is_mirror] > NOISE).any() else 2)

    def _error(self, side: int) -> F32:
        """Relative error of each row by the blocks of a side."""
        found, filled = self._sums[side].host[: self._frames], self._sums[side].host[self._frames]
        mean, count = found.mean(0), np.maximum(filled, 1)
        error = np.sqrt(found.var(0, ddof=1)) / len(found) ** COMPLETED
        level = mean + DARK * count * float(mean.sum() / count.sum())
        relative = error / np.maximum(level, 1e-12)
        y, x = np.divmod(self._there.astype(np.intp), self._window.width)
        out: F32 = relative[y // side, x // side].astype(np.float32)
        return out


def worst_units(error: F32, unit: NDArray[np.intp], fewest: int = 2) -> tuple[int, NDArray[np.intp]]:
    """Chooses the points (of error (n,)) that get more samples, as BUDGET allows, by whole units: tiles, and mirrors.

    Args:
        error: (n,) relative, of each point.
        unit: (n,) that each point belongs to; one that alone is too much for the budget gets nothing.
        fewest: times as many samples that each one gets at least that gets more.

    Returns: how many times as many samples, and which points: the worst units.
    """
    count = np.maximum(np.bincount(unit), 1)
    badness = np.sqrt(np.bincount(unit, error**2) / count)
    bad, budget, times = np.flatnonzero(badness > NOISE), BUDGET * len(unit), REFINE_MOST
    while times > fewest and times * count[bad].sum() > budget:
        times //= 2
    bad = bad[np.argsort(-badness[bad], kind="stable")]
    bad = bad[times * count[bad] <= budget]
    bad = bad[np.cumsum(count[bad]) * times <= budget]
    chosen = np.zeros(len(count), bool)
    chosen[bad] = True
    return times, np.flatnonzero(chosen[unit])
