"""Paint: a path on the picture of a camera becomes a stroke on the surfaces that are seen there."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from typing import TYPE_CHECKING, Any, TypedDict, Unpack

import numpy as np
from numpy.typing import ArrayLike, NDArray

from usdslf.errors import StrokeError
from usdslf.scene.cameras import camera_rays, film_aspect, project_points
from usdslf.scene.records import F32, F64, Camera, Scene
from usdslf.strokes.anchors import points_on_triangles, turned_towards, unit
from usdslf.strokes.stroke import Stroke, _double_single_points, validate_stroke

if TYPE_CHECKING:
    from usdslf.rays import RayTracer

SPACING = 0.5  # of the brush radius, between neighbouring points of a painted curve
MOST_POINTS = 1_000_000  # of one path; more is a brush, or an aspect of the camera, that cannot be meant
GAP = 3.0  # a step that is this many times the expected one is a jump to another surface: the pen is lifted


class Settings(TypedDict, total=False):
    """What a stroke is to mean, as its attributes of these names say, and how its path is laid; see `paint_stroke`."""

    name: str
    tool: str
    mode: str
    strength: float
    space: str
    norm: str
    scope: str
    choice: str
    clone_offset: tuple[float, float, float]
    aspect: float | None
    spacing: float


def paint_stroke(
    scene: Scene,
    tracer: RayTracer,
    camera: Camera,
    paths: Sequence[ArrayLike],
    radius: float,
    color: ArrayLike = (1.0, 1.0, 1.0),
    image: NDArray | None = None,
    **settings: Unpack[Settings],
) -> Stroke:
    """Lays the brush along paths of a picture, onto what the camera sees there, and returns the stroke.

    Each path is resampled at the brush's spacing, so that colours and anchors do not depend on how often the
    pen was read.  A curve ends where the path leaves the surfaces or jumps to one behind.

    Args:
        scene: the shot, as `Session.scene` or `Shot.scene` has it.
        tracer: rays against it, as `Session.tracer` or `Shot.tracer` has them.
        camera: that the picture was made with.
        paths: each (k, 2) x, y in 0..1 of the picture, origin top left; one point is a dab.
        radius: of the brush, as a fraction of the picture's height, above 0.
        color: (3,) working space.
        image: (h, w, 3 or more) picture of the same camera that each point takes its colour from, in the working space.
        settings: `name`, `tool`, `mode`, `strength`, `space`, `norm`, `scope`, `choice` and `clone_offset` of the
            stroke (see `Stroke`); `aspect`, width / height of the picture: by default the image's, else that of the
            camera's aperture; `spacing` between points, in brush radii (0.5).

    Raises:
        StrokeError: nothing is hit, or a value cannot be meant.
    """
    _check_brush(radius, color)
    meant: dict[str, Any] = {"name": "stroke_0001", **settings}
    spacing, aspect = meant.pop("spacing", SPACING), meant.pop("aspect", None)
    if aspect is None:
        aspect = image.shape[1] / image.shape[0] if image is not None else film_aspect(camera)
    at, curve = _resampled(paths, spacing * radius, aspect)
    seen = _seen_at(scene, tracer, camera, at, aspect)
    at, heights = at[seen.row], _picture_height(camera, seen.points, aspect)
    slant = np.abs((seen.normals * unit(seen.eye - seen.points)).sum(1)).clip(0.1, 1)
    lifted = (np.diff(curve[seen.row]) != 0) | (np.diff(seen.row) != 1)
    colors = np.broadcast_to(np.asarray(color, np.float32), (len(at), 3))
    if image is not None:
        colors = sample_picture(image, at)
    stroke = Stroke(
        points=seen.points,
        widths=(2 * radius * heights).astype(np.float32),
        colors=np.ascontiguousarray(colors, np.float32),
        eye=seen.eye,
        normals=seen.normals,
        curve_counts=_unbroken(seen.points, spacing * radius * heights / slant, lifted),
        frame=scene.frame,
        origin=scene.origin,
        film_normal=_film_normal(camera),
        **_anchors(scene, seen.triangle, seen.barycentric),
        **meant,
    )
    stroke = _take(stroke, *_double_single_points(stroke.counts))
    validate_stroke(stroke)
    return stroke


def _check_brush(radius: float, color: ArrayLike) -> None:
    if not (np.isfinite(radius) and radius > 0):
        raise StrokeError(f"the brush radius {radius:g} is not positive: it is a share of picture height")
    if not (np.isfinite(color).all() and np.shape(color) == (3,)):
        raise StrokeError(f"the colour {np.asarray(color).tolist()} is not three finite numbers: give R,G,B")


@dataclass(frozen=True)
class _Seen:
    """What the camera sees at places of the picture: n of them show a surface."""

    row: NDArray  # (n,) of the places
    triangle: NDArray  # (n,)
    barycentric: F32  # (n, 2)
    points: F32  # (n, 3)
    normals: F32  # (n, 3) on the side of the eye
    eye: F32  # (n, 3)


def _seen_at(scene: Scene, tracer: RayTracer, camera: Camera, at: NDArray, aspect: float) -> _Seen:
    rays = camera_rays(camera, at, aspect)
    hits = tracer.intersect(rays.origin, rays.direction)
    row = np.flatnonzero((hits.triangle >= 0) & (hits.distance <= rays.limit))
    if not len(row):
        raise StrokeError(
            f"the stroke lies off every surface that the camera {camera.path} sees: move its path onto one"
        )
    triangle, uv = hits.triangle[row], hits.barycentric[row].astype(np.float32)
    points, normals = points_on_triangles(scene, triangle, uv)
    eye = _eyes(camera, rays.origin[row], rays.direction[row])
    normals = turned_towards(normals, scene.triangles.face_normals[triangle], eye - points)
    return _Seen(row, triangle, uv, points, normals, eye)


def _unbroken(points: NDArray, expected: NDArray, lifted: NDArray) -> tuple[int, ...]:
    """Returns how many points each curve has.

    A step on the picture that is far longer in the world than the surface's slant explains is a jump to another
    surface: the pen is lifted there too.
    """
    step = np.linalg.norm(np.diff(points, axis=0), axis=1)
    broken = lifted | (step > GAP * np.maximum(expected[1:], expected[:-1]))
    ends = np.concatenate([[0], np.flatnonzero(broken) + 1, [len(points)]])
    return tuple(int(c) for c in np.diff(ends))


def _anchors(scene: Scene, triangle: NDArray, uv: NDArray) -> dict[str, Any]:
    """The attributes of a Stroke that say where on its gprims each point lies."""
    used, surface_index = np.unique(scene.triangles.mesh[triangle], return_inverse=True)
    in_face = np.concatenate([m.triangle_in_face for m in scene.meshes])[triangle]
    barycentric = uv + np.stack([in_face, np.zeros_like(in_face)], -1)
    return {
        "surfaces": tuple(scene.meshes[m].path for m in used),
        "surface_index": surface_index.astype(np.int32),
        "face": scene.triangles.face[triangle].astype(np.int32),
        "barycentric": barycentric.astype(np.float32),
    }


def sample_picture(image: NDArray, at: ArrayLike) -> F32:
    """Returns the bilinear colour (n, 3) of a picture (h, w, c) at picture coordinates (n, 2)."""
    image = np.asarray(image, np.float32)[..., :3]
    h, w = image.shape[:2]
    xy = np.clip(np.asarray(at, np.float64) * [w, h] - 0.5, 0, [w - 1, h - 1])
    x0, y0 = np.minimum(xy.astype(int), [max(w - 2, 0), max(h - 2, 0)]).T
    fx, fy = (xy - np.stack([x0, y0], -1)).T[..., None]
    x1, y1 = np.minimum(x0 + 1, w - 1), np.minimum(y0 + 1, h - 1)
    top = image[y0, x0] * (1 - fx) + image[y0, x1] * fx
    bottom = image[y1, x0] * (1 - fx) + image[y1, x1] * fx
    return (top * (1 - fy) + bottom * fy).astype(np.float32)


def _resampled(paths: Sequence[ArrayLike], step: float, aspect: float) -> tuple[F64, NDArray]:
    """Returns points (n, 2) of all paths, and (n,) the path of each."""
    curves = [_resample(path, step, aspect) for path in paths]
    if not sum(map(len, curves)):
        raise StrokeError("the stroke's path is empty: give at least one point x,y in 0..1")
    return np.concatenate(curves), np.repeat(np.arange(len(curves)), [len(c) for c in curves])


def _resample(path: ArrayLike, step: float, aspect: float) -> F64:
    """Returns points (n, 2) along a path at equal distances of at most `step` picture heights."""
    at = np.asarray(path, np.float64)
    if at.ndim != 2 or at.shape[1] != 2 or not np.isfinite(at).all():
        raise StrokeError("a stroke's path has points that are not two finite numbers: give x,y in 0..1")
    if len(at) < 2:
        return at
    along = np.concatenate([[0], np.cumsum(np.linalg.norm(np.diff(at, axis=0) * [aspect, 1], axis=1))])
    if along[-1] == 0:
        return at[:1]
    if not along[-1] / step < MOST_POINTS:
        raise StrokeError(f"the path has more than {MOST_POINTS} points: use a wider brush or another camera")
    s = np.linspace(0, along[-1], int(np.ceil(along[-1] / step - 1e-9)) + 1)
    return np.stack([np.interp(s, along, at[:, 0]), np.interp(s, along, at[:, 1])], -1)


def _picture_height(camera: Camera, points: NDArray, aspect: float) -> F64:
    """Height of the picture [stage units] at the depth of each point (n,)."""
    up = camera.world_from_camera[:3, 1]
    low, _ = project_points(camera, points, aspect)
    high, _ = project_points(camera, points + up, aspect)
    return 1 / np.abs(low[:, 1] - high[:, 1])


def _film_normal(camera: Camera) -> tuple[float, float, float]:
    x, y, z = unit(camera.world_from_camera[None, :3, 2].astype(np.float64))[0].astype(np.float32).tolist()
    return x, y, z


def _eyes(camera: Camera, origin: F32, direction: F32) -> F32:
    """The camera's eye for each ray (n, 3); an orthographic camera has one for each ray."""
    if camera.perspective:
        eye = np.broadcast_to(camera.world_from_camera[:3, 3], origin.shape)
        return np.ascontiguousarray(eye, np.float32)
    return origin


def _take(stroke: Stroke, rows: NDArray, counts: tuple[int, ...]) -> Stroke:
    """The stroke with some of its rows, on curves of `counts`."""
    n = len(stroke.points)
    arrays = {f.name: getattr(stroke, f.name) for f in fields(stroke)}
    per_point = {k: v[rows] for k, v in arrays.items() if isinstance(v, np.ndarray) and len(v) == n}
    return replace(stroke, curve_counts=counts, **per_point)
