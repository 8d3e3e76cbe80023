"""Highlight: the rim of gprims on the picture, found on a worker while nothing moves."""

from __future__ import annotations

from collections.abc import Generator

import numpy as np
from numpy.typing import NDArray
from PySide6.QtGui import QColor, QImage

from usdslf import Camera, Progress, Shot, seen_prims, stepwise

PIXELS = 250_000  # that are asked what they show


def shown_at(shot: Shot, camera: Camera, size: tuple[int, int]) -> Generator[Progress, None, NDArray[np.int32]]:
    """Finds which mesh each of some pixels shows.

    Args:
        size: of the picture [logical pixels]; at most PIXELS are asked.

    Returns, as generators do: (h, w) of `Scene.meshes`; -1: none.
    """
    factor = min(1.0, (PIXELS / max(size[0] * size[1], 1)) ** 0.5)
    asked = max(1, round(size[0] * factor)), max(1, round(size[1] * factor))
    return stepwise(lambda: seen_prims(shot, camera, asked).mesh)


def rim(is_in: NDArray[np.bool_], color: QColor, width: int = 2) -> QImage:
    """Returns a picture of the rim of a mask, to be stretched over it.

    Args:
        is_in: (h, w).
        width: of the rim [pixels of the mask].
    """
    inner = is_in.copy()
    for _ in range(width):
        padded = np.pad(inner, 1, mode="edge")
        inner = padded[1:-1, 1:-1] & padded[:-2, 1:-1] & padded[2:, 1:-1] & padded[1:-1, :-2] & padded[1:-1, 2:]
    h, w = is_in.shape
    pixels = np.zeros((h, w, 4), np.uint8)
    pixels[is_in & ~inner] = (color.red(), color.green(), color.blue(), 255)
    pixels[inner] = (color.red(), color.green(), color.blue(), 26)
    return QImage(pixels.data, w, h, 4 * w, QImage.Format.Format_RGBA8888).copy()
