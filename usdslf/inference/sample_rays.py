"""Rays of samples: what light arrives at painted points, as pictures see it; the host's part of kernels/sample_rays.cl.

At every point rays are drawn from a mixture of a cosine and GGX lobes about the eye's mirror direction, and one set of
rays serves all levels of roughness.  Hits take the light field, misses the domes at full resolution, lights are drawn
with shadow rays, and all are joined by the balance heuristic.  The light field blends elements: in corners, beside
lamps and where reflections are finer than elements, pictures follow the ray instead, and so does this, by the same
kernels.

Source: Veach 1997 (multiple importance sampling); Heitz 2018 (visible normals); Keller and Heidrich 2001.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from usdslf.gpu.launch import GROUP, groups
from usdslf.inference.pictured import Pictured
from usdslf.progress import tell
from usdslf.render.live.paths import BATCH, Brought, follow
from usdslf.render.live.scene import Shadows
from usdslf.sampling.low_discrepancy import random_shifts, sobol_points
from usdslf.surfaces.reflectance import lobe_parameter
from usdslf.surfaces.surface_points import SurfacePoints

SHARPEST = 0.04  # roughness; sharper lobes count as this
LOBE_ROUGHNESS = (0.08, 0.22, 0.42, 0.7)  # of the rays; the first is less at points that are sharper
LIGHT_RAYS = (4, 16)  # of a sample: least to each light, and to all lights where they are few
LEAST_REFLECTED = 1e-3  # of what a surface sends, below which rounding is all that is left beside its own light
MOST_OF_LINK = 1e3  # times what the light field has, that a picture may see along a ray
LANES = 16  # numbers that lie side by side


@dataclass(frozen=True)
class Points:
    """S surface points, in the order of their dabs, as rays leave them."""

    dab: NDArray[np.int64]  # (S,)
    surface: SurfacePoints
    side: NDArray[np.int64]  # (S,) +1 or -1
    eye: NDArray[np.float32]  # (S, 3) local, unit
    frames: NDArray  # (S, 3, 3) rows are the local axes, on the eye's side
    geometric: NDArray  # (S, 3) geometric normal on the eye's side
    origin: NDArray  # (S, 3) off the surface
    weight: NDArray[np.float32]  # (S,) share of their light that counts


@dataclass(frozen=True)
class RayLight:
    """The light of S samples on the device: K rays, then light samples, then zeros up to `row` numbers a channel."""

    towards_d: Any  # (S, 3, row) local directions
    fixed_d: Any  # (S, 3, row) light that no edit changes, over density, by the lights' diffuse factors
    fixed_specular_d: Any  # by their specular factors, where these are others; else `fixed_d`
    gain_d: Any  # (S * K, 3) one over the density, for what the surfaces send, by their detail
    links_d: Any  # (S * K, 4)
    weights_d: Any  # (S * K, 4)
    rays: int  # K


@dataclass(frozen=True)
class Trace:
    """What rays are made of and meet.  A sample has `rays`: a part by cosine, the others by lobes of fixed widths."""

    light: Pictured
    rays: int
    rng: np.random.Generator = field(default_factory=lambda: np.random.default_rng(7))

    @property
    def light_rays(self) -> int:
        """Rays of a sample to each light that has an extent."""
        least, most = LIGHT_RAYS
        wide = sum(not (s.is_met_only or s.is_delta) for s in self.light.lights.sources)
        return max(least, most // max(wide, 1))

    @property
    def counts(self) -> NDArray[np.int64]:
        """Rays of each technique."""
        lobes = len(LOBE_ROUGHNESS)
        counts = np.full(lobes + 1, self.rays // (lobes + 2))
        counts[0] = self.rays - counts[1:].sum()
        return counts

    @cached_property
    def mixture(self) -> tuple[np.int32, Any, Any]:
        """The number of lobes, their widths and the rays of each technique, on the device."""
        upload = self.light.field.device.upload
        alphas = lobe_parameter("preview_surface", LOBE_ROUGHNESS).astype(np.float32)
        return np.int32(len(alphas)), upload(alphas), upload(self.counts.astype(np.float32))

    @cached_property
    def drawn(self) -> NDArray[np.int32]:
        """Of each direction towards a light (per_sample, 3): the source, how many that has, which of them it is."""
        sources = self.light.lights.sources
        many = self.light_rays
        rows = [(s, 1 if source.is_delta else many) for s, source in enumerate(sources) if not source.is_met_only]
        return np.array([(s, n, k) for s, n in rows for k in range(n)], np.int32).reshape(-1, 3)

    def kernel(self, name: str) -> Any:
        """Returns a kernel of sample_rays.cl."""
        return self.light.scene.geometry.kernel("sample_rays", name)


def trace_rays(p: Points, t: Trace) -> RayLight:
    """Draws and traces the rays of samples, and their directions towards lights."""
    device, s = t.light.field.device, len(p.eye)
    per_sample = len(t.drawn)
    row = -(-(t.rays + per_sample) // LANES) * LANES
    make = lambda *shape: device.zeros(shape, np.float32)  # noqa: E731
    fixed_d = make(s, 3, row)
    out = RayLight(
        make(s, 3, row), fixed_d, make(s, 3, row) if t.light.is_split else fixed_d,
        device.empty((s * t.rays, 3), np.float32), device.empty((s * t.rays, 4), np.uint32),
        device.empty((s * t.rays, 4), np.float32), t.rays,
    )  # fmt: skip
    upload = lambda x: device.upload(np.asarray(x, np.float32))  # noqa: E731
    narrowest = lobe_parameter("preview_surface", np.clip(p.surface.roughness, SHARPEST, LOBE_ROUGHNESS[0]))
    places = tuple(upload(x) for x in (p.eye, p.frames, p.origin, p.geometric, narrowest))
    weight_d = upload(p.weight)
    u_d = upload(np.concatenate([_points_of_dabs(int(c), p.dab, t.rng) for c in t.counts], 1))
    with t.light.room.lock:
        step = max(2 * BATCH // t.rays, 1)
        for first in range(0, s, step):
            _trace_rays(out, (first, min(step, s - first)), places, u_d, weight_d, t)
            tell()
    if per_sample:
        us = [_points_of_dabs(n, p.dab, t.rng) for _, n, k in t.drawn.tolist() if k == 0]
        u_d, place_d = upload(np.concatenate(us, 1)), device.upload(_places_of_dabs(p.dab, t.light_rays))
        step = max(2 * BATCH // per_sample, 1)
        for first in range(0, s, step):
            _trace_lights(out, (first, min(step, s - first)), (*places, u_d, place_d), weight_d, t)
            tell()
    return out


def _trace_rays(
    out: RayLight, part: tuple[int, int], places: tuple[Any, ...], u_d: Any, weight_d: Any, t: Trace
) -> None:  # fmt: skip
    """Draws and traces the rays of some samples: first and number."""
    scene, room, depth = t.light.scene, t.light.room, t.light.depth
    device, hits, rays = scene.geometry.device, room.lobes, np.uint32(t.rays)
    n, first, row = part[1] * t.rays, part[0] * t.rays, np.uint32(out.towards_d.shape[2])
    technique_d = device.upload(np.repeat(np.arange(len(t.counts)), t.counts).astype(np.int32))
    density_d, is_split = device.empty((n,), np.float32), np.int32(t.light.is_split)
    specular_d = device.empty((n, 3), np.float32) if is_split else density_d
    t.kernel("draw_rays")(
        groups(n), (GROUP,), np.uint32(n), np.uint32(part[0]), rays, row, *places, u_d, technique_d, *t.mixture,
        out.towards_d, hits.origin, hits.direction, hits.length, density_d,
    )  # fmt: skip
    hits.trace(scene.geometry.tracer, n)
    met = hits.triangle, hits.u, hits.v
    t.kernel("arrive")(
        groups(n), (GROUP,), np.uint32(n), np.uint32(first), np.float32(t.rays), np.float32(t.light_rays),
        np.int32(depth > 0), *t.light.arguments(), *scene.field_arguments(), hits.origin, hits.direction, hits.length,
        *met, hits.distance, density_d, is_split, t.light.sources[1], out.links_d, out.weights_d, room.arrived,
        specular_d, room.state, room.followed,
    )  # fmt: skip
    room.followed.pull()
    who = np.flatnonzero(room.followed.host[:n])
    follow(scene, room, (hits, room.state), who, Brought(room.arrived, 8), depth)
    t.kernel("settle_rays")(
        groups(n), (GROUP,), np.uint32(n), np.uint32(first), rays, row, np.int32(depth > 0),
        np.float32(LEAST_REFLECTED), np.float32(MOST_OF_LINK), *scene.arguments(), scene.light.outgoing_d, *met,
        density_d, room.arrived, specular_d, out.links_d, out.weights_d, weight_d, out.fixed_d, out.fixed_specular_d,
        out.gain_d,
    )  # fmt: skip
    device.finish()  # before the room is written to again


def _trace_lights(
    out: RayLight, part: tuple[int, int], places: tuple[Any, ...], weight_d: Any, t: Trace
) -> None:  # fmt: skip
    """Draws directions of some samples towards all lights, and finds what is in their way."""
    scene = t.light.scene
    device, per_sample = scene.geometry.device, len(t.drawn)
    n, sizes = part[1] * per_sample, (np.uint32(part[0]), np.uint32(per_sample), np.uint32(t.rays))
    row, shadows = np.uint32(out.towards_d.shape[2]), Shadows(device, n)
    t.kernel("draw_lights")(
        groups(n), (GROUP,), np.uint32(n), *sizes, row, *t.light.arguments(), *places, device.upload(t.drawn), weight_d,
        *t.mixture, out.towards_d, out.fixed_d, out.fixed_specular_d, *shadows.arguments,
    )  # fmt: skip
    shadows.trace(scene.geometry.tracer, n)
    t.kernel("shade_lights")(
        groups(n), (GROUP,), np.uint32(n), *sizes, row, shadows.length, shadows.blocked, out.fixed_d,
        out.fixed_specular_d,
    )  # fmt: skip
    device.finish()


def _places_of_dabs(dab: NDArray, light_rays: int) -> NDArray[np.uint32]:
    """Where samples (S,) in the order of their dabs begin among the drawn directions of a dome: side by side."""
    turn = np.arange(len(dab)) - np.searchsorted(dab, dab)
    start = np.random.default_rng(11).integers(0, 1 << 16, int(dab.max(initial=0)) + 1)
    return (start[dab] + turn * light_rays).astype(np.uint32)


def _points_of_dabs(k: int, dab: NDArray, rng: np.random.Generator) -> NDArray[np.float32]:
    """Points (S, k, 2) of the unit square for samples in the order of their dabs (S,).

    The samples of a dab take runs of one sequence, so that all of its rays are stratified together: a lobe is
    sharper than what the few rays of one sample can meet.  Source: Keller and Heidrich 2001 (interleaved sampling).
    """
    _, first, number = np.unique(dab, return_index=True, return_counts=True)
    which = np.searchsorted(dab[first], dab)
    turn = np.arange(len(dab)) - first[which]
    shifts = random_shifts(len(first), rng)
    out = np.empty((len(dab), k, 2), np.float32)
    for size in np.unique(number):
        sets = np.flatnonzero(number == size)
        place = np.searchsorted(sets, which)
        rows = np.flatnonzero(number[which] == size)
        points = sobol_points(0, int(size) * k, shifts[sets]).reshape(len(sets), int(size), k, 2)
        out[rows] = points[place[rows], turn[rows]]
    return out
