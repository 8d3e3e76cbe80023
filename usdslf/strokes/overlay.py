"""Strokes drawn over a picture, as they were painted."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from usdslf.color import Color
from usdslf.scene.cameras import project_points
from usdslf.scene.records import F32, Camera
from usdslf.strokes.stroke import Stroke

RIM = 1.5  # pixels of white around a dab, so that a dab of the surface's own colour shows


def draw_strokes(picture: NDArray, strokes: Sequence[Stroke], camera: Camera, color: Color) -> F32:
    """Returns display code values (h, w, 3) of a scene-linear picture with the dabs of strokes on it."""
    height, width = picture.shape[:2]
    linear = np.array(picture[..., :3], np.float32)
    rim = np.zeros((height, width), np.float32)
    cover = np.zeros((height, width), np.float32)
    y, x = np.mgrid[:height, :width] + 0.5
    for stroke in strokes:
        at, _ = project_points(camera, stroke.points, width / height)
        side, _ = project_points(camera, stroke.points + camera.world_from_camera[:3, 0], width / height)
        radius = 0.5 * stroke.widths * np.abs(side[:, 0] - at[:, 0]) * width
        for (u, v), r, rgb in zip(at * [width, height], radius, stroke.colors):
            distance = np.hypot(x - u, y - v)
            inside = distance < r
            linear[inside] = rgb
            cover[inside] = 1
            rim = np.maximum(rim, np.clip(r + RIM + 0.5 - distance, 0, 1))
    shown = np.clip(color.display(linear), 0, 1)
    rim = (rim * (1 - cover))[..., None]
    return (shown * (1 - rim) + rim).astype(np.float32)
