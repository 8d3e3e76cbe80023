"""Propagation and upsampling: against float64 forms pair by pair, and what they promise at the edges."""

from __future__ import annotations

import numpy as np
import pytest
from reference import propagate as ref

from usdslf.errors import InputError
from usdslf.similarity.similarity import Places, Weights, gate, most_similar, reach_of, shares, similarity
from usdslf.similarity.upsample import upsample


def some(n: int, seed: int) -> Places:
    rng = np.random.default_rng(seed)
    normal = rng.normal(size=(n, 3))
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    return Places(rng.random((n, 3)), normal, rng.random((n, 7)) * 0.2)


def as_tuples(p: Places) -> list:
    return list(zip(p.position, p.normal, p.reflectance))


def propagated(
    x: Places, y: Places, values: object, reach: float, weights: Weights | None = None, gated: bool = True
) -> np.ndarray:
    """The change of places from that of painted ones."""
    share, opened = shares(x, y, reach, weights)
    return share @ np.asarray(values, float) * (opened[:, None] if gated else 1)


@pytest.mark.parametrize("w", [(1, 0.5, 2), (1, 0, 0), (0, 1, 0), (0, 0, 3.0)])
def test_similarity_and_propagation_are_the_formula(w: tuple) -> None:
    x, y = some(67, 1), some(5, 2)
    s = similarity(x, y, 0.2, Weights(*w))
    expected = [[ref.similarity(*a, *b, 0.2, w) for b in as_tuples(y)] for a in as_tuples(x)]
    np.testing.assert_allclose(s, expected, rtol=1e-12)
    assert s.min() >= 0 and s.max() <= 1
    values = np.random.default_rng(3).normal(size=(5, 3))
    got = propagated(x, y, values, 0.2, Weights(*w))
    np.testing.assert_allclose(got, ref.propagated(as_tuples(x), as_tuples(y), values, 0.2, w), atol=1e-12)
    np.testing.assert_allclose(most_similar(x, y, 0.2, Weights(*w)), s.max(1))


def test_a_place_is_most_like_itself_and_similarity_is_symmetric() -> None:
    x = some(20, 4)
    s = similarity(x, x, 0.1)
    np.testing.assert_allclose(np.diag(s), 1)
    np.testing.assert_allclose(s, s.T)
    assert (gate(np.diag(s)) == 1).all() and gate(0.0) == 0


def test_one_painted_place_gives_its_own_change_wherever_the_gate_is_open() -> None:
    x, y = some(30, 5), some(1, 6)
    got = propagated(x, y, [[0.3, -0.1, 0.2]], 0.2, gated=False)
    np.testing.assert_allclose(got, np.tile([0.3, -0.1, 0.2], (30, 1)))
    far = Places(x.position + 100, -np.abs(y.normal).repeat(30, 0), x.reflectance + 5)
    assert not propagated(far, y, [[1.0]], 0.2).any()


def test_a_mean_stays_between_what_was_painted() -> None:
    x, y = some(200, 7), some(9, 8)
    values = np.random.default_rng(9).random((9, 3))
    got = propagated(x, y, values, 0.1, gated=False)
    assert (got >= values.min(0) - 1e-12).all() and (got <= values.max(0) + 1e-12).all()


def test_nothing_painted_changes_nothing() -> None:
    x, y = some(4, 1), some(0, 1)
    assert not propagated(x, y, np.zeros((0, 3)), 0.1).any() and not most_similar(x, y, 0.1).any()
    assert reach_of(np.zeros((1, 3)), 0.25) == 0.25


@pytest.mark.parametrize("w", [(0, 0, 0), (-1, 1, 1), (np.nan, 1, 1)])
def test_weights_that_mean_nothing_are_refused(w: tuple) -> None:
    with pytest.raises(InputError, match="similarity weights"):
        Weights(*w)


def checker(n: int, cells: int = 4, seed: int = 0) -> tuple[Places, np.ndarray]:
    """n places on a flat square whose reflectance is a checker; and which cells are dark."""
    at = np.random.default_rng(seed).random((n, 2))
    dark = (np.floor(at * cells).sum(1) % 2).astype(bool)
    reflectance = np.where(dark[:, None], 0.1, 0.6) * np.ones((1, 7))
    position = np.stack([at[:, 0], 0 * at[:, 0], at[:, 1]], 1)
    return Places(position, np.tile([0.0, 1, 0], (n, 1)), reflectance), dark


def test_upsampling_is_the_joint_bilateral_mean() -> None:
    known, _ = checker(14, seed=3)
    x, _ = checker(50, seed=4)
    values = np.random.default_rng(5).random((14, 3))
    got = upsample(x, known, values, 0.2)
    expected = ref.upsampled(as_tuples(x), as_tuples(known), values, 0.2)
    np.testing.assert_allclose(got, expected, atol=2e-3)


def test_appearance_keeps_a_change_within_its_texture_and_position_alone_leaks() -> None:
    """Figure 13: the dark cells change, the light ones do not."""
    known, dark = checker(900, seed=1)
    x, x_dark = checker(4000, seed=2)
    change = np.where(dark[:, None], [[0.5, 0.0, 0.2]], 0.0)
    truth = np.where(x_dark[:, None], [[0.5, 0.0, 0.2]], 0.0)
    with_, without = (np.abs(upsample(x, known, change, 1 / 30, a) - truth).max(1) for a in (True, False))
    assert with_.max() < 0.01
    assert (without > 0.1).mean() > 0.1  # leaks around all edges
    assert with_.mean() < 0.01 * without.mean()


def test_a_constant_change_is_upsampled_to_itself() -> None:
    known, _ = checker(100, seed=1)
    x, _ = checker(300, seed=2)
    np.testing.assert_allclose(upsample(x, known, np.full((100, 2), 0.25), 0.1), 0.25)
