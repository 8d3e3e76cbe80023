"""Records of the gallery: what an entry is, and what came of one."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np
from numpy.typing import NDArray

from usdslf.procedural.built_shot import BuiltShot

if TYPE_CHECKING:
    from usdslf.inference.answers import Answer
    from usdslf.inference.weights import Options
    from usdslf.session import Session
    from usdslf.strokes.stroke import Stroke

Point = tuple[float, float]
Rgb = tuple[float, float, float]
Dabs = Sequence[tuple[Rgb, Sequence[Point]]]
"""Dabs by colour: scene-linear radiance, and places on the picture, 0..1 from its top left."""


@dataclass(frozen=True)
class Entry:
    """A result figure of the paper as a runnable scene."""

    name: str  # on the command line and of its folder
    figures: str  # of the paper, e.g. "19"
    title: str
    claim: str  # what the figure claims, one sentence
    build: Callable[[Path, str | None], BuiltShot]  # folder, --hdri -> the shot; writes its textures into the folder
    run: Callable[[PlayLike], None]  # paints, solves and says what it shows
    elements: int = 10000
    has_environment: bool = False  # is lit by --hdri where that is given


@dataclass(frozen=True)
class Picture:
    """A picture of the page."""

    file: str  # relative to the entry's folder
    caption: str


@dataclass(frozen=True)
class Step:
    """One round of strokes -> solve -> look layer, with its pictures."""

    title: str
    pictures: tuple[Picture, ...]
    lines: tuple[str, ...]  # what was inferred
    report: dict[str, Any]
    answers: tuple[Answer, ...]
    strokes: tuple[Stroke, ...]
    before: Session
    after: Session
    folder: Path  # of look.usda, strokes.usda, review.usda, report.json


@dataclass(frozen=True)
class Shown:
    """A part of the claim, checked."""

    sentence: str
    is_true: bool
    measured: str = ""


class PlayLike(Protocol):
    """What an entry uses of the play that runs it; `play.Play` says what each does."""

    shot: BuiltShot
    folder: Path
    size: tuple[int, int]
    samples: int
    has_pictures: bool
    session: Session

    def paint(self, dabs: Dabs, radius: float = ..., view: int = ..., **brush: Any) -> Stroke:
        """Paints dabs on the picture of a view, and keeps the stroke for the next step."""

    def sweep(
        self, paths: Sequence[Sequence[Point]], radius: float = ..., color: Rgb = ..., view: int = ..., **brush: Any
    ) -> Stroke:
        """Sweeps a brush of one colour along paths, and keeps the stroke for the next step."""

    def step(
        self, title: str, norm: str | None = ..., choose: Mapping[str, str] | None = ..., options: Options | None = ...,
        goes_on: bool = ...,
    ) -> Step:  # fmt: skip
        """Solves the strokes painted since the last step, writes their layers, takes pictures."""

    def shows(self, sentence: str, is_true: bool, measured: str = ...) -> None:
        """Notes a part of the figure's claim, and whether this run shows it."""

    def see(self, session: Session, view: int = ...) -> dict[str, NDArray[np.float32]]:
        """Renders what a session's view shows."""

    def look_at(self, session: Session, name: str, caption: str, view: int = ...) -> None:
        """Renders what a session's view shows for the page."""

    def picture(self, name: str, pixels: NDArray, caption: str) -> None:
        """Writes another picture for the page."""

    def drawing(self, name: str, svg: str, caption: str) -> None:
        """Writes a drawing for the page."""


def on_picture(dabs: Dabs) -> Dabs:
    """Turns the places of dabs on a picture of 640 x 360 pixels into 0..1."""
    return [(rgb, [(x / 640, y / 360) for x, y in places]) for rgb, places in dabs]
