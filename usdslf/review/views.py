"""Views of a review: from where strokes were painted, and from where nobody looked yet.

    stroke_views(shot, strokes, most) -> [View]             where strokes were painted from, those of most first
    held_out_views(shot, views, changed, count) -> [View]   others that see what changes
    turntable(shot, views, changed, count) -> [View]        round about what changes
    changed_triangles(scene, gprims) -> (T,)                of gprims and GeomSubsets

A held-out view tells whether a change that fits what was painted also holds from elsewhere: it is the camera of the
shot that sees most of what changes and that nobody painted from, else one on a circle about it.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from usdslf.rays import Hits
from usdslf.render.overview_camera import APERTURE, FOCAL_LENGTH
from usdslf.scene.cameras import CameraRays, camera_rays, looking
from usdslf.scene.records import F64, Camera, Scene
from usdslf.shot import Shot
from usdslf.strokes.stroke import Stroke

NEAR = 0.01  # of the scene's diagonal: eyes this close are one
PROBES = 48, 27  # rays of a picture that is only looked at for what it would show
LEAST = 0.01  # of a picture that has to show what changes
ENOUGH = 0.15  # of a picture: what shows more is no better view of it
TURNS = (35.0, -35.0, 70.0, -70.0, 120.0, -120.0, 180.0)  # degrees about what changes, from the strokes' camera
RISES = (0.0, 20.0, 45.0)  # degrees
APART = 25.0  # degrees between two held-out views, at least
BEHIND = 0.15  # of a picture: what shows more of surfaces from their other side looks at a room from outside
CLOSE = 0.03  # of the diagonal: an eye before which everything is this near is in a corner


@dataclass(frozen=True)
class View:
    """A place to look from.

    Attributes:
        name: the camera's path, or in words.
        kind: stroke | held out | light | turntable | camera.
        camera: of it.
        strokes: paths of those that were painted from there.
    """

    name: str
    kind: str
    camera: Camera
    strokes: tuple[str, ...] = ()


def stroke_views(shot: Shot, strokes: Sequence[Stroke], most: int) -> list[View]:
    """Returns the views that strokes were painted from, those of most strokes first.

    Args:
        strokes: of the look; none: the shot's first camera.
        most: views.
    """
    scene, near = shot.scene, NEAR * shot.scene.diagonal
    groups: list[tuple[F64, list[Stroke]]] = []
    for stroke in strokes:
        eye = np.median(np.asarray(stroke.seen_from(scene.origin).eye, np.float64), axis=0)
        home = next((g for g in groups if np.linalg.norm(g[0] - eye) <= near), None)
        if home is None:
            groups.append((eye, [stroke]))
        else:
            home[1].append(stroke)
    groups.sort(key=lambda g: -len(g[1]))
    views = [_painted_from(shot, eye, of, near) for eye, of in groups[:most]]
    return views or [View(shot.camera().path or "overview", "camera", shot.camera())]


def _painted_from(shot: Shot, eye: F64, strokes: list[Stroke], near: float) -> View:
    """The shot's camera at an eye that sees the strokes, else one of its own."""
    scene = shot.scene
    points = np.concatenate([s.seen_from(scene.origin).points for s in strokes]).astype(np.float64)
    names = tuple(s.path for s in strokes)
    for camera in scene.cameras:
        at = np.asarray(camera.world_from_camera)[:3, 3]
        if camera.perspective and np.linalg.norm(at - eye) <= near and _frames(camera, points):
            return View(camera.path, "stroke", camera, names)
    # An overview has no path; a free camera of a viewer is none of the shot's.
    if np.linalg.norm(np.asarray(shot.overview.world_from_camera)[:3, 3] - eye) <= near:
        return View("overview", "stroke", shot.overview, names)
    camera = _looking(scene, eye, points.mean(0))
    return View(f"where {names[0].rpartition('/')[2]} was painted from", "stroke", camera, names)


