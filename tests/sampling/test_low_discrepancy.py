"""Scrambled points are stratified, and those that the device makes."""

from __future__ import annotations

import numpy as np
import pytest

from usdslf.gpu.device import Device
from usdslf.sampling.low_discrepancy import scrambled_points
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
