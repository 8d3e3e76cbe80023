"""Comparison: modes toggle, looks are flipped through in a ring, the difference is in scene-linear light."""

from __future__ import annotations

import numpy as np

from hydra_viewer.model.comparison import BEFORE, MOST_GAIN, Comparison, difference
from hydra_viewer.model.found import Found
from usdslf import Solution


def test_a_mode_is_left_by_asking_for_it_again_and_listeners_hear_of_changes_only() -> None:
    comparison, told = Comparison(), []
    comparison.changed.connect(lambda: told.append(comparison.state.mode))
    comparison.toggle("wipe")
    comparison.toggle("difference")
    comparison.set(mode="difference")
    comparison.toggle("difference")
    assert told == ["wipe", "difference", "now"]


def test_split_and_gain_stay_in_range() -> None:
    comparison = Comparison()
    comparison.set(split=1.7, gain=1e9)
    assert (comparison.state.split, comparison.state.gain) == (1.0, MOST_GAIN)
    comparison.set(split=-1, gain=0)
    assert (comparison.state.split, comparison.state.gain) == (0.0, 1.0)


def test_kept_looks_are_flipped_through_and_back() -> None:
    comparison, one, two = Comparison(), Found((), Solution()), Found((), Solution())
    assert [comparison.keep(found).name for found in (one, two)] == ["Look 1", "Look 2"]
    shown = []
    for _ in range(4):
        comparison.flip(1)
        shown.append((comparison.state.mode, comparison.state.with_, comparison.other))
    assert shown[:3] == [("other", BEFORE, None), ("other", "Look 1", one), ("other", "Look 2", two)]
    assert shown[3][0] == "now"
    comparison.flip(-1)
    assert comparison.other is two


def test_a_look_that_is_forgotten_is_no_longer_compared_with_and_its_number_is_free() -> None:
    comparison = Comparison()
    comparison.keep(None)
    comparison.set(with_="Look 1")
    comparison.drop("Look 1")
    assert comparison.state.with_ == BEFORE and comparison.snapshots == ()
    assert comparison.keep(None).name == "Look 1"
    comparison.clear()
    assert comparison.snapshots == ()


def test_a_difference_is_absolute_and_gained_and_sizes_may_differ() -> None:
    now = np.zeros((4, 6, 3), np.float32)
    now[..., 0], now[:, 3:, 1] = 0.5, 0.25
    other = np.full((2, 3, 3), 0.25, np.float32)
    apart = difference(now, other, 4.0)
    assert apart.shape == (4, 6, 3)
    assert (apart[..., 0] == 1).all() and (apart[:, 3:, 1] == 0).all() and (apart[:, :3, 1] == 1).all()
