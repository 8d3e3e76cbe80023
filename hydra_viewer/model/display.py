"""Display: scene-linear pixels as code values of the screen."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from usdslf import CHANNELS, Color, DisplayPass, DisplaySettings

__all__ = ["CHANNELS", "DisplaySettings", "display_codes"]


def display_codes(pixels: NDArray, settings: DisplaySettings, color: Color) -> NDArray[np.uint8]:
    """Returns the picture (h, w, 3) as code values 0..255 of the screen.

    The first call for a display, view and look takes a quarter of a second, others some 10 ms at 900 x 450.

    Args:
        pixels: (h, w, 3) scene-linear, in the working space of `color`.
        settings: how.
        color: the shot's conversions.

    Raises: InputError where the config has no such display, view or look.
    """
    return DisplayPass.of(color, settings).codes(pixels, settings)
