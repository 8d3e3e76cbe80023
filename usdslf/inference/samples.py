"""Samples: points under a stroke as its eye sees them, and rays from them to all light that arrives there."""

from __future__ import annotations

from dataclasses import dataclass, replace
from dataclasses import field as dataclass_field
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from usdslf.inference.footprint import Mixture, footprint, is_of_picture, mixed_footprint
from usdslf.inference.pictured import Pictured
from usdslf.light_field.light_field import LightField
from usdslf.light_field.renewal import seen_from
from usdslf.light_field.surface import albedo
from usdslf.lights.sources import LightSet
from usdslf.progress import tell
from usdslf.sampling.frames import frames_about
from usdslf.sampling.low_discrepancy import random_shifts, sobol_points
from usdslf.scene.records import F64, Scene
from usdslf.strokes.anchors import find_overlaps, locate_stroke
from usdslf.strokes.stroke import Stroke, dab_rows
from usdslf.surfaces.reflectance import lobe_parameter, model_of
from usdslf.surfaces.surface_points import SurfacePoints, evaluate_surface, turned_to_viewer

if TYPE_CHECKING:
    from usdslf.rays import Hits, RayTracer

MOST_SAMPLES = 9216  # surface points of a stroke, where its dabs have more than the least:
SAMPLES = (96, 384)  # least and most of a dab; detail varies over it more than light varies over a point's rays
MOST_DABS = 128
RAYS = 4608  # of a dab
LOBE_ROUGHNESS = (0.08, 0.22, 0.42, 0.7)  # of the rays; the first is less where the surface is sharper
SHARPEST = 0.04  # roughness; sharper lobes count as this
LIGHT_RAYS = 4  # of a sample to each light
ELSEWHERE = 96  # unpainted points of the painted materials
LEAST_REFLECTED = 1e-3  # of what a surface sends, below which rounding is all that is left beside its own light
MOST_OF_LINK = 1e3  # times what the light field has, that a picture may see along a ray
WIDE_ANGLE = 0.2  # [sr] of a dome that a ray sees which only the shading normal sent out


@dataclass(frozen=True)
class Samples:
    """S surface points under a stroke, in dabs, with the rays that leave them.  K rays and light samples each."""

    dab: NDArray[np.int64]  # (S,) row of the stroke's dabs; those behind the dabs are unpainted points, one sample each
    surface: SurfacePoints
    side: NDArray[np.int64]  # (S,) +1 where the eye is on the front of the surface, -1 behind it
    eye: NDArray[np.float32]  # (S, 3) local, unit
    towards_d: Any  # device (S, 3, K') local directions; K' is K filled up to a multiple of 16
    fixed: NDArray[np.float32]  # (S, K, 3) light that no edit changes, over density, by the lights' diffuse factors
    fixed_specular: NDArray[np.float32] | None  # by their specular factors, where these are others
    gain: NDArray[np.float32]  # (S, K, 3) one over the density, for what the surfaces send, by their detail
    links_d: Any  # of the S * ray_count rays
    weights_d: Any
    ray_count: int  # of the K, those that are rays and not light samples
    weight: NDArray[np.float64] | None = None  # (S,) share of what it sends that its dab shows, in its light already
    beside: Beside | None = None  # what else its dabs show

    def sees(self, field: LightField) -> NDArray[np.float64]:
        """Returns how much each element (N,) matters to what is seen here."""
        links, weights = (field.device.download(x) for x in (self.links_d, self.weights_d))
        found = seen_from(links, weights, albedo(field.surface))
        return found if self.beside is None or self.beside.samples is None else found + self.beside.samples.sees(field)


@dataclass(frozen=True)
class Beside:
    """What shows in n dabs beside the painted material: at edges, through gaps and through glass."""

    samples: Samples | None  # of other materials, weighed so that their mean over a dab is their part of it
    has_some: NDArray[np.int64]  # dabs that have such samples
    light: NDArray[np.float64]  # (n, 3) radiance of lights and domes


@dataclass(frozen=True)
class _Points:
    """S surface points, in the order of their dabs, as rays leave them."""

    dab: NDArray[np.int64]  # (S,)
    surface: SurfacePoints
    side: NDArray[np.int64]  # (S,) +1 or -1
    eye: NDArray[np.float32]  # (S, 3) local, unit
    frames: NDArray  # (S, 3, 3) rows are the local axes, on the eye's side
    geometric: NDArray  # (S, 3) geometric normal on the eye's side
    origin: NDArray  # (S, 3) off the surface


