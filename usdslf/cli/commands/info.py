"""usdslf info: what a stage holds."""

from __future__ import annotations

import click

from usdslf.cli.program import Command, Settings, print_json, settings
from usdslf.cli.shot_options import Reading, reading_options
from usdslf.cli.terminal import progress


@click.command(cls=Command)
@click.argument("stage")
@reading_options
@click.option("--json", "as_json", is_flag=True, help="JSON instead of text.")
@settings
def info(settings: Settings, stage: str, shot: Reading, as_json: bool) -> None:
    """What a stage holds: meshes, materials, lights, cameras, warnings."""
    from usdslf.cli.info import as_text, describe
    from usdslf.usd.review.validate import lines_of_findings, validate

    with progress(settings.quiet) as say:
        opened, scene = shot.read(settings, stage, say)
    findings = validate(opened, settings.ocio, scene)
    found = describe(scene) | {"findings": [vars(f) for f in findings]}
    if as_json:
        print_json(found)
    else:
        click.echo("\n".join([*as_text(found), *lines_of_findings(findings)]))
