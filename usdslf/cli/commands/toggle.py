"""usdslf toggle: edits of a look are kept and silent, or brought back."""

from __future__ import annotations

import click

from usdslf.cli.program import Command, Settings, Several, print_json, settings


@click.command(cls=Command)
@click.argument("look")
@click.option("--off", cls=Several, goes_on=lambda arg: True, metavar="NAME ...", help="Silence what is for these.")
@click.option("--on", cls=Several, goes_on=lambda arg: True, metavar="NAME ...", help="Bring back what is for these.")
@click.option("--json", "as_json", is_flag=True, help="JSON instead of text.")
@settings
def toggle(settings: Settings, look: str, off: tuple[str, ...], on: tuple[str, ...], as_json: bool) -> None:
    """Silence edits of a look, or bring them back; a NAME is an input, a material, a prim, or a stroke."""
    from usdslf.usd.review.toggle import toggle as switch

    if not off and not on:
        raise click.UsageError("nothing is named; give --off NAME or --on NAME")
    done = [switch(look, names, is_on) for names, is_on in ((off, False), (on, True)) if names]
    if as_json:
        print_json([d.as_values() for d in done])
        return
    for d in done:
        for path in d.changed:
            click.echo(f"{'on' if d.on else 'off'}: {path}")
    click.echo(f"{len(done[-1].silent)} opinions of {look} are off")
