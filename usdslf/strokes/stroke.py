"""Strokes: what was painted on a surface, and from where, as a record without USD.

    Stroke                                              frozen record that mirrors the stroke layer (below)
    validate_stroke(stroke) -> None                     StrokeError for what cannot be meant
    paint_stroke(scene, tracer, camera, paths, radius, color=..., image=None, ...) -> Stroke
    dab_rows(stroke) -> (k,) int                        one row per dab: the twin of a single dab left out

A picture's coordinates run over 0..1 with the origin at the top left; the brush radius is a fraction of the
picture's height.  In the world the brush is a ball of that size at the depth of the surface.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, field, fields, replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from usdslf.errors import StrokeError
from usdslf.scene.cameras import camera_rays, film_aspect, project_points
from usdslf.scene.records import F32, F64, I32, Camera, Scene
from usdslf.strokes.anchors import points_on_triangles, turned_towards, unit

if TYPE_CHECKING:
    from usdslf.light_field.visibility import RayTracer

TOOLS = ("replace", "clone", "brighten", "darken", "blur", "sharpen", "fixate")
MODES = ("direct", "indirect")
SPACES = ("scene", "reflectance")
NORMS = ("l2", "l0", "mixed")
SCOPES = ("stroke", "prim", "material", "similar")
SPACING = 0.5  # of the brush radius, between neighbouring points of a painted curve
GAP = 3.0  # a step that is this many times the expected one is a jump to another surface: the pen is lifted


@dataclass(frozen=True)
class Stroke:
    """A painted stroke.  n points on k curves; a single dab is a curve of the same point twice.

    World space, stage units, working colour space.  Anchors (`surface_index`, `face`, `barycentric`) have n
    rows, or none where they are unknown; `surface_index` is -1 for a single unknown one.  `barycentric` is
    (u + number of the triangle within the face, v).
    """

    name: str  # of the prim
    points: F32  # (n, 3) on the surface
    widths: F32  # (n,) diameter of the brush
    colors: F32  # (n, 3)
    eye: F32  # (n, 3) where each point was seen from
    normals: F32 = field(default_factory=lambda: np.zeros((0, 3), np.float32))  # (n, 3) or none; unit
    curve_counts: tuple[int, ...] = ()  # points of each curve, together n; () for one curve
    tool: str = "replace"
    mode: str = "direct"
    strength: float = 1.0  # 0..1
    space: str = "scene"  # scene: radiance as seen | reflectance: albedo-like
    surfaces: tuple[str, ...] = ()  # gprims
    surface_index: I32 = field(default_factory=lambda: np.zeros(0, np.int32))  # (n,) into surfaces
    face: I32 = field(default_factory=lambda: np.zeros(0, np.int32))  # (n,) face of the gprim
    barycentric: F32 = field(default_factory=lambda: np.zeros((0, 2), np.float32))  # (n, 2)
    frame: float = float("nan")  # nan: default time
    norm: str = "mixed"
    scope: str = "material"
    choice: str = ""  # id of the alternative that was chosen, "" for the solver's best
    clone_offset: tuple[float, float, float] = (0.0, 0.0, 0.0)
    active: bool = True
    prim: str = ""  # path of the prim that it was read from, "" for one that is new

    @property
    def path(self) -> str:
        """Path of its prim in the stroke layer."""
        return self.prim or f"/SlfStrokes/{self.name}"

    @property
    def counts(self) -> tuple[int, ...]:
        """Points of each curve."""
        return self.curve_counts or (len(self.points),)

    @property
    def has_anchors(self) -> bool:
        """Each point says which face of which surface it lies on."""
        return bool(self.surfaces) and len(self.points) == len(self.surface_index)


def validate_stroke(stroke: Stroke) -> None:
    """Raises StrokeError, in one sentence, for a stroke that says nothing or something impossible."""
    s, n = stroke, len(stroke.points)
    where = f"Stroke {s.path}"
    if not re.fullmatch(r"[A-Za-z_]\w*", s.name):
        raise StrokeError(f"{where} has the name {s.name!r}: use letters, digits and _.")
    if n == 0:
        raise StrokeError(f"{where} is empty: paint at least one point or remove it.")
    shapes = {"points": (n, 3), "widths": (n,), "colors": (n, 3), "eye": (n, 3)}
    shapes |= {"normals": (n, 3)} if len(s.normals) else {}
    if len(s.surface_index) or len(s.face) or len(s.barycentric):
        shapes |= {"surface_index": (n,), "face": (n,), "barycentric": (n, 2)}
    for name, shape in shapes.items():
        value = np.asarray(getattr(s, name))
        if value.shape != shape:
            raise StrokeError(f"{where} has {name} of shape {value.shape} for {n} points: paint it again.")
        if not np.isfinite(value).all():
            raise StrokeError(f"{where} has {name} that are not finite numbers: paint it again.")
    if (s.widths <= 0).any():
        raise StrokeError(f"{where} has a brush width of zero or less: give a positive one.")
    if any(c < 2 for c in s.counts) or sum(s.counts) != n:
        raise StrokeError(f"{where} has curves of {list(s.counts)} points for {n}: each needs two or more.")
    choices = {"tool": TOOLS, "mode": MODES, "space": SPACES, "norm": NORMS, "scope": SCOPES}
    for name, allowed in choices.items():
        if getattr(s, name) not in allowed:
            known = ", ".join(allowed)
            raise StrokeError(f"{where} has the unknown {name} {getattr(s, name)!r}: use one of {known}.")
    if not 0 <= s.strength <= 1:
        raise StrokeError(f"{where} has a strength of {s.strength:g}: it lies in 0..1.")
    if not np.isfinite(s.clone_offset).all():
        raise StrokeError(f"{where} has a clone offset that is no finite number: choose the source again.")
    if s.tool == "clone" and not np.any(s.clone_offset):
        raise StrokeError(f"{where} clones from itself: give it a clone offset.")
    if s.has_anchors and ((s.surface_index < -1) | (s.surface_index >= len(s.surfaces))).any():
        raise StrokeError(f"{where} points to surfaces that it does not list: paint it again.")


def dab_rows(stroke: Stroke) -> NDArray[np.int64]:
    """Returns the rows (k,) of the points that stand for dabs: without the twin of a single dab."""
    p, last = stroke.points, np.cumsum(stroke.counts) - 1
    twin = [e for e, c in zip(last, stroke.counts) if c == 2 and (p[e] == p[e - 1]).all()]
    return np.setdiff1d(np.arange(len(stroke.points)), twin)


def paint_stroke(
    scene: Scene,
    tracer: RayTracer,
    camera: Camera,
    paths: Sequence[ArrayLike],
    radius: float,
    color: ArrayLike = (1.0, 1.0, 1.0),
    image: NDArray | None = None,
    *,
    aspect: float | None = None,
    name: str = "stroke_0001",
    tool: str = "replace",
    mode: str = "direct",
    strength: float = 1.0,
    space: str = "scene",
    norm: str = "mixed",
    scope: str = "material",
    choice: str = "",
    clone_offset: tuple[float, float, float] = (0.0, 0.0, 0.0),
    spacing: float = SPACING,
) -> Stroke:
    """Lays the brush along paths of a picture, onto what the camera sees there.

    Each path is resampled at the brush's spacing, so that colours and anchors do not depend on how often the
    pen was read.  A curve ends where the path leaves the surfaces or jumps to one behind.

    Args:
        paths: each (k, 2) in picture coordinates; one point is a dab.
        radius: of the brush, as a fraction of the picture's height.
        color: (3,) working space.
        image: (h, w, 3 or more) picture of the same camera that each point takes its colour from.
        aspect: width / height of the picture; None: the image's, else the camera's aperture.
        spacing: between points, in brush radii.

    Raises:
        StrokeError: nothing is hit, or a value cannot be meant.
    """
    if not (np.isfinite(radius) and radius > 0):
        raise StrokeError(f"The brush radius {radius:g} is not positive: it is a share of picture height.")
    if not (np.isfinite(color).all() and np.shape(color) == (3,)):
        raise StrokeError(f"The colour {np.asarray(color).tolist()} is not three finite numbers: give R,G,B.")
    if aspect is None:
        aspect = image.shape[1] / image.shape[0] if image is not None else film_aspect(camera)
    curves = [_resample(path, spacing * radius, aspect) for path in paths]
    if not sum(map(len, curves)):
        raise StrokeError("The stroke's path is empty: give at least one point x,y in 0..1.")
    at = np.concatenate(curves)
    curve = np.repeat(np.arange(len(curves)), [len(c) for c in curves])

    rays = camera_rays(camera, at, aspect)
    hits = tracer.intersect(rays.origin, rays.direction)
    hit = (hits.triangle >= 0) & (hits.distance <= rays.limit)
    if not hit.any():
        raise StrokeError(
            f"The stroke lies off every surface that the camera {camera.path} sees: move its path onto one."
        )
    at, curve, triangle = at[hit], curve[hit], hits.triangle[hit]
    uv = hits.barycentric[hit].astype(np.float32)
    points, normals = points_on_triangles(scene, triangle, uv)
    eye = _eyes(camera, rays.origin[hit], rays.direction[hit])
    normals = turned_towards(normals, scene.triangles.face_normals[triangle], eye - points)
    heights = _picture_height(camera, points, aspect)
    # A step on the picture that is far longer in the world than the surface's slant explains is a jump.
    step = np.linalg.norm(np.diff(points, axis=0), axis=1)
    slant = np.abs((normals * unit(eye - points)).sum(1)).clip(0.1, 1)
    expected = spacing * radius * heights / slant
    broken = (np.diff(curve) != 0) | (np.diff(np.flatnonzero(hit)) != 1)
    broken |= step > GAP * np.maximum(expected[1:], expected[:-1])
    counts = np.diff(np.concatenate([[0], np.flatnonzero(broken) + 1, [len(points)]]))

    colors = np.broadcast_to(np.asarray(color, np.float32), (len(points), 3))
    if image is not None:
        colors = sample_picture(image, at)
    mesh = scene.triangles.mesh[triangle]
    used, surface_index = np.unique(mesh, return_inverse=True)
    in_face = np.concatenate([m.triangle_in_face for m in scene.meshes])[triangle]
    barycentric = uv + np.stack([in_face, np.zeros_like(in_face)], -1)
    stroke = Stroke(
        name=name,
        points=points,
        widths=(2 * radius * heights).astype(np.float32),
        colors=np.ascontiguousarray(colors, np.float32),
        eye=eye,
        normals=normals,
        curve_counts=tuple(int(c) for c in counts),
        tool=tool,
        mode=mode,
        strength=strength,
        space=space,
        surfaces=tuple(scene.meshes[m].path for m in used),
        surface_index=surface_index.astype(np.int32),
        face=scene.triangles.face[triangle].astype(np.int32),
        barycentric=barycentric.astype(np.float32),
        frame=scene.frame,
        norm=norm,
        scope=scope,
        choice=choice,
        clone_offset=clone_offset,
    )
    stroke = _take(stroke, *_double_single_points(stroke.counts))
    validate_stroke(stroke)
    return stroke


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


def _resample(path: ArrayLike, step: float, aspect: float) -> F64:
    """Returns points (n, 2) along a path at equal distances of at most `step` picture heights."""
    at = np.asarray(path, np.float64)
    if at.ndim != 2 or at.shape[1] != 2 or not np.isfinite(at).all():
        raise StrokeError("A stroke's path has points that are not two finite numbers: give x,y in 0..1.")
    if len(at) < 2:
        return at
    along = np.concatenate([[0], np.cumsum(np.linalg.norm(np.diff(at, axis=0) * [aspect, 1], axis=1))])
    if along[-1] == 0:
        return at[:1]
    s = np.linspace(0, along[-1], int(np.ceil(along[-1] / step - 1e-9)) + 1)
    return np.stack([np.interp(s, along, at[:, 0]), np.interp(s, along, at[:, 1])], -1)


def _picture_height(camera: Camera, points: NDArray, aspect: float) -> F64:
    """Height of the picture [stage units] at the depth of each point (n,)."""
    up = camera.world_from_camera[:3, 1]
    low, _ = project_points(camera, points, aspect)
    high, _ = project_points(camera, points + up, aspect)
    return 1 / np.abs(low[:, 1] - high[:, 1])


def _eyes(camera: Camera, origin: F32, direction: F32) -> F32:
    """The camera's eye for each ray (n, 3); an orthographic camera has one for each ray."""
    if camera.perspective:
        eye = np.broadcast_to(camera.world_from_camera[:3, 3], origin.shape)
        return np.ascontiguousarray(eye, np.float32)
    return origin


def _double_single_points(counts: tuple[int, ...]) -> tuple[NDArray, tuple[int, ...]]:
    """Rows and counts of the curves with curves of one point turned into the point twice."""
    single = np.repeat(np.asarray(counts) == 1, counts)
    return np.repeat(np.arange(len(single)), 1 + single), tuple(max(c, 2) for c in counts)


def _take(stroke: Stroke, rows: NDArray, counts: tuple[int, ...]) -> Stroke:
    """The stroke with some of its rows, on curves of `counts`."""
    n = len(stroke.points)
    arrays = {f.name: getattr(stroke, f.name) for f in fields(stroke)}
    per_point = {k: v[rows] for k, v in arrays.items() if isinstance(v, np.ndarray) and len(v) == n}
    return replace(stroke, curve_counts=counts, **per_point)
