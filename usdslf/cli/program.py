"""What every sub-command has: the options of the program, options with several values, and records of parameters."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import dataclass, fields
from functools import wraps
from typing import Any

import click


@dataclass
class Settings:
    """What the options hold that every sub-command has."""

    device: str | None = None
    ocio: str | None = None
    quiet: bool = False
    no_cache: bool = False
    debug: bool = False


settings = click.make_pass_decorator(Settings, ensure=True)
"""Hands a sub-command the `Settings` of this run as its first argument."""


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
        click.Option(["--no-cache"], is_flag=True, expose_value=False, callback=_keep,
                     help="Read and keep nothing between runs (see cache)."),
        click.Option(["--debug"], is_flag=True, expose_value=False, callback=_keep,
                     help="A traceback with an error."),
    ]  # fmt: skip


class Several(click.Option):
    """An option that takes several values at once: `--aov a b` for `--aov a --aov b`."""

    def __init__(self, *args: Any, goes_on: Callable[[str], bool], **kwargs: Any) -> None:
        """Keeps how its values are known.

        Args:
            goes_on: tells whether an argument after the first value is one more; where it is not, it is an argument
                of the sub-command, as the stage's name may follow.
        """
        super().__init__(*args, **{**kwargs, "multiple": True})
        self.goes_on = goes_on


class Command(click.Command):
    """A sub-command that also takes the options of the program, and options with several values."""

    def __init__(self, *args: Any, **kwargs: Any) -> None:
        super().__init__(*args, **kwargs)
        self.params.extend(_everywhere())

    def invoke(self, ctx: click.Context) -> Any:
        """Runs the sub-command, without the cache where that was asked for."""
        if not ctx.find_root().ensure_object(Settings).no_cache:
            return super().invoke(ctx)
        from usdslf.cache import switched

        with switched("off"):
            return super().invoke(ctx)

    def parse_args(self, ctx: click.Context, args: list[str]) -> list[str]:
        """Repeats an option of several values before each of them."""
        several = {name: p for p in self.params if isinstance(p, Several) for name in p.opts}
        spread: list[str] = []
        option, values = "", 0  # the one of several values that is open, and how many it has
        for arg in args:
            if arg.startswith("-"):
                option, values = arg if arg in several else "", 0
            elif option and values and not several[option].goes_on(arg):
                option = ""
            elif option:
                spread += [option] if values else []
                values += 1
            spread.append(arg)
        return super().parse_args(ctx, spread)


class Program(click.Group):
    """The program: its options may stand before or after the sub-command."""

    command_class = Command

    def __init__(self, *args: Any, **kwargs: Any) -> None:
        super().__init__(*args, **kwargs)
        self.params.extend(_everywhere())

    def invoke(self, ctx: click.Context) -> Any:
        """Runs a sub-command; Ctrl-C in it raises Abort: for a KeyboardInterrupt click prints an empty line."""
        try:
            return super().invoke(ctx)
        except KeyboardInterrupt:
            raise click.Abort from None


def gathered(name: str, record: type[Any]) -> Callable[[Callable[..., Any]], Callable[..., Any]]:
    """Hands parameters of a sub-command over as one record.

    Args:
        name: of the argument that takes the record.
        record: a dataclass; each of its fields is a parameter of the same name.
    """
    names = [field.name for field in fields(record)]

    def decorate(function: Callable[..., Any]) -> Callable[..., Any]:
        @wraps(function)
        def call(*args: Any, **given: Any) -> Any:
            made = record(**{n: given.pop(n) for n in names})
            return function(*args, **{name: made}, **given)

        return call

    return decorate


def print_json(values: Any) -> None:
    """Prints JSON-ready values on stdout."""
    click.echo(json.dumps(values, indent=2, allow_nan=False))
