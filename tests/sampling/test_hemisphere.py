"""Laws of the hemisphere's bins: equal areas, inverse, mirror, and the device's twin."""

from __future__ import annotations

from typing import Any

import numpy as np
import pyopencl as cl
import pytest
from reference.visibility import square_cells

from usdslf.gpu.device import Device
from usdslf.gpu.source import kernel_source
from usdslf.sampling.hemisphere import (
    SIDE,
    SOLID_ANGLE,
    D,
    bin_directions,
    bin_of,
    hemisphere_from_square,
    square_from_hemisphere,
)

PROBE = """
__kernel void probe(__global const float *l, const uint n, __global int *bin, __global float *centre)
{
    uint i = get_global_id(0);
    if (i >= n) return;
    bin[i] = bin_of(load3(l, i));
    store3(bin_direction(i % D_BINS), centre, i);
}
"""


def random_directions(n: int, seed: int = 0) -> np.ndarray:
    """Unit vectors (n, 3), even over the upper hemisphere."""
    rng = np.random.default_rng(seed)
    z, phi = rng.random(n), 2 * np.pi * rng.random(n)
    s = np.sqrt(1 - z * z)
    return np.stack([s * np.cos(phi), s * np.sin(phi), z], 1)


def test_every_bin_has_the_same_solid_angle() -> None:
    """The map's Jacobian is 2 pi / 4 everywhere; where wedges meet it is the limit from either side."""
    square = np.random.default_rng(0).uniform(-0.999, 0.999, (5000, 2))
    square = square[np.abs(np.abs(square[:, 0]) - np.abs(square[:, 1])) > 1e-4]
    h = 1e-6
    du, dv = (
        (hemisphere_from_square(square + s) - hemisphere_from_square(square - s)) / (2 * h)
        for s in ([h, 0], [0, h])
    )
    jacobian = np.cross(du, dv)
    np.testing.assert_allclose(np.linalg.norm(jacobian, axis=1), np.pi / 2, rtol=1e-5)
    outward = np.sum(jacobian * hemisphere_from_square(square), 1)
    assert (outward > 0).all()  # it does not turn over either
    assert D == SIDE**2 == 1024
    np.testing.assert_allclose(SOLID_ANGLE * D, 2 * np.pi)


def test_directions_fall_into_bins_evenly_as_the_textbook_says() -> None:
    l = random_directions(200_000)
    got, expected = bin_of(l), square_cells(l)
    assert (got == expected).mean() > 0.99999  # the last digit decides on the border
    counts = np.bincount(got, minlength=D)
    chi2 = ((counts - len(l) / D) ** 2 / (len(l) / D)).sum()
    assert abs(chi2 - D) < 5 * np.sqrt(2 * D)


def test_square_and_hemisphere_are_inverse() -> None:
    l = random_directions(2000)
    np.testing.assert_allclose(hemisphere_from_square(square_from_hemisphere(l)), l, atol=1e-7)
    edge = np.linspace(-1, 1, 9)
    square = np.stack(np.meshgrid(edge, edge), -1).reshape(-1, 2)  # diagonals, axes, corners, centre
    np.testing.assert_allclose(square_from_hemisphere(hemisphere_from_square(square)), square, atol=1e-7)
    np.testing.assert_allclose(hemisphere_from_square(np.zeros(2)), [0, 0, 1], atol=1e-12)
    rim = hemisphere_from_square(square[np.abs(square).max(1) == 1])
    np.testing.assert_allclose(rim[:, 2], 0, atol=1e-12)


@pytest.mark.parametrize("side", [SIDE, SIDE // 2])
def test_centres_lie_in_their_bins_and_mirror_by_a_permutation(side: int) -> None:
    centre = bin_directions(side)
    np.testing.assert_allclose(np.linalg.norm(centre, axis=1), 1, atol=1e-12)
    assert (centre[:, 2] > 0).all()
    np.testing.assert_array_equal(bin_of(centre, side), np.arange(side**2))
    np.testing.assert_allclose(centre[::-1], centre * [-1, -1, 1], atol=1e-12)
    with pytest.raises(ValueError, match="read-only"):
        centre[0] = 0


def test_centres_integrate_the_cosine_and_its_square() -> None:
    z = bin_directions()[:, 2]
    assert z.sum() * SOLID_ANGLE == pytest.approx(np.pi, rel=3e-3)
    assert (z**2).sum() * SOLID_ANGLE == pytest.approx(2 * np.pi / 3, rel=4e-3)


def test_what_lies_below_the_horizon_goes_to_its_rim() -> None:
    rim = random_directions(500, 3) * [1, 1, 0]
    rim /= np.linalg.norm(rim, axis=1, keepdims=True)
    below = rim - [0, 0, 0.4]
    np.testing.assert_array_equal(bin_of(below), bin_of(rim))
    y, x = np.divmod(bin_of(below), SIDE)
    assert ((np.minimum(x, y) == 0) | (np.maximum(x, y) == SIDE - 1)).all()
    assert 0 <= bin_of(np.zeros((1, 3)))[0] < D


def test_the_device_has_the_same_bins(device: Device) -> None:
    n = 4 * D + 77
    l = random_directions(n, 5)
    l[:D] = bin_directions()
    l[D : D + 200, 2] *= -1
    program: Any = cl.Program(device.context, kernel_source("common") + PROBE).build(["-cl-std=CL1.2"])
    bin_d, centre_d = device.empty((n,), np.int32), device.empty((n, 3), np.float32)
    l_d = device.upload(l.astype(np.float32))
    program.probe(device.queue, (n + 43,), None, l_d.data, np.uint32(n), bin_d.data, centre_d.data)
    got = device.download(bin_d)
    assert (got != bin_of(l)).sum() <= 3  # on borders
    np.testing.assert_array_equal(got[:D], np.arange(D))
    np.testing.assert_allclose(device.download(centre_d)[:D], bin_directions(), atol=1e-6)
