"""usdslf view: the desktop application."""

from __future__ import annotations

import subprocess
import sys
from dataclasses import asdict

import click

from usdslf.cli.program import Command, Settings, settings
from usdslf.cli.shot_options import Lighting, lighting_options
from usdslf.viewing import require_viewer


@click.command(cls=Command)
@click.argument("stage", default="")
@click.argument("strokes", default="")
@click.argument("look", default="")
@lighting_options("Give surfaces without UsdPreviewSurface one, to edit them.")
@settings
def view(settings: Settings, stage: str, strokes: str, look: str, shot: Lighting) -> int:
    """Open a window on the shot: paint, see what was understood, save.

    STROKES and LOOK are where both are kept, new files or such that are there.
    """
    require_viewer()
    asked = {**asdict(shot), "device": settings.device, "ocio": settings.ocio}
    options: list[str] = []
    for name, value in asked.items():
        if value is not None and value is not False:
            options.append(f"--{name.replace('_', '-')}" + ("" if value is True else f"={value}"))
    # A process of its own: it chooses its USD library before anything of this one is loaded.
    return subprocess.run([sys.executable, "-m", "hydra_viewer", *options, "--", stage, strokes, look]).returncode
