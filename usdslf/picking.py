"""Picking: what a place of a picture shows.

    pick(shot, camera, at, aspect) -> Pick | None
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from usdslf.scene.cameras import camera_rays
from usdslf.scene.records import F32, Camera
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
