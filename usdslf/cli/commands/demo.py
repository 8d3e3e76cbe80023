"""usdslf demo: the shipped scenes."""

from __future__ import annotations

import click

from usdslf.cli.program import Command, Settings, settings
from usdslf.cli.terminal import progress


@click.command(cls=Command)
@click.argument("names", nargs=-1, metavar="[NAME ...]")
@click.option("--all", "all_names", is_flag=True, help="Every shipped scene.")
@click.option("-o", "output", default="usdslf-demo", show_default=True, metavar="DIR")
@click.option("--hdri", metavar="FILE", help="Latlong picture for the scenes that are lit by an environment.")
@settings
def demo(settings: Settings, names: tuple[str, ...], all_names: bool, output: str, hdri: str | None) -> None:
    """The paper's figures as shipped scenes with scripted strokes: look layers, reports, pictures, an index."""
    from usdslf.gallery.demo import run_demos

    with progress(settings.quiet) as say:
        for line in run_demos(names, all_names, output, hdri, settings.device, settings.ocio, say):
            click.echo(line)
