"""usdslf review: what a look layer changes, and what is wrong with it; as a page with pictures."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from usdslf.cli.page_options import Pages, page_options
from usdslf.cli.program import Command, Settings, print_json, settings
from usdslf.cli.shot_options import Lighting, lighting_options
from usdslf.cli.terminal import progress, talk, warn

if TYPE_CHECKING:
    from usdslf.review.review import Review


@click.command(cls=Command)
@click.argument("stage")
@click.argument("look")
@page_options
@click.option("--json", "as_json", is_flag=True, help="JSON instead of text (schemas/review.schema.json).")
@lighting_options("Surfaces without UsdPreviewSurface get one in the pictures, to be seen.")
@settings
@click.pass_context
def review(
    context: click.Context, settings: Settings, stage: str, look: str, pages: Pages, shot: Lighting, as_json: bool
) -> None:
    """What a look layer changes in a shot, and what is wrong with it; exit code 1 where something is."""
    from usdslf.usd.review.review import lines_of_review, review_look

    if pages.is_asked:
        found, values = _with_pictures(settings, stage, look, pages, shot)
    else:
        found = review_look(stage, look, settings.ocio)
        values = found.as_values()
    if as_json:
        print_json(values)
    else:
        click.echo("\n".join(lines_of_review(found)))
    if found.findings:
        context.exit(1)


def _with_pictures(settings: Settings, stage: str, look: str, pages: Pages, shot: Lighting) -> Any:
    """Reviews with pictures and writes them; returns the review without, and all of it as JSON holds it."""
    from usdslf.outputs import check_place
    from usdslf.progress import hearing
    from usdslf.review.review import review as review_of

    if pages.output:
        check_place(pages.output)
    with progress(settings.quiet) as say, hearing(lambda p: say(p.step, p.share)):
        found = review_of(stage, look, pages.settings(settings, shot))
        written = write_pages(pages, found)
    warn(found.warnings, settings.quiet)
    for file in written:
        talk(file, settings.quiet)
    return found.look, found.as_values()


def write_pages(pages: Pages, found: Review, than: str = "") -> list[str]:
    """Writes the page and the pictures that were asked for; returns their files.

    Args:
        than: look that the review compares with.
    """
    from usdslf.replacing import replacing
    from usdslf.review.page import page_of, write_pictures

    written = []
    if pages.output:
        with replacing(pages.output) as temporary:
            temporary.write_text(page_of(found, than), encoding="utf-8")
        written.append(pages.output)
    return [*written, *map(str, write_pictures(Path(pages.pictures), found) if pages.pictures else [])]
