"""What pictures are made of, and how well: shared by all that renders."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from numpy.typing import NDArray

from usdslf.errors import InputError
from usdslf.gpu.device import Device
from usdslf.light_field.light_field import LightField
from usdslf.rays import RayTracer
from usdslf.scene.records import Light, Scene

BAND = 300_000  # samples in a band
FOOTPRINT = 12.0  # element areas that a ray's footprint must cover for the light field to be good enough
MAX_DEPTH = 6  # surfaces followed after the first
LAYERS = 8  # see-through surfaces that a camera ray shows
AOVS = {
    "color": 3, "direct": 3, "indirect": 3, "albedo": 3, "specular": 3, "roughness": 1, "emission": 3,
    "normal": 3, "position": 3, "depth": 1, "material": 1, "mesh": 1, "alpha": 1,
}  # fmt: skip
"""Names and channels of what `render` can return; scene-linear, world space, stage units.  `material` and
`mesh` are indices of the scene, -1 where nothing is seen; depth along the view axis, inf there."""


@dataclass(frozen=True)
class Quality:
    """How much work goes into a picture."""

    antialias: int = 2  # samples on a side of a pixel
    rays: int = 4  # of each sample

    @staticmethod
    def of(samples: int) -> Quality:
        """Makes a picture of about `samples` gathered rays a pixel; a power of two is best."""
        if samples < 1:
            raise InputError(f"a picture needs at least 1 sample a pixel, not {samples}")
        antialias = 1 if samples < 8 else 2 if samples < 256 else 4
        return Quality(antialias, max(1, samples // antialias**2))


KeepSums = Callable[[Callable[[], Mapping[str, NDArray[Any]]]], Mapping[str, NDArray[Any]]]
"""What computes arrays by name -> these, or those that were kept of an earlier run."""


@dataclass(frozen=True)
class LitScene:
    """A scene with all that lights it."""

    scene: Scene
    tracer: RayTracer
    light_field: LightField | None  # radiance of surfaces met by gathered rays; None: black unless they are followed
    lights: Sequence[Light]  # the scene's, or the default ones
    device: Device
    keep_sums: KeepSums | None = None  # keeps what the light field, as it is, is summed up to


@dataclass(frozen=True)
class PictureOptions:
    """What is not the same for all pictures."""

    samples: int = 16  # gathered rays a pixel
    elements: int = 10000  # of the light field
    hide_lights: bool = False  # lights are not seen by the camera (nor is the dome)
    depth: int = MAX_DEPTH  # surfaces that a ray may be followed to before the light field is asked in any case
    footprint: float = FOOTPRINT  # element areas that a ray's must cover to be answered by the light field
    seed: int = 0
