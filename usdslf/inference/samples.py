"""Samples: points under a stroke as its eye sees them, and rays from them to all light that arrives there."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from usdslf.inference.footprint import Mixture, footprint, is_of_picture, mixed_footprint
from usdslf.inference.pictured import Pictured
from usdslf.inference.sample_rays import Points, RayLight, Trace, trace_rays
from usdslf.light_field.importance import met_along
from usdslf.light_field.light_field import LightField
from usdslf.lights.sources import LightSet
from usdslf.sampling.frames import frames_about
from usdslf.scene.records import Scene
from usdslf.strokes.anchors import find_overlaps, locate_stroke
from usdslf.strokes.stroke import Stroke, dab_rows
from usdslf.surfaces.surface_points import SurfacePoints, evaluate_surface, turned_to_viewer

if TYPE_CHECKING:
    from usdslf.rays import RayTracer

MOST_SAMPLES = 9216  # surface points of a stroke, where its dabs have more than the least:
SAMPLES = (96, 384)  # least and most of a dab; detail varies over it more than light varies over a point's rays
MOST_DABS = 128
RAYS = 4608  # of a dab, and of a stroke no more than:
MOST_RAYS = 32 * RAYS  # many dabs share what few have
UNBENT = 1 - 1e-4  # cosine of a normal to itself, after it was turned to the eye
ELSEWHERE = 96  # unpainted points of the painted materials


@dataclass(frozen=True)
class Samples:
    """S surface points under a stroke, in dabs, with the rays that leave them.  K rays and light samples each."""

    dab: NDArray[np.int64]  # (S,) row of the stroke's dabs; those behind the dabs are unpainted points, one sample each
    surface: SurfacePoints
    side: NDArray[np.int64]  # (S,) +1 where the eye is on the front of the surface, -1 behind it
    eye: NDArray[np.float32]  # (S, 3) local, unit
    light: RayLight
    horizon: NDArray[np.float32]  # (S, 3) local, unit: the surface's own normal, on the eye's side
    is_bent: NDArray[np.bool_]  # (S,) where the shading normal faces away from the eye
    weight: NDArray[np.float64] | None = None  # (S,) share of what it sends that its dab shows, in its light already
    beside: Beside | None = None  # what else its dabs show
    doubtful: NDArray[np.float64] | None = None  # (S, 3, 3) radiance before any edit, see doubt.py; None: not known

    def met(self, field: LightField) -> NDArray[np.float64]:
        """Returns how many of the rays end at each element (N,)."""
        links, weights = (field.device.download(x) for x in (self.light.links_d, self.light.weights_d))
        found = met_along(len(field.elements), links, weights)
        return found if self.beside is None or self.beside.samples is None else found + self.beside.samples.met(field)


@dataclass(frozen=True)
class Beside:
    """What shows in n dabs beside the painted material: at edges, through gaps and through glass."""

    samples: Samples | None  # of other materials, weighed so that their mean over a dab is their part of it
    has_some: NDArray[np.int64]  # dabs that have such samples
    light: NDArray[np.float64]  # (n, 3) radiance of lights and domes


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
    rays = min(RAYS, MOST_RAYS // len(rows)) // count
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
    weight = np.concatenate([weight[order], np.ones(len(other))])
    samples = trace_samples(dab, surface, seen_from, light, rays, weight if mixture else None)
    if mixture is not None:
        samples = replace(samples, beside=_beside(mixture, eye, scene, light, rays))
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
    samples = trace_samples(number.reshape(-1), surface, eye[dab], light, rays, mixture.other_weight[order])
    return Beside(samples, has_some, mixture.light)


def trace_samples(
    dab: NDArray, surface: SurfacePoints, seen_from: NDArray, light: Pictured, rays: int,
    weight: NDArray[np.float64] | None = None,
) -> Samples:  # fmt: skip
    """Traces the rays of samples, surface points of dabs (S,), each seen from an eye (S, 3) and sending `rays`.

    Args:
        weight: (S,) share of the light that each sends; None: all.
    """
    eye = seen_from - surface.position
    eye /= np.linalg.norm(eye, axis=1, keepdims=True)
    side = np.where(np.einsum("ij,ij->i", eye, surface.geometric_normal) < 0, -1, 1)
    flip = side[:, None].astype(np.float32)
    geometric = surface.geometric_normal * flip
    shading = surface.normal * flip
    seen = turned_to_viewer(shading, geometric, eye)
    frames = frames_about(seen)
    e = np.einsum("sij,sj->si", frames, eye)
    e = (e / np.linalg.norm(e, axis=1, keepdims=True)).astype(np.float32)
    origin = light.tracer.offset_points(surface.position, geometric, surface.triangle)
    counts = np.ones(len(dab), np.float32) if weight is None else weight.astype(np.float32)
    points = Points(dab, surface, side, e, frames, geometric, origin, counts)
    horizon = np.einsum("sij,sj->si", frames, geometric).astype(np.float32)
    is_bent = (seen * shading).sum(1) < UNBENT
    return Samples(dab, surface, side, e, trace_rays(points, Trace(light, rays)), horizon, is_bent, weight)


def _elsewhere(field: LightField, tracer: RayTracer, materials: NDArray, eye: NDArray) -> NDArray[np.int64]:
    """Elements of some materials that an eye sees: where the stroke might have been and is not."""
    e = field.elements
    way = eye - e.position
    mine = np.flatnonzero(np.isin(e.material, materials) & (np.einsum("ij,ij->i", way, e.geometric_normal) > 0))
    mine = np.random.default_rng(11).permutation(mine)[: 3 * ELSEWHERE]
    start = tracer.offset_points(e.position[mine], e.geometric_normal[mine], e.triangle[mine])
    hidden = tracer.occluded(start, (eye - start).astype(np.float32), np.full(len(mine), 0.999, np.float32))
    return mine[~hidden][:ELSEWHERE]
