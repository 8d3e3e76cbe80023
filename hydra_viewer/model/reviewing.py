"""Reviewing: a saved look with pictures, and what belongs to each of its changes, as a panel shows it.

    reviewing(shot, look)               a generator: what is said of the look, then the same with pictures
    details_of(said, review, material)  strokes, residuals, colours, alternatives, what changes unpainted
    heat_map(values, gain) -> (h, w, 3) indirect effects in colours
"""

from __future__ import annotations

from collections.abc import Generator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hydra_viewer.model.understanding import brief_of
from usdslf import LookReview, Progress, Shot, review_look, stepwise
from usdslf.review import Review, ReviewSettings, review_shot, toggle

SETTINGS = ReviewSettings(size=(640, 360), frames=6)
HEAT = ((0.0, 0.0, 0.0), (0.35, 0.05, 0.35), (0.85, 0.25, 0.15), (1.0, 0.75, 0.2), (1.0, 1.0, 0.9))  # of the screen
Rgb = tuple[float, ...]


@dataclass(frozen=True)
class Weighed:
    """An explanation that was weighed: what it changes, how likely it was, its cost; None: not admitted."""

    title: str
    chance: float
    cost: float | None


@dataclass(frozen=True)
class Details:
    """What belongs to what a look changes of a material.

    Attributes:
        strokes: names of those that asked for it.
        residuals: relative error of what was painted, before and after; () where it was not measured.
        painted, before, after: mean colours of the paint, and of what is seen there, scene-linear; () where no view
            shows it, or nothing was painted with a colour.
        weighed: all explanations, the cheapest first.
        unpainted: paths of gprims that change and that no stroke lies on.
    """

    strokes: tuple[str, ...]
    residuals: tuple[float, ...]
    painted: Rgb
    before: Rgb
    after: Rgb
    weighed: tuple[Weighed, ...]
    unpainted: tuple[str, ...]


def reviewing(shot: Shot, look: str) -> Generator[Progress | LookReview, None, Review]:
    """Reviews a look as it was saved: what is said of it first, then with pictures.

    Args:
        shot: that is open.
        look: file.

    Raises, when it is run: StageError for the shot, InputError for the look.
    """
    said = yield from stepwise(lambda: review_look(shot.path, look, shot.ocio))
    yield said
    return (yield from stepwise(lambda: review_shot(shot, look, SETTINGS, said)))


def switching(look: str, name: str, is_on: bool) -> Generator[Progress, None, None]:
    """Switches what a look changes off or on, in its file.

    Args:
        name: as `usdslf toggle` takes it.

    Raises, when it is run: InputError.
    """
    yield from stepwise(lambda: toggle(look, [name], is_on))


def details_of(said: LookReview, review: Review | None, material: str) -> Details:
    """Returns what belongs to what a look changes of a material.

    Args:
        said: of the look.
        review: of it with pictures; None: not there yet, no colours are known.
        material: its path in the look.
    """
    record = next((m for m in said.materials if m.prim == material), None)
    strokes = record.strokes if record else ()
    unpainted = tuple(g.path for g in said.gprims if material in g.materials and not g.is_painted)
    views = review.views if review else ()
    seen = next((s for v in views for s in v.strokes if s.path in strokes and s.target), None)
    residuals: tuple[float, ...] = ()
    if record and record.residual_before is not None and record.residual_after is not None:
        residuals = record.residual_before, record.residual_after
    weighed = tuple(Weighed(brief_of(a.id), a.probability, a.cost) for a in (record.alternatives if record else ()))
    colors = (seen.target, seen.seen_before, seen.seen_after) if seen else ((), (), ())
    return Details(tuple(s.rsplit("/", 1)[-1] for s in strokes), residuals, *colors, weighed, unpainted)


def heat_map(values: NDArray, gain: float = 1.0) -> NDArray[np.uint8]:
    """Returns values (h, w) as colours of the screen (h, w, 3), black where there is nothing.

    Args:
        values: 0 and above; the brightest colour is for the largest of them, outliers aside.
        gain: what they are magnified by before that.
    """
    top = float(np.percentile(values, 99.8)) or float(values.max(initial=0.0)) or 1.0
    at = np.clip(gain * values / top, 0, 1)
    ends = np.linspace(0, 1, len(HEAT))
    channels = [np.interp(at, ends, [color[c] for color in HEAT]) for c in range(3)]
    return np.round(255 * np.stack(channels, -1)).astype(np.uint8)
