"""Review: the order of the steps from a shot and a look to all that a person needs to accept it.

    review(stage, look, settings) -> Review             what changes, pictures, strokes, what is wrong
    review_shot(shot, look, settings) -> Review         the same over a shot that is open, whose light is there
    pictured(found, before, after, settings) -> Review   the same of two states of a shot that are there

Without pictures it is `usdslf.usd.review.review.review_look`, which opens no light.
"""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from usdslf.errors import InputError, StrokeError
from usdslf.progress import step, tell, tell_during
from usdslf.review.pictures import Eyes, Pair, Pictures, StrokeOn, exposure_like, strokes_on, take_pictures
from usdslf.review.rig import held_out_rig
from usdslf.review.views import View, changed_triangles, held_out_views, stroke_views, turntable
from usdslf.scene.records import Scene
from usdslf.shot import Shot
from usdslf.strokes.stroke import Stroke
from usdslf.usd.review.records import LookReview
from usdslf.usd.review.review import over_its_shot, review_look, strokes_of_look

SIZE = 960, 540  # of a picture [pixels]
RIG_ELEMENTS = 4000  # of the light field under another light, at most


@dataclass(frozen=True)
class ReviewSettings:
    """What a review is told.

    Attributes:
        cameras: paths of further cameras to look from.
        size: of each picture, width and height [pixels].
        frames: of each picture; they are live pictures, the more the less noise.
        painted: most views that strokes were painted from.
        held_out: views that nobody painted from.
        turns: views of a turntable; 0: none.
        frame: time code; None: that which the look was solved at.
        device, ocio: OpenCL device and OpenColorIO config.
        quality: of `Shot.open`: elements, bounces, refine, make_preview, ...
    """

    cameras: tuple[str, ...] = ()
    size: tuple[int, int] = SIZE
    frames: int = 8
    painted: int = 3
    held_out: int = 2
    turns: int = 0
    frame: float | None = None
    device: str | None = None
    ocio: str | None = None
    quality: Mapping[str, Any] = field(default_factory=dict)


@dataclass(frozen=True, eq=False)
class ReviewedView:
    """One view of a review.

    Attributes:
        pictures: before and after.
        strokes: that lie on it.
        light: what shines, in words; "": the shot's own light.
    """

    pictures: Pictures
    strokes: tuple[StrokeOn, ...]
    light: str = ""

    def as_values(self) -> dict[str, Any]:
        """As JSON holds it, without pixels."""
        p = self.pictures
        return {
            "name": p.view.name, "kind": p.view.kind, "light": self.light, "size": list(p.size),
            "exposure": p.exposure, "painted_from": list(p.view.strokes),
            "indirect": {"mean": float(p.indirect.mean()), "worst": float(p.indirect.max(initial=0.0))},
            "strokes": [s.as_values() for s in self.strokes],
        }  # fmt: skip


@dataclass(frozen=True, eq=False)
class Review:
    """All that a person needs to accept a look.

    Attributes:
        look: what changes and what is wrong, without light.
        strokes: of the look, as its stroke layer has them; those that are gone are not among them.
        views: pictures.
        scene: the shot without the look.
        warnings: sentences.
    """

    look: LookReview
    strokes: tuple[Stroke, ...]
    views: tuple[ReviewedView, ...]
    scene: Scene
    warnings: tuple[str, ...] = ()

    def as_values(self) -> dict[str, Any]:
        """As JSON holds it: schemas/review.schema.json."""
        named = {s for m in self.look.materials for s in m.strokes}
        strokes = [
            {
                "path": s.path, "tool": s.tool, "mode": s.mode, "scope": s.scope,
                "active": s.active, "materials": [m.shown_at for m in self.look.materials if s.path in m.strokes],
            }
            for s in self.strokes
        ]  # fmt: skip
        gone = sorted(named - {s.path for s in self.strokes})
        return {
            **self.look.as_values(),
            "strokes": strokes,
            "strokes_gone": gone,
            "views": [v.as_values() for v in self.views],
            "warnings": list(self.warnings),
        }


def review(
    stage: str | os.PathLike[str], look: str | os.PathLike[str], settings: ReviewSettings | None = None
) -> Review:
    """Reviews a look: what it changes in a shot, by numbers and by pictures.

    Args:
        stage: the shot, with or without the look.
        look: its layer.
        settings: None: as usual.

    Raises: StageError for the shot or a camera, InputError for the look.
    """
    s = settings or ReviewSettings()
    seconds: dict[str, float] = {}
    with step("review", seconds):
        found = tell_during(lambda: review_look(stage, look, s.ocio))
    with_look, below = over_its_shot(stage, look)
    frame = found.provenance.get("frame") if s.frame is None else s.frame
    before = Shot.open(below, frame, s.device, s.ocio, **s.quality)
    return pictured(found, before, before.reopened(with_look), s)