@dataclass(frozen=True)
class _Trace:
    """What rays are made of and meet.  A sample has `rays`: a part by cosine, the others by lobes of fixed widths."""

    light: Pictured
    rays: int
    light_rays: int  # to each light
    sharpest: float = LOBE_ROUGHNESS[0]  # roughness of the first lobe
    rng: np.random.Generator = dataclass_field(default_factory=lambda: np.random.default_rng(7))

    @property
    def field(self) -> LightField:
        """What surfaces send."""
        return self.light.field

    @property
    def counts(self) -> NDArray[np.int64]:
        """Rays of each technique."""
        lobes = len(LOBE_ROUGHNESS)
        counts = np.full(lobes + 1, self.rays // (lobes + 2))
        counts[0] = self.rays - counts[1:].sum()
        return counts

    @cached_property
    def mixture(self) -> tuple[Any, Any]:
        """The widths of the lobes and the rays of each technique, on the device."""
        alphas = lobe_parameter("preview_surface", (self.sharpest, *LOBE_ROUGHNESS[1:])).astype(np.float32)
        return self.field.device.upload(alphas), self.field.device.upload(self.counts.astype(np.float32))

    @property
    def constants(self) -> dict[str, int]:
        """Build constants of the kernels."""
        return {"LOBES": len(LOBE_ROUGHNESS), **model_of(self.field.model).constants}


def gather_samples(
    stroke: Stroke, scene: Scene, tracer: RayTracer, field: LightField, lights: LightSet, warnings: list[str],
    light: Pictured | None = None,
) -> tuple[Samples, NDArray[np.int64]]:  # fmt: skip
    """Lays the stroke's dabs and traces the rays of their samples.

    Args:
        light: of the same light field and lights, where there is one already.

    Returns: the samples, and (n,) the row of the stroke of each dab.

    Raises: StrokeError where no dab lies on a surface.
    """
    located = locate_stroke(scene, stroke, warnings)
    warnings += find_overlaps(scene, stroke, located)
    rows = np.flatnonzero(np.isin(located.row, dab_rows(stroke)))
    if len(rows) > MOST_DABS:
        rows = rows[np.linspace(0, len(rows) - 1, MOST_DABS).round().astype(int)]
    count = int(np.clip(MOST_SAMPLES // len(rows), *SAMPLES))
    rays = RAYS // count
    mixture = None
    if is_of_picture(stroke):
        mixture = mixed_footprint(stroke, scene, tracer, located, rows, count, lights)
        own, weight = mixture.own, mixture.weight
    else:
        own = footprint(stroke, scene, tracer, located, rows, count)
        weight = np.ones(len(own[0]))
    eye = stroke.eye[located.row[rows]].astype(np.float64)
    order = np.argsort(own[0], kind="stable")
    dab, triangle, barycentric = (x[order] for x in own)
    material = np.unique(scene.triangles.material[triangle])
    other = _elsewhere(field, tracer, material, eye[dab].mean(0))
    surface = evaluate_surface(
        scene,
        np.concatenate([triangle, field.elements.triangle[other]]),
        np.concatenate([barycentric, field.elements.barycentric[other]]),
    )
    seen_from = np.concatenate([eye[dab], np.broadcast_to(eye[dab].mean(0), (len(other), 3))])
    dab = np.concatenate([dab, len(rows) + np.arange(len(other))])
    light = light or Pictured.of(tracer, field, lights)
    samples = trace_samples(dab, surface, seen_from, light, rays)
    if mixture is not None:
        beside = _beside(mixture, eye, scene, light, rays)
        samples = replace(_weighed(samples, np.concatenate([weight[order], np.ones(len(other))])), beside=beside)
    return samples, located.row[rows]


def _beside(mixture: Mixture, eye: NDArray, scene: Scene, light: Pictured, rays: int) -> Beside | None:
    """Traces what dabs, seen from eyes (n, 3), show beside the painted material; None where that is nothing."""
    order = np.argsort(mixture.other[0], kind="stable")
    dab, triangle, barycentric = (x[order] for x in mixture.other)
    if not len(dab) and not mixture.light.any():
        return None
    has_some, number = np.unique(dab, return_inverse=True)
    if not len(dab):
        return Beside(None, has_some, mixture.light)
    surface = evaluate_surface(scene, triangle, barycentric)
    samples = trace_samples(number.reshape(-1), surface, eye[dab], light, rays)
    return Beside(_weighed(samples, mixture.other_weight[order]), has_some, mixture.light)


def _weighed(samples: Samples, weight: NDArray) -> Samples:
    """Samples that send a share (S,) of their light."""
    by = weight.astype(np.float32)[:, None, None]
    split = None if samples.fixed_specular is None else samples.fixed_specular * by
    return replace(samples, weight=weight, fixed=samples.fixed * by, fixed_specular=split, gain=samples.gain * by)


def trace_samples(dab: NDArray, surface: SurfacePoints, seen_from: NDArray, light: Pictured, rays: int) -> Samples:
    """Traces the rays of samples, surface points of dabs (S,), each seen from an eye (S, 3) and sending `rays`."""
    eye = seen_from - surface.position
    eye /= np.linalg.norm(eye, axis=1, keepdims=True)
    side = np.where(np.einsum("ij,ij->i", eye, surface.geometric_normal) < 0, -1, 1)
    flip = side[:, None].astype(np.float32)
    geometric = surface.geometric_normal * flip
    frames = frames_about(turned_to_viewer(surface.normal * flip, geometric, eye))
    e = np.einsum("sij,sj->si", frames, eye)
    e = (e / np.linalg.norm(e, axis=1, keepdims=True)).astype(np.float32)
    origin = light.tracer.offset_points(surface.position, geometric, surface.triangle)
    points = _Points(dab, surface, side, e, frames, geometric, origin)
    sharpest = float(np.clip(np.median(surface.roughness), SHARPEST, LOBE_ROUGHNESS[0]))
    return _trace(points, _Trace(light, rays, LIGHT_RAYS, sharpest))


def _elsewhere(field: LightField, tracer: RayTracer, materials: NDArray, eye: NDArray) -> NDArray[np.int64]:
    """Elements of some materials that an eye sees: where the stroke might have been and is not."""
    e = field.elements
    way = eye - e.position
    mine = np.flatnonzero(np.isin(e.material, materials) & (np.einsum("ij,ij->i", way, e.geometric_normal) > 0))
    mine = np.random.default_rng(11).permutation(mine)[: 3 * ELSEWHERE]
    start = tracer.offset_points(e.position[mine], e.geometric_normal[mine], e.triangle[mine])
    hidden = tracer.occluded(start, (eye - start).astype(np.float32), np.full(len(mine), 0.999, np.float32))
    return mine[~hidden][:ELSEWHERE]


def _trace(p: _Points, t: _Trace) -> Samples:
    s, device = len(p.eye), t.field.device
    local, world, density = _make_rays(p, t)
    starts = np.repeat(p.origin, t.rays, 0)
    world, is_folded = _folded(world, np.repeat(p.geometric, t.rays, 0))
    hits = t.light.tracer.intersect(starts, world)
    usable = density > 0
    inverse = np.where(usable, 1 / np.where(usable, density, 1), 0)
    links_d, weights_d = t.field.link_hits(
        np.where(usable, hits.triangle, -1), hits.barycentric.astype(np.float32), world
    )
    pictured, own = _as_pictured(links_d, weights_d, world, density, hits, p, t)
    met = _met_lights(starts, world, density, is_folded, hits, t) - inverse[:, None] * pictured * own
    locals_, lights_in = [local], [met.reshape(2, s, t.rays, 3)]
    for source in t.light.lights.sources:
        direction, light = _sample_source(source, p, t)
        locals_.append(direction)
        lights_in.append(np.stack([source.diffuse * light, source.specular * light]))
        tell()
    all_local = np.concatenate(locals_, 1)
    gain = np.zeros(all_local.shape)
    gain[:, : t.rays] = (inverse[:, None] * pictured).reshape(s, t.rays, 3)
    light_d, light_s = np.concatenate(lights_in, 2).astype(np.float32)
    is_split = any(source.diffuse != source.specular for source in t.light.lights.sources)
    return Samples(
        p.dab, p.surface, p.side, p.eye, device.upload(by_sixteen(all_local)), light_d, light_s if is_split else None,
        gain.astype(np.float32), links_d, weights_d, t.rays,
    )  # fmt: skip


def _make_rays(p: _Points, t: _Trace) -> tuple[NDArray, NDArray, NDArray]:
    """Rays by all techniques: local directions (S, rays, 3), world ones (S * rays, 3), their density (S * rays,)."""
    device, s, n = t.field.device, len(p.eye), len(p.eye) * t.rays
    technique = np.repeat(np.arange(len(t.counts)), t.counts).astype(np.int32)
    u = np.concatenate([_points_of_dabs(int(c), p.dab, t.rng) for c in t.counts], 1).astype(np.float32)
    local_d, world_d = device.empty((s, t.rays, 3), np.float32), device.empty((s, t.rays, 3), np.float32)
    density_d = device.empty((s, t.rays), np.float32)
    device.kernel("evidence", "make_rays", **t.constants)(
        (_up(n),), (64,), device.upload(p.eye), device.upload(p.frames), device.upload(u), device.upload(technique),
        *t.mixture, np.uint32(t.rays), np.uint32(n), local_d, world_d, density_d,
    )  # fmt: skip
    world, density = device.download(world_d).reshape(-1, 3), device.download(density_d).reshape(-1)
    return device.download(local_d), world, density


def _as_pictured(
    links_d: Any, weights_d: Any, world: NDArray, density: NDArray, hits: Hits, p: _Points, t: _Trace
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Factors (n, 3) on what is reflected along n rays, pictures' over the light field's, and what shines there (n, 3).

    The light field blends elements: in corners, beside lamps and where reflections are finer than elements, pictures
    follow the ray instead, and so does this.  What shines by itself is sampled as a light, and is no part of it.
    """
    out, own, hit = np.ones((len(world), 3)), np.zeros((len(world), 3)), np.flatnonzero(density > 0)
    sent = t.field.follow_links(links_d, weights_d)[hit]
    lit = sent.max(1) > 0
    hit, sent = hit[lit], sent[lit]
    emissive = t.light.lights.emissive
    shining = emissive.emits[hits.triangle[hit]]
    own[hit[shining]] = emissive.emission(hits.triangle[hit[shining]], hits.barycentric[hit[shining]])
    reflected = sent - own[hit]
    if t.light.gatherer is None:
        return out, own
    sample = hit // t.rays
    seen = t.light.gatherer.reflected_along(
        p.origin[sample], p.geometric[sample].astype(np.float32), world[hit], (density[hit] / t.rays).astype(np.float32)
    )  # fmt: skip
    is_known = reflected > LEAST_REFLECTED * sent
    out[hit] = np.where(is_known, seen / np.where(is_known, reflected, 1), 1)
    return np.minimum(out, MOST_OF_LINK), own


def _folded(world: NDArray, geometric: NDArray) -> tuple[NDArray, NDArray[np.bool_]]:
    """Folds up directions (n, 3) that only the shading normal sends out, as pictures do; tells which (n,)."""
    below = np.einsum("nj,nj->n", world, geometric)
    up = world - 2 * np.minimum(below, 0)[:, None] * geometric
    return up.astype(np.float32), below < 0


def _met_lights(starts: NDArray, world: NDArray, density: NDArray, is_folded: NDArray, hits: Hits, t: _Trace) -> F64:
    """What n rays (n, 3) meet of the lights, over density: (2, n, 3) by their diffuse and by their specular factors.

    Those that were folded stand for directions in which no light is sampled: they see domes only, and wide.
    """
    fixed = np.zeros((2, len(world), 3))
    usable = (density > 0) & ~is_folded
    missed = (hits.triangle < 0) & usable
    wide = (hits.triangle < 0) & (density > 0) & is_folded
    for dome in t.light.lights.domes:
        seen = dome.dome.radiance(world[wide], WIDE_ANGLE) / density[wide, None]
        fixed[0, wide] += dome.diffuse * seen
        fixed[1, wide] += dome.specular * seen
        p = t.light_rays * dome.dome.pdf(world[missed])
        seen = dome.dome.radiance(world[missed], None) / (density[missed] + p)[:, None]
        fixed[0, missed] += dome.diffuse * seen
        fixed[1, missed] += dome.specular * seen
    for placed in t.light.lights.placed:
        if not placed.is_delta:
            distance, radiance, pdf = placed.intersect(starts, world)
            met = usable & (distance < np.where(hits.triangle < 0, np.inf, hits.distance) * 1.0001)
            met |= usable & (radiance.max(1) > 0) & (hits.triangle < 0)
            seen = radiance[met] / (density[met] + t.light_rays * pdf[met])[:, None]
            fixed[0, met] += placed.diffuse * seen
            fixed[1, met] += placed.specular * seen
    emissive = t.light.lights.emissive
    shining = np.flatnonzero(usable & (hits.triangle >= 0) & emissive.emits[hits.triangle])
    if len(shining):
        triangle = hits.triangle[shining]
        p = t.light_rays * emissive.pdf(triangle, world[shining], hits.distance[shining])
        fixed[:, shining] += emissive.emission(triangle, hits.barycentric[shining]) / (density[shining] + p)[:, None]
    return fixed


def _points_of_dabs(k: int, dab: NDArray, rng: np.random.Generator) -> F64:
    """Points (S, k, 2) of the unit square for samples in the order of their dabs (S,).

    The samples of a dab take runs of one sequence, so that all of its rays are stratified together: a lobe is
    sharper than what the few rays of one sample can meet.  Source: Keller and Heidrich 2001 (interleaved sampling).
    """
    _, first, number = np.unique(dab, return_index=True, return_counts=True)
    which = np.searchsorted(dab[first], dab)
    turn = np.arange(len(dab)) - first[which]
    shifts = random_shifts(len(first), rng)
    out = np.empty((len(dab), k, 2))
    for size in np.unique(number):
        sets = np.flatnonzero(number == size)
        place = np.searchsorted(sets, which)
        rows = np.flatnonzero(number[which] == size)
        points = sobol_points(0, int(size) * k, shifts[sets]).reshape(len(sets), int(size), k, 2)
        out[rows] = points[place[rows], turn[rows]]
    return out


def _sample_source(source: Any, p: _Points, t: _Trace) -> tuple[NDArray, NDArray]:
    """Local directions (S, k, 3) towards one light and its radiance over density (S, k, 3), occlusion tested."""
    s, device = len(p.eye), t.field.device
    k = 1 if source.is_delta else t.light_rays
    u = _points_of_dabs(k, p.dab, t.rng).reshape(-1, 2)
    start = np.repeat(p.origin, k, 0)
    arrival = source.sample(start, u.astype(np.float32))
    local = np.einsum("sij,skj->ski", p.frames, arrival.direction.reshape(s, k, 3)).astype(np.float32)
    up = local[..., 2].reshape(-1) > 0
    density = np.zeros(s * k)
    if not source.is_delta:
        density_d = device.empty((s, k), np.float32)
        device.kernel("evidence", "density_at", **t.constants)(
            (_up(s * k),), (64,), device.upload(p.eye), device.upload(local), *t.mixture, np.uint32(k),
            np.uint32(s * k), density_d,
        )  # fmt: skip
        density = device.download(density_d).reshape(-1).astype(np.float64)
    shines = up & (arrival.pdf > 0) & (arrival.radiance.max(1) > 0)
    rows = np.flatnonzero(shines)
    blocked = t.light.tracer.occluded(start[rows], arrival.direction[rows], arrival.distance[rows] * np.float32(0.9999))
    rows = rows[~blocked]
    light = np.zeros((s * k, 3))
    if source.is_delta:
        light[rows] = arrival.radiance[rows]
    else:
        light[rows] = arrival.radiance[rows] / (k * arrival.pdf[rows] + density[rows])[:, None]
    return local, light.reshape(s, k, 3)


def by_sixteen(rows: NDArray) -> NDArray[np.float32]:
    """Lays rows (R, K, 3) out as (R, 3, K') with K filled up to a multiple of 16 by zeros."""
    r, k, _ = rows.shape
    out = np.zeros((r, 3, -(-k // 16) * 16), np.float32)
    out[:, :, :k] = rows.transpose(0, 2, 1)
    return out


def _up(n: int) -> int:
    return max(-(-n // 64) * 64, 64)