def _frames(camera: Camera, points: F64) -> bool:
    matrix = np.asarray(camera.world_from_camera, np.float64)
    local = (points - matrix[:3, 3]) @ matrix[:3, :3]
    depth = np.maximum(-local[:, 2], 1e-12)
    half = 0.5 * np.array([camera.horizontal_aperture, camera.vertical_aperture]) / camera.focal_length
    return bool(((local[:, 2] < 0) & (np.abs(local[:, :2]) / depth[:, None] <= 1.05 * half).all(1)).mean() > 0.5)


def held_out_views(
    shot: Shot, views: Sequence[View], changed: NDArray[np.bool_], count: int = 2
) -> list[View]:
    """Returns views that nobody painted from and that see what changes, the shot's own cameras first.

    Args:
        views: those that are there.
        changed: (T,) triangles that change.
    """
    taken = [np.asarray(v.camera.world_from_camera)[:3, 3] for v in views]
    near, about = NEAR * shot.scene.diagonal, _middle(shot.scene, changed)
    own = [c for c in shot.scene.cameras if all(np.linalg.norm(_eye(c) - t) > near for t in taken)]
    found = [View(c.path, "held out", c) for c in own if _share(shot, c, changed) >= LEAST]
    found.sort(key=lambda v: -_share(shot, v.camera, changed))
    found = found[:count]
    if len(found) == count:
        return found
    front = _sides(shot, views[0].camera)
    around = [
        (_share(shot, v.camera, changed), _share_behind(shot, v.camera, front) > BEHIND, v)
        for v in _around(shot, views[0].camera, about)
    ]
    for share, _, view in sorted(around, key=lambda x: (x[1], -min(x[0], ENOUGH))):  # the first that shows enough
        others = [_eye(v.camera) for v in found] + taken
        if share >= LEAST and all(_angle(_eye(view.camera) - about, o - about) >= APART for o in others):
            found.append(view)
        if len(found) == count:
            break
    return found


def turntable(shot: Shot, views: Sequence[View], changed: NDArray[np.bool_], count: int) -> list[View]:
    """Returns `count` views round about what changes, a whole turn from the first view on."""
    camera, about = views[0].camera, _middle(shot.scene, changed)
    turns = [360.0 * i / count for i in range(count)]
    return [
        View(f"turntable {turn:.0f} degrees", "turntable", _turned(shot.scene, camera, about, turn, 0.0, 1.0))
        for turn in turns
    ]


def changed_triangles(scene: Scene, gprims: Iterable[str]) -> NDArray[np.bool_]:
    """Returns which triangles (T,) of a scene belong to gprims or GeomSubsets; copies of instancers too."""
    paths = set(gprims)
    rows = []
    for mesh in scene.meshes:
        own = mesh.path.split("[")[0] in paths or (mesh.prototype in paths and bool(mesh.prototype))
        row = np.full(len(mesh.triangles), own)
        if mesh.subset_of_triangle is not None and mesh.subsets:
            bound = np.array([s in paths for s in mesh.subsets] + [own])
            row = bound[mesh.subset_of_triangle]
        rows.append(row)
    return np.concatenate(rows) if rows else np.zeros(0, bool)


def _around(shot: Shot, camera: Camera, about: F64) -> Iterator[View]:
    for rise in RISES:
        for turn in TURNS:
            for share in (1.0, 0.6):
                side = "left" if turn < 0 else "right"
                name = f"{abs(turn):.0f} degrees to the {side}" + (f", {rise:.0f} higher" if rise else "")
                name += ", nearer" if share < 1 else ""
                yield View(name, "held out", _turned(shot.scene, camera, about, turn, rise, share))


