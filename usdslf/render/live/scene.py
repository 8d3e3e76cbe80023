"""A scene with its light on the device, as the kernels of the live picture take it, and surfaces at hits."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from dataclasses import field as field_of
from functools import lru_cache
from types import MappingProxyType
from typing import Any

import numpy as np

from usdslf.cache import address, arrays
from usdslf.elements.lookup import DeviceLookup
from usdslf.gpu.device import Device, Kernel
from usdslf.gpu.launch import GROUP, groups
from usdslf.gpu.shared import Shared
from usdslf.light_field.light_field import LightField
from usdslf.light_field.preconvolution import WEIGHTS_VERSION
from usdslf.light_field.storage import constants_of
from usdslf.lights.sources import LightSet
from usdslf.rays import RayTracer
from usdslf.render.live import records as r
from usdslf.render.live.host_surfaces import rows_by_host
from usdslf.render.live.materials import MaterialTable, TexturePool
from usdslf.render.live.sources import EACH, SourceTable
from usdslf.render.live.sums import Sums, usual_of
from usdslf.render.settings import FOOTPRINT, KeepSums
from usdslf.render.wide_field import BLOCK, mean_of_blocks
from usdslf.sampling.hemisphere import D
from usdslf.scene.records import F32, Material, Scene
from usdslf.surfaces.reflectance import directional_albedo, lobe_parameter, model_of


@dataclass(frozen=True)
class Geometry:
    """Triangles, textures and sources on the device: what edits of opacity and emission alone change."""

    device: Device
    tracer: RayTracer
    scene: Scene
    lights: LightSet
    sources: SourceTable
    pool: TexturePool
    model: str
    normals_d: Any  # (T, 3, 3)
    material_d: Any  # (T,)
    extent_d: Any  # (T,)
    tables: DeviceLookup
    fresnel_d: Any  # (FRESNEL_COSINES,) share of the column Y in even light
    stored: Mapping[str, int]  # build constants that say how the light field's radiance is stored
    kernels: dict[tuple[str, str], Kernel] = field_of(default_factory=dict, init=False, repr=False, compare=False)

    @staticmethod
    def of(
        device: Device, scene: Scene, tracer: RayTracer, lights: LightSet, field: LightField | None, each: int = EACH
    ) -> Geometry:
        """Uploads a scene; where it has more sources than `each`, some are chosen for each ray."""
        up, t, model = device.upload, scene.triangles, field.model if field else "preview_surface"
        return Geometry(
            device, tracer, scene, lights, SourceTable.of(device, lights, each), TexturePool.of(device, scene), model,
            up(np.asarray(t.normals, np.float32)), up(np.asarray(t.material, np.int32)),
            up(np.asarray(tracer.extent, np.float32)), field.lookup_d if field else no_lookup(device, scene),
            up(fresnel_shares(model)), constants_of(field.outgoing_d) if field else {},
        )  # fmt: skip

    def under(self, materials: Sequence[Material]) -> Geometry:
        """Returns the same under materials that differ in what can be seen through, or in what shines."""
        scene = replace(self.scene, materials=tuple(materials))
        lights = self.lights.under(scene)
        sources = SourceTable.of(self.device, lights)
        return replace(self, scene=scene, tracer=self.tracer.under(scene), lights=lights, sources=sources)

    def kernel(self, stem: str, name: str) -> Kernel:
        """Returns a kernel of the live picture, built for its model."""
        if (stem, name) not in self.kernels:  # finding it by its macros takes as long as launching it
            self.kernels[stem, name] = self.device.kernel(stem, name, **constants_of_kernels(self.model, self.stored))
        return self.kernels[stem, name]


def constants_of_kernels(model: str, stored: Mapping[str, int] = MappingProxyType({})) -> dict[str, Any]:
    """Returns the macros of the live picture's kernels.

    Args:
        model: of reflectance.
        stored: of `constants_of`, how the light field's radiance is stored; empty: in float32.
    """
    return {**r.CONSTANTS, **model_of(model).constants, **stored}


def no_lookup(device: Device, scene: Scene) -> DeviceLookup:
    """Returns the tables of a scene that has no elements."""
    up, t = device.upload, scene.triangles
    n = max(len(t.mesh), 1)
    none, zeros = np.full((2, 1), 0xFFFFFFFF, np.uint32), lambda *shape: np.zeros(shape, np.float32)
    cells = np.tile(np.array([0, 1], np.uint32), (n, 1))
    return DeviceLookup(
        up(cells), up(np.asarray(t.face_normals, np.float32)), up(none), up(np.zeros((1, 8), np.uint32)),
        up(zeros(1, 3)), up(zeros(1, 9)), up(np.asarray(t.positions, np.float32)), np.uint32(1),
    )  # fmt: skip


@dataclass(frozen=True)
class SentLight:
    """A light field as rays of a live picture read it: the light that surfaces send out now."""

    field: LightField | None
    outgoing_d: Any  # (N, D, 3)
    mean_d: Any  # (N, blocks, 3)
    arriving_d: Any  # (N,) mean luminance that arrives there
    guide_d: Any  # (N, blocks) cumulative chances of where it comes from
    soft_d: Any  # (N, 3) indirect irradiance over pi
    usual: float  # mean luminance
    footprint: float  # area that a ray's footprint must cover to be answered by it

    @property
    def count(self) -> int:
        """Its elements."""
        return 0 if self.field is None else len(self.field.elements)

    @staticmethod
    def of(
        geometry: Geometry, field: LightField | None, footprint: float | None = None, keep: KeepSums | None = None
    ) -> SentLight:  # fmt: skip
        """Sums a light field up, as it is now; without one surfaces are dark unless rays are followed.

        Args:
            footprint: area that a ray's must cover to be answered by it; None: as usual.
            keep: its sums between runs, as of `LitScene`.
        """
        if field is None:
            dark = geometry.device.zeros((1, D // BLOCK**2), np.float32)
            return SentLight(None, dark, dark, dark, dark, dark, 0.0, footprint or 0.0)
        sums = Sums.kept(field, geometry.lights, keep) if keep else Sums.of(field, geometry.lights)
        area = float(geometry.scene.triangles.areas.sum()) / len(field.elements)
        outgoing_d = field.outgoing_d
        if constants_of(outgoing_d) != geometry.stored:  # a light field of an edit that is stored in another way
            outgoing_d = geometry.device.upload(field.radiance().astype(np.float16 if geometry.stored else np.float32))
        return SentLight(
            field, outgoing_d, sums.mean_d, sums.arriving_d, sums.guide_d, sums.soft_d, sums.usual,
            FOOTPRINT * area if footprint is None else footprint,
        )  # fmt: skip

    @staticmethod
    def unguided(geometry: Geometry, field: LightField, footprint: float) -> SentLight:
        """Sums a light field up for rays that others draw."""
        mean_d, none = mean_of_blocks(field), geometry.device.zeros((1, 3), np.float32)
        usual = usual_of(geometry.device, mean_d)
        return SentLight(field, field.outgoing_d, mean_d, none, none, none, usual, footprint)


@dataclass(frozen=True)
class LiveScene:
    """Geometry under some materials and the light that they send."""

    geometry: Geometry
    materials: MaterialTable
    light: SentLight

    def arguments(self) -> tuple[Any, ...]:
        """SCENE_PARAMETERS of kernels/live_sources.cl."""
        g, m = self.geometry, self.materials
        return (
            np.uint32(len(g.scene.triangles.mesh)), g.tables.corners_d, g.tables.face_normal_d, g.material_d, m.rows_d,
            m.refs_d, *m.pool, *g.sources.arrays,
        )  # fmt: skip

    def field_arguments(self) -> tuple[Any, ...]:
        """FIELD_PARAMETERS of kernels/live_arrival.cl."""
        t, light = self.geometry.tables, self.light
        return (
            t.cells_of_triangle_d, t.entry_of_cell_d, t.cell_count, t.elements_of_entry_d, t.position_d, t.frames_d,
            light.outgoing_d, light.mean_d, np.int32(light.field is not None), np.float32(light.usual),
            np.float32(light.footprint),
        )  # fmt: skip

    def evaluate(self, hits: Hits, rows: Shared, count: int, surface: Shared) -> None:
        """Makes surfaces, rows of (., SURFACE), of what rays met, as seen along the rays.

        Args:
            rows: the first `count` of them are done.
        """
        g, m, t = self.geometry, self.materials, self.geometry.tables
        g.kernel("live_surfaces", "surfaces_at_hits")(
            groups(count), (GROUP,), np.uint32(count), rows, hits.triangle, hits.u, hits.v, hits.direction,
            hits.least_roughness,
            np.uint32(len(g.scene.triangles.mesh)), t.corners_d, g.normals_d, t.face_normal_d, g.material_d, g.extent_d,
            m.rows_d, m.refs_d, *m.pool, t.cells_of_triangle_d, t.entry_of_cell_d, t.cell_count, t.elements_of_entry_d,
            np.uint32(self.light.count), surface,
        )  # fmt: skip
        if m.on_host.any():
            surface.pull()
            some = rows.host[:count]
            material = surface.host[some, r.MATERIAL].astype(np.intp)
            some = some[(material >= 0) & m.on_host[material]]
            if len(some):
                surface.host[some] = rows_by_host(
                    replace(g.scene, materials=m.materials), g.model, hits, some, surface.host[some]
                )
                surface.push()

    def recolor(self, hits: Hits, rows: Shared, count: int, surface: Shared) -> None:
        """Gives some surfaces their colours again, by the device."""
        g, m = self.geometry, self.materials
        g.kernel("live_surfaces", "recolor")(
            groups(count), (GROUP,), np.uint32(count), rows, hits.triangle, hits.u, hits.v,
            np.uint32(len(g.scene.triangles.mesh)), g.material_d, m.rows_d, m.refs_d, *m.pool, surface,
        )  # fmt: skip


@lru_cache(maxsize=4)
def fresnel_shares(model: str) -> F32:
    """Returns the share (FRESNEL_COSINES,) of the column Y in even light by the eye's cosine; 1 where Y is all."""
    if not model_of(model).has_fresnel:
        return np.ones(r.FRESNEL_COSINES, np.float32)

    def integrate() -> dict[str, F32]:
        cosine = np.maximum(np.linspace(0, 1, r.FRESNEL_COSINES), 1e-3)
        albedo = directional_albedo(model, float(lobe_parameter(model, 0.5)), cosine)
        return {"share": albedo[:, 1].astype(np.float32)}

    return arrays(address("shares", WEIGHTS_VERSION, model, r.FRESNEL_COSINES), integrate)["share"]


