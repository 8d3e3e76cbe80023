"""Previews: small pictures of the shot by each explanation, and what of it changes beside the paint.

    previewing(shot, found, groups, sight, whole)      a generator that yields a Preview each, then an Effects
    WholePicture                                        the picture that they begin with, kept from one to the next
"""

from __future__ import annotations

import tempfile
from collections.abc import Collection, Generator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hydra_viewer.model.brush_color import shot_color
from hydra_viewer.model.display import DisplaySettings, display_codes
from hydra_viewer.model.found import Found
from hydra_viewer.model.understanding import OF_MATERIAL, Understood
from usdslf import (
    Camera,
    LivePicture,
    Progress,
    Settings,
    Shot,
    Solution,
    Stroke,
    UsdslfError,
    author,
    live_picture,
    project_points,
    solve,
    stepwise,
)

FRAMES = 4  # of a preview
WHOLE = 220  # width of the picture that tells what changes [pixels]
LEAST_CROP = 0.22  # of the picture's height
Materials = Sequence[Any]  # of a Scene
SEEN_CHANGE = 0.01  # mean relative change of a gprim's picture that is said


@dataclass(frozen=True)
class Sight:
    """What previews look at.

    Attributes:
        camera: relative to `Scene.origin`.
        aspect: width / height of the picture.
        size: of a preview, width and height [pixels].
        display: how the screen shows them.
    """

    camera: Camera
    aspect: float
    size: tuple[int, int] = (168, 112)
    display: DisplaySettings = field(default_factory=DisplaySettings)


@dataclass(frozen=True, eq=False)
class Preview:
    """A picture round a stroke by one explanation.

    Attributes:
        group: number of the Understood that it is of.
        id: of the alternative.
        picture: (h, w, 3) scene-linear; None: it cannot be chosen.
        why_not: a sentence where it cannot be.
        codes: (h, w, 3) the picture as the screen shows it by `display`; None where there is no picture.
    """

    group: int
    id: str
    picture: NDArray | None
    why_not: str = ""
    codes: NDArray[np.uint8] | None = None
    display: DisplaySettings | None = None


@dataclass(frozen=True)
class Effect:
    """How far the picture of a gprim changes.

    Attributes:
        path: of the gprim.
        change: mean relative change of its radiance in the picture.
        is_painted: a stroke lies on it.
        shows_material: its own material changes; False: only the light that it gets.
    """

    path: str
    change: float
    is_painted: bool
    shows_material: bool


@dataclass(frozen=True)
class Effects:
    """What of the picture changes, the most first."""

    rows: tuple[Effect, ...]


class WholePicture:
    """The whole picture of a shot, small, and all that is on the device for it; kept as long as it is of that shot."""

    def __init__(self) -> None:
        self._of: Shot | None = None
        self._live: LivePicture | None = None

    def seen(self, shot: Shot, sight: Sight) -> LivePicture:
        """Returns it, begun anew only as far as it has to be."""
        live, size = self._live, (WHOLE, max(1, round(WHOLE / sight.aspect)))
        if live is None or self._of is not shot:
            live = live_picture(shot, sight.camera, size=size)
        elif live.view.camera is not sight.camera or live.view.size != size:
            live = live.seen_by(sight.camera, size)
        self._of, self._live = shot, live
        return live

    def forget(self) -> None:
        """Keeps nothing: another shot is there."""
        self._of = self._live = None


def previewing(
    shot: Shot, found: Found, groups: Sequence[Understood], sight: Sight, whole: WholePicture,
    known: Collection[tuple[int, str]] = (),
) -> Generator[Progress | Preview | Effects, None, None]:  # fmt: skip
    """Makes pictures of the alternatives, then looks at what changes.

    Args:
        shot: as its files have it.
        found: with its look, and lit.
        groups: what was understood of it.
        sight: through which camera.
        whole: of an earlier call.
        known: number of the group and id of the alternatives whose pictures are there already.
    """
    if found.shot is None:
        return
    base: LivePicture = yield from stepwise(lambda: whole.seen(shot, sight))
    with tempfile.TemporaryDirectory(prefix="usdslf-previews-") as folder:
        for number, group in enumerate(groups):
            strokes = [s for s in found.strokes if s.name in group.strokes]
            crop, region = crop_of(shot, strokes, sight)
            near = base.seen_by(sight.camera, crop, region)
            for alternative in group.offered:
                if (number, alternative.id) in known:
                    continue
                path = Path(folder) / f"look_{number}.usda"
                if alternative.is_chosen:
                    materials: Materials | str = found.shot.scene.materials
                else:
                    materials = yield from _materials(shot, found, group.strokes, alternative.id, path)
                if isinstance(materials, str):
                    yield Preview(number, alternative.id, None, materials)
                    continue
                picture = yield from _picture(near, materials)
                codes = display_codes(picture, sight.display, shot_color(shot))
                yield Preview(number, alternative.id, picture, "", codes, sight.display)
    yield from _effects(base, shot, found, groups)


