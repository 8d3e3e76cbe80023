"""Windows for tests: a display without a screen, and whether Hydra can be had."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path

SCREEN = "3400x2200x24"  # a window of 1600 x 1000 at two pixels a point
NO_DISPLAY = "no display: install xvfb, or run the tests where there is a screen"
ROOT = Path(__file__).resolve().parents[2]


@contextmanager
def display() -> Iterator[dict[str, str] | None]:
    """Yields the environment of processes that show windows, on a virtual display where Xvfb is installed.

    None: there is neither Xvfb nor a screen.
    """
    environment = dict(os.environ, PYTHONPATH=os.pathsep.join([str(ROOT), str(ROOT / "tests")]))
    if shutil.which("Xvfb") is None:
        yield environment if os.environ.get("DISPLAY") or sys.platform != "linux" else None
        return
    read, write = os.pipe()
    command = ["Xvfb", "-displayfd", str(write), "-screen", "0", SCREEN, "-nolisten", "tcp"]
    server = subprocess.Popen(command, pass_fds=[write], stderr=subprocess.DEVNULL)
    os.close(write)
    try:
        with os.fdopen(read) as told:
            number = told.readline().strip()
        assert number, "Xvfb did not start"
        yield environment | {"DISPLAY": f":{number}", "QT_QPA_PLATFORM": "xcb"}
    finally:
        server.terminate()
        server.wait()


def why_no_qt() -> str:
    """Returns why Qt cannot be loaded here, "" where it can."""
    try:
        for name in ("QtWidgets", "QtOpenGLWidgets"):
            import_module(f"PySide6.{name}")
    except ImportError as error:
        return " ".join(str(error).split())
    return ""


def has_hydra() -> bool:
    """Whether a pxr with UsdImagingGL is installed, by itself or in bpy."""
    pxr = find_spec("pxr")
    folders = [Path(p) for p in (pxr.submodule_search_locations or ())] if pxr else []
    return any((f / "UsdImagingGL").is_dir() for f in folders) or find_spec("bpy") is not None
