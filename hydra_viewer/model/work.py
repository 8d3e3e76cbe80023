"""Work: the long steps of a document, as generators that a worker steps, and that `close` cancels.

    opening(path, strokes, options)     a stage, and strokes on it
    finding(shot, strokes, folder)      what strokes ask for: the sentence first, then the shot under it
    saving(shot, found, strokes, files) a stroke layer and a look layer

Each yields how far it is, and what is whole already; it returns its result.
"""

from __future__ import annotations

import itertools
from collections.abc import Generator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from hydra_viewer.model.document import Files, Strokes
from hydra_viewer.model.found import Found
from usdslf import Progress, Shot, Solution, author, frame_of, read_strokes, solve, stepwise, write_strokes

_numbers = itertools.count(1)


@dataclass(frozen=True, eq=False)
class Opened:
    """A shot as it was opened, with what pictures need made, and the strokes on it."""

    shot: Shot
    files: Files
    strokes: Strokes
    warnings: tuple[str, ...] = ()


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
        return Opened(shot, files, strokes, (*said, *shot.warnings))

    return stepwise(open_all)


def make_ready(shot: Shot) -> None:
    """Makes what pictures of a shot, and painting on it, need."""
    _ = shot.scene, shot.tracer, shot.light_field, shot.light_set, shot.camera()


def finding(shot: Shot, strokes: Strokes, folder: Path) -> Generator[Progress | Found, None, Found | None]:
    """Finds what strokes ask for; yields a Found without a look as soon as there is one, then one without its light.

    Args:
        shot: that they are on.
        strokes: the active ones; none: returns None.
        folder: for looks that are only looked at.

    Raises, when it is run: StrokeError, SolveError, AuthorError.
    """
    if not strokes:
        return None
    solution: Solution = yield from solve(shot, strokes)
    found = Found(strokes, solution)
    yield found
    path = folder / f"look_{next(_numbers)}.usda"

    def show() -> Found:
        look = author(shot, solution, path)
        edited = shot.edited(path)
        _ = edited.scene
        return replace(found, look=look, shot=edited)

    shown = yield from stepwise(show)
    yield shown
    yield from stepwise(lambda: shown.shot.light_field if shown.shot else None)
    return replace(shown, is_lit=True)


def saving(shot: Shot, found: Found | None, strokes: Strokes, files: Files) -> Generator[Progress, None, Files]:
    """Writes strokes, and the look where there is one.

    Raises, when it is run: StrokeError, AuthorError.
    """

    def save() -> Files:
        write_strokes(files.strokes, strokes, shot.source)
        if files.look:
            author(shot, found.solution if found is not None else Solution(), files.look, files.strokes)
        return files

    return stepwise(save)
