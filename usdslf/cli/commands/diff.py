"""usdslf diff: what two looks over one shot say otherwise, and how it looks."""

from __future__ import annotations

import click

from usdslf.cli.commands.review import write_pages
from usdslf.cli.page_options import Pages, page_options
from usdslf.cli.program import Command, Settings, print_json, settings
from usdslf.cli.shot_options import Lighting, lighting_options
from usdslf.cli.terminal import progress, talk, warn


@click.command(cls=Command)
@click.argument("stage")
@click.argument("look_a")
@click.argument("look_b")
@page_options
@click.option("--json", "as_json", is_flag=True, help="JSON instead of text (schemas/diff.schema.json).")
@lighting_options("Surfaces without UsdPreviewSurface get one in the pictures, to be seen.")
@settings
def diff(
    settings: Settings, stage: str, look_a: str, look_b: str, pages: Pages, shot: Lighting, as_json: bool
) -> None:
    """What two look layers of a shot say otherwise; with a page, how that looks."""
    from usdslf.outputs import check_place
    from usdslf.progress import hearing
    from usdslf.review.diff import compare, diff_looks

    if not pages.is_asked:
        found = diff_looks(stage, look_a, look_b, settings.ocio)
    else:
        if pages.output:
            check_place(pages.output)
        with progress(settings.quiet) as say, hearing(lambda p: say(p.step, p.share)):
            found, review = compare(stage, look_a, look_b, pages.settings(settings, shot))
            written = write_pages(pages, review, look_a)
        warn(review.warnings, settings.quiet)
        for file in written:
            talk(file, settings.quiet)
    if as_json:
        print_json(found.as_values())
    else:
        click.echo("\n".join(found.lines()))
