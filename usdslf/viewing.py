"""Viewing: the desktop application from here, which knows nothing of it but its name.

    require_viewer() -> None                          InputError where what it needs is not installed
    view_shot(shot, strokes) -> strokes, Solution     shows a shot until the window is closed
"""

from __future__ import annotations

from collections.abc import Sequence
from importlib import import_module
from importlib.util import find_spec
from typing import Any

from usdslf.errors import InputError
from usdslf.shot import Shot
from usdslf.strokes.stroke import Stroke


def require_viewer() -> None:
    """Raises InputError where Qt is not installed."""
    if find_spec("PySide6") is None:
        raise InputError("the viewer needs PySide6; install it with: pip install 'usdslf[viewer]'")


def view_shot(shot: Shot, strokes: Sequence[Stroke]) -> Any:
    """Shows a shot with strokes, and waits until the window is closed.

    Returns: the strokes that are on it then, and the Solution that was found of them.

    Raises: InputError where Qt is not installed.
    """
    require_viewer()
    return import_module("hydra_viewer.ui.application").view_shot(shot, strokes)
