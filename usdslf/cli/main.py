"""The command line: its sub-commands, and the exit code that a run ends with.

The result goes to stdout and the talk to stderr.  Exit codes are those of usdslf/errors.py; an error is one
line, and a traceback only with --debug.
"""

from __future__ import annotations

import os
import signal
import sys
import threading
import traceback

import click

import usdslf
from usdslf.cli.commands.accept import accept
from usdslf.cli.commands.batch import batch
from usdslf.cli.commands.bench import bench
from usdslf.cli.commands.cache import cache
from usdslf.cli.commands.demo import demo
from usdslf.cli.commands.diff import diff
from usdslf.cli.commands.doctor import doctor
from usdslf.cli.commands.info import info
from usdslf.cli.commands.merge import merge
from usdslf.cli.commands.render import render
from usdslf.cli.commands.review import review
from usdslf.cli.commands.solve import solve
from usdslf.cli.commands.stroke import stroke
from usdslf.cli.commands.stylize import stylize
from usdslf.cli.commands.toggle import toggle
from usdslf.cli.commands.view import view
from usdslf.cli.program import Program, Settings
from usdslf.cli.terminal import log_as_warnings
from usdslf.errors import InputError, UsdslfError
from usdslf.progress import forget_interrupt, interrupt
from usdslf.threads import BLAS_THREADS


@click.group(cls=Program, context_settings={"help_option_names": ["-h", "--help"]})
@click.version_option(usdslf.__version__, prog_name="usdslf")
def program() -> None:
    """Paint how a surface should look; get the material change that explains it, as a USD layer."""


COMMANDS = (
    *(info, review, accept, toggle, diff, merge, render, stroke, solve, stylize),
    *(batch, view, demo, bench, doctor, cache),
)
for command in COMMANDS:
    program.add_command(command)


def main(arguments: list[str] | None = None) -> int:
    """Runs the program and returns its exit code."""
    options = Settings()
    if "numpy" not in sys.modules and not any(name in os.environ for name in BLAS_THREADS):  # it reads them once
        os.environ[BLAS_THREADS[0]] = "1"  # others would wait by turning, on the device's processors
    forget_interrupt()
    on_main = threading.current_thread() is threading.main_thread()
    before = signal.signal(signal.SIGINT, interrupt) if on_main else None
    try:
        return _run(arguments, options)
    finally:
        if on_main:
            signal.signal(signal.SIGINT, before or signal.SIG_DFL)


def _run(arguments: list[str] | None, options: Settings) -> int:
    try:
        with log_as_warnings(lambda: options.quiet):
            code = program.main(args=arguments, prog_name="usdslf", standalone_mode=False, obj=options)
        return code if isinstance(code, int) else 0
    except click.ClickException as error:
        return _say(_usage_message(error), InputError.exit_code)
    except (KeyboardInterrupt, click.exceptions.Abort):
        signal.signal(signal.SIGINT, signal.SIG_IGN)  # what is cleaned up now is not disturbed
        if sys.stderr.isatty():
            click.echo(err=True)  # behind the terminal's ^C
        return _say("interrupted", 130)
    except Exception as error:
        if options.debug:
            traceback.print_exc()
        if isinstance(error, UsdslfError):
            return _say(str(error), error.exit_code)
        if isinstance(error, MemoryError):
            return _say("not enough memory; lower --elements or the picture's --size", 4)
        return _say(f"internal error: {type(error).__name__}: {error} (--debug shows where)", 1)


def _usage_message(error: click.ClickException) -> str:
    context = getattr(error, "ctx", None)
    where = f"; see {context.command_path} --help" if context is not None else ""
    return error.format_message().rstrip(".") + where


def _say(message: str, code: int) -> int:
    click.echo("usdslf: " + " ".join(message.split()), err=True)
    return code


if __name__ == "__main__":
    sys.exit(main())
