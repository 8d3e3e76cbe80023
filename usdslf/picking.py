"""Picking: what a place of a picture shows.

    pick(shot, camera, at, aspect) -> Pick | None
    seen_prims(shot, camera, size) -> Seen              the same of all pixels
    are_seen(shot, camera, points, aspect) -> (n,)      which points nothing hides
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from usdslf.scene.cameras import camera_rays, project_points
from usdslf.scene.records import F32, I32, Camera
from usdslf.shot import Shot
from usdslf.strokes.anchors import points_on_triangles, turned_towards


@dataclass(frozen=True, eq=False)
class Pick:
    """A place on a surface.

    Attributes:
        path: of the gprim; of an instance proxy where instanced.
        material: path of the material that it shows there; "" where it has none.
        point: (3,) relative to `Scene.origin` [stage units].
        normal: (3,) unit, of shading, on the side of the eye.
        distance: from the eye [stage units].
    """

    path: str
    material: str
    point: F32
    normal: F32
    distance: float


def pick(shot: Shot, camera: Camera, at: ArrayLike, aspect: float) -> Pick | None:
    """Finds the surface that a camera sees at a place of its picture.

    Args:
        shot: whose scene and tracer are made if they are not there yet.
        camera: relative to `Scene.origin`.
        at: (2,) x, y in 0..1 of the picture, origin top left.
        aspect: width / height of the picture.

    Returns: None where it sees none.
    """
    scene, tracer = shot.scene, shot.tracer
    rays = camera_rays(camera, at, aspect)
    hits = tracer.intersect(rays.origin, rays.direction)
    triangle, distance = hits.triangle[:1], float(hits.distance[0])
    if triangle[0] < 0 or distance > rays.limit[0]:
        return None
    point, normal = points_on_triangles(scene, triangle, hits.barycentric[:1])
    normal = turned_towards(normal, scene.triangles.face_normals[triangle], -rays.direction)
    mesh, material = scene.triangles.mesh[triangle[0]], scene.triangles.material[triangle[0]]
    eye = distance + float(rays.near[0])
    return Pick(scene.meshes[mesh].path, scene.materials[material].path, point[0], normal[0], float(np.float32(eye)))


@dataclass(frozen=True, eq=False)
class Seen:
    """What the middles of the pixels of a picture show.

    Attributes:
        mesh: (h, w) of `Scene.meshes`; -1: nothing.
        material: (h, w) of `Scene.materials`; -1: nothing.
    """

    mesh: I32
    material: I32


def seen_prims(shot: Shot, camera: Camera, size: tuple[int, int]) -> Seen:
    """Finds what all pixels of a picture show.

    Args:
        shot: whose scene and tracer are made if they are not there yet.
        camera: relative to `Scene.origin`.
        size: width and height [pixels].

    Returns: by pixel.
    """
    width, height = size
    y, x = np.mgrid[:height, :width] + 0.5
    at = np.stack([x.ravel() / width, y.ravel() / height], -1)
    rays = camera_rays(camera, at, width / height)
    hits = shot.tracer.intersect(rays.origin, rays.direction)
    is_there, table = (hits.triangle >= 0) & (hits.distance <= rays.limit), shot.scene.triangles
    first = np.where(is_there, hits.triangle, 0)
    of = lambda ids: np.where(is_there, ids[first] if len(ids) else -1, -1).astype(np.int32)  # noqa: E731
    return Seen(of(table.mesh).reshape(height, width), of(table.material).reshape(height, width))


def are_seen(shot: Shot, camera: Camera, points: ArrayLike, aspect: float) -> NDArray[np.bool_]:
    """Returns which points (n,) a camera sees: those in front of it that no surface hides.

    Args:
        shot: whose scene and tracer are made if they are not there yet.
        camera: relative to `Scene.origin`.
        points: (n, 3) on surfaces [stage units].
        aspect: width / height of the picture.
    """
    at, depth = project_points(camera, points, aspect)
    is_ahead = np.isfinite(at).all(1) & (depth > 0)
    rays = camera_rays(camera, np.where(is_ahead[:, None], at, 0.5), aspect)
    hits = shot.tracer.intersect(rays.origin, rays.direction)
    away = ((np.asarray(points, np.float64) - rays.origin) * rays.direction).sum(1)
    return is_ahead & ((hits.triangle < 0) | (hits.distance > away - 1e-3 * shot.scene.diagonal))
