"""Options of opening a shot that say how well its light is found, and what each can be."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from usdslf.errors import InputError
from usdslf.lights.missing_dome import MISSING_DOME
from usdslf.surfaces.reflectance import model_of

QUALITY: dict[str, Any] = {
    "elements": 10000, "bounces": 8, "refine": 1, "model": "preview_surface", "missing_dome": MISSING_DOME[0],
    "memory": None,
}  # fmt: skip
MOST_ELEMENTS = (1 << 22) - 1


def quality_of(asked: Mapping[str, Any]) -> tuple[int, int, int, str, str, float | None]:
    """Returns the values of all options, in the order of QUALITY.

    Args:
        asked: those that are not as usual.

    Raises: TypeError for an unknown option, InputError for a value that cannot be.
    """
    if unknown := sorted(asked.keys() - QUALITY.keys()):
        raise TypeError(f"there is no option '{unknown[0]}'; choose from {', '.join(QUALITY)}")
    elements, bounces, refine, model, missing_dome, memory = (QUALITY | dict(asked)).values()
    if not 1 <= elements <= MOST_ELEMENTS:
        raise InputError(f"--elements {elements} is not in 1 .. {MOST_ELEMENTS}")
    if bounces < 1:
        raise InputError(f"--bounces {bounces} is less than 1")
    if missing_dome not in MISSING_DOME:
        raise InputError(f"--missing-dome {missing_dome} is unknown; choose one of {', '.join(MISSING_DOME)}")
    if memory is not None and not memory > 0:
        raise InputError(f"--memory {memory:g} is not above 0")
    model_of(model)
    return elements, bounces, refine, model, missing_dome, memory
