"""The rule of relative residuals, by hand, and that one candidate is foreseen alike wherever it is asked about."""

from __future__ import annotations

import numpy as np
import pytest

from usdslf.inference.bilinear import Bilinear, Tables
from usdslf.inference.candidate import Candidate
from usdslf.inference.residuals import mean_by_stroke, relative_rms, relative_scale

N, LEVELS = 5, 2


def test_a_residual_is_relative_to_the_target_and_a_tenth_of_the_mean() -> None:
    target = np.array([[1.0, 2.0, 3.0], [0.0, 0.0, 0.0]])
    np.testing.assert_allclose(relative_scale(target), target + 0.1, atol=2e-6)
    np.testing.assert_allclose(relative_scale(-target), target + 0.1, atol=2e-6)
    assert relative_scale(np.zeros((1, 3))).min() > 0
    scale = np.array([[2.0, 2.0, 2.0], [1.0, 1.0, 1.0]])
    assert relative_rms(target + scale * [[3, 3, 3], [4, 4, 4]], target, scale) == pytest.approx(np.sqrt(12.5))


def test_black_paint_is_relative_to_what_it_covers() -> None:
    target = np.array([[0.0] * 3, [0.0] * 3, [0.4, 0.5, 0.6]])
    covered = np.full((3, 3), 0.25)
    np.testing.assert_allclose(mean_by_stroke(target, np.array([0, 0, 1]), covered), [0.25, 0.25, 0.5])


def tables(rng: np.random.Generator) -> Tables:
    """Tables of any numbers, whose d and F0 vary from dab to dab."""
    rows = lambda: rng.random((N, LEVELS, 3))  # noqa: E731
    d, f0 = rng.random((2, N, 1, 3))
    b = Bilinear(rows(), rows(), rows(), rows())
    target = rng.random((N, 3))
    return Tables(
        target=target, scale=relative_scale(target), place=rng.random((N, 3)), stroke=np.zeros(N, np.int64),
        has_one_color=np.zeros(N, bool), dabs=b, factor_u=b.u * d, factor_w=b.w * d, factor_v=b.v * f0,
        swatch=np.full(len(target), -1),
        background=Bilinear.empty(LEVELS), background_scale=np.zeros((0, 3)), elsewhere=Bilinear.empty(LEVELS),
        dab_levels=rng.random((N, LEVELS)), levels=np.array([0.2, 0.5]), diffuse=d.mean((0, 1)), f0=f0.mean((0, 1)),
        roughness=0.5, is_metal=False, is_textured=True, is_textured_f0=True,
    )  # fmt: skip


@pytest.mark.parametrize("freed", [("diffuse",), ("specular",), ("diffuse", "specular")])
def test_a_factor_changes_each_dab_by_its_own_colour(freed: tuple[str, ...]) -> None:
    """A factor on d, or where d is kept one on F0; of both, the one on d, with F0 by a term."""
    t = tables(np.random.default_rng(1))
    d, f0 = (t.factor_u / t.dabs.u)[:, 0], (t.factor_v / t.dabs.v)[:, 0]
    g, h = np.array([0.3, -0.2, 0.5]) * ("diffuse" in freed), np.array([0.1, 0.4, -0.3]) * ("specular" in freed)
    found = Candidate(freed, g, h, is_factor=True, level=1).radiance(t)
    dd, df = g * d, h if "diffuse" in freed else h * f0
    b = t.dabs.at_level(1)
    np.testing.assert_allclose(found, b.p + dd * b.u + df * b.v - dd * df * b.w)
