"""Pictures: direct and indirect light at full texture and normal-map detail, band by band: live/still.py has how."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from usdslf.errors import InputError
from usdslf.render.live.records import TILE
from usdslf.render.live.still import StillPicture
from usdslf.render.settings import AOVS, BAND, LitScene, PictureOptions
from usdslf.scene.records import F32, Camera

USUAL = PictureOptions()


def render(
    lit: LitScene, camera: Camera, size: tuple[int, int], aovs: Sequence[str] = ("color",),
    options: PictureOptions = USUAL,
) -> dict[str, F32]:  # fmt: skip
    """Renders a picture.

    Args:
        size: width and height [pixels].
        aovs: names of AOVS.

    Returns: name -> (height, width, channels), float32; `color` is always among them.

    Raises: InputError for a size, a number of samples or an AOV that cannot be.
    """
    *_, (_, pictures) = render_bands(lit, camera, size, aovs, options)
    return pictures


def render_bands(
    lit: LitScene, camera: Camera, size: tuple[int, int], aovs: Sequence[str] = ("color",),
    options: PictureOptions = USUAL,
) -> Iterator[tuple[float, dict[str, F32]]]:  # fmt: skip
    """As `render`, but yields after each band: the share that is done and the pictures so far."""
    width, height = size
    if width < 1 or height < 1:
        raise InputError(f"a picture of {width} x {height} pixels cannot be rendered; give a positive size")
    unknown = [a for a in aovs if a not in AOVS]
    if unknown:
        raise InputError(f"unknown AOV '{unknown[0]}'; choose from {', '.join(AOVS)}")
    view = StillPicture(lit, camera, size, options)
    out = {name: np.zeros((height, width, AOVS[name]), np.float32) for name in dict.fromkeys(("color", *aovs))}
    a = view.quality.antialias
    rows = max(TILE, BAND // (width * a * a))
    for first in range(0, height, rows):
        last = min(first + rows, height)
        for name, part in view.render_band(first, last, tuple(out)).items():
            out[name][first:last] = part
        yield last / height, out
