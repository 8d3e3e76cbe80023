"""The painters of the recovery suite paint what they say, the same each time."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from truth.recovery.cases import CASES
from truth.recovery.painters import FEW, PAINTERS, SWATCHES, painted
from truth.recovery.run_recovery import AIMED_AT, read_truth

from usdslf.color import BUILT_IN, USD_DEFAULT_SPACE, color_of

SOME = CASES[:12]


@pytest.fixture(params=SOME, ids=lambda case: case.name)
def truth(request: pytest.FixtureRequest) -> dict[str, Any]:
    return read_truth(request.param)


def exact_of(truth: dict[str, Any]) -> np.ndarray:
    return np.array(truth["colors"]["exact"])


@pytest.mark.parametrize("way", PAINTERS)
def test_painting_again_gives_the_same(truth: dict[str, Any], way: str) -> None:
    first, again = painted(truth, way), painted(truth, way)
    np.testing.assert_array_equal(first[0], again[0])
    np.testing.assert_array_equal(first[1], again[1])
    assert np.isfinite(first[1]).all()
    assert (first[1] >= 0).all()
    assert first[1].shape == (len(first[0]), 3)


def test_few_are_six_of_the_uneven_dabs(truth: dict[str, Any]) -> None:
    chosen, colors = painted(truth, "few")
    assert len(set(chosen.tolist())) == FEW
    np.testing.assert_array_equal(colors, np.array(truth["colors"]["uneven"])[chosen])


def test_swatches_are_three_and_each_dab_has_the_nearest(truth: dict[str, Any]) -> None:
    _, colors = painted(truth, "swatch")
    exact = exact_of(truth)
    palette = np.unique(colors, axis=0)
    assert len(palette) == SWATCHES
    distance = ((np.log(np.maximum(exact, 1e-5))[:, None] - np.log(palette)) ** 2).sum(2)
    own = ((np.log(np.maximum(exact, 1e-5)) - np.log(colors)) ** 2).sum(1)
    np.testing.assert_allclose(own, distance.min(1), atol=1e-12)
    for color in palette:  # the middle, in log space, of those that it stands for
        mine = np.log(np.maximum(exact, 1e-5))[(colors == color).all(1)]
        np.testing.assert_allclose(np.log(color), mine.mean(0), atol=1e-9)


def test_dark_is_the_uneven_paint_times_one_factor(truth: dict[str, Any]) -> None:
    ratio = painted(truth, "dark")[1] / np.array(truth["colors"]["uneven"])
    assert np.ptp(ratio) < 1e-9
    assert 0.7 <= ratio.mean() <= 1


def test_strokes_are_darkened_differently() -> None:
    factors = [painted(t, "dark")[1].sum() / np.sum(t["colors"]["uneven"]) for t in map(read_truth, CASES)]
    assert np.std(factors) > 0.05
    assert abs(np.mean(factors) - 0.85) < 0.04


def test_display_picks_are_codes_of_8_bit() -> None:
    color = color_of(BUILT_IN, USD_DEFAULT_SPACE)
    truths = [read_truth(case) for case in SOME]
    exact = np.concatenate([exact_of(t) for t in truths]).astype(np.float32)
    picks = np.concatenate([painted(t, "display")[1] for t in truths]).astype(np.float32)
    shown = 255 * np.clip(color.display(exact), 0, 1)
    clear = ((shown > 8) & (shown < 250)).all(1)  # codes next to black have no inverse
    codes = 255 * color.display(picks)[clear]
    assert len(codes) > 150
    assert np.abs(codes - codes.round()).max() < 0.05
    assert np.abs(codes - shown[clear]).max() < 0.55
    assert (np.abs(picks - exact).max(1) > 0).mean() > 0.9


def test_uneven_paint_that_is_not_saved_is_drawn(truth: dict[str, Any]) -> None:
    exact = exact_of(truth)
    bare = {"name": truth["name"], "xy": truth["xy"], "colors": {"exact": truth["colors"]["exact"]}}
    ratio = painted(bare, "uneven")[1] / np.maximum(exact, 1e-9)
    tint = ratio.mean(0) / ratio.mean()
    assert 0.02 < tint.std() < 0.08
    wave = (ratio / tint).mean(1) - 1
    assert 0.03 < np.sqrt(np.mean(wave**2)) < 0.2
    np.testing.assert_array_equal(painted(bare, "few")[1], painted(bare, "uneven")[1][painted(bare, "few")[0]])


def test_every_painter_has_an_aim_and_unknown_ones_are_refused(truth: dict[str, Any]) -> None:
    assert set(AIMED_AT["clean"]) == set(PAINTERS)
    with pytest.raises(ValueError, match="no painter smudge"):
        painted(truth, "smudge")
