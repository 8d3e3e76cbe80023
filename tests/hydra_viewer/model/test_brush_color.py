"""Colours of the brush come back through the screen."""

from __future__ import annotations

import numpy as np
import pytest

from hydra_viewer.model.brush import LEAST, MOST, RECENT, Brush
from hydra_viewer.model.brush_color import BRIGHTEST, linear_color, shown_colors
from usdslf import DisplaySettings, color_of


@pytest.mark.parametrize("settings", [DisplaySettings(), DisplaySettings(exposure=-2.0), DisplaySettings(gamma=1.6)])
def test_a_code_value_is_shown_as_it_was_picked(settings: DisplaySettings) -> None:
    color = color_of(None, "lin_rec709_scene")
    for code in ((0.2, 0.5, 0.3), (0.6, 0.1, 0.1), (0.5, 0.5, 0.5)):
        linear = linear_color(code, settings, color)
        np.testing.assert_allclose(shown_colors(linear, settings, color)[0], code, atol=2e-3)
    assert max(linear_color((1.0, 1.0, 1.0), settings, color)) <= BRIGHTEST


def test_recent_colours_are_each_there_once_the_last_first() -> None:
    brush = Brush()
    for n in range(RECENT + 5):
        brush = Brush(color=(n, 0.0, 0.0), recent=brush.recent).used()
    assert len(brush.recent) == RECENT and brush.recent[0] == (RECENT + 4, 0.0, 0.0)
    again = Brush(color=brush.recent[3], recent=brush.recent).used()
    assert again.recent[0] == brush.recent[3] and len(set(again.recent)) == len(again.recent)
    assert Brush().resized(9.0).radius == MOST and Brush().resized(0.0).radius == LEAST
