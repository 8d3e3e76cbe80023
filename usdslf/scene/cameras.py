"""Rays of a camera, and where points land in its picture.

The film follows UsdGeomCamera: apertures and focal length in one unit, the window about the aperture
offset.  Where the picture's shape differs from the aperture's, the shorter side is widened (UsdRender's
`expandAperture`), so that all that the camera frames is seen.  Picture coordinates run over 0..1 with
the origin at the top left.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from usdslf.errors import StageError
from usdslf.scene.records import F32, F64, Camera, Scene

APERTURE_UNIT = 0.1  # stage units in one unit of aperture of an orthographic camera (GfCamera::APERTURE_UNIT)


@dataclass(frozen=True)
class CameraRays:
    """n rays from the near plane of a camera."""

    origin: F32  # (n, 3) on the near plane
    direction: F32  # (n, 3) unit
    limit: F32  # (n,) distance of the far plane, inf without one
    near: F32  # (n,) distance from the eye to the origin


def camera_of(scene: Scene, path: str | None = None) -> Camera:
    """Returns the camera of a path; None: the first of the cameras that there are.

    Raises: StageError where there is none of that path.
    """
    cameras = scene.cameras
    if found := [c for c in cameras if path in (None, c.path)]:
        return found[0]
    some = ", ".join(c.path for c in cameras[:5]) + (f" and {len(cameras) - 5} more" if len(cameras) > 5 else "")
    without = "it has none at all: without --camera a view that sees everything is taken"
    raise StageError(f"{scene.stage} has no camera {path}; {f'it has {some}' if cameras else without}")


def looking(eye: F64, back: F64, up: F64) -> F64:
    """Returns a camera's matrix (4, 4), world from camera: its axes right, up and back as columns, and where it is.

    Args:
        eye: (3,) where it is.
        back: (3,) away from what it looks at, of any length but 0.
        up: (3,) unit; where it looks along that, its right is x.
    """
    back = back / max(float(np.linalg.norm(back)), 1e-30)
    right = np.cross(up, back)
    size = float(np.linalg.norm(right))
    right = right / size if size > 1e-6 else np.array([1.0, 0.0, 0.0])
    matrix = np.eye(4)
    matrix[:3, :3], matrix[:3, 3] = np.stack([right, np.cross(back, right), back], 1), eye
    return matrix


def film_window(camera: Camera, aspect: float) -> tuple[float, float, float, float]:
    """Returns left, right, bottom and top of the film for a picture of width / height = `aspect`.

    In units of the aperture for perspective, of the stage for orthographic cameras.
    """
    width = max(camera.horizontal_aperture, camera.vertical_aperture * aspect)
    height = width / aspect
    x, y = camera.horizontal_offset, camera.vertical_offset
    unit = 1.0 if camera.perspective else APERTURE_UNIT
    return (x - width / 2) * unit, (x + width / 2) * unit, (y - height / 2) * unit, (y + height / 2) * unit


def film_aspect(camera: Camera) -> float:
    """Returns width / height of a camera's aperture: of the picture that strokes are painted on by default."""
    width, height = camera.horizontal_aperture, camera.vertical_aperture
    return width / height if width > 0 and height > 0 else 1.0


def film_size(camera: Camera, longest: int = 960) -> tuple[int, int]:
    """Returns width and height [pixels] of a picture as the film, its longer side given."""
    aspect = film_aspect(camera)
    return max(1, round(longest * min(aspect, 1.0))), max(1, round(longest / max(aspect, 1.0)))


