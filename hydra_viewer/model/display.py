"""Display: scene-linear pixels as code values of the screen."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from usdslf import Color

CHANNELS = ("color", "red", "green", "blue", "luminance", "false_color")


@dataclass(frozen=True)
class DisplaySettings:
    """How a picture is brought to the screen; colours and strokes go the same way.

    Attributes:
        display, view: names in the OpenColorIO config; "": its first ones.
        look: of the config; "": the view's own.
        exposure: [stops], before the view.
        gamma: exponent 1 / gamma after the view, above 0.
        channel: one of CHANNELS; all but `color` are grey or false colour.
    """

    display: str = ""
    view: str = ""
    look: str = ""
    exposure: float = 0.0
    gamma: float = 1.0
    channel: str = "color"


def display_codes(pixels: NDArray, settings: DisplaySettings, color: Color) -> NDArray[np.uint8]:
    """Returns the picture (h, w, 3) as code values 0..255 of the screen.

    Args:
        pixels: (h, w, 3) scene-linear, in the working space of `color`.
        settings: how.
        color: the shot's conversions.

    Raises: InputError where the config has no such display, view or look.
    """
    s = settings
    if s.channel in ("red", "green", "blue"):
        pixels = np.repeat(pixels[..., CHANNELS.index(s.channel) - 1, None], 3, -1)
    shown = color.display(pixels, s.exposure, s.gamma, s.display, s.view)
    return (np.clip(shown, 0, 1) * 255 + 0.5).astype(np.uint8)
