"""Colours that a painter names or picks, brought into the working space."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from usdslf.color import color_of
from usdslf.scene.records import F32, Scene
from usdslf.textures.images import declared_space, read_image, what_was_taken

DISPLAY_LIMIT = 16.0
"""Most that a colour of the display may stand for [scene-linear]: display white itself would be 128."""


def paint_color(color: Sequence[float], space: str | None, scene: Scene, warnings: list[str]) -> F32:
    """Returns a painted colour (3,) in the scene's working space.

    Args:
        space: OpenColorIO space of `color`; "display": code values of the display; None: the working space.
    """
    values = np.asarray(color, np.float32)
    if space is None:
        return values
    converter = color_of(scene.ocio or None, scene.working_space)
    if space == "display":
        return _from_display(values[None], scene, warnings)[0]
    return converter.to_working(values[None], space)[0]


def paint_image(path: str, space: str | None, scene: Scene, warnings: list[str]) -> F32:
    """Returns a picture (h, w, 3) in the scene's working space.

    Args:
        space: as for `paint_color`; None: as the file says (8 bit pictures are taken for sRGB).
    """
    converter = color_of(scene.ocio or None, scene.working_space)
    known = "raw" if space == "display" else space or "auto"
    warnings += [f"image {path}: {words}" for words in what_was_taken(path, known)]
    if space == "display":
        return _from_display(read_image(path, "raw", converter)[..., :3], scene, warnings)
    if space is None and converter.converts(found := declared_space(path)):
        warnings.append(
            f"image {path}: converted from {found} to {scene.working_space}; --color-space names another space"
        )
    pixels = read_image(path, space or "auto", converter)[..., :3]
    is_negative = (pixels < 0).any(-1)
    if is_negative.any():
        warnings.append(
            f"image {path}: {is_negative.mean():.1%} of its pixels are negative in {scene.working_space}, the least "
            f"{pixels.min():.3g}, which no surface can look like: is its colour space the right one?"
        )
    return pixels


def _from_display(values: NDArray, scene: Scene, warnings: list[str]) -> F32:
    converter = color_of(scene.ocio or None, scene.working_space)
    linear = converter.display(np.ascontiguousarray(values, np.float32), invert=True)
    if linear.max(initial=0.0) > DISPLAY_LIMIT:
        warnings.append(f"display colours above {DISPLAY_LIMIT:g} scene-linear were limited to it")
    return np.clip(linear, 0.0, DISPLAY_LIMIT)
