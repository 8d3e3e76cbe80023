"""usdslf solve: strokes to a look layer."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import click

from usdslf.cli.look_options import LookFiles, look_options, write_look
from usdslf.cli.parameters import ChoiceWeights, Choose, Similarity
from usdslf.cli.program import Command, Settings, gathered, settings
from usdslf.cli.shot_options import Lighting, lighting_options
from usdslf.strokes.words import NORMS

if TYPE_CHECKING:
    from collections.abc import Iterator

    from usdslf.inference.next_dab import NextDab
    from usdslf.session import Session

DIRECTIONS = 1024  # of each element, as the kernels have them


@dataclass(frozen=True)
class Choice:
    """What decides between the changes that explain the strokes, and how far one spreads."""

    norm: str | None  # None: each stroke's own
    weights: tuple[float, ...] | dict[str, float] | None
    similarity: tuple[float, float, float] | None
    choose: tuple[tuple[str, str], ...]  # stroke, id of an alternative
    mode: str | None
    next_dab: bool
    alternatives: int


@click.command(cls=Command)
@click.argument("stage")
@click.argument("strokes")
@look_options("what was inferred, with alternatives", "look, strokes and shot")
@click.option("--directions", type=int, default=DIRECTIONS, show_default=True, help="Of each element; 1024.")
@click.option("--norm", type=click.Choice(NORMS), help="For all strokes; default: each stroke's own.")
@click.option(
    "--weights",
    type=ChoiceWeights(),
    help="Of the norm mixed: three factors of the misfit for one, two and three "
    "freed parameters, 1,5,25 in the paper; or costs by name, e.g. group=8,freedom=2.",
)
@click.option(
    "--similarity",
    type=Similarity(),
    help="What counts where a stroke of scope similar finds more materials like the painted one; default 0.25,0.25,2.",
)
@click.option("--choose", type=Choose(), multiple=True, help="Take an alternative of the report.")
@click.option(
    "--mode",
    type=click.Choice(("override", "new", "class")),
    default=None,
    help="override: all that show the material; new: a material for what was painted only; class: all "
    "instances, by their asset's class.  Default: as each stroke's scope says.",
)
@click.option(
    "--next",
    "next_dab",
    is_flag=True,
    help="Also say where one more dab best tells the two leading explanations apart, and what each expects there.",
)
@click.option(
    "--alternatives",
    type=click.IntRange(0, 8),
    default=0,
    metavar="N",
    help="Hold the N next best explanations of each change too, as variants that any USD program flips between.",
)
@lighting_options("Give surfaces without UsdPreviewSurface one, to edit them.")
@gathered("choice", Choice)
@settings
def solve(
    settings: Settings, stage: str, strokes: str, shot: Lighting, files: LookFiles, directions: int, choice: Choice
) -> None:
    """Find the smallest material change that explains the strokes, and write it as a look layer."""
    from usdslf.inference.weights import Options
    from usdslf.similarity import similarity
    from usdslf.strokes.stroke import frame_of
    from usdslf.usd.stroke_layer import read_strokes

    if directions != DIRECTIONS:
        raise click.UsageError(f"--directions {directions} is not possible; the kernels have {DIRECTIONS}")
    weighed = Options.of(choice.weights) if choice.weights is not None else None
    similar = similarity.Weights(*choice.similarity) if choice.similarity is not None else None
    files.check()
    heard: list[str] = []
    painted = read_strokes(strokes, heard)
    shot = replace(shot, frame=frame_of([s for s in painted if s.active], shot.frame, heard))

    def find(session: Session) -> None:
        session.warnings += heard
        for each in painted:
            session.add_stroke(each)
        session.solve(choice.norm, dict(choice.choose), weighed, similar)
        if choice.next_dab:
            click.echo("\n".join(_lines_of_next(session.next_dab())))

    how = {"mode": choice.mode or "", "alternatives": choice.alternatives}
    write_look(settings, stage, shot, files, find, strokes_path=strokes, **how)


def _lines_of_next(dab: NextDab) -> Iterator[str]:
    sure = "decides" if dab.is_decisive else "says most, but may not decide"
    yield f"next dab: --path \"{dab.xy[0]:.3f},{dab.xy[1]:.3f}\" {sure}"
    for name, color in dab.expected.items():
        yield f"  {name} expects --color {','.join(f'{c:.4g}' for c in color)}"
