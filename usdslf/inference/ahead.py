"""Programs of kernels that a first answer runs, which are built while the light of a shot is made."""

from __future__ import annotations

from usdslf.gpu.ahead import Programs
from usdslf.light_field.renewal import BLOCK
from usdslf.render.live.scene import constants_of_kernels
from usdslf.render.wide_field import BLOCK as WIDE_BLOCK
from usdslf.surfaces.reflectance import model_of

OF_RAYS = ("live_surfaces", "sample_rays", "live_paths")


def programs_of_answers(model: str) -> Programs:
    """Returns what answers in light of float32 ask for.

    Args:
        model: of reflectance.
    """
    rays = [(stem, constants_of_kernels(model)) for stem in OF_RAYS]
    rest = [("evidence", model_of(model).constants), ("importance", {}), ("renewal", {"BLOCK": BLOCK})]
    return [("wide_field", {"BLOCK": WIDE_BLOCK}), *rays, *rest]
