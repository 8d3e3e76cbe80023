"""Overview: a camera for a stage that has none.

From the front, a little from above and from the right, as near as the picture lets it be; in a closed room
that is lit from within, which from outside would be a black box, from one of its ends.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from usdslf.lights.sources import EmissiveSurfaces, SurfaceEmission
from usdslf.rays import RayTracer
from usdslf.scene.cameras import looking
from usdslf.scene.records import F64, Camera, Scene

APERTURE = 36.0, 20.25  # 16 : 9, as pictures are by default
FOCAL_LENGTH = 45.0
INDOORS = 24.0  # focal length in a room
MARGIN = 1.08  # picture over object
LEAST_ENCLOSED = 0.97  # of all directions, in a room
TURN, LIFT = 0.3, 0.35  # to the right and up, per step to the front


def overview_camera(scene: Scene, tracer: RayTracer) -> Camera:
    """Returns a perspective camera, film 16 : 9, without a path."""
    up = scene.up
    front = np.array([0.0, -1, 0]) if scene.up_axis == "Z" else np.array([0.0, 0, 1])
    middle = find_room(scene, tracer)
    if middle is not None:
        eye, back = _end_of_room(tracer, middle, up, front)
        return _camera(eye, back, up, INDOORS)
    back = front + LIFT * up + TURN * np.cross(up, front)
    return _camera(fit_eye(scene, back, up), back, up, FOCAL_LENGTH)


def fit_eye(scene: Scene, back: F64, up: F64) -> F64:
    """Returns the nearest place (3,) from which all vertices are in the picture of a camera that looks along -back."""
    axes = looking(np.zeros(3), back, up)[:3, :3]
    points = np.concatenate([m.positions for m in scene.meshes if len(m.triangles)]).astype(np.float64)
    local = points[np.isfinite(points).all(1)] @ axes
    place, depth = np.zeros(3), local[:, 2].max()
    for i, aperture in enumerate(APERTURE):
        slope = aperture / 2 / FOCAL_LENGTH / MARGIN
        # Both sides of the frustum touch the points: |x - place| <= slope (depth - z) for all of them.
        right = (local[:, i] + slope * local[:, 2]).max()
        left = (-local[:, i] + slope * local[:, 2]).max()
        place[i] = (right - left) / 2
        depth = max(depth, (right + left) / (2 * slope))
    low, high = scene.bounds
    place[2] = depth + 0.01 * np.linalg.norm(high - low) + 1e-6
    return axes @ place


def find_room(scene: Scene, tracer: RayTracer) -> F64 | None:
    """Returns a point (3,) in the middle of a room, or None: it is closed nearly all around and has light in it."""
    low, high = scene.bounds
    steps = np.array([[0, 0, 0], [1, 0, 0], [-1, 0, 0], [0, 1, 0], [0, -1, 0], [0, 0, 1], [0, 0, -1]])
    places = (low + high) / 2 + 0.23 * steps * (high - low)
    directions = _all_around(256)
    met = tracer.intersect(np.repeat(places, len(directions), 0), np.tile(directions, (len(places), 1)))
    hit = (met.triangle >= 0).reshape(len(places), -1)
    shines = EmissiveSurfaces(scene, SurfaceEmission(scene)).emits[met.triangle].reshape(hit.shape) & hit
    lamps = [x.world_from_light[:3, 3] for x in scene.lights if x.kind not in ("dome", "distant")]
    lit = np.array([any(_sees(tracer, place, lamp) for lamp in lamps) for place in places])
    rooms = np.flatnonzero((hit.mean(1) >= LEAST_ENCLOSED) & (lit | shines.any(1)))
    free = np.where(hit, met.distance.reshape(hit.shape), 0).mean(1)
    return places[rooms[np.argmax(free[rooms])]] if len(rooms) else None


def _sees(tracer: RayTracer, place: F64, lamp: F64) -> bool:
    away = (lamp - place).astype(np.float32)
    distance = float(np.linalg.norm(away))
    if distance == 0:
        return True
    limit = np.array([0.999 * distance], np.float32)
    return not tracer.occluded(place.astype(np.float32)[None], away[None] / distance, limit)[0]


def _end_of_room(tracer: RayTracer, middle: F64, up: F64, front: F64) -> tuple[F64, F64]:
    """Returns an eye near the wall at one end of the longest level line through `middle`, and its backward axis."""
    angle = np.arange(64) * (2 * np.pi / 64)
    side = np.cross(up, front)
    level = np.cos(angle)[:, None] * front + np.sin(angle)[:, None] * side
    origins = np.tile(middle, (64, 1)).astype(np.float32)
    met = tracer.intersect(origins, level.astype(np.float32))
    reach = np.where(met.triangle >= 0, met.distance, 0)
    behind = int(np.argmax(np.minimum(reach + np.roll(reach, 32), 3 * reach)))
    back = level[behind] + 0.1 * up
    return middle + 0.9 * reach[behind] * level[behind], back


def _camera(eye: F64, back: F64, up: F64, focal_length: float) -> Camera:
    return Camera("", looking(eye, back, up), *APERTURE, focal_length)


def _all_around(n: int) -> NDArray[np.float32]:
    """Returns n even directions (n, 3): Fibonacci's sphere."""
    z = 1 - (2 * np.arange(n) + 1) / n
    turn = np.pi * (1 + 5**0.5) * np.arange(n)
    s = np.sqrt(1 - z * z)
    return np.stack([s * np.cos(turn), s * np.sin(turn), z], -1).astype(np.float32)
