"""Footprints: what a dab covers of the picture, as points on surfaces.

    footprint(stroke, scene, tracer, located, rows, ...) -> dab, triangle, barycentric    of the painted surface alone
    mixed_footprint(...) -> Mixture                                                      all that shows in the dabs
    is_of_picture(stroke)                                                                which of the two a stroke means

Rays start at the eye where it sees the dab's centre: on weave, thin parts and folds it sees other places than a probe
from near by.  Where something hides the centre now (a stroke read again after motion), they start close to the surface.
They go through a disc that is parallel to the film: one that faces the eye would be longer on the picture than it was
painted, away from its middle, by one over the cosine.

A colour that was taken from the picture is that of all that shows there: at an edge, on thin parts and through glass
it is a mixture,

    painted = mean over the dab's rays of  sum over layers of  (prod (1 - opacity) of those in front) presence L

of which the painted material sends a part; the rest stays as it is.  Who paints many dabs with one colour means the
surface, and what is beside it is left out.
"""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from usdslf.lights.sources import LightSet, brightest
from usdslf.sampling.frames import frames_about
from usdslf.scene.records import F64, Scene
from usdslf.strokes.anchors import Located, points_on_triangles
from usdslf.strokes.stroke import Stroke, dab_rows
from usdslf.surfaces.surface_points import evaluate_opacity

if TYPE_CHECKING:
    from usdslf.rays import RayTracer

PICKED = 0.5  # share of a stroke's dabs with a colour of their own, above which it was taken from a picture
LEAST_PICKED = 3  # dabs of such a stroke
LAYERS = 8  # see-through surfaces of a ray
LEAST_SHOWN = 1e-3  # of a layer
FINEST = 4096  # rays of a dab that sees several things
MOST_FINER = 1 << 15  # of a stroke
MOST_FOUND = 1 << 16  # of a stroke, that find points of the painted material where it covers little
RARE = 24  # points of others, below which a dab takes some of those, up to as many
Points = tuple[NDArray, NDArray, NDArray]
"""dab (S,), triangle (S,), barycentric (S, 2)."""


@dataclass(frozen=True)
class Mixture:
    """What shows in n dabs: points of the painted material, points of others, and lights.

    The mean over a dab's points of `weight` L, `own` and `other` each for itself, is its share of the dab's radiance.
    """

    own: Points
    weight: F64  # (S,)
    other: Points
    other_weight: F64  # (F,)
    light: F64  # (n, 3) radiance of what is no surface


def is_of_picture(stroke: Stroke) -> bool:
    """Whether the colours of a stroke were taken from a picture, dab by dab, and not mixed for the surface."""
    if stroke.tool != "replace" or stroke.space != "scene":
        return False
    colors = stroke.colors[dab_rows(stroke)].astype(np.float64)
    step = 1e-3 * max(float(np.abs(colors).mean()), 1e-9)
    different = len(np.unique(np.round(colors / step), axis=0))
    return len(colors) >= LEAST_PICKED and different > PICKED * len(colors)


def footprint(
    stroke: Stroke, scene: Scene, tracer: RayTracer, located: Located, rows: NDArray, count: int, reach: float = 1.0
) -> Points:
    """Returns points of the painted surfaces, up to `count` a dab, spread over `reach` brushes."""
    start, aim = _rays(stroke, tracer, located, rows, count, reach)
    hits = tracer.intersect(start, aim)
    dab = np.repeat(np.arange(len(rows)), count)
    same = _is_painted(hits.triangle, dab, scene, located, rows, True)
    points = dab[same], hits.triangle[same], hits.barycentric[same]
    return _with_centres(points, located, rows)


