"""Pictured: the light of a shot as pictures see it, for evidence that is to agree with them."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from usdslf.light_field.light_field import LightField
from usdslf.lights.sources import LightSet
from usdslf.render.gather import Gatherer

if TYPE_CHECKING:
    from usdslf.rays import RayTracer
DEPTH = 2  # surfaces that rays are followed to beyond the first; pictures go further, and are seen one by one
FOOTPRINT = 4.0  # element areas below which a ray's footprint is followed


@dataclass(frozen=True)
class Pictured:
    """What light arrives anywhere: light field, lights, and the gatherer of pictures that follows rays."""

    tracer: RayTracer
    field: LightField
    lights: LightSet
    gatherer: Gatherer | None  # None: light is what the light field sends

    @property
    def as_sent(self) -> Pictured:
        """The light that the light field sends, caustics too, of which the few rays that are followed lose a third."""
        return replace(self, gatherer=None)

    @staticmethod
    def of(tracer: RayTracer, field: LightField, lights: LightSet) -> Pictured:
        """Makes the gatherer for a light field as it is now."""
        area = float(field.elements.area.mean()) if len(field.elements) else 0.0
        return Pictured(
            tracer, field, lights, Gatherer(tracer.scene, tracer, lights, field, field.device, area, DEPTH, FOOTPRINT)
        )
