"""The environment of entries that take one: --hdri, else a hall with windows that is computed.

    check_environment(hdri) -> None                   before any entry is run
    put_environment(folder, hdri) -> name             into an entry's folder
"""

from __future__ import annotations

import shutil
from pathlib import Path

from usdslf.color import USD_DEFAULT_SPACE, color_of
from usdslf.errors import InputError
from usdslf.procedural.textures import windows
from usdslf.replacing import is_file
from usdslf.textures.images import read_image, write_image


def check_environment(hdri: str) -> None:
    """Raises InputError where --hdri is no picture that can be read."""
    source = Path(hdri)
    if not is_file(source):
        raise InputError(f"--hdri {hdri} is not there; give a latlong picture (.hdr or .exr)")
    read_image(source, "raw", color_of(None, USD_DEFAULT_SPACE))  # whether it can be: its colours are for the shot


def put_environment(folder: Path, hdri: str | None) -> str:
    """Puts the environment's picture into a folder and returns its name there.

    Raises: InputError where --hdri is no picture that can be read.
    """
    if hdri is None:
        write_image(folder / "windows.exr", windows())
        return "windows.exr"
    check_environment(hdri)
    source = Path(hdri)
    if source.resolve() != (folder / source.name).resolve():
        shutil.copyfile(source, folder / source.name)
    return source.name
