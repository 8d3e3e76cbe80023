"""usdslf merge: the strokes of several artists as one layer, and where they contradict each other."""

from __future__ import annotations

from dataclasses import replace

import click

from usdslf.cli.program import Command, Settings, print_json, settings
from usdslf.cli.shot_options import Lighting, lighting_options
from usdslf.cli.terminal import progress, say_missing, warn


@click.command(cls=Command)
@click.argument("stage")
@click.argument("layers", nargs=-1, required=True, metavar="STROKES STROKES ...")
@click.option("-o", "output", required=True, metavar="STROKES", help="The stroke layer to write.")
@click.option("--json", "as_json", is_flag=True, help="JSON instead of text.")
@lighting_options("Give surfaces without UsdPreviewSurface one, to edit them.")
@settings
@click.pass_context
def merge(
    context: click.Context, settings: Settings, stage: str, layers: tuple[str, ...], output: str, shot: Lighting,
    as_json: bool,
) -> None:  # fmt: skip
    """Put the strokes of several artists together; exit code 1 where they contradict each other."""
    from usdslf.errors import AuthorError
    from usdslf.outputs import check_place
    from usdslf.progress import hearing
    from usdslf.review.merge import merge_strokes, write_merged
    from usdslf.strokes.stroke import frame_of
    from usdslf.usd.stroke_layer import read_strokes

    check_place(output, AuthorError)
    if len(layers) < 2:
        raise click.UsageError("one stroke layer is nothing to merge; name two or more")
    heard: list[str] = []
    painted = [s for layer in layers for s in read_strokes(layer, heard) if s.active]
    shot = replace(shot, frame=frame_of(painted, shot.frame, heard))
    with progress(settings.quiet) as say, hearing(lambda p: say(p.step, p.share)):
        opened = shot.open(settings, stage, say).shot
        say_missing(opened.scene)
        merged = merge_strokes(opened, layers)
        write_merged(output, merged, opened)
    warn([*heard, *merged.warnings], settings.quiet)
    if as_json:
        print_json(merged.as_values())
    else:
        lines = [f"{layer} is {name}" for layer, name in merged.renamed.items()]
        for c in merged.conflicts:
            lines += [f"conflict on {c.material}: {c.why}", *(f"  {s.in_words()}" for s in c.said)]
        click.echo("\n".join([*lines, f"{len(merged.strokes)} strokes, {len(merged.conflicts)} conflicts", output]))
    if merged.conflicts:
        context.exit(1)
