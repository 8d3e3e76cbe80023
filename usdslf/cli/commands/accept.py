"""usdslf accept: what is accepted of a look, as a look of its own."""

from __future__ import annotations

from dataclasses import dataclass, replace

import click

from usdslf.cli.parameters import Choose
from usdslf.cli.program import Command, Settings, Several, gathered, print_json, settings
from usdslf.cli.shot_options import Lighting, given, lighting_options
from usdslf.cli.terminal import progress, warn


@dataclass(frozen=True)
class Choice:
    """What is accepted."""

    only: tuple[str, ...]
    but: tuple[str, ...]
    verdict: str | None
    choose: tuple[tuple[str, str], ...]


@click.command(cls=Command)
@click.argument("stage")
@click.argument("look")
@click.option("-o", "output", required=True, metavar="ACCEPTED", help="The look to write; LOOK stays as it is.")
@click.option("--only", cls=Several, goes_on=lambda arg: True, metavar="NAME ...", help="Accept these alone.")
@click.option("--except", "but", cls=Several, goes_on=lambda arg: True, metavar="NAME ...", help="All but these.")
@click.option("--verdict", metavar="FILE", help="As the page of review saved it.")
@click.option("--choose", type=Choose(), multiple=True, help="Leave one of the alternatives that the look holds.")
@click.option("--json", "as_json", is_flag=True, help="JSON instead of text.")
@lighting_options("Where strokes are solved again: give surfaces without UsdPreviewSurface one.")
@gathered("choice", Choice)
@settings
def accept(
    settings: Settings, stage: str, look: str, output: str, choice: Choice, shot: Lighting, as_json: bool
) -> None:
    """Write what is accepted of a look; a NAME is a stroke, a material, one of its inputs, or a gprim.

    Of several strokes that were answered together the others are solved again without those that are not accepted, with
    the options that the look was solved with, but for those that are given here.
    """
    from usdslf.progress import hearing
    from usdslf.review.accepting import accept as accept_some
    from usdslf.review.verdict import read_verdict
    from usdslf.usd.review.accept import Wish

    wish = Wish(choice.only, choice.but, choose=dict(choice.choose))
    if choice.verdict:
        said = read_verdict(choice.verdict, look).wish()
        wish = replace(wish, said=said.said, by=said.by, verdict=said.verdict)
    options = {"device": settings.device, "ocio": settings.ocio, **given(shot)}
    with progress(settings.quiet) as say, hearing(lambda p: say(p.step, p.share)):
        done = accept_some(stage, look, output, wish, options)
    warn(done.warnings, settings.quiet)
    if as_json:
        print_json(done.as_values())
        return
    for name, targets in (("accepted", done.kept), ("left out", done.left_out)):
        for target in targets:
            click.echo(f"{name}: {target}")
    click.echo(done.path)
