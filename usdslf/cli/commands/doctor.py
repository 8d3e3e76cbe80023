"""usdslf doctor: what this installation has."""

from __future__ import annotations

import click

from usdslf.cli.program import Command, Settings, settings


@click.command(cls=Command)
@settings
def doctor(settings: Settings) -> None:
    """Versions, OpenCL devices, OCIO config, Hydra present or not, limits."""
    from usdslf.cli.doctor import diagnose

    for section, name, value in diagnose(settings.device, settings.ocio):
        click.echo(f"{section:<13} {name:<26} {value}")
