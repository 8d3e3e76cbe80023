"""The basis of the square's symmetries: orthogonal, and a matrix that commutes with them falls into its blocks."""

from __future__ import annotations

import numpy as np
import pytest
from kit.light_field_scenes import lone_elements, under_sky

from usdslf.gpu.device import Device
from usdslf.light_field.preconvolution import build_level, coarse_of_bin, fresnel_diffuse
from usdslf.light_field.symmetry import SIZES, H, blocks_of, folding, output_scale, unfolding
from usdslf.sampling.hemisphere import D, bin_directions

SIDE = 2 * H


def moved(square: np.ndarray, flip_y: bool, flip_x: bool, swap: bool) -> np.ndarray:
    square = square[:: -1 if flip_y else 1, :: -1 if flip_x else 1]
    return square.T if swap else square


def symmetries() -> list[np.ndarray]:
    """The eight permutations of the bins."""
    bins = np.arange(SIDE * SIDE).reshape(SIDE, SIDE)
    return [moved(bins, a, b, c).ravel() for a in (False, True) for b in (False, True) for c in (False, True)]


def of_blocks(blocks: np.ndarray) -> np.ndarray:
    """The matrix (Q, Q) between bins that has some blocks; the last one serves twice."""
    whole, at, first = np.zeros((SIDE * SIDE,) * 2), 0, 0
    for i, n in enumerate(SIZES):
        start = at if i < 5 else at - n * n
        whole[first : first + n, first : first + n] = blocks[start : start + n * n].reshape(n, n)
        at, first = start + n * n, first + n
    return unfolding() @ (whole / output_scale()[:, None]) @ folding()


def test_the_basis_is_orthogonal_and_complete() -> None:
    f = folding()
    np.testing.assert_allclose(f @ f.T, np.diag((f * f).sum(1)))
    np.testing.assert_allclose(unfolding() @ f, np.eye(SIDE * SIDE))
    assert sum(SIZES) == SIDE * SIDE


def test_a_matrix_that_commutes_with_the_symmetries_is_its_blocks() -> None:
    any_matrix = np.random.default_rng(1).random((SIDE * SIDE,) * 2)
    mean = np.mean([any_matrix[np.ix_(g, g)] for g in symmetries()], 0)
    np.testing.assert_allclose(of_blocks(blocks_of(mean)), mean, atol=1e-6)
    assert len(blocks_of(mean)) * 5.3 < 2 * mean.size  # the last one twice
    assert np.abs(of_blocks(blocks_of(any_matrix)) - any_matrix).max() > 0.3


@pytest.mark.parametrize("model", ["preview_surface", "phong"])
def test_the_columns_of_rough_levels_are_their_blocks(model: str, device: Device) -> None:
    level = build_level(device, model, 0.6)
    for matrix in (level.a, level.b, fresnel_diffuse(device, model)[0]):
        np.testing.assert_allclose(of_blocks(blocks_of(matrix)), matrix, atol=2e-7 * max(matrix.max(), 1e-3))


@pytest.mark.parametrize("roughness", [0.6, 0.3])
def test_a_bounce_is_the_product_with_the_whole_matrices(roughness: float, device: Device) -> None:
    """Light without any symmetry, colours in all weights; the matrices between bins in float64, without a basis."""
    n, rng = 20, np.random.default_rng(5)
    d, f0, f90 = rng.random((3, n, 3))
    light = rng.random((n, D, 3)) ** 3
    elements = lone_elements(n, roughness=np.full(n, roughness), diffuse=d, f0=f0, f90=f90)
    got = under_sky(device, elements, light.astype(np.float32))

    square = light.reshape(n, SIDE, 2, SIDE, 2, 3)
    coarse, of_bin = square.mean((2, 4)).reshape(n, -1, 3), coarse_of_bin()
    cosine = bin_directions()[:, 2]
    e_over_pi = np.einsum("d,ndc->nc", cosine / cosine.sum(), light)[:, None]
    matrix, scale = fresnel_diffuse(device, "preview_surface")
    y = (matrix.astype(float) @ coarse)[:, of_bin] * scale[:, None]
    wanted = (d * (1 - f0))[:, None] * (e_over_pi - y) + (d * (1 - f90))[:, None] * y
    level = build_level(device, "preview_surface", roughness)
    for weight, column, k in ((f0, level.a, 0), (f90, level.b, 1)):
        if level.coarse:
            lobe = (column.astype(float) @ coarse)[:, of_bin] * level.fine_scale[:, k, None]
        else:
            whole = np.zeros((D, D))
            whole[np.repeat(np.arange(D), np.diff(level.first)), level.tap] = column
            lobe = whole @ light
        wanted += weight[:, None] * lobe
    np.testing.assert_allclose(got, wanted, rtol=2e-5, atol=2e-6)
