"""Means over dabs of what samples make of their columns, on the device, against sums in double precision."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from reference import solve as ref

from usdslf.gpu.device import Device
from usdslf.inference.columns import DeviceColumns


@pytest.mark.parametrize(("model", "tied"), [("preview_surface", False), ("preview_surface", True), ("phong", False)])
def test_means_over_dabs_are_those_of_their_samples(device: Device, model: str, tied: bool) -> None:
    """P, U, V, W are the radiance and its differences by d and F0, exact as it is bilinear; 3 samples lie behind."""
    rng = np.random.default_rng(5)
    counts, levels = (1, 40, 16, 17), 3
    first = np.cumsum([0, *counts])
    s = int(first[-1]) + 3
    columns = rng.uniform(0, 2, (s, levels, 4, 3)).astype(np.float32)
    if model == "phong":
        columns[:, :, [1, 3]] = 0
    d, f0, f90 = (rng.uniform(0, 0.5, (s, 3)).astype(np.float32) for _ in range(3))
    kept = DeviceColumns(device, device.upload(columns), model)
    got = kept.means(first, d, f0, f90, tied)

    def sent(dd: float, df: float) -> np.ndarray:
        """Radiance (S, J, 3) after changes of all channels."""
        at = [x.astype(float) for x in (d + dd, f0 + df, f90 + (df if tied else 0))]
        return np.stack([ref.radiance(model, columns[:, j].astype(float), *at) for j in range(levels)], 1)

    p = sent(0, 0)
    u, v = sent(1, 0) - p, sent(0, 1) - p
    w = p + u + v - sent(1, 1)
    by = lambda color, x: color[:, None] * x  # noqa: E731
    expected = {"p": p, "u": u, "v": v, "w": w, "factor_u": by(d, u), "factor_w": by(d, w), "factor_v": by(f0, v)}
    for name, x in expected.items():
        means = [x[a:b].mean(0) for a, b in pairwise(first)]
        np.testing.assert_allclose(getattr(got, name), means, rtol=2e-6, atol=2e-6, err_msg=name)
    np.testing.assert_allclose(got.own, p[: first[-1], -1], rtol=2e-6, atol=2e-6)
    np.testing.assert_array_equal(kept.behind(int(first[-1])), columns[-3:])
    np.testing.assert_array_equal(kept[2:5, -1], columns[2:5, -1])
    assert kept.behind(s).shape == (0, levels, 4, 3)