def _turned(scene: Scene, camera: Camera, about: F64, turn: float, rise: float, share: float) -> Camera:
    """A camera turned about a point [degrees], nearer by a share of the distance."""
    up = scene.up
    arm = _eye(camera) - about
    c, s = np.cos(np.radians(turn)), np.sin(np.radians(turn))
    arm = arm * c + np.cross(up, arm) * s + up * (up @ arm) * (1 - c)
    level, length = arm - up * (up @ arm), float(np.linalg.norm(arm))
    flat = float(np.linalg.norm(level))
    if flat > 1e-9 * max(length, 1e-30):
        angle = np.clip(np.arctan2(up @ arm, flat) + np.radians(rise), -1.4, 1.4)
        arm = length * (np.cos(angle) * level / flat + np.sin(angle) * up)
    return _looking(scene, about + share * arm, about, camera)


def _looking(scene: Scene, eye: F64, at: F64, like: Camera | None = None) -> Camera:
    matrix = looking(eye, eye - at, scene.up)
    if like is None or not like.perspective:
        return Camera("", matrix, *APERTURE, FOCAL_LENGTH)
    return Camera("", matrix, like.horizontal_aperture, like.vertical_aperture, like.focal_length)


def _probed(shot: Shot, camera: Camera) -> tuple[CameraRays, Hits]:
    """Rays of a camera's picture, and what they meet."""
    width, height = PROBES
    x, y = (np.arange(width) + 0.5) / width, (np.arange(height) + 0.5) / height
    rays = camera_rays(camera, np.stack(np.meshgrid(x, y), -1).reshape(-1, 2), width / height)
    return rays, shot.tracer.intersect(rays.origin, rays.direction)


def _sides(shot: Shot, camera: Camera) -> F64:
    """By which side each mesh (M,) of the scene is seen, the mean of 1 for its front and -1; 0 where it is not seen."""
    mesh, side = _seen_sides(shot, camera)
    count = len(shot.scene.meshes)
    return np.bincount(mesh, side, count) / np.maximum(np.bincount(mesh, minlength=count), 1)


def _share_behind(shot: Shot, camera: Camera, front: F64) -> float:
    """The share of a camera's picture that shows meshes from another side than `front` says."""
    mesh, side = _seen_sides(shot, camera)
    return float((side * front[mesh] < 0).sum() / (PROBES[0] * PROBES[1]))


def _seen_sides(shot: Shot, camera: Camera) -> tuple[NDArray[np.int32], F64]:
    """The mesh of each place of a picture that shows something, and by which side: 1 its front, -1 its back."""
    rays, met = _probed(shot, camera)
    rows = np.flatnonzero(met.triangle >= 0)
    triangles, corner = shot.scene.triangles, shot.scene.triangles.positions[met.triangle[rows]].astype(np.float64)
    normal = np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])
    side = -np.sign(np.einsum("ij,ij->i", normal, rays.direction[rows]))
    return triangles.mesh[met.triangle[rows]], side


def _share(shot: Shot, camera: Camera, changed: NDArray[np.bool_]) -> float:
    """The share of a camera's picture that shows what changes; 0 from inside of things."""
    _, met = _probed(shot, camera)
    hit = met.triangle >= 0
    if hit.any() and np.median(met.distance[hit]) < CLOSE * shot.scene.diagonal:
        return 0.0
    return float((hit & changed[met.triangle]).mean()) if len(changed) else 0.0


def _middle(scene: Scene, changed: NDArray[np.bool_]) -> F64:
    rows = changed if changed.any() else np.ones(len(changed), bool)
    positions, areas = scene.triangles.positions[rows].astype(np.float64), scene.triangles.areas[rows]
    weights = areas if areas.sum() > 0 else np.ones(len(areas))
    return np.asarray(np.average(positions.mean(1), axis=0, weights=weights), np.float64)


def _eye(camera: Camera) -> F64:
    return np.asarray(camera.world_from_camera, np.float64)[:3, 3]


def _angle(a: F64, b: F64) -> float:
    cosine = a @ b / max(float(np.linalg.norm(a) * np.linalg.norm(b)), 1e-30)
    return float(np.degrees(np.arccos(np.clip(cosine, -1, 1))))
