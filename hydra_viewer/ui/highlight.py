"""Highlight: the rim of gprims on the picture, found on a worker while nothing moves."""

from __future__ import annotations

from collections.abc import Generator

import numpy as np
from numpy.typing import NDArray
from PySide6.QtGui import QColor, QImage

from usdslf import Camera, Progress, Shot, seen_prims, stepwise

PIXELS = 250_000  # that are asked what they show
BLURS, SHARPNESS = 3, 2.5  # of a rim
HATCH, HATCH_OPACITY = 9, 0.45  # every so many pixels, of 1


def shown_at(shot: Shot, camera: Camera, size: tuple[int, int]) -> Generator[Progress, None, NDArray[np.int32]]:
    """Finds which mesh each of some pixels shows.

    Args:
        size: of the picture [logical pixels]; at most PIXELS are asked.

    Returns, as generators do: (h, w) of `Scene.meshes`; -1: none.
    """
    factor = min(1.0, (PIXELS / max(size[0] * size[1], 1)) ** 0.5)
    asked = max(1, round(size[0] * factor)), max(1, round(size[1] * factor))
    return stepwise(lambda: seen_prims(shot, camera, asked).mesh)


def rim(is_in: NDArray[np.bool_], color: QColor, hatched: bool = False) -> QImage:
    """Returns a picture of the rim of a mask, to be stretched over it: a line without steps, some pixels wide.

    What lies inside keeps its colour: people judge it.

    Args:
        is_in: (h, w).
        hatched: thin lines cross what lies inside.
    """
    share: NDArray = is_in.astype(np.float32)  # of what is about a pixel, that is in
    for _ in range(BLURS):
        padded = np.pad(share, 1, mode="edge")
        across = 0.25 * (padded[:, :-2] + padded[:, 2:]) + 0.5 * padded[:, 1:-1]
        share = 0.25 * (across[:-2] + across[2:]) + 0.5 * across[1:-1]
    h, w = is_in.shape
    pixels = np.empty((h, w, 4), np.uint8)
    pixels[..., :3] = color.red(), color.green(), color.blue()
    line = np.clip(SHARPNESS * (0.5 - np.abs(share - 0.5)), 0, 1)
    if hatched:
        y, x = np.mgrid[:h, :w]
        line = np.maximum(line, np.where((share > 0.5) & ((x + y) % HATCH == 0), HATCH_OPACITY, 0))
    pixels[..., 3] = 255 * line
    return QImage(pixels.data, w, h, 4 * w, QImage.Format.Format_RGBA8888).copy()