def crop_of(
    shot: Shot, strokes: Sequence[Stroke], sight: Sight
) -> tuple[tuple[int, int], tuple[int, int, int, int]]:
    """Returns the size of a whole picture and the part of it round strokes, which has the size of a preview.

    Args:
        shot: that they are on.
        strokes: one or more; where the camera sees none of them the part is the middle.
        sight: through which camera, and how large a preview is.
    """
    points = np.concatenate([s.seen_from(shot.scene.origin).points for s in strokes])
    at, _ = project_points(sight.camera, points, sight.aspect)
    at = at[np.isfinite(at).all(1) & (at >= 0).all(1) & (at <= 1).all(1)]
    low, high = (at.min(0), at.max(0)) if len(at) else (np.array([0.3, 0.3]), np.array([0.7, 0.7]))
    w, h = sight.size
    tall = max(LEAST_CROP, 1.8 * (high[1] - low[1]), 1.8 * (high[0] - low[0]) * sight.aspect * h / w)
    tall = min(tall, 1.0, sight.aspect * h / w)  # of the picture's height
    height = max(h, round(h / tall))
    width = max(w, round(height * sight.aspect))
    middle = (low + high) / 2 * [width, height]
    left, top = (round(float(np.clip(m - n / 2, 0, most - n))) for m, n, most in zip(middle, (w, h), (width, height)))
    return (width, height), (left, top, left + w, top + h)


def _materials(
    shot: Shot, found: Found, names: Sequence[str], id_: str, path: Path
) -> Generator[Progress, None, Materials | str]:
    """The materials by an explanation, or why it cannot be had."""

    def with_look(solution: Solution) -> Materials:
        return solution.materials(shot) or shot.edited(author(shot, solution, path).path).scene.materials

    try:
        if OF_MATERIAL in id_:  # of an indirect stroke: what its light comes from is looked for anew
            solution = yield from solve(shot, found.strokes, Settings(choose=dict.fromkeys(names, id_), bounces=1))
        else:
            solution = found.solution.as_chosen(names[0], id_)
        return (yield from stepwise(lambda: with_look(solution)))
    except UsdslfError as error:
        return str(error)


def _picture(near: LivePicture, materials: Materials) -> Generator[Progress, None, NDArray]:
    live = yield from stepwise(lambda: near.with_materials(materials))
    for _ in range(FRAMES):
        yield from stepwise(lambda: live.gather_frame(FRAMES))
    return np.array(live.now(FRAMES).picture)


def _effects(
    base: LivePicture, shot: Shot, found: Found, groups: Sequence[Understood]
) -> Generator[Progress | Effects, None, None]:
    """Compares the whole picture before and after, light included."""
    edited = found.shot
    assert edited is not None
    light = edited.light_field if found.is_lit else None
    under = yield from stepwise(lambda: base.with_materials(edited.scene.materials, light))
    for live in (base, under):
        for _ in range(FRAMES):
            yield from stepwise(lambda live=live: live.gather_frame(FRAMES))  # type: ignore[misc]
    before, after = (np.array(live.now(FRAMES).picture, np.float64) for live in (base, under))
    yield Effects(effects_of(shot, groups, base.seen()["mesh"], before, after))


def effects_of(
    shot: Shot, groups: Sequence[Understood], mesh: NDArray, before: NDArray, after: NDArray
) -> tuple[Effect, ...]:
    """Returns how far the picture of each gprim changes, those that change visibly, the most first.

    Args:
        shot: whose gprims they are.
        groups: what was understood.
        mesh: (h, w) into the scene's meshes; -1: none.
        before, after: (h, w, 3) scene-linear.
    """
    changing = {p for g in groups if g.changes for p in (*g.painted, *g.sharing)}
    painted = {p for g in groups for p in g.painted}
    found = []
    for i in np.unique(mesh[mesh >= 0]):
        is_here = mesh == i
        change = float(np.abs(after[is_here] - before[is_here]).mean() / max(before[is_here].mean(), 1e-9))
        path = shot.scene.meshes[int(i)].path
        if change >= SEEN_CHANGE:
            found.append(Effect(path, change, path in painted, path in changing))
    return tuple(sorted(found, key=lambda e: -e.change))