class Hits:
    """Room for rays and the first surfaces that they meet."""

    def __init__(self, device: Device, count: int) -> None:
        make = lambda shape, dtype=np.float32: Shared(device, shape, dtype, is_clean=False)  # noqa: E731
        self.origin, self.direction, self.length = make((count, 3)), make((count, 3)), make((count,))
        self.triangle, self.u, self.v = make((count,), np.int32), make((count,)), make((count,))
        self.distance, self.least_roughness = make((count,)), Shared(device, (count,), np.float32)

    def trace(self, tracer: RayTracer, count: int, stop_at_translucent: bool = False) -> None:
        """Finds what the first rays meet; rays of length 0 meet nothing."""
        rays, found = (self.origin, self.direction, self.length), (self.triangle, self.u, self.v, self.distance)
        for a in rays:
            a.pull()
        origin, direction, length = (a.host[:count] for a in rays)
        triangle, u, v, distance = (a.host[:count] for a in found)
        tracer.intersect_into((origin, direction, length), (triangle, u, v, distance), stop_at_translucent)
        for a in found:
            a.push()


class Shadows:
    """Room for rays towards sources."""

    def __init__(self, device: Device, count: int) -> None:
        make = lambda shape, dtype=np.float32: Shared(device, shape, dtype)  # noqa: E731
        self.origin, self.direction, self.length = make((count, 3)), make((count, 3)), make((count,))
        self.blocked = make((count,), np.uint8)

    def trace(self, tracer: RayTracer, count: int) -> None:
        """Finds which of the first rays something is in the way of."""
        rays = self.origin, self.direction, self.length
        for a in rays:
            a.pull()
        origin, direction, length = (a.host[:count] for a in rays)
        tracer.occluded_into((origin, direction, length), self.blocked.host[:count])
        self.blocked.push()

    @property
    def arguments(self) -> tuple[Shared, Shared, Shared]:
        """Origins, directions, lengths."""
        return self.origin, self.direction, self.length
