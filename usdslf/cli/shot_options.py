"""The options that say how a shot is read and how its light is found: one record for all sub-commands."""

from __future__ import annotations

import math
from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING, Any

import click
from click.core import ParameterSource

import usdslf
from usdslf.cli.program import Settings, gathered
from usdslf.lights.missing_dome import MISSING_DOME, with_missing_domes
from usdslf.surfaces.models import MODEL_NAMES

if TYPE_CHECKING:
    from usdslf.progress import Say
    from usdslf.scene.records import Scene
    from usdslf.session import Session


@dataclass(frozen=True)
class Reading:
    """How a stage is read."""

    frame: float | None  # time code; None: the stage's start
    refine: int  # levels of subdivision
    missing_dome: str  # what shines for a dome whose texture cannot be read

    def read(self, settings: Settings, path: str, say: Say) -> tuple[Any, Scene]:
        """Reads a stage alone, without what light needs: half the time of a start; returns the Usd.Stage too."""
        from usdslf.progress import hearing, step
        from usdslf.usd.read.read import open_stage, read_scene

        with hearing(lambda p: say(p.step, p.share)), step("read"):
            stage = open_stage(path)
            scene = read_scene(stage, self.frame, refine=self.refine, ocio=settings.ocio)
        return stage, with_missing_domes(scene, self.missing_dome)

    def open(self, settings: Settings, stage: Any, say: Say | None) -> Session:
        """Opens a stage, a path or a Usd.Stage."""
        return usdslf.open(stage, device=settings.device, ocio=settings.ocio, say=say, **asdict(self))


@dataclass(frozen=True)
class Lighting(Reading):
    """How a stage is read, and how its light field is made."""

    elements: int
    bounces: int
    make_preview: bool
    model: str
    memory: float | None  # of the light field on the device, at most [GiB]


def given(shot: Reading) -> dict[str, Any]:
    """Returns those of the options that were given on this command line, which are not what they are by default."""
    asked = click.get_current_context().get_parameter_source
    return {name: value for name, value in asdict(shot).items() if asked(name) is not ParameterSource.DEFAULT}


def reading_options(command: Any) -> Any:
    """Adds --frame, --refine and --missing-dome, which arrive as `shot`, a `Reading`."""
    return _frame(_refine(_missing_dome(gathered("shot", Reading)(command))))


def lighting_options(make_preview: str) -> Any:
    """Adds those of `reading_options`, --elements, --bounces, --memory, --make-preview and --model, as a `Lighting`.

    Args:
        make_preview: what --make-preview does for this sub-command, in words.
    """

    def add(command: Any) -> Any:
        command = _frame(_refine(_missing_dome(gathered("shot", Lighting)(command))))
        command = click.option(
            "--model", type=click.Choice(list(MODEL_NAMES)), default=MODEL_NAMES[0], show_default=True,
            help="How surfaces reflect: as UsdPreviewSurface, or the Phong of the paper, to be compared with it.",
        )(command)  # fmt: skip
        command = click.option("--make-preview", is_flag=True, help=make_preview)(command)
        command = click.option(
            "--memory", type=float, metavar="GIB", callback=_finite,
            help="Of the device, for the light field: where it is less than usual, .04 a thousand elements, light is "
            "stored in half floats if that changes it by less than .1 %, then streamed.  Default: as much as it takes.",
        )(command)  # fmt: skip
        command = click.option(
            "--bounces", type=int, default=8, show_default=True, help="Most bounces of light."
        )(command)  # fmt: skip
        return click.option(
            "--elements", type=int, default=10000, show_default=True, help="Surface elements."
        )(command)  # fmt: skip

    return add


def _finite(context: click.Context, option: click.Parameter, value: float | None) -> float | None:
    if value is not None and not math.isfinite(value):
        raise click.BadParameter(f"{value} is no finite number", context, option)
    return value


_frame = click.option(
    "--frame", type=float, metavar="F", callback=_finite, help="Time code; default: the stage's start."
)
_refine = click.option(
    "--refine", type=click.IntRange(0, 4), default=1, help="Levels of subdivision of cages; default 1."
)
_missing_dome = click.option(
    "--missing-dome", type=click.Choice(MISSING_DOME), default=MISSING_DOME[0], show_default=True,
    help="What shines for a dome whose texture cannot be read: its own color, white of radiance 1, or nothing.",
)  # fmt: skip
