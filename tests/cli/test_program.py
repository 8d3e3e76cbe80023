"""Options that take several values: where the values end and the arguments of the sub-command go on."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import click
import pytest

from usdslf.cli.program import Command, Settings, Several, gathered, settings

Run = Callable[..., tuple[int, str, str]]


@dataclass(frozen=True)
class Asked:
    layers: tuple[str, ...]
    size: int


@click.command(cls=Command)
@click.argument("stage")
@click.option("--layer", "layers", cls=Several, goes_on={"albedo", "depth"}.__contains__)
@click.option("--size", type=int, default=3)
@gathered("asked", Asked)
@settings
def show(settings: Settings, stage: str, asked: Asked) -> None:
    click.echo(f"{stage} {' '.join(asked.layers)} {asked.size} {settings.device}")


@pytest.mark.parametrize(
    ("arguments", "heard"),
    [
        ("shot --layer albedo depth", "shot albedo depth 3 None"),
        ("--layer albedo depth shot", "shot albedo depth 3 None"),
        ("--layer albedo shot", "shot albedo 3 None"),
        ("--layer albedo --layer depth shot --size 5", "shot albedo depth 5 None"),
        ("--layer beauty shot", "shot beauty 3 None"),  # the first value is one whatever it is
        ("--layer albedo depth --device gpu shot", "shot albedo depth 3 gpu"),
        ("shot", "shot  3 None"),
    ],
)
def test_an_option_has_the_values_that_it_knows(arguments: str, heard: str, capsys: pytest.CaptureFixture[str]) -> None:
    show.main(arguments.split(), standalone_mode=False, obj=Settings())
    assert capsys.readouterr().out.strip() == heard


def test_an_option_without_its_value_is_a_usage_error() -> None:
    with pytest.raises(click.UsageError, match="layer"):
        show.main(["shot", "--layer"], standalone_mode=False, obj=Settings())


@pytest.mark.parametrize("stage", ["shot", "missing.usda"])
def test_a_stage_after_layers_is_a_stage(stage: str, tmp_path: Path, run: Run) -> None:
    code, out, err = run("render", "-o", tmp_path / "a.exr", "--aov", "albedo", "depth", stage)
    assert (code, out) == (2, "")
    assert stage in err and "AOV" not in err and "argument" not in err


def test_the_list_of_commands_waits_for_no_arrays() -> None:
    code = "import sys, usdslf.cli.main; print({'numpy', 'pxr', 'pyopencl', 'scipy'} & sys.modules.keys())"
    run = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert run.stdout.strip() == "set()"


@pytest.mark.parametrize("asked", [None, "OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS"])
def test_linear_algebra_leaves_the_processors_to_the_device(asked: str | None) -> None:
    """Its threads wait by turning; where somebody asks for more they are there."""
    names = ("OPENBLAS_NUM_THREADS", "GOTO_NUM_THREADS", "OMP_NUM_THREADS")
    code = f"import os, usdslf.cli.main as m; m.main(['--version']); print([os.environ.get(n) for n in {names}])"
    environment = {k: v for k, v in os.environ.items() if k not in names}
    environment |= {asked: "3"} if asked else {}
    run = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True, env=environment)
    wanted = {asked: "3"} if asked else {names[0]: "1"}
    assert run.stdout.splitlines()[-1] == str([wanted.get(name) for name in names])
