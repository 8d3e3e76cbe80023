"""Bounded least squares against scipy's lsq_linear, an active set method with a proof."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import lsq_linear

from usdslf.inference.least_squares import bounded_least_squares

ROWS = 37


def problem(rng: np.random.Generator, unknowns: int, parallel: float) -> tuple[np.ndarray, np.ndarray]:
    """A matrix (ROWS, unknowns) whose columns have `parallel` of a common one in them, and a right side."""
    a = rng.normal(size=(ROWS, unknowns)) + parallel * rng.normal(size=(ROWS, 1))
    return a, a @ rng.uniform(-0.5, 1.5, unknowns) + 0.1 * rng.normal(size=ROWS)


@pytest.mark.parametrize("unknowns", [1, 3, 6])
@pytest.mark.parametrize("parallel", [0.0, 3.0])
def test_bounds_that_are_not_met_do_not_matter(unknowns: int, parallel: float) -> None:
    rng = np.random.default_rng(unknowns)
    for _ in range(20):
        a, b = problem(rng, unknowns, parallel)
        wide = np.full(unknowns, 50.0)
        expected = lsq_linear(a, b).x
        np.testing.assert_allclose(bounded_least_squares(a, b, -wide, wide), expected, rtol=1e-6, atol=1e-6)


def test_channels_that_do_not_meet_are_bounded_each_by_itself() -> None:
    """As the three channels of a colour: no row has two of them."""
    rng = np.random.default_rng(2)
    for _ in range(50):
        a = np.zeros((20, 3, 3))
        a[:, range(3), range(3)] = rng.normal(size=(20, 3))
        a, low = a.reshape(-1, 3), rng.uniform(-1, 0, 3)
        b = a @ rng.uniform(-2, 2, 3) + 0.1 * rng.normal(size=60)
        expected = lsq_linear(a, b, (low, low + 1), tol=1e-12).x
        np.testing.assert_allclose(bounded_least_squares(a, b, low, low + 1), expected, atol=1e-6)


def test_one_unknown_that_meets_its_bound_leaves_the_best_of_the_others() -> None:
    rng = np.random.default_rng(3)
    compared = 0
    for _ in range(200):
        a, b = problem(rng, 4, 3.0)
        low, high = np.full(4, -0.3), np.full(4, 1.3)
        exact = lsq_linear(a, b, (low, high), tol=1e-12)
        loose = lsq_linear(a, b).x
        outside = (loose < low) | (loose > high)
        if outside.sum() != 1 or not np.array_equal(outside, exact.active_mask != 0):
            continue
        compared += 1
        np.testing.assert_allclose(bounded_least_squares(a, b, low, high), exact.x, atol=1e-6)
    assert compared > 20


@pytest.mark.parametrize("parallel", [0.0, 3.0])
def test_it_stays_within_bounds_and_is_never_better_than_the_best(parallel: float) -> None:
    """What is fixed on a bound is not let go again: the price of that is bounded where columns are not parallel."""
    rng = np.random.default_rng(4)
    excess = []
    for _ in range(100):
        a, b = problem(rng, 6, parallel)
        x = bounded_least_squares(a, b, np.zeros(6), np.ones(6))
        assert x.min() >= 0 and x.max() <= 1
        best = lsq_linear(a, b, (0, 1), tol=1e-12).x
        excess.append(((a @ x - b) ** 2).sum() / ((a @ best - b) ** 2).sum() - 1)
    assert min(excess) > -1e-9
    assert np.median(excess) < 1e-9
    assert max(excess) < (0.1 if parallel == 0 else np.inf)
