"""Work: the long steps of a document, as generators that a worker steps, and that `close` cancels.

    opening(path, strokes, options)     a stage, and strokes on it
    warming(shot)                       what the first stroke would be the first to need
    finding(shot, strokes, folder)      what strokes ask for: a sentence at once, then the shot under it, then its light
    saving(shot, found, strokes, files) a stroke layer and a look layer

Each yields how far it is, and what is whole already; it returns its result.
"""

from __future__ import annotations

import itertools
import time
from collections.abc import Callable, Generator, Mapping
from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from hydra_viewer.model.autosave import Recovered, recovered
from hydra_viewer.model.brush_color import shot_color, shown_colors
from hydra_viewer.model.display import DisplaySettings
from hydra_viewer.model.document import Files, Strokes, are_same
from hydra_viewer.model.found import Found
from hydra_viewer.model.prim_tree import PrimTree
from usdslf import (
    Look,
    Progress,
    Settings,
    Shot,
    Solution,
    Stroke,
    UsdslfError,
    author,
    frame_of,
    paint_stroke,
    read_strokes,
    reload_stage,
    solve,
    stage_files,
    stepwise,
    write_strokes,
)

_numbers = itertools.count(1)
_has_solved = list[bool]()  # a stroke, in this process
COLOR = (0.4, 0.2, 0.1)
TRIED = ((0.5, 0.5), (0.5, 0.7), (0.3, 0.6), (0.7, 0.6), (0.5, 0.3))  # places of the picture that a dab may meet
WAIT = 0.01  # seconds between looks whether a stage is read


@dataclass(frozen=True, eq=False)
class Opened:
    """A shot as it was opened, with what pictures need made.

    Attributes:
        shot, files: it, and where it is from.
        strokes: on it, of the stroke layer.
        prims: its tree.
        layers: its files.
        warnings: sentences, the most important first.
        left: strokes that an earlier session did not save; None: none.
        look: a look layer that is there without strokes; None: none.
    """

    shot: Shot
    files: Files
    strokes: Strokes
    prims: PrimTree
    layers: tuple[str, ...]
    warnings: tuple[str, ...] = ()
    left: Recovered | None = None
    look: Found | None = None


def opening(files: Files, options: Mapping[str, Any]) -> Generator[Progress, None, Opened]:
    """Opens a shot and makes what pictures of it need.

    Args:
        files: stage, and strokes, "" for none.
        options: of `Shot.open`.

    Raises, when it is run: StageError, StrokeError, DeviceError.
    """

    def open_all() -> Opened:
        said: list[str] = []
        strokes: Strokes = ()
        if files.strokes and Path(files.strokes).exists():
            strokes = tuple(read_strokes(files.strokes, said))
        asked = dict(options)
        asked["frame"] = frame_of(strokes, asked.get("frame"), said)
        shot = Shot.open(files.stage, **asked)
        make_ready(shot)
        look = None if strokes else _look_of(shot, files)
        warnings = (*(m.sentence for m in shot.scene.missing), *said, *shot.warnings)
        layers = tuple(stage_files(shot.source))
        return Opened(shot, files, strokes, PrimTree.of(shot.stage), layers, warnings, recovered(files), look)

    return stepwise(open_all)


def preparing(shot: Shot, files: Files, strokes: Strokes) -> Generator[Progress, None, Opened]:
    """Makes what pictures of a shot need that is open already.

    Args:
        files: of it.
        strokes: on it.
    """

    def prepare() -> Opened:
        make_ready(shot)
        return Opened(shot, files, strokes, PrimTree.of(shot.stage), tuple(stage_files(shot.source)))

    return stepwise(prepare)


def _look_of(shot: Shot, files: Files) -> Found | None:
    """A look layer that is there, over the shot."""
    if not files.look or not Path(files.look).exists():
        return None
    edited = shot.edited(files.look)
    _ = edited.scene, edited.light_field
    return Found((), Solution(), Look(files.look, (), Solution()), edited, is_lit=True)


def reopening(
    shot: Shot, files: Files, options: Mapping[str, Any], is_read: Callable[[], bool]
) -> Generator[Progress, None, Opened]:
    """Opens a shot anew whose files have changed.

    Args:
        shot: as it was.
        files, options: as of `opening`.
        is_read: whether something is still reading its stage; that is waited for.
    """
    while is_read():
        yield Progress("read", 0.0)
        time.sleep(WAIT)
    reload_stage(shot.source)
    return (yield from opening(replace(files, strokes="", look=""), options))


def make_ready(shot: Shot) -> None:
    """Makes what pictures of a shot, and painting on it, need."""
    _ = shot.scene.bounds, shot.tracer, shot.light_field, shot.light_set, shot.camera()
    with suppress(UsdslfError):  # the picture says what is wrong with a display
        shown_colors([COLOR], DisplaySettings(), shot_color(shot))  # the first colour takes long


