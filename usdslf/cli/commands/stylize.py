"""usdslf stylize: a look layer that sharpens the whole shot."""

from __future__ import annotations

from typing import TYPE_CHECKING

import click

from usdslf.cli.look_options import LookFiles, look_options, write_look
from usdslf.cli.program import Command, Settings, settings
from usdslf.cli.shot_options import Lighting, lighting_options
from usdslf.strokes.words import NORMS

if TYPE_CHECKING:
    from usdslf.session import Session


@click.command(cls=Command)
@click.argument("stage")
@click.option(
    "--amount",
    type=float,
    default=1.0,
    show_default=True,
    metavar="A",
    help="Contrast to add, as a multiple of what is there; 0 changes nothing.",
)
@click.option(
    "--radius",
    type=float,
    default=0.1,
    show_default=True,
    metavar="R",
    help="How far the surroundings reach that a place is set off from, as a share of the scene's diagonal.",
)
@click.option(
    "--norm",
    type=click.Choice(NORMS),
    default="mixed",
    show_default=True,
    help="How freely diffuse, specular and glossiness of a place change together.",
)
@look_options("what became of each material", "look and shot")
@lighting_options("Give surfaces without UsdPreviewSurface one, to edit them.")
@settings
def stylize(
    settings: Settings, stage: str, shot: Lighting, files: LookFiles, amount: float, radius: float, norm: str
) -> None:
    """Sharpen the look of the whole shot: unsharp masking of its light, as valid materials."""
    from usdslf.stylize.unsharp_mask import check_numbers

    check_numbers(amount, radius)
    files.check()

    def find(session: Session) -> None:
        session.stylize(amount, radius, norm)

    write_look(settings, stage, shot, files, find)
