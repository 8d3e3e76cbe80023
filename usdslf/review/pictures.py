"""Pictures of a review: before and after from each view, what each pixel shows, and indirect effects as a heat map.

    take_pictures(pair, view, size, frames) -> Pictures
    strokes_on(pictures, strokes, pair) -> [StrokeOn]        where strokes lie on a picture, and what is seen there

Indirect effects are the difference of the two light fields, not of two pictures: radiance that surfaces send to the
camera which are not changed themselves, without the noise of gathered rays.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from usdslf.color import luminance
from usdslf.pictures import live_picture
from usdslf.progress import tell
from usdslf.render.live.picture import LivePicture
from usdslf.review.views import View
from usdslf.scene.cameras import camera_rays, project_points
from usdslf.scene.records import F32, Camera
from usdslf.shot import Shot
from usdslf.strokes.stroke import Stroke

HIDDEN = 0.02  # share of the distance that a dab may lie behind what a ray meets


class Eyes:
    """What sees a shot: pictures of it from one camera after another, which share what is on the device."""

    def __init__(self, shot: Shot) -> None:
        self._shot = shot
        self._live: LivePicture | None = None

    def see(self, camera: Camera, size: tuple[int, int], frames: int) -> F32:
        """Returns the picture (h, w, 3) of a camera after so many frames."""
        if self._live is None:
            self._live = live_picture(self._shot, camera, None, size)
        else:
            self._live = self._live.seen_by(camera, size)
        for frame in self._live.frames(frames):
            tell(frame.share)
        return np.array(frame.picture[..., :3])


@dataclass(frozen=True, eq=False)
class Pair:
    """A shot without a look and with it.

    Attributes:
        before, after: shots.
        eyes: what sees each of them.
        changed: (T,) triangles whose gprims or GeomSubsets show something else.
        gprim: (T,) of each triangle its row in the review's gprims, -1 for none.
    """

    before: Shot
    after: Shot
    eyes: tuple[Eyes, Eyes]
    changed: NDArray[np.bool_]
    gprim: NDArray[np.int32]


@dataclass(frozen=True, eq=False)
class Pictures:
    """What one view shows.

    Attributes:
        view: from where.
        before, after: (h, w, 3) scene-linear.
        gprim: (h, w) row of the review's gprims that a pixel shows, -1 for none.
        indirect: (h, w) by how much the radiance [UsdLux scale] of what is not changed itself differs.
        exposure: [stops] that it is shown with.
    """

    view: View
    before: F32
    after: F32
    gprim: NDArray[np.int32]
    indirect: F32
    exposure: float = 0.0

    @property
    def size(self) -> tuple[int, int]:
        """Width and height [pixels]."""
        return self.before.shape[1], self.before.shape[0]


@dataclass(frozen=True)
class StrokeOn:
    """A stroke on a picture.

    Attributes:
        path: of the stroke.
        dabs: rows of x, y and radius, in 0..1 of the picture's width and height, the radius of its width.
        target: mean colour that was painted, scene-linear; none for tools that paint no colour.
        seen_before, seen_after: mean colour there, scene-linear.
    """

    path: str
    dabs: tuple[tuple[float, float, float], ...]
    target: tuple[float, ...]
    seen_before: tuple[float, ...]
    seen_after: tuple[float, ...]

    def as_values(self) -> dict[str, Any]:
        """As JSON holds it, without the dabs."""
        return {
            "path": self.path, "target": list(self.target), "seen_before": list(self.seen_before),
            "seen_after": list(self.seen_after),
        }  # fmt: skip


def take_pictures(pair: Pair, view: View, size: tuple[int, int], frames: int) -> Pictures:
    """Renders a view without and with the look.

    Args:
        size: width and height [pixels].
        frames: of a live picture, a gathered ray a pixel each.
    """
    before, after = (eyes.see(view.camera, size, frames) for eyes in pair.eyes)
    width, height = size
    x, y = (np.arange(width) + 0.5) / width, (np.arange(height) + 0.5) / height
    rays = camera_rays(view.camera, np.stack(np.meshgrid(x, y), -1).reshape(-1, 2), width / height)
    met = pair.before.tracer.intersect(rays.origin, rays.direction)
    hit = met.triangle >= 0
    gprim = np.where(hit, pair.gprim[met.triangle], -1).astype(np.int32)
    indirect = np.zeros(len(hit), np.float32)
    rows = np.flatnonzero(hit & ~pair.changed[met.triangle])
    if len(rows):
        ray = met.triangle[rows], met.barycentric[rows], rays.direction[rows]
        sent = [shot.light_field.radiance_from_hits(*ray) for shot in (pair.before, pair.after)]
        indirect[rows] = luminance(np.abs(sent[1] - sent[0]))
    return Pictures(view, before, after, gprim.reshape(height, width), indirect.reshape(height, width))


def exposure_like(picture: F32, like: F32) -> float:
    """Returns the exposure [stops] that makes a picture as bright as another, in quarters of a stop."""
    bright, wanted = (max(float(np.percentile(luminance(p), 90)), 1e-6) for p in (picture, like))
    return float(np.clip(np.round(4 * np.log2(wanted / bright)) / 4, -10, 10))


def strokes_on(p: Pictures, strokes: Sequence[Stroke], pair: Pair) -> list[StrokeOn]:
    """Returns where the strokes lie that a picture shows, and what is seen there before and after."""
    width, height = p.size
    found = []
    eye = np.asarray(p.view.camera.world_from_camera, np.float64)[:3, 3]
    for stroke in strokes:
        here = stroke.seen_from(pair.before.scene.origin)
        points = np.asarray(here.points, np.float64)
        at, depth = project_points(p.view.camera, points, width / height)
        side, _ = project_points(
            p.view.camera, points + np.asarray(p.view.camera.world_from_camera)[:3, 0], width / height
        )
        radius = 0.5 * np.asarray(here.widths) * np.abs(side[:, 0] - at[:, 0])
        inside = (depth > 0) & np.isfinite(at).all(1) & (at >= 0).all(1) & (at < 1).all(1)
        away = points - eye
        far = np.linalg.norm(away, axis=1)
        with np.errstate(invalid="ignore", divide="ignore"):
            way = (away / far[:, None]).astype(np.float32)
        rows = np.flatnonzero(inside & (far > 0))
        if not len(rows):
            continue
        start = np.broadcast_to(eye.astype(np.float32), (len(rows), 3))
        hidden = pair.before.tracer.occluded(start, way[rows], ((1 - HIDDEN) * far[rows]).astype(np.float32))
        rows = rows[~hidden]
        if not len(rows):
            continue
        column, row = (at[rows] * [width, height]).astype(np.intp).T
        seen = [tuple(_mean(picture[row, column])) for picture in (p.before, p.after)]
        paints = stroke.tool == "replace" and stroke.space == "scene" and len(stroke.colors)
        target = tuple(_mean(np.asarray(stroke.colors))) if paints else ()
        dabs = np.round(np.column_stack([at[rows], radius[rows]]), 4).tolist()
        found.append(StrokeOn(stroke.path, tuple(tuple(d) for d in dabs), target, *seen))
    return found


def _mean(colors: NDArray) -> list[float]:
    return [float(x) for x in np.asarray(colors, np.float64).reshape(-1, 3).mean(0)]
