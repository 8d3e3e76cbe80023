"""usdslf bench: what each step costs here."""

from __future__ import annotations

import click

from usdslf.cli.program import Command, Settings, print_json, settings
from usdslf.cli.terminal import progress


@click.command(cls=Command)
@click.option("--json", "as_json", is_flag=True, help="JSON instead of a table.")
@click.option(
    "--elements", type=click.IntRange(1, (1 << 22) - 1), default=10000, show_default=True, help="Surface elements."
)
@click.option("--batch", is_flag=True, help="Throughput and cost of batches instead.")
@click.option("--jobs", type=click.IntRange(1, 10000), default=24, show_default=True, help="Of the longest batch.")
@click.option("--viewer", is_flag=True, help="How long an artist waits in the window instead.")
@settings
def bench(settings: Settings, as_json: bool, elements: int, batch: bool, jobs: int, viewer: bool) -> None:
    """Time of each step beside the measured limits of this machine."""
    if batch:
        _bench_batch(settings, as_json, jobs)
        return
    if viewer:
        _bench_viewer(settings, as_json, elements)
        return
    from usdslf.cli.bench import lines_of_table, measure

    with progress(settings.quiet) as say:
        found = measure(settings.device, settings.ocio, elements, say)
    if as_json:
        print_json(found)
    else:
        click.echo("\n".join(lines_of_table(found)))


def _bench_batch(settings: Settings, as_json: bool, jobs: int) -> None:
    from usdslf.cli.bench_batch import lines_of_batch, measure_batch

    with progress(settings.quiet) as say:
        found = measure_batch(jobs, settings.device, settings.ocio, say)
    if as_json:
        print_json(found)
    else:
        click.echo("\n".join(lines_of_batch(found)))


def _bench_viewer(settings: Settings, as_json: bool, elements: int) -> None:
    from usdslf.cli.bench_viewer import lines_of_viewer, measure_viewer

    found = measure_viewer(elements, settings.device)
    if as_json:
        print_json(found)
    else:
        click.echo("\n".join(lines_of_viewer(found)))