def mixed_footprint(
    stroke: Stroke, scene: Scene, tracer: RayTracer, located: Located, rows: NDArray, count: int, lights: LightSet
) -> Mixture:
    """Returns all that `count` rays a dab see, through what can be seen through.

    A rim that covers a hundredth of a dab may shine as much as all the rest: where rays see several things, more of
    them, of which none is lit, say how much each covers, and where its material covers little more find points of it.
    """
    asked, n = Asked(stroke, scene, tracer, located), len(rows)
    seen, light = _shown(asked, rows, count, lights)
    mine = asked.is_mine(seen, rows)
    own, other, light = seen.chosen(mine), seen.chosen(~mine), light / count
    cover, other_cover = own.cover(n) / count, other.cover(n) / count
    mixed = np.flatnonzero((cover > 0) & ((other_cover > 0) | light.any(1)))
    more = min(FINEST, MOST_FINER // max(len(mixed), 1))
    if len(mixed) and more > count:
        finer, light_there = _shown(asked, rows[mixed], more, lights)
        mine = asked.is_mine(finer, rows[mixed])
        cover[mixed], light[mixed] = finer.chosen(mine).cover(len(mixed)) / more, light_there / more
        there = finer.chosen(~mine)
        other_cover[mixed] = there.cover(len(mixed)) / more
        other = other.with_rare(there.of_dabs(mixed), n, RARE)
        own = own.replaced_by(_whole_count(asked, rows, count, cover, mixed, lights))
    # The centre stands for all of a dab that shows nothing of its material.
    shows = np.bincount(own.dab, minlength=n) > 0
    other = other.chosen(shows[other.dab])
    whole = _with_centres(own.points, located, rows)
    weight = np.concatenate([own.shares(cover), np.ones(len(whole[0]) - len(own.dab))])
    return Mixture(whole, weight, other.points, other.shares(other_cover), light * shows[:, None])


def _whole_count(
    asked: Asked, rows: NDArray, count: int, cover: F64, mixed: NDArray, lights: LightSet
) -> Shown:
    """Returns some `count` points of the painted material in each mixed dab, of as many rays as that needs."""
    most = max(min(FINEST, MOST_FOUND // len(mixed)), count)
    rays = np.clip(count / np.maximum(cover[mixed], 1e-9), count, most).astype(int)
    seen, _ = _shown(asked, rows[mixed], rays, lights)
    return seen.chosen(asked.is_mine(seen, rows[mixed])).of_dabs(mixed)


@dataclass(frozen=True)
class Asked:
    """A stroke on a shot."""

    stroke: Stroke
    scene: Scene
    tracer: RayTracer
    located: Located

    def is_mine(self, seen: Shown, rows: NDArray) -> NDArray[np.bool_]:
        """Whether points of the dabs of some rows are of the painted material."""
        of_one_mesh = self.stroke.scope in ("prim", "stroke")
        return _is_painted(seen.triangle, seen.dab, self.scene, self.located, rows, of_one_mesh)


@dataclass(frozen=True)
class Shown:
    """Points that rays of dabs see, each with the part of its ray that it shows."""

    dab: NDArray
    triangle: NDArray
    barycentric: NDArray
    part: F64

    @property
    def points(self) -> Points:
        """Where they are."""
        return self.dab, self.triangle, self.barycentric

    def chosen(self, which: NDArray) -> Shown:
        """Some of them."""
        return Shown(self.dab[which], self.triangle[which], self.barycentric[which], self.part[which])

    def of_dabs(self, dabs: NDArray) -> Shown:
        """The same, of dabs that are numbered otherwise."""
        return Shown(dabs[self.dab], self.triangle, self.barycentric, self.part)

    def cover(self, n: int) -> F64:
        """Sums of their parts by dab (n,)."""
        return np.bincount(self.dab, self.part, n).astype(np.float64)

    def shares(self, cover: F64) -> F64:
        """Weights whose mean over the points of a dab is what they cover of it (n,)."""
        n = len(cover)
        number = np.bincount(self.dab, minlength=n)
        return self.part * (cover * number / np.maximum(self.cover(n), 1e-30))[self.dab]

    def replaced_by(self, others: Shown) -> Shown:
        """These, and others in place of those of the same dabs."""
        kept = self.chosen(~np.isin(self.dab, others.dab))
        pairs = ((getattr(kept, f.name), getattr(others, f.name)) for f in fields(Shown))
        return Shown(*(np.concatenate(pair) for pair in pairs))

    def with_rare(self, finer: Shown, n: int, least: int) -> Shown:
        """These, and `least` of others at most in place of the points of each dab (n,) that has fewer."""
        is_rare = np.bincount(self.dab, minlength=n) < least
        turn = np.random.default_rng(17).permutation(len(finer.dab))
        turn = turn[np.argsort(finer.dab[turn], kind="stable")]
        dab = finer.dab[turn]
        place = np.arange(len(dab)) - np.searchsorted(dab, dab)
        return self.replaced_by(finer.chosen(turn[(place < least) & is_rare[dab]]))


def _shown(asked: Asked, rows: NDArray, count: int | NDArray, lights: LightSet) -> tuple[Shown, F64]:
    """Returns what `count` rays, or (n,), of dabs see of surfaces, and the sum (n, 3) of the lights that they see."""
    scene, tracer = asked.scene, asked.tracer
    origin, aim = _rays(asked.stroke, tracer, asked.located, rows, count, 1.0)
    dab, n = np.repeat(np.arange(len(rows)), count), len(rows)
    ray, through = np.arange(len(dab)), np.ones(len(dab))
    light = np.zeros((n, 3))
    none = (np.zeros(0, int), np.zeros(0, np.int32), np.zeros((0, 2), np.float32), np.zeros(0))
    found: list[tuple[NDArray, ...]] = [none]
    for _ in range(LAYERS):
        hits = tracer.intersect(origin, aim[ray], stop_at_translucent=True)
        is_hit = hits.triangle >= 0
        _, shone = lights.seen(origin, aim[ray], np.where(is_hit, hits.distance, np.inf).astype(np.float32))
        in_light = brightest(shone) > 0
        away = ~is_hit & ~in_light
        shone[away] += lights.background(aim[ray[away]])
        np.add.at(light, dab[ray], through[ray, None] * shone)
        hit = np.flatnonzero(is_hit & ~in_light)
        if not len(hit):
            break
        ray, triangle, barycentric = ray[hit], hits.triangle[hit], hits.barycentric[hit]
        opacity, presence = evaluate_opacity(scene, triangle, barycentric)
        found.append((dab[ray], triangle, barycentric, through[ray] * presence))
        through[ray] *= 1 - opacity
        open_ = np.flatnonzero(through[ray] > LEAST_SHOWN)
        ray, triangle, barycentric = ray[open_], triangle[open_], barycentric[open_]
        position, _ = points_on_triangles(scene, triangle, barycentric)
        normal = scene.triangles.face_normals[triangle]
        behind = np.where((normal * aim[ray]).sum(1, keepdims=True) < 0, -normal, normal)
        origin = tracer.offset_points(position, behind, triangle)
    seen = Shown(*(np.concatenate(x) for x in zip(*found, strict=True)))
    return seen.chosen(seen.part > LEAST_SHOWN), light


def _rays(
    stroke: Stroke, tracer: RayTracer, located: Located, rows: NDArray, count: int | NDArray, reach: float
) -> tuple[NDArray, NDArray]:
    """Starts and unit directions (sum of counts, 3) of rays spread over `reach` brushes as the painter saw them."""
    counts = np.broadcast_to(count, len(rows))
    dab = np.repeat(np.arange(len(rows)), counts)
    k = np.arange(len(dab)) - (np.cumsum(counts) - counts)[dab]
    spiral = np.sqrt((k + 0.5) / counts[dab])[:, None] * np.stack([np.cos(2.39996 * k), np.sin(2.39996 * k)], -1)
    center = located.position[rows].astype(np.float64)
    stroke_row = located.row[rows]
    origin = stroke.eye[stroke_row].astype(np.float64)
    towards = center - origin
    distance = np.linalg.norm(towards, axis=1)
    facing = np.broadcast_to(stroke.film_normal, towards.shape) if any(stroke.film_normal) else towards
    frame = frames_about(facing / np.linalg.norm(facing, axis=1, keepdims=True)) * (reach / 2)
    brush = stroke.widths[stroke_row]
    place = center[dab] + np.einsum("rc,rcj->rj", spiral, (frame[:, :2] * brush[:, None, None])[dab])
    aim = place - origin[dab]
    aim /= np.linalg.norm(aim, axis=1, keepdims=True)
    shortest = np.minimum(2 * reach * brush, distance)
    clear = np.maximum(distance - 0.5 * brush, 0) / np.maximum(distance, 1e-30)
    hidden = tracer.occluded(origin, towards, clear.astype(np.float32))
    start = np.where(hidden[dab, None], place - aim * shortest[dab, None], origin[dab])
    return start.astype(np.float32), aim.astype(np.float32)


def _is_painted(
    triangle: NDArray, dab: NDArray, scene: Scene, located: Located, rows: NDArray, of_one_mesh: bool
) -> NDArray[np.bool_]:
    """Whether hits (m,) of rays of dabs (m,) are on the material, and the mesh, that the dab's centre is on."""
    table, met = scene.triangles, np.maximum(triangle, 0)
    center = located.triangle[rows][dab]
    same = (triangle >= 0) & (table.material[met] == table.material[center])
    return same & (table.mesh[met] == table.mesh[center]) if of_one_mesh else same


def _with_centres(points: Points, located: Located, rows: NDArray) -> Points:
    """The points, and the centre of each dab that has none: it is smaller than the rounding."""
    dab, triangle, barycentric = points
    missing = np.setdiff1d(np.arange(len(rows)), dab)
    return (
        np.concatenate([dab, missing]),
        np.concatenate([triangle, located.triangle[rows[missing]]]).astype(np.int32),
        np.concatenate([barycentric, located.barycentric[rows[missing]]]).astype(np.float32),
    )
