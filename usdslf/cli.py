"""The command line: one sub-command a step, each a few lines on Session.

The result goes to stdout and the talk to stderr.  Exit codes are those of usdslf/errors.py; an error is one
line, and a traceback only with --debug.
"""

from __future__ import annotations

import sys
import traceback
from dataclasses import dataclass
from typing import Any

import click

import usdslf
from usdslf.errors import InputError, UsdslfError


@dataclass
class Settings:
    """What the options hold that every sub-command has."""

    device: str | None = None
    ocio: str | None = None
    quiet: bool = False
    debug: bool = False


def _keep(context: click.Context, option: click.Parameter, value: Any) -> None:
    # Given twice, the later one (after the sub-command) wins; not given, the earlier one stays.
    if value not in (None, False):
        setattr(context.find_root().ensure_object(Settings), str(option.name), value)


def _everywhere() -> list[click.Option]:
    return [
        click.Option(["--device"], metavar="NAME", expose_value=False, callback=_keep,
                     help="OpenCL device: its number or part of its name (see doctor)."),
        click.Option(["--ocio"], metavar="CONFIG", expose_value=False, callback=_keep,
                     help="OpenColorIO config; default $OCIO, else ocio://default."),
        click.Option(["--quiet"], is_flag=True, expose_value=False, callback=_keep,
                     help="No progress and no talk on stderr but errors."),
        click.Option(["--debug"], is_flag=True, expose_value=False, callback=_keep,
                     help="A traceback with an error."),
    ]  # fmt: skip


class Command(click.Command):
    """A sub-command that also takes the options of the program."""

    def __init__(self, *args: Any, **kwargs: Any) -> None:
        super().__init__(*args, **kwargs)
        self.params.extend(_everywhere())


class Program(click.Group):
    """The program: its options may stand before or after the sub-command."""

    command_class = Command

    def __init__(self, *args: Any, **kwargs: Any) -> None:
        super().__init__(*args, **kwargs)
        self.params.extend(_everywhere())


settings = click.make_pass_decorator(Settings, ensure=True)


@click.group(cls=Program, context_settings={"help_option_names": ["-h", "--help"]})
@click.version_option(usdslf.__version__, prog_name="usdslf")
def program() -> None:
    """Paint how a surface should look; get the material change that explains it, as a USD layer."""


@program.command()
@settings
def doctor(options: Settings) -> None:
    """Versions, OpenCL devices, OCIO config, Hydra present or not, limits."""
    from usdslf.doctor import diagnose

    for section, name, value in diagnose(options.device, options.ocio):
        click.echo(f"{section:<13} {name:<26} {value}")


def main(arguments: list[str] | None = None) -> int:
    """Runs the program and returns its exit code."""
    options = Settings()
    try:
        code = program.main(args=arguments, prog_name="usdslf", standalone_mode=False, obj=options)
        return code if isinstance(code, int) else 0
    except click.exceptions.Abort:
        return _say("interrupted", 130)
    except click.ClickException as error:
        return _say(_usage_message(error), InputError.exit_code)
    except KeyboardInterrupt:
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
