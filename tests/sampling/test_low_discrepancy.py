"""Scrambled points are stratified, and so are Sobol points."""

from __future__ import annotations

import numpy as np
import pytest

from usdslf.sampling.low_discrepancy import random_shifts, scrambled_points, sobol_points


@pytest.mark.parametrize("count", [4, 16, 64, 256])
def test_aligned_runs_of_scrambled_points_are_stratified_in_every_way(count: int) -> None:
    p = scrambled_points(4 * count, np.array([3, 11], np.uint32))[1, 2 * count : 3 * count]
    for columns in 2 ** np.arange(int(np.log2(count)) + 1):
        rows = count // columns
        cell = (p[:, 0] * columns).astype(int) * rows + (p[:, 1] * rows).astype(int)
        assert len(np.unique(cell)) == count, (columns, rows)


def test_every_run_of_sobol_points_fills_all_elementary_intervals() -> None:
    points = sobol_points(0, 64, random_shifts(5, np.random.default_rng(0)))
    for first, count in ((0, 16), (16, 16), (0, 64)):
        for bits in range(count.bit_length()):
            nx, ny = 1 << bits, count >> bits
            cell = (points[:, first : first + count] * [nx, ny]).astype(int)
            for one in cell:
                assert len({tuple(c) for c in one}) == count, (first, count, nx, ny)
