"""Navigation: a camera that a mouse moves about a pivot, as in DCCs.

View(camera, pivot)                 what is looked through, and the point that it turns about
orbited, panned, dollied, framed    another View
in_sight                            the same, before what would hide it
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from usdslf import Camera, Scene

F64 = NDArray[np.float64]
FREE = ""  # path of a camera that is no prim
NEARER = tuple(0.25 * n for n in range(17))  # halvings of the distance that are tried
ENOUGH = 0.7  # of what is seen of something at best
SOME = 200  # faces of something that are asked for
STEEPEST = np.radians(89.0)  # that orbiting looks up or down


@dataclass(frozen=True, eq=False)
class View:
    """A camera and the point that it turns about.

    Attributes:
        camera: relative to `Scene.origin`.
        pivot: (3,) [stage units].
        up: (3,) unit, of the world.
    """

    camera: Camera
    pivot: F64
    up: F64

    @property
    def distance(self) -> float:
        """From the eye to the pivot, along the axis [stage units]."""
        matrix = self.camera.world_from_camera
        return float((matrix[:3, 3] - self.pivot) @ matrix[:3, 2])


def view_of(camera: Camera, bounds: tuple[F64, F64], up_axis: str) -> View:
    """Returns a view through a camera, its pivot on its axis, in the middle of what it looks at.

    Args:
        camera: relative to `Scene.origin`.
        bounds: lower and upper corner (3,), (3,) of what is there [stage units].
        up_axis: Y | Z.
    """
    low, high = bounds
    eye, back = camera.world_from_camera[:3, 3], camera.world_from_camera[:3, 2]
    ahead = float((eye - (low + high) / 2) @ back)
    least = 0.05 * float(np.linalg.norm(high - low)) or 1.0
    up = np.array([0.0, 0.0, 1.0]) if up_axis == "Z" else np.array([0.0, 1.0, 0.0])
    return View(camera, eye - back * max(ahead, least), up)


def orbited(view: View, right: float, down: float) -> View:
    """Returns a view turned about its pivot.

    Args:
        right, down: that the mouse went, of the picture's height; one height is half a turn.
    """
    matrix, up = view.camera.world_from_camera, view.up
    back = matrix[:3, 2]
    height = float(np.arcsin(np.clip(back @ up, -1, 1)))
    tilt = np.clip(height + np.pi * down, -STEEPEST, STEEPEST) - height
    turned = _rotation(up, -np.pi * right) @ _rotation(matrix[:3, 0], -tilt)
    axes = turned @ matrix[:3, :3]
    return _placed(view, axes, view.pivot + turned @ (matrix[:3, 3] - view.pivot))


def panned(view: View, right: float, down: float) -> View:
    """Returns a view moved so that what lies at the pivot follows the mouse.

    Args:
        right, down: that the mouse went, of the picture's height.
    """
    matrix = view.camera.world_from_camera
    shift = (matrix[:3, 1] * down - matrix[:3, 0] * right) * _height_at_pivot(view)
    return replace(_placed(view, matrix[:3, :3], matrix[:3, 3] + shift), pivot=view.pivot + shift)


def dollied(view: View, nearer: float) -> View:
    """Returns a view nearer to its pivot.

    Args:
        nearer: 1 halves the distance, -1 doubles it; an orthographic picture is magnified alike.
    """
    matrix, factor = view.camera.world_from_camera, 2.0**-nearer
    eye = matrix[:3, 3] + matrix[:3, 2] * view.distance * (factor - 1)
    moved = _placed(view, matrix[:3, :3], eye)
    if view.camera.perspective:
        return moved
    camera = moved.camera
    wide, high = camera.horizontal_aperture * factor, camera.vertical_aperture * factor
    return replace(moved, camera=replace(camera, horizontal_aperture=wide, vertical_aperture=high))


def framed(view: View, bounds: tuple[F64, F64]) -> View:
    """Returns a view in the same direction that sees all of a box.

    Args:
        bounds: lower and upper corner (3,), (3,) [stage units].
    """
    low, high = bounds
    camera, middle = view.camera, (low + high) / 2
    radius = max(float(np.linalg.norm(high - low)) / 2, 1e-9)
    matrix = camera.world_from_camera
    narrow = min(camera.horizontal_aperture, camera.vertical_aperture)
    if camera.perspective:
        distance = radius / np.sin(np.arctan(narrow / 2 / camera.focal_length))
    else:
        distance, factor = max(view.distance, 2 * radius), 20 * radius / narrow
        wide, tall = camera.horizontal_aperture * factor, camera.vertical_aperture * factor
        camera = replace(camera, horizontal_aperture=wide, vertical_aperture=tall)
    found = View(camera, middle, view.up)
    return _placed(found, matrix[:3, :3], middle + matrix[:3, 2] * distance)


def in_sight(view: View, seen: Callable[[Camera], float]) -> View:
    """Returns a view nearer to its pivot where something stands before it: a wall that one would be behind.

    Args:
        seen: the share 0..1 of what is looked at that a camera sees.
    """
    tried = [dollied(view, nearer) for nearer in NEARER]
    shares = [seen(v.camera) for v in tried]
    return next(v for v, share in zip(tried, shares) if share >= ENOUGH * max(shares))


def faces_under(scene: Scene, path: str) -> tuple[F64, F64]:
    """Returns the middles (n, 3) and normals (n, 3) of some faces of the gprims at and below a prim.

    Args:
        scene: where they are.
        path: of the prim; "", or one that has no gprim: the whole scene.
    """
    table, meshes = scene.triangles, _meshes_under(scene, path)
    is_in = np.isin(table.mesh, [n for n, m in enumerate(scene.meshes) if any(m is other for other in meshes)])
    rows = np.flatnonzero(is_in) if meshes else np.arange(len(table.mesh))
    rows = rows[:: max(1, len(rows) // SOME)]
    return table.positions[rows].mean(1).astype(np.float64), table.face_normals[rows].astype(np.float64)


def are_turned(camera: Camera, points: F64, normals: F64) -> NDArray[np.bool_]:
    """Returns which faces (n,) turn their front to a camera: not those of a fruit, from inside of it.

    Args:
        points, normals: (n, 3), (n, 3) of the faces.
    """
    matrix = camera.world_from_camera
    to_eye = matrix[:3, 3] - points if camera.perspective else np.broadcast_to(matrix[:3, 2], points.shape)
    return (to_eye * normals).sum(1) > 0


def bounds_under(scene: Scene, path: str) -> tuple[F64, F64]:
    """Returns lower and upper corner (3,), (3,) of the gprims at and below a prim; of all where it has none.

    Args:
        scene: where they are.
        path: of the prim; "": the whole scene.
    """
    points = [m.positions for m in _meshes_under(scene, path)]
    if not points:
        return scene.bounds
    low, high = np.min([p.min(0) for p in points], 0), np.max([p.max(0) for p in points], 0)
    return low.astype(np.float64), high.astype(np.float64)


def _meshes_under(scene: Scene, path: str) -> list[Any]:
    below = path.rstrip("/") + "/"
    return [m for m in scene.meshes if path and (m.path == path or m.path.startswith((below, f"{path}[")))]


def _placed(view: View, axes: F64, eye: F64) -> View:
    """The view from elsewhere; its camera is no prim any more, and clips nothing that it comes near to."""
    matrix = np.eye(4)
    matrix[:3, :3], matrix[:3, 3] = axes, eye
    return replace(view, camera=replace(view.camera, path=FREE, world_from_camera=matrix, near=0.0, far=np.inf))


def _height_at_pivot(view: View) -> float:
    camera = view.camera
    if camera.perspective:
        return camera.vertical_aperture / camera.focal_length * view.distance
    return camera.vertical_aperture * 0.1


def _rotation(axis: F64, angle: float) -> F64:
    """Rotation (3, 3) about a unit axis, Rodrigues' formula."""
    x, y, z = axis
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.eye(3) + np.sin(angle) * cross + (1 - np.cos(angle)) * cross @ cross
