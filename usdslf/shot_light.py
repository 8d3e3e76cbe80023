"""The light of a shot: what arrives at its elements, which may never be asked for, and what they send out.

Where what they send out was kept, a picture needs nothing of what arrives: links and fixed light are read when a
bounce asks for them first.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from usdslf.elements.elements import Elements
from usdslf.elements.lookup import ElementLookup
from usdslf.gpu.device import Device
from usdslf.lazy import Later
from usdslf.light_field.light_field import LightField
from usdslf.light_field.renewal import renew
from usdslf.light_field.static_light import static_light
from usdslf.light_field.storage import Storage
from usdslf.light_field.visibility import Visibility, trace_visibility
from usdslf.rays import RayTracer
from usdslf.scene.records import Light
from usdslf.shot_cache import Kind, ShotCache


@dataclass(frozen=True)
class Arriving:
    """What light arrives by.

    Attributes:
        visibility: what each element sees in each direction.
        fixed: light (N, D, 3) that no edit changes.
    """

    visibility: Later[Visibility]
    fixed: Later[NDArray[np.float32]]

    @staticmethod
    def of(
        places: tuple[Elements, ElementLookup, Later[RayTracer]], lights: Sequence[Light], device: Device,
        kept: ShotCache | None, visibility: Visibility | None = None,
    ) -> Arriving:  # fmt: skip
        """Remembers what it is made of, or where it is kept.

        Args:
            places: elements, what is near to points, rays.
            lights: that shine.
            device: that computes.
            kept: what is kept of the shot.
            visibility: None: it is to be traced.
        """
        elements, lookup, tracer = places
        trace = lambda: trace_visibility(elements, lookup, tracer(), device)  # noqa: E731
        links = Later(lambda: kept.visibility(elements, trace) if kept else trace())
        if visibility is not None:
            links = Later.of(visibility)
        light = lambda: static_light(elements, tracer(), lights, links()).diffuse  # noqa: E731
        return Arriving(links, Later(lambda: kept.fixed_light(elements, light) if kept else light()))


@dataclass(frozen=True)
class Recipe:
    """What a light field is made of."""

    device: Device
    elements: Elements
    lookup: ElementLookup
    arriving: Arriving
    model: str
    storage: Storage
    bounces: int

    @property
    def kind(self) -> Kind:
        """What it is kept as."""
        return Kind(self.model, self.bounces, np.dtype(self.storage.dtype).name)

    def made(self, kept: ShotCache | None, start: LightField | None) -> LightField:
        """Returns the light after all bounces.

        Args:
            kept: what is kept of the shot.
            start: light field of another state, that it starts from.
        """
        if start is not None and start.lookup is self.lookup:  # of the same elements: it follows what is other
            found = start.with_elements(self.elements)
            renew(found, self.bounces)
            return found
        if kept is None:
            found = self._from(None)
            if start is not None:
                found.start_from(start)
            found.settle(self.bounces)
            found.rest()
            return found
        settled: list[LightField] = []

        def settle() -> NDArray[Any]:
            settled.append(self._from(None).settle(self.bounces))
            radiance: NDArray[Any] = self.device.download(settled[0].outgoing_d)
            return radiance

        radiance_d = kept.radiance(self.elements, self.kind, settle)
        found = settled[0] if settled else self._from(radiance_d)
        found.waits[:] = 0
        found.rest()
        return found

    def _from(self, radiance_d: Any) -> LightField:
        visibility, fixed = self.arriving.visibility, self.arriving.fixed
        return LightField(
            self.device, self.elements, self.lookup, visibility, fixed, self.model, self.storage, radiance_d
        )
