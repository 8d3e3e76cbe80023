"""Which points of which sides of surfaces light can reach, so that the inside of closed bodies costs nothing.

Every surface reflects on both sides, but nothing of the inside of a vase with a lid is ever seen.  A point
is *reached* when one of a few random paths from it ends in the environment, on an emissive surface, or at a
vertex that sees a light; its first vertex may also see a camera.  Paths start from the true hits, so
nothing leaks where bodies cut into each other, which a graph over gprims or samples would allow.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from usdslf.rays import see_each_other
from usdslf.scene.records import F64, Light, Material, Scene

if TYPE_CHECKING:
    from usdslf.rays import RayTracer

BOUNCES = 5  # vertices of a path after its first
PROBE_ROUNDS = (2, 6, 16)  # paths per probe; only points not yet reached go into the next round
CANDIDATE_ROUNDS = (1, 4)  # where neighbours are asked as well
LOCAL = ("rect", "disk", "sphere", "cylinder")


def find_reached_points(
    scene: Scene,
    tracer: RayTracer,
    triangle: NDArray,
    position: NDArray,
    normal: NDArray,
    rng: np.random.Generator,
    rounds: tuple[int, ...] = PROBE_ROUNDS,
) -> NDArray[np.bool_]:
    """Tells which points can send light of the scene on.

    Args:
        triangle: (n,) that the points lie on.
        position: (n, 3) on the surface.
        normal: (n, 3) unit geometric normal of the side in question.
        rounds: paths per point, round by round.

    Returns: (n,) true where light or a camera was found.
    """
    reached = np.zeros(len(triangle), bool)
    start = tracer.offset_points(position, normal, triangle)
    for camera in scene.cameras:
        eye = camera.world_from_camera[:3, 3]
        reached |= _sees(tracer, start, normal, np.broadcast_to(eye, start.shape))
    for paths in rounds:
        left = np.flatnonzero(~reached)
        if not len(left):
            break
        rows = np.repeat(left, paths)
        reached[rows[_trace_paths(scene, tracer, start[rows], normal[rows], rng)]] = True
    return reached


def share_of_reached(
    tracer: RayTracer, position: NDArray, normal: NDArray, reached: NDArray, rows: NDArray, near: NDArray
) -> NDArray[np.float64]:
    """Tells how many of the places around some are reached and in sight: what is shut off from light has none.

    Args:
        position, normal: (n, 3) on surfaces, unit geometric normals of their sides.
        reached: (n,).
        rows: (m,) of these places.
        near: (m, k) of these places, around each; it may be among them, and is in sight of itself.

    Returns: shares (m,) of k.
    """
    row, column = np.nonzero(reached[near])
    a, b = rows[row], near[row, column]
    counts = (a == b) | see_each_other(tracer, position[a], normal[a], position[b], normal[b])
    return np.bincount(row[counts], minlength=len(rows)) / near.shape[1]


def _trace_paths(
    scene: Scene, tracer: RayTracer, origin: NDArray, normal: NDArray, rng: np.random.Generator
) -> NDArray[np.bool_]:
    """Follows one path from each origin (n, 3) and tells which met light."""
    environment = not scene.lights or any(light.kind not in LOCAL for light in scene.lights)
    lights = [light for light in scene.lights if light.kind in LOCAL]
    emits = np.array([_may_emit(m) for m in scene.materials], bool)
    table = scene.triangles
    met = np.zeros(len(origin), bool)
    path = np.arange(len(origin))
    for _ in range(BOUNCES):
        if lights:
            point, facing = _sample_lights(lights, len(path), rng)
            back = ((origin - point) * facing).sum(1) < 0
            lit = ~back & _sees(tracer, origin, normal, point)
            met[path[lit]] = True
            path, origin, normal = path[~lit], origin[~lit], normal[~lit]
        direction = _cosine_directions(normal, rng)
        hits = tracer.intersect(origin, direction)
        hit = hits.triangle >= 0
        if environment:
            met[path[~hit]] = True
        glows = np.zeros(len(path), bool)
        glows[hit] = emits[table.material[hits.triangle[hit]]]
        met[path[glows]] = True
        on = hit & ~glows
        if not on.any():
            break
        path, tri = path[on], hits.triangle[on]
        there = origin[on] + direction[on] * hits.distance[on, None]
        normal = table.face_normals[tri]
        normal = np.where((normal * direction[on]).sum(1, keepdims=True) > 0, -normal, normal)
        origin = tracer.offset_points(there, normal, tri)
    return met


def _sees(tracer: RayTracer, origin: NDArray, normal: NDArray, target: NDArray) -> NDArray[np.bool_]:
    """Tells which points (n, 3) see their target (n, 3) above their horizon."""
    way = target - origin
    distance = np.linalg.norm(way, axis=1)
    direction = way / np.maximum(distance, 1e-30)[:, None]
    out = (direction * normal).sum(1) > 0
    rows = np.flatnonzero(out)
    out[rows] = ~tracer.occluded(origin[rows], direction[rows], distance[rows] * (1 - 1e-4))
    return out


def _sample_lights(lights: list[Light], n: int, rng: np.random.Generator) -> tuple[F64, F64]:
    """Returns points (n, 3) of lights and the ways they shine (n, 3), each point of a light of its own choice.

    One light for all would leave what another one lights dark, wherever that one is not chosen in any round.
    """
    chosen = rng.integers(len(lights), size=n) if len(lights) > 1 else np.zeros(n, np.int64)
    points, ways = np.empty((n, 3)), np.empty((n, 3))
    for number in np.unique(chosen):
        rows = np.flatnonzero(chosen == number)
        points[rows], ways[rows] = _sample_light_point(lights[number], len(rows), rng)
    return points, ways


def _sample_light_point(light: Light, n: int, rng: np.random.Generator) -> tuple[F64, F64]:
    """Returns random points (n, 3) of a light's shape and the way each shines (n, 3), zero for all ways.

    Not `lights.sampling`, which draws directions of what is seen from a point, by solid angle, with their density: here
    any point of the shape will do, whatever hides the others, and its far side counts where light passes it.
    """
    if light.kind in ("rect", "disk"):
        p = np.zeros((n, 3))
        if light.kind == "rect":
            p[:, :2] = (rng.random((n, 2)) - 0.5) * (light.width, light.height)
        else:
            angle, r = 2 * np.pi * rng.random(n), light.radius * np.sqrt(rng.random(n))
            p[:, 0], p[:, 1] = r * np.cos(angle), r * np.sin(angle)
        way = -light.world_from_light[:3, 2]
    else:
        p = _unit(rng.normal(size=(n, 3)))
        if light.kind == "cylinder":
            p[:, 1:] = _unit(p[:, 1:])
            p[:, 0] = light.length * (rng.random(n) - 0.5)
            p[:, 1:] *= light.radius
        else:
            p *= 0.0 if light.treat_as_point else light.radius
        way = np.zeros(3)
    world = p @ light.world_from_light[:3, :3].T + light.world_from_light[:3, 3]
    return world, np.broadcast_to(way, world.shape)


def _cosine_directions(normal: NDArray, rng: np.random.Generator) -> NDArray[np.float32]:
    """Random unit directions (n, 3) about normals (n, 3), by the cosine."""
    d = normal + 0.999 * _unit(rng.normal(size=normal.shape))
    return _unit(d).astype(np.float32)


def _unit(v: NDArray) -> NDArray:
    return v / np.maximum(np.linalg.norm(v, axis=-1, keepdims=True), 1e-30)


def _may_emit(material: Material) -> bool:
    emission = material.emissive_color
    return not isinstance(emission, np.ndarray) or bool((emission > 0).any())
