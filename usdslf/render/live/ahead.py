"""Programs of kernels that a first frame runs, which are built while a shot is read that will be looked at."""

from __future__ import annotations

from usdslf.gpu.ahead import Programs
from usdslf.render.live.scene import constants_of_kernels

STEMS = ("live_camera", "live_surfaces", "live_draw", "live_gather", "live_entries", "live_combine", "live_paths")
"""In the order in which first frames ask for them."""


def programs_of_pictures(model: str) -> Programs:
    """Returns what pictures of light in float32 ask for.

    Args:
        model: of reflectance.
    """
    return [(stem, constants_of_kernels(model)) for stem in STEMS]
