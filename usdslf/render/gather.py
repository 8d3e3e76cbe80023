"""Final gathering: the light that arrives at surface points, split so that colours can be taken out of it.

    L_o = d [(1 - F0) X + (1 - F90) Y] + F0 A + F90 B + coat      (columns of usdslf/surfaces/reflectance.py)

X, Y, A, B and the coat's light are gathered with rays.  Lights and domes are sampled and met by rays drawn from
the surface's lobes, combined by the balance heuristic (Veach and Guibas 1995).  A ray that meets a surface
takes the radiance of the light field there, unless its footprint is smaller than the light field resolves:
then the point it met is lit in its own right, with one more ray onwards.  So sharp reflections show
full detail, corners get no leaks, and no path is long enough to be noisy.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from typing import Protocol, cast

import numpy as np
from numpy.typing import NDArray

from usdslf.color import luminance
from usdslf.gpu.device import Device
from usdslf.lights.sources import Arrival, LightSet, Source, brightest, dot
from usdslf.progress import told
from usdslf.rays import Hits, RayTracer
from usdslf.render.guide import GuidingField, LightGuide
from usdslf.render.lobes import COLUMNS, Lobes, ShadingPoints, reflect, shading_points
from usdslf.render.wide_field import NearField, WideField
from usdslf.scene.records import F32, I32, Scene
from usdslf.surfaces.surface_points import evaluate_surface
from usdslf.threads import map_ahead

CHUNK = 1 << 14  # points that one thread works on: their rays stay in the caches
FOOTPRINT = 12.0  # element areas that a ray's footprint must cover for the light field to be good enough
WIDE_PDF = 2.0  # [1/sr] density up to which a ray reads the light field averaged over directions
UNEVEN = 1.8  # times its mean that the brightest of a hit's near elements may be
BRIGHT = 4.0  # times the mean of all that rays meet, above which the light field is not trusted either
SHARP_PDF = 8.0  # [1/sr] density from which on a ray counts as a reflection
# Smoother surfaces count as this rough for rays of wide lobes that follow them: found by chance, their highlights
# would be fireflies.  Source: Kaplanyan and Dachsbacher 2013, path space regularization.
CAUSTIC_ROUGHNESS = 0.35
MIRRORED_ANGLE = 0.2  # [sr] of a dome that a ray sees which only the shading normal sent out
# What surfaces send along one ray of a wide lobe may bring this many times the mean of all light that arrives at
# the nearest element, or about it; more is cut off.  It is the one place where light is clamped.
RAY_MOST = 8.0
MAX_DEPTH = 6  # surfaces followed after the first


class RadianceOfHits(Protocol):
    """What a light field answers."""

    def radiance_from_hits(self, triangle: NDArray, barycentric: NDArray, direction: NDArray) -> NDArray: ...


@dataclass(frozen=True)
class Illumination:
    """Demodulated light at n points: columns (n, 5, 3), and radiance that needs no filter (n, 3)."""

    sampled: F32  # (n, 5, 3) from lights that have a place, where they were sampled
    direct: F32  # (n, 5, 3) from domes, and from lights that rays of the lobes met
    indirect: F32  # (n, 5, 3) from surfaces
    exact: F32  # (n, 3) reflected from lights without extent, which have no noise


@dataclass(frozen=True)
class _Rays:
    """n rays on their way from points."""

    origin: F32  # (n, 3)
    geometric_normal: F32  # (n, 3) of the points
    direction: F32  # (n, 3)
    pdf: F32  # (n,) of the direction [1/sr]
    lobe_pdf: F32  # (n,) the same without the guide
    ratio: F32  # (n, sources) samples of each source for one ray
    index: NDArray[np.uint32]  # (n,) in the sequence
    least_pdf: F32  # (n,) of all rays of the path so far


class Gatherer:
    """Gathers light at points of one scene."""

    def __init__(
        self,
        scene: Scene,
        tracer: RayTracer,
        lights: LightSet,
        light_field: RadianceOfHits | None,
        device: Device,
        element_area: float,
        depth: int = MAX_DEPTH,
        footprint: float = FOOTPRINT,
    ) -> None:
        """Keeps what rays need.

        Args:
            light_field: gives the radiance of surfaces; None: surfaces that are not followed are black.
            element_area: mean area that one element of the light field stands for [stage units squared].
            depth: surfaces that a path may be followed to before the light field is asked in any case.
            footprint: in element areas; inf follows every path to `depth`: a plain path tracer.
        """
        self.scene, self.tracer, self.lights, self.light_field = scene, tracer, lights, light_field
        self.device, self.element_area, self.depth, self.footprint = device, element_area, depth, footprint
        low, high = scene.bounds
        self.center = ((low + high) / 2).astype(np.float32)
        is_real = hasattr(light_field, "lookup")
        wide = WideField(device, cast(NearField, light_field)) if is_real else None
        guiding = cast(GuidingField, light_field) if wide and np.isfinite(footprint) else None
        self._wide_field = wide
        self.guide = LightGuide(device, guiding, wide.mean_d if wide else None, lights)
        self.model = str(getattr(light_field, "model", "preview_surface"))
        self._lobes = Lobes(device, self.guide, self.model)

    # ── the first surface ────────────────────────────────────────────────────────────────────────

    def gather(
        self,
        p: ShadingPoints,
        place: NDArray[np.uint32],
        near_place: NDArray[np.uint32],
        rays: int,
        light_samples: int,
        seed: int = 0,
    ) -> Illumination:
        """Gathers at points with `rays` rays each and `light_samples` samples of each source.

        Args:
            place: (n,) of each point in the interleaving tile: its samples are `place * count` and following.
            near_place: (n,) in the smaller tile of lights that have a place, whose shadows are to stay sharp.
        """

        def gather_part(first: int) -> tuple[F32, F32, F32, F32]:
            part = slice(first, first + CHUNK)
            q = p[part]
            sampled, dome, exact = self._sample_lights(q, place[part], near_place[part], rays, light_samples, seed)
            lit, indirect = self._send_rays(q, place[part], rays, light_samples, seed)
            return sampled, dome + lit, indirect, exact

        return Illumination(*self._in_parts(gather_part, len(p), CHUNK))

    def gather_more(
        self, p: ShadingPoints, place: NDArray[np.uint32], rays: int, light_samples: int, times: int, seed: int
    ) -> tuple[F32, F32]:
        """Gathers `direct` and `indirect` of `gather` anew, with `times` the samples, for points that need them."""
        size = CHUNK // times

        def gather_part(first: int) -> tuple[F32, F32]:
            part = slice(first, first + size)
            q, at = p[part], place[part]
            dome = self._sample_lights(q, at, at, rays, light_samples, seed, times)[1]
            lit, indirect = self._send_rays(q, at, rays, light_samples, seed, times)
            return dome + lit, indirect

        direct, indirect = self._in_parts(gather_part, len(p), size)
        return direct, indirect

    def _in_parts(self, gather_part: Callable[[int], tuple[F32, ...]], count: int, size: int) -> Iterator[F32]:
        """Yields the columns of all parts of some points, each of which begins at one; tells after each part."""
        with ThreadPoolExecutor(self.tracer.threads) as pool:
            parts = map_ahead(pool, gather_part, range(0, max(count, 1), size), 2 * self.tracer.threads)
            done = [part for _, part in told(parts)]
        return (np.concatenate(c) for c in zip(*done, strict=True))

    def _sample_lights(
        self, p: ShadingPoints, place: NDArray[np.uint32], near_place: NDArray[np.uint32], rays: int,
        light_samples: int, seed: int, times: int = 0,
    ) -> tuple[F32, F32, F32]:  # fmt: skip
        """Returns the columns of lights (n, 5, 3) and of domes (n, 5, 3), and the radiance of delta lights (n, 3).

        `times` > 0 asks for domes only, with so many times the samples.
        """
        n = len(p)
        near, far = np.zeros((n, COLUMNS, 3), np.float32), np.zeros((n, COLUMNS, 3), np.float32)
        exact = np.zeros((n, 3), np.float32)
        for s, source in enumerate(self.lights.sources):
            is_dome = s in self.lights.dome_range
            if source.is_met_only or (times and not is_dome):
                continue
            count = 1 if source.is_delta else light_samples * max(times, 1)
            index = place if is_dome else near_place
            for j in range(count):
                u = self._lobes.sequence(index * np.uint32(count) + np.uint32(j), 1000 + seed + s)
                arrival = source.sample(p.position, u)
                rows, weight, rest = self._weigh(p, arrival, source, np.float32(light_samples / rays))
                if source.is_delta:
                    exact[rows] += reflect(p.colors[rows], weight[:, :, None] * rest[:, None])
                else:
                    total = far if is_dome else near
                    total[rows] += weight[:, :, None] * (rest / np.float32(count))[:, None]
        return near, far, exact

    def _send_rays(
        self, p: ShadingPoints, place: NDArray[np.uint32], rays: int, light_samples: int, seed: int, times: int = 1
    ) -> tuple[F32, F32]:
        """Returns columns (n, 5, 3) of what rays of the lobes meet: of lights, and of surfaces."""
        n, share = len(p), light_samples / rays
        rays *= times
        direction, pdf, lobe_pdf, weight = self._lobes.sample(p, place * np.uint32(rays), rays, seed)
        sent_out = np.flatnonzero((pdf > 0).reshape(-1))  # of n * rays: not those below the horizon
        point = sent_out // rays
        direction, pdf = direction.reshape(-1, 3)[sent_out], pdf.reshape(-1)[sent_out]
        lobe_pdf = lobe_pdf.reshape(-1)[sent_out]
        of_source = [0.0 if s.is_met_only else share for s in self.lights.sources]
        ratio = np.broadcast_to(np.array(of_source, np.float32), (len(sent_out), len(of_source)))
        order = place[point] * np.uint32(rays) + (sent_out % rays).astype(np.uint32)
        out = _Rays(
            p.origin[point], p.geometric_normal[point], direction, pdf, lobe_pdf, ratio, order, lobe_pdf
        )  # fmt: skip
        lit, bounced = self._incoming(out, 1, seed)
        if self.guide.field is not None:
            matte = weight.reshape(-1, COLUMNS)[sent_out, :2].sum(1)
            level = np.where(p.guide < 0, np.inf, self.guide.arriving[p.guide])[point]
            brings = luminance(bounced) * matte
            is_too_much = (brings > RAY_MOST * level) & (lobe_pdf < SHARP_PDF)
            bounced[is_too_much] *= (RAY_MOST * level / np.maximum(brings, 1e-30))[is_too_much, None]
        met = np.zeros((n * rays, 6), np.float32)
        met[sent_out, :3], met[sent_out, 3:] = lit, bounced
        sums = np.matmul(weight.transpose(0, 2, 1), met.reshape(n, rays, 6)) / np.float32(rays)
        return sums[..., :3], sums[..., 3:]

    # ── lights ───────────────────────────────────────────────────────────────────────────────────

    def _weigh(
        self, p: ShadingPoints, arrival: Arrival, source: Source, ratio: F32 | np.float32
    ) -> tuple[NDArray[np.intp], F32, F32]:
        """Weighs sampled light, shadows included.

        Args:
            ratio: light samples for one ray of the lobes; scalar or (n,).

        Returns: rows (m,) of points that are lit, their lobe weights (m, 5), radiance over density (m, 3).
        """
        useful = (arrival.pdf > 0) & (brightest(arrival.radiance) > 0)
        useful &= dot(p.normal, arrival.direction) > 0
        useful &= dot(p.geometric_normal, arrival.direction) > 0
        rows = np.flatnonzero(useful)
        direction = arrival.direction[rows]
        blocked = self.tracer.occluded(p.origin[rows], direction, arrival.distance[rows] * np.float32(1 - 1e-4))
        rows, direction = rows[~blocked], direction[~blocked]
        lobe_pdf, weight = self._lobes.evaluate(p, rows, direction)
        weight *= np.array([source.diffuse] * 2 + [source.specular] * 3, np.float32)
        density = arrival.pdf[rows]
        if arrival.is_delta or source.is_split:
            share = np.ones_like(density)
        else:
            sampled = density * np.broadcast_to(ratio, len(arrival.pdf))[rows]
            share = sampled / (sampled + lobe_pdf)
        return rows, weight, arrival.radiance[rows] * (share / density)[:, None]

    def _lights_met(self, origin: F32, direction: F32, pdf: F32, ratio: F32, met: Hits, mirrored: NDArray) -> F32:
        """Returns what lights, domes and emissive surfaces send along rays (n, 3), weighted against their sampling.

        `ratio` (n, sources): samples of each source for one ray.  Mirrored rays stand for directions in which
        nothing was sampled: what is small and bright would be found by chance, so they see domes only, and wide.
        """
        out = np.zeros((len(origin), 3), np.float32)

        def add(rows: NDArray, radiance: F32, light_pdf: F32, s: int) -> None:
            sampled = light_pdf * ratio[rows, s]
            out[rows] += radiance * (pdf[rows] / (pdf[rows] + sampled))[:, None]

        escaped = np.flatnonzero(met.triangle < 0)
        wide = escaped[mirrored[escaped]]
        escaped = escaped[~mirrored[escaped]]
        for s, source in enumerate(self.lights.placed):
            if source.is_delta or source.is_split:
                continue
            distance, radiance, light_pdf = source.intersect(origin, direction)
            rows = np.flatnonzero((brightest(radiance) > 0) & (distance <= met.distance) & ~mirrored)
            add(rows, radiance[rows] * np.float32(source.diffuse), light_pdf[rows], s)
        first = len(self.lights.placed)
        for s, dome in enumerate(self.lights.domes, first):
            if not dome.is_split:
                d = direction[escaped]
                add(escaped, dome.dome.radiance(d, None) * np.float32(dome.diffuse), dome.dome.pdf(d), s)
                if len(wide):
                    out[wide] += dome.dome.radiance(direction[wide], MIRRORED_ANGLE) * np.float32(dome.diffuse)
        emissive = self.lights.emissive
        if len(emissive.triangle):
            rows = np.flatnonzero((met.triangle >= 0) & ~mirrored)
            rows = rows[emissive.emits[met.triangle[rows]]]
            triangle = met.triangle[rows]
            radiance = emissive.emission(triangle, met.barycentric[rows])
            light_pdf = emissive.pdf(triangle, direction[rows], met.distance[rows])
            add(rows, radiance, light_pdf, len(self.lights.sources) - 1)
        return out

    # ── rays ─────────────────────────────────────────────────────────────────────────────────────

    def _incoming(self, rays: _Rays, depth: int, seed: int) -> tuple[F32, F32]:
        """Returns the radiance that arrives along rays: from lights (n, 3) and from surfaces (n, 3)."""
        lobe_pdf, least_pdf = rays.lobe_pdf, rays.least_pdf
        below = dot(rays.geometric_normal, rays.direction)
        mirrored = below < 0  # seen by the shading normal only: folded up, else bumps would be black
        up = rays.direction - 2 * below[:, None] * rays.geometric_normal
        direction = np.where(mirrored[:, None], up, rays.direction)
        met = self.tracer.intersect(rays.origin, direction)
        lit = self._lights_met(rays.origin, direction, rays.pdf, rays.ratio, met, mirrored)
        bounced = np.zeros_like(lit)
        rows = np.flatnonzero(met.triangle >= 0)
        if not len(rows):
            return lit, bounced
        triangle, barycentric, distance = met.triangle[rows], met.barycentric[rows], met.distance[rows]
        d = direction[rows]
        cosine = np.abs(dot(self.scene.triangles.face_normals[triangle], d))
        footprint = distance**2 / np.maximum(lobe_pdf[rows] * np.maximum(cosine, 0.05), 1e-6)
        follow = (footprint < self.footprint * self.element_area) & (depth <= self.depth)
        known = np.flatnonzero(~follow)
        if len(known) and self.light_field is not None:
            value, is_uneven = self._cached(triangle[known], barycentric[known], d[known], lobe_pdf[rows[known]])
            emissive = self.lights.emissive
            if len(emissive.triangle):  # their own light was counted above
                shining = np.flatnonzero(emissive.emits[triangle[known]])
                own = emissive.emission(triangle[known[shining]], barycentric[known[shining]])
                value[shining] = np.maximum(value[shining] - own, 0)
                is_uneven[shining] = False
            bounced[rows[known]] = value
            follow[known] = is_uneven & (depth <= self.depth)
        at = np.flatnonzero(follow)
        if len(at):
            surface = evaluate_surface(self.scene, triangle[at], barycentric[at])
            if np.isfinite(self.footprint):
                wide = least_pdf[rows[at]] < SHARP_PDF
                rougher = np.maximum(surface.roughness, CAUSTIC_ROUGHNESS)
                surface = replace(surface, roughness=np.where(wide, rougher, surface.roughness))
            q = shading_points(surface, -d[at], self.tracer, model=self.model)
            out = self._outgoing(q, rays.index[rows[at]], depth, least_pdf[rows[at]], seed)
            # a ray is stopped here with the probability `opacity`; what is reflected is not scaled by that
            bounced[rows[at]] = out * (surface.presence / np.maximum(surface.opacity, 0.05))[:, None]
        return lit, bounced

    def _cached(self, triangle: I32, barycentric: F32, direction: F32, pdf: F32) -> tuple[F32, NDArray[np.bool_]]:
        """Returns the light field's radiance (n, 3) at hits, and where it is too uneven to be interpolated.

        That is where something bright is near: a lamp close to a wall, the edge of a strong shadow.
        """
        n = len(triangle)
        out, uneven = np.empty((n, 3), np.float32), np.zeros(n, bool)
        wide = np.flatnonzero(pdf < WIDE_PDF)
        sharp = np.flatnonzero(pdf >= WIDE_PDF)
        assert self.light_field is not None
        if self._wide_field is None:
            wide, sharp = wide[:0], np.arange(n)
        else:
            out[wide], brightest_near = self._wide_field.radiance_from_hits(
                triangle[wide], barycentric[wide], direction[wide]
            )
            usual = luminance(out[wide])
            mean = usual.mean() if len(usual) else 0
            uneven[wide] = (brightest_near > UNEVEN * np.maximum(usual, mean)) | (usual > BRIGHT * mean)
        out[sharp] = self.light_field.radiance_from_hits(triangle[sharp], barycentric[sharp], direction[sharp])
        return out, uneven

    def _outgoing(self, p: ShadingPoints, index: NDArray[np.uint32], depth: int, least_pdf: F32, seed: int) -> F32:
        """Returns the reflected radiance (n, 3) of points on the way: one sample of one source, one ray onwards."""
        n = len(p)
        out = np.zeros((n, 3), np.float32)
        stream = seed + 100 * depth
        chances = np.zeros((n, 0), np.float32)
        if self.lights.sources:
            chances = self.lights.chances(p.position)
            u = self._lobes.sequence(index, stream + 1)
            pick = (np.cumsum(chances, 1) < u[:, :1]).sum(1)
            pick = np.minimum(pick, len(self.lights.sources) - 1)
            u = self._lobes.sequence(index, stream + 2)
            for s, source in enumerate(self.lights.sources):
                rows = np.flatnonzero((pick == s) & (chances[:, s] > 0))
                if not len(rows):
                    continue
                q, chance = p[rows], chances[rows, s]
                arrival = source.sample(q.position, u[rows])
                lit, weight, radiance = self._weigh(q, arrival, source, chance)
                light = weight[:, :, None] * (radiance / chance[lit, None])[:, None]
                out[rows[lit]] += reflect(q.colors[lit], light)
        direction, pdf, _, weight = (a[:, 0] for a in self._lobes.sample(p, index, 1, stream + 3))
        rows = np.flatnonzero(pdf > 0)
        q, density = p[rows], pdf[rows]
        least = np.minimum(least_pdf[rows], density)
        onwards = _Rays(
            q.origin, q.geometric_normal, direction[rows], density, density, chances[rows], index[rows], least
        )  # fmt: skip
        shone, bounced = self._incoming(onwards, depth + 1, seed)
        out[rows] += reflect(q.colors, weight[rows][:, :, None] * (shone + bounced)[:, None])
        return out