def camera_rays(camera: Camera, at: ArrayLike, aspect: float) -> CameraRays:
    """Makes the rays through points of the picture.

    Args:
        camera: perspective or orthographic.
        at: (n, 2) picture coordinates in 0..1, origin top left.
        aspect: width / height of the picture.

    Returns: n rays.
    """
    at = np.asarray(at, np.float64).reshape(-1, 2)
    left, right, bottom, top = film_window(camera, aspect)
    x, y = left + at[:, 0] * (right - left), top + at[:, 1] * (bottom - top)
    axes, eye = camera.world_from_camera[:3, :3], camera.world_from_camera[:3, 3]
    near, far = max(camera.near, 0.0), max(camera.far, 0.0)
    if camera.perspective:
        local = np.stack([x, y, np.full_like(x, -camera.focal_length)], -1)
        length = np.linalg.norm(local, axis=1)
        per_depth = length / camera.focal_length  # distance along the ray for one unit of depth
        direction = (local / length[:, None]) @ axes.T
        start = np.broadcast_to(eye, direction.shape)
    else:
        per_depth = np.ones_like(x)
        direction = np.broadcast_to(-axes[:, 2], (len(x), 3))
        start = eye + np.stack([x, y], -1) @ axes[:, :2].T
    skipped = per_depth * near
    with np.errstate(invalid="ignore"):
        limit = per_depth * far - skipped if np.isfinite(far) else np.full_like(x, np.inf)
    return CameraRays(
        (start + skipped[:, None] * direction).astype(np.float32),
        direction.astype(np.float32),
        limit.astype(np.float32),
        skipped.astype(np.float32),
    )


def project_points(camera: Camera, points: ArrayLike, aspect: float) -> tuple[NDArray, NDArray]:
    """Returns where world points land: picture coordinates (n, 2) and depth (n,) in front of the eye.

    Points at or behind the eye of a perspective camera give nan.

    Args:
        camera: perspective or orthographic.
        points: (n, 3) [stage units].
        aspect: width / height of the picture.
    """
    axes, eye = camera.world_from_camera[:3, :3], camera.world_from_camera[:3, 3]
    local = (np.asarray(points, np.float64).reshape(-1, 3) - eye) @ axes
    left, right, bottom, top = film_window(camera, aspect)
    depth = -local[:, 2]
    xy = local[:, :2]
    if camera.perspective:
        xy = xy * (camera.focal_length / np.where(depth > 0, depth, np.nan))[:, None]
    at = np.stack([(xy[:, 0] - left) / (right - left), (xy[:, 1] - top) / (bottom - top)], -1)
    return at, depth


def pixel_size(camera: Camera, distance: NDArray, size: tuple[int, int]) -> NDArray:
    """Returns the width of a pixel's footprint at some distance from the eye, across the ray [stage units]."""
    left, right, _, _ = film_window(camera, size[0] / size[1])
    if camera.perspective:
        return np.asarray(distance) * ((right - left) / size[0] / camera.focal_length)
    return np.full(np.shape(distance), (right - left) / size[0])


def view_and_projection(
    camera: Camera, aspect: float, near: float, far: float, shift: tuple[float, float] = (0.0, 0.0)
) -> tuple[F64, F64]:
    """Returns what OpenGL draws a camera's picture with: matrices (4, 4) that act on column vectors.

    Args:
        camera: perspective or orthographic.
        aspect: width / height of the picture.
        near, far: depth of what is drawn [stage units], near above 0 for perspective.
        shift: of the picture to the right and up, in widths and heights of it.

    Returns: camera_from_world, and clip_from_camera with depth -1..1.
    """
    left, right, bottom, top = film_window(camera, aspect)
    x, y = shift[0] * (right - left), shift[1] * (top - bottom)
    left, right, bottom, top = left - x, right - x, bottom - y, top - y
    out = np.zeros((4, 4))
    out[0, 0], out[1, 1] = 2 / (right - left), 2 / (top - bottom)
    across, upwards = (right + left) / (right - left), (top + bottom) / (top - bottom)
    if camera.perspective:
        out[0, 0], out[1, 1] = out[0, 0] * camera.focal_length, out[1, 1] * camera.focal_length
        out[:2, 2] = across, upwards
        out[2, 2:] = -(far + near) / (far - near), -2 * far * near / (far - near)
        out[3, 2] = -1
    else:
        out[:2, 3] = -across, -upwards
        out[2, 2:] = -2 / (far - near), -(far + near) / (far - near)
        out[3, 3] = 1
    return np.linalg.inv(np.asarray(camera.world_from_camera, np.float64)), out
