"""Scrambled points are stratified, those that the device makes too, and so are Sobol points."""

from __future__ import annotations

import numpy as np
import pytest

from usdslf.gpu.device import Device
from usdslf.sampling.low_discrepancy import random_shifts, scrambled_points, sobol_points
from usdslf.surfaces.reflectance import model_of


@pytest.mark.parametrize("count", [16, 64, 256])
def test_aligned_runs_of_scrambled_points_are_stratified_in_every_way(count: int) -> None:
    p = scrambled_points(4 * count, np.array([3, 11], np.uint32))[1, 2 * count : 3 * count]
    for columns in 2 ** np.arange(int(np.log2(count)) + 1):
        rows = count // columns
        cell = (p[:, 0] * columns).astype(int) * rows + (p[:, 1] * rows).astype(int)
        assert len(np.unique(cell)) == count, (columns, rows)


def test_scrambled_points_are_the_device_s(device: Device) -> None:
    out_d = device.empty((100, 2), np.float32)
    constants = model_of("preview_surface").constants
    kernel = device.kernel("lobes", "sequence_points", BLOCK=4, **constants)
    kernel((128,), (64,), np.uint32(100), np.uint32(77), device.upload(np.arange(100, dtype=np.uint32)), out_d)
    np.testing.assert_array_equal(scrambled_points(100, np.array([77], np.uint32))[0], device.download(out_d))


def test_every_run_of_sobol_points_fills_all_elementary_intervals() -> None:
    points = sobol_points(0, 64, random_shifts(5, np.random.default_rng(0)))
    for first, count in ((0, 16), (16, 16), (0, 64)):
        for bits in range(count.bit_length()):
            nx, ny = 1 << bits, count >> bits
            cell = (points[:, first : first + count] * [nx, ny]).astype(int)
            for one in cell:
                assert len({tuple(c) for c in one}) == count, (first, count, nx, ny)
