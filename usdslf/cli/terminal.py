"""What the command line says beside its result: progress, talk and warnings, all on stderr."""

from __future__ import annotations

import logging
import sys
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING

import click

if TYPE_CHECKING:
    from usdslf.progress import Say
    from usdslf.scene.records import Scene


@contextmanager
def progress(quiet: bool) -> Iterator[Say]:
    """Yields what steps tell their progress to: a bar on a terminal, nothing when piped or quiet."""
    if quiet or not sys.stderr.isatty():
        yield lambda step, share: None
        return
    from rich.console import Console
    from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

    columns = TextColumn("{task.description:>12}"), BarColumn(), TextColumn("{task.percentage:3.0f}%")
    with Progress(*columns, TimeElapsedColumn(), console=Console(stderr=True), transient=True) as bar:
        task = bar.add_task("", total=1.0)
        yield lambda step, share: bar.update(task, description=step, completed=min(share, 1.0))


@contextmanager
def log_as_warnings(is_quiet: Callable[[], bool]) -> Iterator[None]:
    """Says what the package's log has to warn of as warnings, on stderr."""

    class Heard(logging.Handler):
        def emit(self, record: logging.LogRecord) -> None:
            warn([record.getMessage()], is_quiet())

    log, handler = logging.getLogger("usdslf"), Heard(logging.WARNING)
    log.addHandler(handler)
    try:
        yield
    finally:
        log.removeHandler(handler)


def talk(text: str, quiet: bool) -> None:
    """Says a line on stderr."""
    if not quiet:
        click.echo(text, err=True)


def say_missing(scene: Scene) -> None:
    """Says on stderr which textures of a shot cannot be read, also where it is quiet: all else stands on it."""
    for each in scene.missing:
        click.echo("warning: missing " + " ".join(each.sentence.split()), err=True)


def warn(sentences: Iterable[str], quiet: bool) -> None:
    """Says each warning once, a line each, on stderr."""
    for sentence in dict.fromkeys(sentences):
        talk("warning: " + " ".join(sentence.split()), quiet)
