"""Captions: lines of text as pixels, in a font that OpenImageIO brings.

caption(text, size, color, ground) -> (h, w, 3)
"""

from __future__ import annotations

import numpy as np
import OpenImageIO as oiio
from numpy.typing import NDArray

FONT, CUT = "DroidSans", "..."
PER_EM = 0.75  # height of letters, of the height of a line, and where they stand

Rgb = tuple[float, float, float]


def caption(text: str, size: tuple[int, int], color: Rgb, ground: Rgb) -> NDArray[np.float32]:
    """Returns a line of text (h, w, 3), cut at its beginning where it is too long.

    Args:
        size: width and height [pixels].
        color, ground: of letters and of what is behind them, as the picture has its colours, 0..1.
    """
    width, height = size
    points = max(1, round(PER_EM * height))
    shown = text
    while shown and oiio.ImageBufAlgo.text_size(shown, points, FONT).width > width - height // 2:
        text = text[1:]
        shown = CUT + text if text else ""
    buffer = oiio.ImageBuf(oiio.ImageSpec(width, height, 3, oiio.FLOAT))
    oiio.ImageBufAlgo.fill(buffer, ground)
    if shown:
        oiio.ImageBufAlgo.render_text(buffer, height // 4, points, shown, points, FONT, color)
    return np.asarray(buffer.get_pixels(oiio.FLOAT), np.float32)
