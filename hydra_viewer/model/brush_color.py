"""Colours of the brush: scene-linear, as the screen shows them, and back.

A colour is picked as the screen shows it and goes through the inverse of the view, exposure and gamma; what a picture
shows is taken scene-linear.  The inverse of a view's white is very large, so it stops at BRIGHTEST.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from hydra_viewer.model.brush import Rgb
from usdslf import Color, DisplaySettings, Shot, color_of

BRIGHTEST = 16.0  # scene-linear: what display white may stand for


def shot_color(shot: Shot) -> Color:
    """Returns the conversions of a shot."""
    return color_of(shot.scene.ocio or None, shot.scene.working_space)


def shown_colors(linear: ArrayLike, settings: DisplaySettings, color: Color) -> NDArray[np.float64]:
    """Returns what the screen shows of colours, code values (n, 3) in 0..1.

    Args:
        linear: (n, 3) scene-linear.
        settings: display, view, look, exposure and gamma count.
        color: the shot's conversions.
    """
    s, pixels = settings, np.asarray(linear, np.float32).reshape(1, -1, 3)
    shown = color.display(pixels, s.exposure, s.gamma, s.display, s.view, look=s.look)
    return np.clip(shown[0].astype(np.float64), 0, 1)


def linear_color(shown: ArrayLike, settings: DisplaySettings, color: Color) -> Rgb:
    """Returns the scene-linear colour that the screen shows as code values (3,) in 0..1."""
    s, codes = settings, np.asarray(shown, np.float32).reshape(1, 1, 3)
    linear = color.display(codes, s.exposure, s.gamma, s.display, s.view, invert=True, look=s.look)
    r, g, b = (float(c) for c in np.clip(linear[0, 0], 0, BRIGHTEST))
    return r, g, b
