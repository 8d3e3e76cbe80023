"""Pictured: the light of a shot as pictures see it, for evidence that is to agree with them."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

from usdslf.light_field.light_field import LightField
from usdslf.lights.sources import LightSet
from usdslf.render.live import records as r
from usdslf.render.live.materials import MaterialTable
from usdslf.render.live.paths import PathRoom
from usdslf.render.live.scene import Geometry, LiveScene, SentLight

if TYPE_CHECKING:
    from usdslf.rays import RayTracer
DEPTH = 2  # surfaces that rays are followed to beyond the first; pictures go further, and are seen one by one
SOURCE_ROWS = 2  # of SourceTable.arrays
FOOTPRINT = 4.0  # element areas below which a ray's footprint is followed


@dataclass(frozen=True)
class Pictured:
    """What light arrives anywhere: light field, lights, and both on the device as pictures follow rays."""

    tracer: RayTracer
    field: LightField
    lights: LightSet
    scene: LiveScene
    room: PathRoom
    sources: tuple[Any, Any]  # rows of sources that rays meet, split ones too: of diffuse and of specular factors
    depth: int = DEPTH  # 0: light is what the light field sends

    @property
    def is_split(self) -> bool:
        """Whether some light has a diffuse and a specular factor that differ."""
        return any(source.is_split for source in self.lights.sources)

    def arguments(self) -> tuple[Any, ...]:
        """SCENE_PARAMETERS of kernels/live_sources.cl, with `sources`."""
        usual, rows = self.scene.arguments(), self.scene.geometry.sources.arrays[SOURCE_ROWS]
        return tuple(self.sources[0] if x is rows else x for x in usual)

    @property
    def as_sent(self) -> Pictured:
        """The light that the light field sends, caustics too, of which the few rays that are followed lose a third."""
        return replace(self, depth=0)

    @staticmethod
    def of(tracer: RayTracer, field: LightField, lights: LightSet) -> Pictured:
        """Puts a light field as it is now on the device with all that shines."""
        area = float(field.elements.area.mean()) if len(field.elements) else 0.0
        geometry = Geometry.of(field.device, tracer.scene, tracer, lights, field, max(len(lights.sources), 1))
        table = MaterialTable.of(geometry.pool, tracer.scene.materials)
        light = SentLight.unguided(geometry, field, FOOTPRINT * area)
        rows = geometry.device.download(geometry.sources.arrays[SOURCE_ROWS])
        for row, source in zip(rows, lights.sources):
            row[r.SRC_ALONE] = source.is_delta  # pictures draw what is split, and do not meet it
        specular = rows.copy()
        specular[:, r.SRC_DIFFUSE] = rows[:, r.SRC_SPECULAR]
        sources = geometry.device.upload(rows), geometry.device.upload(specular)
        return Pictured(tracer, field, lights, LiveScene(geometry, table, light), PathRoom(geometry), sources)
