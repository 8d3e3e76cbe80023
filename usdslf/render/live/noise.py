"""How uncertain the light of a final picture's samples is, and which of them get more rays.

Samples of a tile draw other numbers in each frame, of the same surfaces; what the means of a tile over frames differ by
is noise, whatever is seen in the tile.  Where reflections are sharp the filter does not look at the whole tile, and a
pixel's own samples say it.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from usdslf.gpu.shared import Shared
from usdslf.render.filter import NOISE, TILE, worst_tiles
from usdslf.render.live import records as r
from usdslf.render.live.view import Rows, Window
from usdslf.render.lobes import QUARTERED_ALPHA
from usdslf.scene.records import F32

SHARP_TILE = 2  # samples on a side that judge sharp reflections
COMPLETED = 0.75  # frames complete each other's numbers: errors of n, at edges of shadows too, fall as n to this power
BUDGET = 0.25  # of the rays of all, that uncertain samples get more
DARK = 0.05  # of the mean luminance, that errors of less are compared with


class Noise:
    """Luminance of blocks of samples, frame by frame."""

    def __init__(self, window: Window, rows: Rows, there: NDArray[np.uint32]) -> None:
        """Judges some rows of a window's grid."""
        self._window, self._there, self._rows = window, there, rows
        self._sums: dict[int, list[F32]] = {TILE: [], SHARP_TILE: []}
        self._filled = {side: self._blocks(self._there_map(), side) for side in self._sums}

    def _there_map(self) -> F32:
        out = np.zeros(self._window.count, np.float32)
        out[self._there] = 1
        return out

    def _blocks(self, values: F32, side: int) -> F32:
        """Sums of values (samples,) over blocks of side x side."""
        grid = values.reshape(self._window.height, self._window.width)
        grid = np.add.reduceat(grid, np.arange(0, self._window.height, side), axis=0)
        return np.add.reduceat(grid, np.arange(0, self._window.width, side), axis=1)

    def add(self, sent: Shared) -> None:
        """Takes the luminance (samples,) of a frame; 0 where nothing is."""
        sent.pull()
        for side, found in self._sums.items():
            found.append(self._blocks(sent.host, side))

    def uncertain(self, frames: int) -> tuple[int, NDArray[np.intp]]:
        """Returns how many times as many rays some rows should get, and which of those that are there."""
        nothing = 1, np.zeros(0, np.intp)
        if frames < 2 or not len(self._there):
            return nothing
        errors = {side: self._error(side) for side in self._sums}
        self._rows.guide.pull()
        guide, size = self._rows.guide.host[self._there], (self._window.width, self._window.height)
        is_mirror = guide[:, r.G_TILE] < TILE
        error = np.where(is_mirror | (guide[:, r.G_ALPHA] < QUARTERED_ALPHA), errors[SHARP_TILE], errors[TILE])
        # What few samples are wrong by is alike in the whole of a flat mirror: a part with more of them would show.
        at = np.flatnonzero(is_mirror)
        kind = guide[at, r.G_CLASS].astype(np.intp)
        error[at] = np.sqrt(np.bincount(kind, error[at] ** 2) / np.maximum(np.bincount(kind), 1))[kind]
        return worst_tiles(error, self._there, size, 1 if (error[at] > NOISE).any() else 2, BUDGET)

    def _error(self, side: int) -> F32:
        """Relative error of each row by the blocks of a side."""
        found = np.stack(self._sums[side])
        mean, count = found.mean(0), np.maximum(self._filled[side], 1)
        error = np.sqrt(found.var(0, ddof=1)) / len(found) ** COMPLETED
        level = mean + DARK * count * float(mean.sum() / count.sum())
        relative = error / np.maximum(level, 1e-12)
        y, x = np.divmod(self._there.astype(np.intp), self._window.width)
        out: F32 = relative[y // side, x // side].astype(np.float32)
        return out
