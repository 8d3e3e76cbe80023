"""usdslf bench: what each step costs here."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import click

from usdslf.cli.program import Command, Settings, gathered, print_json, settings
from usdslf.cli.terminal import progress

AXES = ("elements", "triangles", "lights", "strokes", "instances", "textures")


@dataclass(frozen=True)
class Growing:
    """What is asked of the bench of growth."""

    growth: str | None  # one of AXES, or all; None: another bench
    most: int | None  # largest size
    output: Path | None  # folder of the results


@click.command(cls=Command)
@click.option("--json", "as_json", is_flag=True, help="JSON instead of a table.")
@click.option(
    "--elements", type=click.IntRange(1, (1 << 22) - 1), default=10000, show_default=True, help="Surface elements."
)
@click.option("--stage", metavar="STAGE", help="A stage in place of the demo; strokes go on what its camera sees.")
@click.option("--batch", is_flag=True, help="Throughput and cost of batches instead.")
@click.option("--jobs", type=click.IntRange(1, 10000), default=24, show_default=True, help="Of the longest batch.")
@click.option("--viewer", is_flag=True, help="How long an artist waits in the window instead.")
@click.option(
    "--growth", is_flag=False, flag_value="all", type=click.Choice(["all", *AXES]), metavar="[AXIS]",
    help=f"Time and memory of growing shots instead: {', '.join(AXES)}, or all of them.",
)
@click.option("--most", type=click.IntRange(min=1), metavar="N", help="With --growth: sizes up to this one.")
@click.option(
    "-o", "--output", type=click.Path(file_okay=False, path_type=Path), metavar="DIR",
    help="With --growth: the folder of growth.json and growth.png; what it holds of other axes stays.",
)
@gathered("growing", Growing)
@settings
def bench(
    settings: Settings, as_json: bool, elements: int, stage: str | None, batch: bool, jobs: int, viewer: bool,
    growing: Growing,
) -> None:  # fmt: skip
    """Time of each step beside the measured limits of this machine."""
    if growing.growth:
        _bench_growth(settings, as_json, growing)
        return
    if batch:
        _bench_batch(settings, as_json, jobs)
        return
    if viewer:
        _bench_viewer(settings, as_json, elements)
        return
    from usdslf.cli.bench import lines_of_table, measure

    with progress(settings.quiet) as say:
        found = measure(settings.device, settings.ocio, elements, say, stage)
    if as_json:
        print_json(found)
    else:
        click.echo("\n".join(lines_of_table(found)))


def _bench_growth(settings: Settings, as_json: bool, asked: Growing) -> None:
    if asked.output is None:
        raise click.UsageError("--growth needs a folder for its results: -o DIR")
    from usdslf.cli.bench_growth import lines_of_growth, measure_growth
    from usdslf.cli.growth_plot import plot_growth, require_plots

    require_plots()
    with progress(settings.quiet) as say:
        axes = AXES if asked.growth == "all" else (str(asked.growth),)
        found = measure_growth(axes, asked.most, asked.output, settings.device, say)
    if as_json:
        print_json(found)
    else:
        click.echo("\n".join(lines_of_growth(found)))
    plot_growth(found, asked.output)


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