def warming(shot: Shot) -> Generator[Progress, None, None]:
    """Makes what the first stroke on a shot would be the first to ask for; the first shot is painted on for nothing.

    Modules that are loaded and kernels that are built at first use make the first answer of a process late.
    """

    yield from stepwise(lambda: shot.pictured)
    dab = None if _has_solved else _dab_of(shot)
    _has_solved.append(True)
    if dab is not None:
        with suppress(UsdslfError):
            yield from solve(shot, [dab])


def _dab_of(shot: Shot) -> Stroke | None:
    """A dab on what its first camera sees."""
    for place in TRIED:
        with suppress(UsdslfError):
            return paint_stroke(shot.scene, shot.tracer, shot.camera(), [np.array([place])], 0.01, COLOR, aspect=1.6)
    return None


def finding(
    shot: Shot, strokes: Strokes, folder: Path, is_look_first: bool = True
) -> Generator[Progress | Found, None, Found | None]:  # fmt: skip
    """Finds what strokes ask for; yields each Found that tells or shows more than the one before.

    First comes what direct strokes ask for in the light as it is, which is soon there; then the shot under it, as far
    as that needs no look; then the same with the light that goes round followed; then the look and its light.

    Args:
        shot: that they are on.
        strokes: the active ones; none: returns None.
        folder: for looks that are only looked at.
        is_look_first: the look comes before its light, for a picture that is of the look; else behind it, where the
            light can do without.

    Raises, when it is run: StrokeError, SolveError, AuthorError.
    """
    if not strokes:
        return None
    if any(s.mode == "direct" for s in strokes):
        first = yield from solve(shot, strokes, Settings(follows_light=False))
        yield from _shown_at_once(shot, Found(strokes, first, is_first=True))
    solution = yield from solve(shot, strokes)
    found = yield from _shown_at_once(shot, Found(strokes, solution))
    if found.shot is not None and not is_look_first:
        found = yield from stepwise(lambda: _lit(found))
        yield found
    path = folder / f"look_{next(_numbers)}.usda"
    shown = yield from stepwise(lambda: _with_look(shot, found, path))
    if shown.is_lit:
        return shown
    yield shown
    return (yield from stepwise(lambda: _lit(shown)))


def _lit(found: Found) -> Found:
    """Lets the light of the shot under what was found follow."""
    assert found.shot is not None
    _ = found.shot.light_field
    return replace(found, is_lit=True)


def _shown_at_once(shot: Shot, found: Found) -> Generator[Progress | Found, None, Found]:
    """Yields what was found, then the same with the shot under it where that needs no look; returns it."""
    yield found
    under = yield from stepwise(lambda: found.solution.over(shot))
    if under is not None:
        found = replace(found, shot=under)
        yield found
    return found


def _with_look(shot: Shot, found: Found, path: Path) -> Found:
    """Writes a look and reads the shot under it; where that is what is shown already, it stays."""
    look = author(shot, found.solution, path)
    under = look.over(shot, found.shot)
    return replace(found, look=look, shot=under, is_lit=found.is_lit and under is found.shot)


@dataclass(frozen=True, eq=False)
class Framed:
    """A shot at another frame, and what was found put over it."""

    shot: Shot
    found: Found | None


def framing(shot: Shot, frame: float, found: Found | None) -> Generator[Progress, None, Framed]:
    """Goes to another frame of a shot.

    Args:
        frame: time code.
        found: whose look is put over it; None: none.
    """

    def go() -> Framed:
        other = shot.at_frame(frame)
        make_ready(other)
        if found is None or found.look is None:
            return Framed(other, None)
        edited = other.edited(found.look.path)
        _ = edited.scene, edited.light_field
        return Framed(other, replace(found, shot=edited, is_lit=True))

    return stepwise(go)


def saving(
    shot: Shot, found: Found | None, strokes: Strokes, files: Files
) -> Generator[Progress | Found, None, Files]:  # fmt: skip
    """Writes strokes, and the look that they ask for.

    Args:
        shot: that they are on.
        found: what was found of strokes; where they are others by now they are solved first.
        strokes: all.
        files: where both go; look "": none.

    Raises, when it is run: StrokeError, SolveError, AuthorError.
    """
    yield from stepwise(lambda: write_strokes(files.strokes, strokes, shot.source))
    active = tuple(s for s in strokes if s.active)
    if not files.look:
        return files
    if found is not None and not found.is_first and are_same(found.strokes, active):
        solution = found.solution
    else:
        solution = (yield from solve(shot, active)) if active else Solution()
    yield from stepwise(lambda: author(shot, solution, files.look, files.strokes))
    return files
