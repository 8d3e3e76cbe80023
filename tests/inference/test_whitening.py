"""Products along grey and colours are those of the whole matrix."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from kit.dull_tables import N, dull_tables

import usdslf.inference.paint_errors
from usdslf.inference.bilinear import Bilinear
from usdslf.inference.candidate import Candidate
from usdslf.inference.paint_errors import as_shown, paint_errors, refit_as_painted
from usdslf.inference.residuals import relative_scale
from usdslf.inference.uncertainty import interval
from usdslf.inference.weights import Options
from usdslf.inference.whitening import MANY, White, white_of_parts, whiten


@pytest.mark.parametrize("swatches", [0, 5])
@pytest.mark.parametrize("painted", [False, True])
def test_products_are_those_of_the_whole_matrix(
    painted: bool, swatches: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    rng = np.random.default_rng(2)
    t = dull_tables(rng)
    alike = np.arange(N) < swatches
    t = replace(t, swatch=np.where(alike, 0, -1), has_one_color=alike, stroke=np.arange(N) // (N // 2))
    white = whiten(t, Options())
    if painted:  # of few dabs channels err by shares of their own
        monkeypatch.setattr(usdslf.inference.paint_errors, "MOST_GROUPS", 4)
        white = paint_errors(t, Options(), Candidate(("diffuse",), level=0, freedoms=3)).white
    assert white.whole is None
    whole = White(None, None, white.matrix)
    x = rng.standard_normal((3 * N, 4))
    np.testing.assert_allclose(white @ x, white.matrix @ x, atol=1e-9)
    np.testing.assert_allclose(white @ x[:, 0], white.matrix @ x[:, 0], atol=1e-9)
    y = rng.standard_normal(len(white.matrix))
    np.testing.assert_allclose(white.transposed(y), white.matrix.T @ y, atol=1e-9)
    tables = Bilinear(*(rng.random((N, 3, 3)) for _ in range(4)))
    share, change = rng.random((N, 3, 3)), rng.standard_normal((2, 3, 3))
    one, other = (a.of_tables(tables, t.target, share) for a in (white, whole))
    for name in ("rest", "u", "v", "w"):
        np.testing.assert_allclose(getattr(one, name), getattr(other, name), atol=1e-9)
    np.testing.assert_allclose(white.products_of_tables(tables, t.target, share), other.products(), atol=1e-8)
    off = tables.at_level(1).predict(change[0, 1], change[1, 1]) - t.target
    expected = white.matrix @ (share[:, 1] * off).ravel()
    np.testing.assert_allclose(one.at(*change)[1], expected, atol=1e-9)


def test_errors_that_differ_by_channel_are_whitened_as_a_whole() -> None:
    t = dull_tables(np.random.default_rng(3))
    t = replace(t, diffuse=np.array([1.0, 0.4, 0.2]))  # nothing more of red can be asked
    errors = paint_errors(t, Options(), Candidate(("diffuse",), level=0, freedoms=3))
    assert errors.white.whole is not None
    covariance = errors.white @ (errors.white @ errors.covariance).T
    np.testing.assert_allclose(covariance, np.eye(3 * N), atol=1e-8)


@pytest.mark.parametrize("error", [0.0, 0.08])
def test_channel_means_of_many_dabs_say_what_all_channels_do(error: float, monkeypatch: pytest.MonkeyPatch) -> None:
    """From MOST_GROUPS dabs on errors are those of the channels' means, along grey and colours: values and intervals
    are those of the whole covariance."""
    rng, true = np.random.default_rng(5), np.array([0.12, -0.05, 0.2])
    t = dull_tables(rng, 120)
    wave = 1 + error * np.sin(5 * t.place[:, :1])
    wanted = (t.before + true * t.dabs.u[:, 0]) * wave * (1 + 0.5 * error * rng.standard_normal((120, 3)))
    vague, doubt = t.before * [0.05, 0.1, 0.15], t.before[:, None] * rng.uniform(0, 0.02, (120, 3, 1))
    t = replace(t, target=wanted, scale=relative_scale(wanted), noise=vague, doubt=doubt)
    first = Candidate(("diffuse",), level=0, freedoms=3)
    found, ends, kinds = [], [], []
    for most in (96, 120):
        monkeypatch.setattr(usdslf.inference.paint_errors, "MOST_GROUPS", most)
        found.append(refit_as_painted(t, Options(), first))
        ends.append(interval(t, Options(), found[-1]).diffuse)
        kinds.append(paint_errors(as_shown(t, found[-1]), Options(), found[-1]).white.whole is None)
    assert kinds == [True, False]
    value = t.diffuse + true
    np.testing.assert_allclose(found[0].delta_diffuse, true, atol=0.005 + 0.3 * error)
    np.testing.assert_allclose(found[0].delta_diffuse, found[1].delta_diffuse, atol=0.003 + 0.1 * error)
    widths = [(high - low).mean() for low, high in ends]
    assert widths[0] == pytest.approx(widths[1], rel=0.15)
    assert ((ends[0][0] <= value) & (value <= ends[0][1])).all(), (ends[0], value)


@pytest.mark.parametrize("per_stroke", [3, 40])
def test_a_root_by_parts_whitens_as_the_whole_covariance_asks(per_stroke: int) -> None:
    """Dabs of three strokes that share brightness and a tint each, of unlike sizes; by the covariance written out."""
    rng, n = np.random.default_rng(5), 3 * per_stroke
    of = np.repeat(np.eye(3), per_stroke, 0)
    own, parts = rng.uniform(0.001, 0.1, n), np.concatenate([rng.uniform(0.01, 0.3, (n, 1)) * of, 0.02 * of], 1)
    drift = np.exp(-np.abs(np.subtract.outer(np.arange(n), np.arange(n))) / 20)
    white = white_of_parts(drift, own, parts)
    color = np.diag(own) + sum(np.outer(p, p) for p in parts.T)
    covariance = np.kron(drift, np.ones((3, 3))) + np.kron(color, np.eye(3))
    np.testing.assert_allclose(white.matrix @ covariance @ white.matrix.T, np.eye(3 * n), atol=1e-9)
    x = rng.standard_normal(3 * n)
    np.testing.assert_allclose(white.transposed(white @ x), np.linalg.solve(covariance, x), rtol=1e-7)


def test_many_dabs_are_whitened_by_their_covariance() -> None:
    """Of two strokes, and so many that channels count as alike."""
    rng = np.random.default_rng(6)
    t = dull_tables(rng, 6 * N)
    t = replace(t, stroke=np.arange(6 * N) % 2)
    errors = paint_errors(t, Options(), Candidate(("diffuse",), level=0, freedoms=3))
    assert errors.root.whole is None and len(errors.single) > MANY * 4
    whitened = errors.root.matrix @ errors.covariance @ errors.root.matrix.T
    np.testing.assert_allclose(whitened, np.eye(len(whitened)), atol=1e-8)
