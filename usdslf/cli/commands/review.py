"""usdslf review: what a look layer changes, and what is wrong with it."""

from __future__ import annotations

import click

from usdslf.cli.program import Command, Settings, print_json, settings


@click.command(cls=Command)
@click.argument("stage")
@click.argument("look")
@click.option("--json", "as_json", is_flag=True, help="JSON instead of text.")
@settings
@click.pass_context
def review(context: click.Context, settings: Settings, stage: str, look: str, as_json: bool) -> None:
    """What a look layer changes in a shot, and what is wrong with it; exit code 1 where something is."""
    from usdslf.usd.review.review import lines_of_review, review_look

    found = review_look(stage, look, settings.ocio)
    if as_json:
        print_json(found)
    else:
        click.echo("\n".join(lines_of_review(found)))
    if found["findings"]:
        context.exit(1)
