"""Rays against all triangles of a scene, traced by Embree on all processors.

Facts about `EmbreeScene.run` that it relies on: it releases the GIL; `dists` limits the distance (and is
overwritten); an OCCLUDED query returns 0 where something is in the way and -1 where not, and is to be
asked without `output`; barycentric (u, v) means (1 - u - v) P0 + u P1 + v P2.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import ThreadPoolExecutor
from copy import copy
from dataclasses import dataclass
from typing import Any
from weakref import finalize

import numpy as np
from numpy.typing import NDArray

from usdslf.embree import build_tree
from usdslf.progress import tell
from usdslf.scene.records import F32, I32, Scene
from usdslf.surfaces.surface_points import evaluate_opacity
from usdslf.threads import Work, map_ahead, thread_count

LEAST_COSINE = 0.005  # rays that a shading normal sends below the surface leave it at this angle
FAR = np.float32(1e37)  # Embree's "no limit"
CHUNK = 16384  # rays of one run: their records stay in the second-level cache
FEWEST = 2048  # rays of one run, where several threads share what is less than CHUNK
MAX_LAYERS = 32  # see-through surfaces that a ray may pass
ULPS = 16.0  # offset of ray origins, in units of the last place of the coordinates
MOST = 0.88  # share of rows that are rays, above which the others are traced with them
USUAL = 0.99  # of all triangles keep the bound of points whose triangle is not told
LIFT = 0.2  # of their distance: how far two places are lifted to look at each other

Opacity = Callable[[I32, F32], F32]
"""triangle (n,), barycentric (n, 2) -> opacity (n,)."""


@dataclass(frozen=True)
class Hits:
    """First surfaces met by n rays."""

    triangle: I32  # (n,) into Scene.triangles, -1 where nothing was hit
    barycentric: F32  # (n, 2)
    distance: F32  # (n,) in lengths of the direction; inf where nothing was hit


class RayTracer:
    """Traces rays against all triangles of a scene.

    Surfaces that can be seen through are passed by tracing again from behind them: cut-outs
    (opacityThreshold > 0) where the opacity at the hit is below the threshold, others with the
    probability 1 - opacity, decided by a hash of ray and triangle, so that the same ray always
    gives the same answer and an average over rays the right mixture.
    """

    def __init__(self, scene: Scene, opacity: Opacity | None = None, threads: int | None = None) -> None:
        """Builds the tree.

        Args:
            scene: whose triangles are traced.
            opacity: opacity at points; None: the materials', from `surface.evaluate_opacity`.
            threads: None: as many as there are processors.
        """
        self.scene = scene
        self._whose: RayTracer | None = None
        self.threads = threads or thread_count()
        triangles = scene.triangles
        corners = np.ascontiguousarray(triangles.positions, np.float32)
        # NaN and infinite corners would poison the bounds of the tree: collapse those triangles.
        finite = np.isfinite(corners).reshape(-1, 9).all(1)
        corners = np.where(finite.reshape(-1, 1, 1), corners, np.float32(0))
        # (T,) largest coordinate of each triangle, which bounds the rounding of points on it
        self.extent: F32 = np.abs(corners).max((1, 2)) if len(corners) else np.zeros(0, np.float32)
        usual = math.ceil(USUAL * (len(corners) - 1))
        self._usual_extent = float(np.partition(self.extent, usual)[usual]) if len(corners) else 0.0
        self._embree, starts = build_tree(corners)
        # (meshes + 1,) first triangle of each of Embree's meshes; the last, -1, is that of rays that met none
        self._first = np.array([*starts, 0], np.int32)
        self._pool = ThreadPoolExecutor(self.threads, thread_name_prefix="usdslf-rays")
        finalize(self, self._pool.shutdown, wait=False)

        self._opacity = opacity  # None: the materials'; a method here would keep the tracer until garbage is collected
        self._set_materials(scene)

    def _set_materials(self, scene: Scene) -> None:
        clear = np.fromiter((not m.is_opaque for m in scene.materials), bool)
        self._threshold = np.array([m.opacity_threshold for m in scene.materials], np.float32)
        self._clear = clear[scene.triangles.material] if np.any(clear) else None

    def under(self, scene: Scene) -> RayTracer:
        """Returns a tracer of the same triangles under other materials; the tree is shared."""
        other = copy(self)
        other.scene, other._whose = scene, self  # whose threads and tree they are
        other._set_materials(scene)
        return other

    def intersect(self, origins: NDArray, directions: NDArray, stop_at_translucent: bool = False) -> Hits:
        """Finds the first surface along each ray.

        Args:
            origins: (n, 3), moved off the surface they lie on by `offset_points`.
            directions: (n, 3); unit vectors make distances stage units.
            stop_at_translucent: surfaces with an opacity below one are hit as well, for callers that blend them
                exactly; only cut-outs are passed.
        """
        o, d = _rays(origins, directions)
        n = len(o)
        hits = Hits(np.empty(n, np.int32), np.empty((n, 2), np.float32), np.empty(n, np.float32))
        self._run_chunks(n, lambda rows: self._intersect_into(o[rows], d[rows], hits, rows))
        if self._clear is not None:
            self._pass_through(o, d, hits, stop_at_translucent)
        return hits

    def occluded(
        self,
        origins: NDArray,
        directions: NDArray,
        distance: NDArray | float = np.inf,
        see_through: bool = True,
    ) -> NDArray:
        """Tells which rays (n,) meet a surface within `distance` (scalar or (n,), in direction lengths)."""
        o, d = _rays(origins, directions)
        n = len(o)
        limit = np.minimum(np.broadcast_to(np.asarray(distance, np.float32), n), FAR)
        if self._clear is None or not see_through:
            blocked = np.empty(n, bool)

            def run(rows: slice) -> None:
                found = self._embree.run(o[rows], d[rows], dists=limit[rows].copy(), query="OCCLUDED")
                blocked[rows] = found == 0

            self._run_chunks(n, run)
            return blocked & (limit > 0)
        hits = self.intersect(o, d)
        return (hits.triangle >= 0) & (hits.distance < limit)

    def intersect_into(
        self, rays: tuple[F32, F32, F32], found: tuple[I32, F32, F32, F32], stop_at_translucent: bool = False
    ) -> None:
        """Does what `intersect` does with arrays that are there already, which it writes to.

        Args:
            rays: origins (n, 3), directions (n, 3) and lengths (n,); 0: there is no ray.
            found: triangle, u, v and distance, each (n,).
            stop_at_translucent: as of `intersect`.
        """
        origin, direction, length = rays
        triangle, u, v, distance = found

        def run(rows: slice) -> None:
            at = _there(length, rows)
            if at is not rows:
                triangle[rows] = -1
                if not len(at):
                    return
            met = self._embree.run(*_taken(rays, at), output=True)
            triangle[at], u[at], v[at], distance[at] = self._triangle(met), met["u"], met["v"], met["tfar"]

        self._run_chunks(len(length), run)
        if self._clear is None:
            return
        hits = Hits(triangle, np.stack([u, v], 1), distance)
        self._pass_through(origin, direction, hits, stop_at_translucent)
        u[:], v[:] = hits.barycentric.T

    def occluded_into(self, rays: tuple[F32, F32, F32], blocked: NDArray[np.uint8]) -> None:
        """Does what `occluded` does with arrays that are there already; writes 1 where something is in the way.

        Args:
            rays: origins (n, 3), directions (n, 3) and lengths (n,); 0: there is no ray.
            blocked: (n,).
        """
        origin, direction, length = rays
        if self._clear is not None:
            asked = np.flatnonzero(length > 0)
            blocked[asked] = self.occluded(origin[asked], direction[asked], length[asked])
            return

        def run(rows: slice) -> None:
            at = _there(length, rows)
            if at is not rows and not len(at):
                return
            blocked[at] = self._embree.run(*_taken(rays, at), query="OCCLUDED") == 0

        self._run_chunks(len(length), run)

    def intersect_columns(self, origins: F32, directions: F32) -> tuple[NDArray, ...]:
        """Does what `intersect` does on the calling thread alone, for callers that share out the work.

        Returns: triangle, u, v, distance, each (n,); the distance of a miss is any large number.
        """
        found = self._embree.run(origins, directions, output=True)
        triangle, u, v, distance = self._triangle(found), *(found[name] for name in ("u", "v", "tfar"))
        if self._clear is None:
            return triangle, u, v, distance
        hits = Hits(triangle, np.stack([u, v], 1), distance)
        self._pass_through(origins, directions, hits)
        return triangle, *(np.ascontiguousarray(x) for x in hits.barycentric.T), distance

    def map_ahead(self, work: Callable[[int], Work], items: Iterable[int]) -> Iterator[tuple[int, Work]]:
        """Yields (item, work(item)) in order, working on some items ahead on all threads: see `threads.map_ahead`."""
        return map_ahead(self._pool, work, items, 2 * self.threads)

    def offset_points(
        self, points: NDArray, geometric_normals: NDArray, triangle: NDArray | None = None
    ) -> NDArray[np.float32]:
        """Moves points off their surface, so that rays do not hit the surface they start from.

        The error of a point and of its intersection is some units of the last place of the largest
        coordinate of its triangle, so the step is that many, whatever the size of the scene and its
        distance from the origin.

        Args:
            points: (n, 3) on surfaces.
            geometric_normals: (n, 3) unit, on the side to move to.
            triangle: (n,) that the points lie on; without it a bound that nearly all triangles keep is used.
        """
        p = np.asarray(points, np.float64)
        extent = np.abs(p).max(-1, initial=0.0)
        if triangle is None:
            extent = np.maximum(extent, self._usual_extent)
        else:
            extent = np.maximum(extent, self.extent[np.asarray(triangle)])
        step = ULPS * np.finfo(np.float32).eps * extent
        return (p + step[..., None] * np.asarray(geometric_normals, np.float64)).astype(np.float32)

    def _triangle(self, found: dict[str, NDArray]) -> I32:
        """The triangles (n,) that Embree's records name by mesh and row, -1 where nothing was hit."""
        row: I32 = found["primID"]
        if len(self._first) > 2:  # the row of a miss is -1, and so is its mesh: the last
            row += self._first.take(found["geomID"], mode="wrap")
        return row

    def _run_chunks(self, n: int, run: Callable[[slice], None]) -> None:
        parts = max(-(-n // CHUNK), min(self.threads, n // FEWEST), 1)
        if parts > self.threads:  # as many for each thread
            parts = -(-parts // self.threads) * self.threads
        size = max(-(-n // parts), 1)
        slices = [slice(a, min(a + size, n)) for a in range(0, n, size)]
        if len(slices) < 2 or self.threads == 1:
            for rows in slices:
                run(rows)
        else:
            for _ in self._pool.map(run, slices):
                tell()

    def _intersect_into(self, o: F32, d: F32, hits: Hits, rows: slice | NDArray) -> None:
        found = self._embree.run(o, d, output=True)
        triangle = self._triangle(found)
        hits.triangle[rows] = triangle
        hits.barycentric[rows, 0] = found["u"]
        hits.barycentric[rows, 1] = found["v"]
        hits.distance[rows] = np.where(triangle >= 0, found["tfar"], np.float32(np.inf))

    def _pass_through(self, o: F32, d: F32, hits: Hits, stop_at_translucent: bool = False) -> None:
        """Moves hits on what a ray passes through to the surfaces behind, in at most MAX_LAYERS rounds."""
        assert self._clear is not None
        rays = np.flatnonzero((hits.triangle >= 0) & self._clear[hits.triangle])
        for _ in range(MAX_LAYERS):
            rays = rays[self._lets_through(o[rays], d[rays], hits, rays, stop_at_translucent)]
            if not len(rays):
                return
            triangle, travelled = hits.triangle[rays], hits.distance[rays]
            t = self.scene.triangles
            normal = t.face_normals[triangle]
            ahead = np.where((normal * d[rays]).sum(1, keepdims=True) < 0, -normal, normal)
            met = points_at(t.positions, triangle, hits.barycentric[rays])
            start = self.offset_points(met, ahead, triangle)
            self._intersect_into(start, d[rays], hits, rays)
            hits.distance[rays] += travelled
            again = (hits.triangle[rays] >= 0) & self._clear[hits.triangle[rays]]
            rays = rays[again]

    def _lets_through(self, o: F32, d: F32, hits: Hits, rays: NDArray, stop_at_translucent: bool) -> NDArray:
        triangle = hits.triangle[rays]
        opacity = (self._opacity or self._material_opacity)(triangle, hits.barycentric[rays])
        threshold = self._threshold[self.scene.triangles.material[triangle]]
        chance = np.float32(-1) if stop_at_translucent else _hash_unit(o, d, triangle)
        return np.where(threshold > 0, opacity < threshold, chance >= opacity)

    def _material_opacity(self, triangle: I32, barycentric: F32) -> F32:
        return evaluate_opacity(self.scene, triangle, barycentric)[0]


def _there(length: F32, rows: slice) -> Any:
    """Returns which of some rows are rays, that is, have a length; all where most are: then moving them costs more."""
    there = np.flatnonzero(length[rows] > 0)
    return rows if len(there) > MOST * (rows.stop - rows.start) else there + rows.start


def _taken(rays: tuple[F32, F32, F32], at: Any) -> tuple[F32, F32, F32]:
    """Returns some rows of rays; the lengths are a copy, which Embree writes to."""
    origin, direction, length = rays
    if isinstance(at, slice):
        return origin[at], direction[at], length[at].copy()
    return origin.take(at, 0), direction.take(at, 0), length.take(at)


def points_at(corners: NDArray, triangle: NDArray, barycentric: NDArray) -> NDArray:
    """Interpolates corner values (T, 3, k) at points (n,), (n, 2) in float64: (n, k)."""
    c = corners[triangle].astype(np.float64)
    u, v = barycentric[:, 0:1].astype(np.float64), barycentric[:, 1:2].astype(np.float64)
    return c[:, 0] + u * (c[:, 1] - c[:, 0]) + v * (c[:, 2] - c[:, 0])


def _rays(origins: NDArray, directions: NDArray) -> tuple[F32, F32]:
    d = np.ascontiguousarray(np.asarray(directions).reshape(-1, 3), np.float32)
    o = np.ascontiguousarray(np.broadcast_to(np.asarray(origins, np.float32), d.shape))
    return o, d


def _hash_unit(o: F32, d: F32, triangle: I32) -> NDArray[np.float32]:
    """A number in [0, 1) for each ray and triangle: their bits, mixed as in PCG's output function.

    Source: Jarzynski and Olano 2020, Hash Functions for GPU Rendering.
    """
    h = triangle.astype(np.uint32) * np.uint32(0x9E3779B9)
    for column in (*o.view(np.uint32).T, *d.view(np.uint32).T):
        state = (h ^ column) * np.uint32(747796405) + np.uint32(2891336453)
        word = ((state >> ((state >> np.uint32(28)) + np.uint32(4))) ^ state) * np.uint32(277803737)
        h = (word >> np.uint32(22)) ^ word
    return (h >> np.uint32(8)).astype(np.float32) * np.float32(2.0**-24)


def see_each_other(
    tracer: RayTracer, position: NDArray, normal: NDArray, other: NDArray, other_normal: NDArray
) -> NDArray[np.bool_]:
    """Tells which pairs of near places, lifted off their surfaces, have nothing between them.

    Args:
        position, other: (n, 3) on surfaces.
        normal, other_normal: (n, 3) unit geometric normals of their sides.
    """
    up = LIFT * np.linalg.norm(other - position, axis=1)[:, None]
    start = tracer.offset_points(position + up * normal, normal)
    seen: NDArray[np.bool_] = ~tracer.occluded(start, other + up * other_normal - start, 0.999, see_through=False)
    return seen
