"""Intervals hold the truth about as often as they say, for painters whose errors follow known distributions."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from kit.dull_tables import BEFORE, N, dull_tables

from usdslf.inference.bilinear import Tables, swatches
from usdslf.inference.candidate import Candidate
from usdslf.inference.paint_errors import refit_as_painted
from usdslf.inference.residuals import relative_scale
from usdslf.inference.solve import refit, refit_problem
from usdslf.inference.uncertainty import interval, probabilities
from usdslf.inference.weights import Options
from usdslf.inference.whitening import whiten
from usdslf.surfaces.reflectance import moved_roughness

TRUE = np.array([0.12, -0.05, 0.2])  # change of the diffuse colour


@pytest.mark.parametrize(("shared", "own"), [(1.0, 0.3), (0.05, 0.05), (0.3, 1.0)])
def test_intervals_hold_the_truth_nine_times_of_ten(shared: float, own: float) -> None:
    """Errors of drift and tint (`shared`) and of single dabs (`own`), as multiples of the usual variances."""
    rng, o = np.random.default_rng(3), Options()
    inside, half = [], []
    for _ in range(400):
        t = dull_tables(rng)
        wanted = t.dabs.p[:, 0] + TRUE * t.dabs.u[:, 0]
        cov = shared * shared_errors(t, o) + own * o.dab_error**2 * np.eye(3 * N)
        root = np.linalg.cholesky(cov + 1e-12 * np.eye(3 * N))  # the same draws with any LAPACK
        error = (root @ rng.standard_normal(3 * N)).reshape(N, 3)
        t = replace(t, target=wanted + error * relative_scale(wanted), scale=relative_scale(wanted))
        found = refit_as_painted(t, o, refit(refit_problem(t, o), Candidate(("diffuse",), level=0, freedoms=3)))
        low, high = interval(t, o, found).diffuse
        inside += list((low <= BEFORE + TRUE) & (high >= BEFORE + TRUE))
        half.append(float((high - low).mean() / 2))
    share = float(np.mean(inside))
    assert 0.82 <= share <= 0.98, (share, np.mean(half))



def shared_errors(t: Tables, o: Options) -> np.ndarray:
    """Covariance (3n, 3n) of drift over the stroke and of its tint, as fit.py states it."""
    gap = np.linalg.norm(t.place[:, None] - t.place[None], axis=-1)
    same = t.stroke[:, None] == t.stroke[None]
    length = o.drift_length * np.array([gap[i][same[i]].max() for i in range(len(gap))])
    length = np.array([max(length[same[i]]) for i in range(len(gap))])
    drift = same * np.exp(-0.5 * (gap / length[:, None]) ** 2) * o.drift_error**2
    return np.kron(drift, np.ones((3, 3))) + np.kron(same * o.tint_error**2, np.eye(3))


def test_exact_paint_has_narrow_intervals_and_what_is_not_freed_none() -> None:
    t = dull_tables(np.random.default_rng(4))
    wanted = t.dabs.p[:, 0] + TRUE * t.dabs.u[:, 0]
    t = replace(t, target=wanted, scale=relative_scale(wanted))
    found = refit_as_painted(t, Options(), refit(refit_problem(t), Candidate(("diffuse",), level=0, freedoms=3)))
    got = interval(t, Options(), found)
    assert (got.diffuse[1] - got.diffuse[0]).max() < 0.06
    np.testing.assert_array_equal(got.specular[0], got.specular[1])
    np.testing.assert_array_equal(got.roughness, [[0.5], [0.5]])


def test_whitened_errors_are_those_of_the_whole_covariance_dab_by_dab() -> None:
    rng, o = np.random.default_rng(5), Options()
    t = replace(dull_tables(rng), swatch=np.where(np.arange(N) < 4, 0, -1), stroke=np.arange(N) % 2)
    alike = np.kron((t.swatch[:, None] == 0) & (t.swatch[None] == 0), np.eye(3))
    cov = shared_errors(t, o) + o.dab_error**2 * np.eye(3 * N)
    cov += o.flat_error**2 * (alike * np.eye(3 * N) - alike / 4)
    white, r = whiten(t, o), rng.standard_normal(3 * N)
    np.testing.assert_allclose(white @ (white @ cov).T, np.eye(3 * N), atol=1e-7)
    np.testing.assert_allclose(white @ np.eye(3 * N), white.matrix, atol=1e-12)
    expected = np.linalg.solve(np.linalg.cholesky(cov), r)
    for found in (white @ r, whiten(t, replace(o, tail=9.0)) @ r):
        squares = [(x.reshape(-1, 3) ** 2).sum(1) for x in (found, expected)]
        np.testing.assert_allclose(*squares, rtol=1e-6)
    other = whiten(t, replace(o, dab_error=2 * o.dab_error))
    assert np.abs(other.matrix - white.matrix).max() > 0.1 * np.abs(white.matrix).max()


def test_dabs_of_a_swatch_are_found_and_gradients_are_none() -> None:
    red, blue = [0.5, 0.1, 0.1], [0.1, 0.1, 0.5]
    got = swatches(np.array([red, blue, red, red, [0.3, 0.3, 0.3]]), False)
    assert (got == got[0]).tolist() == [True, False, True, True, False]
    assert got[1] == got[4] == -1
    assert (swatches(np.linspace(0.1, 0.2, 30)[:, None] * np.ones(3), False) == -1).all()
    assert (swatches(np.full((4, 3), 0.2), True) == 0).all()
    palette = swatches(np.array([red] * 8 + [blue] * 6 + [[0.3, 0.3, 0.3]] * 2 + [[0.2, 0.3, 0.3]]), False)
    assert np.bincount(palette).tolist().count(0) == 0 and sorted(np.bincount(palette)) == [1, 2, 6, 8]


def test_probabilities_follow_costs() -> None:
    p = probabilities([5.0, 7.0, 50.0, None])
    assert p.sum() == pytest.approx(1)
    assert p[0] / p[1] == pytest.approx(np.e)
    assert p[2] < 1e-6 and p[3] == 0
    assert probabilities([None, None]).tolist() == [0.5, 0.5] and not len(probabilities([]))


def test_roughness_that_varies_moves_by_a_factor() -> None:
    """A metal part of .24 among .78 stays as much smoother as it was, where a term would make a mirror of it."""
    r = np.array([0.24, 0.78])
    np.testing.assert_allclose(moved_roughness(r, -0.255, 0.51), r / 2)
    np.testing.assert_allclose(moved_roughness(r, -0.2, 0.0), r - 0.2)
    assert moved_roughness(np.array([0.9]), 0.5, 0.5) == 1