def review_shot(
    shot: Shot, look: str | os.PathLike[str], settings: ReviewSettings | None = None, found: LookReview | None = None
) -> Review:
    """Reviews a look over a shot that is open, as its files are now; what of its light is the same is not made anew.

    Args:
        shot: with or without the look; its frame, device and quality hold, in place of those of the settings.
        look: its layer.
        settings: None: as usual.
        found: what `review_look` said of it; None: it is asked.

    Raises: StageError for the shot or a camera, InputError for the look.
    """
    s = settings or ReviewSettings()
    with step("review"):
        said = found if found is not None else tell_during(lambda: review_look(shot.path, look, s.ocio or shot.ocio))
        with_look, below = over_its_shot(shot.path, look)
        before = shot.reopened(below)
        return pictured(said, before, before.reopened(with_look), s)


def pictured(found: LookReview, before: Shot, after: Shot, s: ReviewSettings) -> Review:
    """Adds pictures to what is said of a look.

    Args:
        found: without pictures.
        before, after: the shot without the look and with it, or with another one and with it.

    Raises: StageError for a camera, InputError where the look changes geometry.
    """
    said: list[str] = []
    strokes = _strokes(found, said)
    paths = [g.path for g in found.gprims]
    changed, gprims = changed_triangles(before.scene, paths), _gprim_of_triangle(before.scene, paths)
    pair = Pair(before, after, (Eyes(before), Eyes(after)), changed, gprims)
    if len(after.scene.triangles.mesh) != len(before.scene.triangles.mesh):
        raise InputError(f"{found.look} changes geometry, which is no look: solve again")
    views = stroke_views(before, [x for x in strokes if x.active], s.painted)
    views += [View(name, "camera", before.camera(name)) for name in s.cameras]
    views += held_out_views(before, views, pair.changed, s.held_out)
    views += turntable(before, views, pair.changed, s.turns) if s.turns else []
    seen = []
    for number, view in enumerate(views):
        half = view.kind == "turntable"
        size = (max(1, s.size[0] // 2), max(1, s.size[1] // 2)) if half else s.size
        pictures = take_pictures(pair, view, size, s.frames)
        seen.append(ReviewedView(pictures, tuple(strokes_on(pictures, strokes, pair))))
        tell((number + 1) / (len(views) + 1))
    seen.append(_under_rig(pair, seen[0], s))
    said += [*before.warnings, *after.warnings]
    return Review(found, tuple(strokes), tuple(seen), before.scene, tuple(dict.fromkeys(said)))


def _strokes(found: LookReview, said: list[str]) -> list[Stroke]:
    """The strokes that the look is of, if their layer is there."""
    named = {s for m in found.materials for s in m.strokes}
    try:
        strokes = strokes_of_look(found.look)
    except StrokeError as error:
        said.append(str(error))
        return []
    if named and not strokes:
        said.append(f"the strokes of {found.look} are not there: their places and targets are not shown")
    return [s for s in strokes if s.path in named]


def _gprim_of_triangle(scene: Scene, paths: list[str]) -> np.ndarray:
    rows = {path: i for i, path in enumerate(paths)}
    found = []
    for mesh in scene.meshes:
        own = rows.get(mesh.path.split("[")[0], rows.get(mesh.prototype, -1))
        row = np.full(len(mesh.triangles), own, np.int32)
        if mesh.subset_of_triangle is not None and mesh.subsets:
            row = np.array([rows.get(s, own) for s in mesh.subsets] + [own], np.int32)[mesh.subset_of_triangle]
        found.append(row)
    return np.concatenate(found) if found else np.zeros(0, np.int32)


def _under_rig(pair: Pair, first: ReviewedView, s: ReviewSettings) -> ReviewedView:
    """The first view in a light that nobody painted under."""
    camera = first.pictures.view.camera
    lights, words = held_out_rig(pair.before, camera)
    count = min(pair.before.element_count, RIG_ELEMENTS)
    before = pair.before.relit(lights, count)
    after = before.sharing(pair.after.relit(lights, count))
    view = View(first.pictures.view.name, "light", camera)
    lit = replace(pair, before=before, after=after, eyes=(Eyes(before), Eyes(after)))
    pictures = take_pictures(lit, view, s.size, s.frames)
    exposure = exposure_like(pictures.before, first.pictures.before)
    return ReviewedView(replace(pictures, exposure=exposure), (), words)
