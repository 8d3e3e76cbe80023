"""usdslf batch: many shots in one run."""

from __future__ import annotations

import signal
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import click

from usdslf.cli.program import Command, Settings, gathered, settings
from usdslf.cli.terminal import talk

if TYPE_CHECKING:
    from usdslf.batch.job import Event
    from usdslf.batch.planning import Plan
    from usdslf.batch.run import Engine
    from usdslf.batch.summary import Summary


@dataclass(frozen=True)
class Way:
    """How the jobs are run."""

    prefer_robust: bool
    dry_run: bool
    job: str | None  # this one alone
    collect: bool  # the summary alone
    scheduler: str | None  # address of a Dask scheduler
    ship: bool  # files go to the workers and come back
    openjd: str | None  # a template is written, and nothing is run


@click.command(cls=Command)
@click.argument("manifest")
@click.option("-o", "output", metavar="FOLDER", help="Of all results; default: `output` of the manifest.")
@click.option("--workers", type=click.IntRange(1, 1024), help="Jobs at a time; default: `limits.workers`.")
@click.option("--prefer-robust", is_flag=True, help="At a near tie take what holds in the lights of `elsewhere` too.")
@click.option("--dry-run", is_flag=True, help="Say what would be run, and why; run nothing.")
@click.option("--job", metavar="NAME", help="Run one job, as a task of a farm; what fails is kept for --collect.")
@click.option("--collect", is_flag=True, help="Write the summary of what was run; fails where a result is missing.")
@click.option("--scheduler", metavar="ADDRESS", help="Run on a Dask distributed cluster, e.g. tcp://farm:8786.")
@click.option("--ship", is_flag=True, help="With --scheduler: send files, where workers do not share the disk.")
@click.option("--openjd", metavar="OUT.yaml", help="Write an Open Job Description template; run nothing.")
@gathered("way", Way)
@settings
@click.pass_context
def batch(
    context: click.Context, settings: Settings, manifest: str, output: str | None, workers: int | None, way: Way
) -> None:
    """Solve many shots, as a TOML manifest says, each in a process of its own; exit code 1 where one failed.

    Finished jobs are known by the contents of all that they read: the same command goes on where it was stopped.
    """
    from usdslf.batch.planning import plan

    if way.ship and not way.scheduler:
        raise click.UsageError("--ship sends files to the workers of a --scheduler; name one")
    found = plan(manifest, output, workers or 0, way.prefer_robust)
    if way.dry_run:
        click.echo("\n".join(_lines_of_plan(found)))
        return
    if way.openjd:
        from usdslf.batch.openjd import write_template

        click.echo(write_template(found, way.openjd))
        return
    if way.job:
        _run_one(found, way.job, settings)
        return
    summary = _collected(found) if way.collect else _run(found, way, settings)
    click.echo("\n".join(_lines(summary)))
    if summary.failed or (way.collect and summary.count("new")):
        context.exit(1)


def _run_one(found: Plan, name: str, settings: Settings) -> None:
    """Runs one job.  A failure is kept and said; it is no failure of the task, so that others go on."""
    from usdslf.batch.run import run_one

    with _stoppable():
        result = run_one(found, name)
    for line in result.lines if result.is_done else [f"failed: {result.why}"]:
        click.echo(line)


def _collected(found: Plan) -> Summary:
    from usdslf.batch.collecting import collect

    return collect(found)


def _run(found: Plan, way: Way, settings: Settings) -> Summary:
    from usdslf.batch.run import run_batch

    try:
        with _stoppable(), _told(found, settings.quiet) as hear:
            return run_batch(found, _engine(way), hear)
    except KeyboardInterrupt:
        from usdslf.batch.planning import plan

        left = len(plan(found.manifest, found.output, prefer_robust=way.prefer_robust).to_run)
        done = len(found.jobs) - left
        said = f"stopped: {done} of {len(found.jobs)} jobs are done; the same command goes on with the rest"
        click.echo(said, err=True)
        raise


def _engine(way: Way) -> Engine | None:
    if not way.scheduler:
        return None
    from usdslf.batch.cluster import on_cluster

    return on_cluster(way.scheduler, way.ship)


@contextmanager
def _stoppable() -> Iterator[None]:
    """Makes SIGTERM end the block as Ctrl-C does."""

    def stop(*_: object) -> None:
        raise KeyboardInterrupt

    if threading.current_thread() is not threading.main_thread():
        yield
        return
    before = signal.signal(signal.SIGTERM, stop)
    try:
        yield
    finally:
        signal.signal(signal.SIGTERM, before)


@contextmanager
def _told(found: Plan, quiet: bool) -> Iterator[Any]:
    """Yields what jobs tell their progress to: bars on a terminal, else a line a job on stderr."""
    total = len(found.to_run)
    talk(f"{len(found.jobs)} jobs, {total} to run, {found.workers} at a time", quiet)
    ended = 0

    def line(event: Event) -> None:
        nonlocal ended
        if event.state in ("done", "failed"):
            ended += 1
            talk(f"{ended}/{total} {event.state} {event.job}" + (f": {event.why}" if event.why else ""), quiet)

    if quiet or not sys.stderr.isatty():
        yield line
        return
    from rich.console import Console
    from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

    columns = TextColumn("{task.description:>24}"), BarColumn(), TextColumn("{task.fields[step]:>12}")
    with Progress(*columns, TimeElapsedColumn(), console=Console(stderr=True), transient=True) as bars:
        whole, tasks = bars.add_task("all jobs", total=total, step=""), dict[str, Any]()

        def hear(event: Event) -> None:
            if event.state == "started":
                tasks[event.job] = bars.add_task(event.job[-24:], total=1.0, step="")
            elif event.state == "running" and event.job in tasks:
                bars.update(tasks[event.job], completed=event.share, step=event.step)
            elif event.state in ("done", "failed"):
                if event.job in tasks:
                    bars.remove_task(tasks.pop(event.job))
                line(event)
                bars.update(whole, completed=ended, step=f"{ended}/{total}")

        yield hear


def _lines_of_plan(found: Plan) -> Iterator[str]:
    for job in found.jobs:
        why = found.why[job.name]
        yield f"{job.name}: {f'to run ({why})' if why else 'done'}"
    memory = f", {found.limits.memory / 2**30:.2g} GiB" if found.limits.memory else ""
    yield (
        f"{len(found.jobs)} jobs, {len(found.to_run)} to run, {found.workers} at a time, each with "
        f"{found.limits.threads} threads, {found.limits.seconds:g} s{memory}, into {found.output}"
    )


def _lines(summary: Summary) -> Iterator[str]:
    for row in summary.rows:
        if row.state == "failed":
            yield f"{row.job}: failed: {row.why}"
        else:
            found = f", findings: {len(row.findings)}" if row.findings else ""
            yield f"{row.job}: {row.state}{found}"
            for e in row.elsewhere:
                shown = ", ".join(f"{k} shows {100 * v:.0f} % of what is wanted" for k, v in e["shares"].items())
                yield f"  in {e['place']}: {e['why_not'] or shown}"
            for key in ("why", "answers"):
                yield from (f"  {sentence}" for sentence in (row.changed or {}).get(key, ()))
    words = (("done", "done"), ("failed", "failed"), ("new", "not run"))
    yield f"{', '.join(f'{summary.count(s)} {w}' for s, w in words)}: {summary.output}/index.html"
