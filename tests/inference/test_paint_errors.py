"""What a painter got wrong is read off the paint: dabs far off lose trust, careful paint is believed."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from kit.dull_tables import BEFORE, N, dull_tables

from usdslf.inference.bilinear import Tables
from usdslf.inference.candidate import Candidate
from usdslf.inference.paint_errors import as_shown, paint_errors, refit_as_painted
from usdslf.inference.residuals import relative_scale
from usdslf.inference.solve import refit, refit_problem, relative_error
from usdslf.inference.uncertainty import interval
from usdslf.inference.varying import BestConstant, VaryingAnswer, asks_to_vary
from usdslf.inference.weights import Options

TRUE = np.array([0.12, -0.05, 0.2])  # change of the diffuse colour
O = Options()


def painted(t: Tables, error: np.ndarray) -> tuple[Tables, Candidate]:
    """Tables of paint that is what the true change shows, times 1 + error (n, 3); the plain fit of it."""
    wanted = (t.dabs.p[:, 0] + TRUE * t.dabs.u[:, 0]) * (1 + error)
    t = replace(t, target=wanted, scale=relative_scale(wanted))
    return t, refit(refit_problem(t, O), Candidate(("diffuse",), level=0, freedoms=3))


def specular_tables(t: Tables) -> Tables:
    """The tables with a highlight on some of the dabs, for which the specular colour would have to change."""
    light = np.zeros((N, 1, 3))
    light[::3] = 4.0
    return replace(t, dabs=replace(t.dabs, p=t.dabs.p + 0.04 * light, v=light))


def test_drift_is_heard_for_its_contrast_and_not_for_its_mean() -> None:
    """A highlight a little apart from its neighbours says more than brightness that drifts over the stroke."""
    off, plain = [], []
    for seed in range(12):
        rng = np.random.default_rng(seed)
        t = specular_tables(dull_tables(rng))
        wave = 0.15 * np.sin(5 * t.place[:, :1] + rng.uniform(0, 6)) * np.ones(3)
        wanted = (t.dabs.p[:, 0] + 0.1 * t.dabs.v[:, 0]) * (1 + wave)
        t = replace(t, target=wanted, scale=relative_scale(wanted))
        first = refit(refit_problem(t, O), Candidate(("specular",), level=0, freedoms=1))
        found = refit_as_painted(t, O, first)
        off.append(abs(found.delta_f0[0] - 0.1))
        plain.append(abs(first.delta_f0[0] - 0.1))
    assert np.mean(off) < 0.7 * np.mean(plain), (np.mean(off), np.mean(plain))


def test_a_stroke_that_is_too_dark_is_no_weaker_highlight() -> None:
    """Of a dark dab, whose residual has a floor, darkness of the whole stroke is less than of a bright one."""
    moved = []
    for seed in range(12):
        rng = np.random.default_rng(seed)
        t = specular_tables(dull_tables(rng))
        found = []
        wave = 0.1 * np.sin(5 * t.place[:, :1] + rng.uniform(0, 6)) * np.ones(3)
        for bright in (1.0, 0.72):
            wanted = bright * (t.dabs.p[:, 0] + 0.3 * t.dabs.v[:, 0]) * (1 + wave)
            u = replace(t, target=wanted, scale=relative_scale(wanted))
            first = refit(refit_problem(u, O), Candidate(("specular",), level=0, freedoms=1))
            found.append(refit_as_painted(u, O, first).delta_f0[0])
        moved.append(abs(found[1] - found[0]))
        assert abs(found[0] - 0.3) < 0.01, found
    assert np.mean(moved) < 0.017, moved


def test_dabs_that_few_points_are_known_of_allow_more() -> None:
    t, first = painted(dull_tables(np.random.default_rng(4)), np.zeros((N, 3)))
    found = refit_as_painted(t, O, first)
    known, vague = (interval(replace(t, noise=noise * t.target), O, found).diffuse for noise in (0.0, 0.2))
    assert ((vague[1] - vague[0]) > 1.5 * (known[1] - known[0])).all()


def test_careful_paint_makes_a_specular_coloured_and_a_tint_does_not() -> None:
    wave = 0.1 * np.sin(5 * dull_tables(np.random.default_rng(9)).place[:, :1]) * np.ones(3)
    for change, error, is_colored in (
        ([0.31, 0.26, 0.16], 0 * wave, True),
        ([0.25, 0.25, 0.25], 0 * wave, False),
        ([0.25, 0.25, 0.25], wave + np.array([0.05, -0.02, -0.03]), False),
    ):
        t = specular_tables(dull_tables(np.random.default_rng(9)))
        wanted = (t.dabs.p[:, 0] + np.array(change) * t.dabs.v[:, 0]) * (1 + error)
        t = replace(t, target=wanted, scale=relative_scale(wanted))
        grey = refit(refit_problem(t, O), Candidate(("specular",), level=0, freedoms=1))
        found = refit_as_painted(t, O, grey)
        assert (np.ptp(found.delta_f0) > 0.05) == is_colored, (change, found.delta_f0)
        np.testing.assert_allclose(found.delta_f0, change, atol=0.06)


def test_sizes_of_errors_follow_the_paint() -> None:
    rng = np.random.default_rng(2)
    t = dull_tables(rng)
    wave = np.sin(5 * t.place[:, :1]) * np.ones(3)
    seen = []
    grey = 0.05 * rng.standard_normal((N, 1)) + 0.02 * rng.standard_normal((N, 3))
    for error in (0 * wave, 0.12 * wave, 0.06 * rng.standard_normal((N, 3)), grey):
        u, first = painted(t, error)
        seen.append(paint_errors(as_shown(u, first), O, first))
    exact, drift, rough, grey_dabs = seen
    assert exact.alike < 0.1 < drift.alike
    assert exact.own < 0.2 and drift.own < 0.2 < rough.own
    assert grey_dabs.alike < drift.alike and grey_dabs.grey > 0.4


def test_a_dab_that_is_far_off_loses_its_trust_and_moves_nothing() -> None:
    error = np.zeros((N, 3))
    error[7] = 1.5
    t, first = painted(dull_tables(np.random.default_rng(5)), error)
    found = refit_as_painted(t, O, first)
    np.testing.assert_allclose(found.diffuse_of(BEFORE), BEFORE + TRUE, atol=0.01)
    trust = paint_errors(as_shown(t, found), O, found).trust
    assert trust[t.group[7]] < 0.2 and np.delete(trust, t.group[7]).min() > 0.5


def test_paint_may_be_too_dark_more_easily_than_too_bright() -> None:
    rng = np.random.default_rng(6)
    t = dull_tables(rng)
    t, first = painted(t, 0.1 * np.sin(5 * t.place[:, :1]) * np.ones(3))
    found = refit_as_painted(t, O, first)
    low, high = interval(t, O, found).diffuse
    value = found.diffuse_of(BEFORE)
    assert (high - value > 1.3 * (value - low)).all()


def test_one_colour_over_uneven_light_is_no_wish_to_vary() -> None:
    """The constant that meets the mean of one colour is off at every dab, which the painter did not say."""
    t = dull_tables(np.random.default_rng(8))
    t = replace(t, dabs=replace(t.dabs, p=t.dabs.p**4, u=4 * t.dabs.u**4))
    mean = (t.dabs.p[:, 0] + 0.1 * t.dabs.u[:, 0]).mean(0) * np.ones((N, 3))
    one = np.zeros(N, np.int64)
    t = replace(t, target=mean, scale=relative_scale(mean), swatch=one, has_one_color=np.ones(N, bool))
    exact = VaryingAnswer(Candidate(("diffuse",), cost=1e9), None, 0.0)  # type: ignore[arg-type]
    constant = Candidate(("diffuse",), np.full(3, 0.1), level=0, freedoms=3)
    assert relative_error(t, constant) > 0.5
    assert not asks_to_vary(exact, BestConstant(t, O, constant))
    apart = replace(t, swatch=np.full(N, -1), has_one_color=~t.has_one_color)
    assert asks_to_vary(exact, BestConstant(apart, O, constant))
