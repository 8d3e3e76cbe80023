"""Viewing: the desktop application from here, which knows nothing of it but its name.

    require_viewer() -> None                          InputError where no window can be shown
    view_shot(shot, strokes) -> strokes, Solution     shows a shot until the window is closed
"""

from __future__ import annotations

import os
import sys
from collections.abc import Sequence
from importlib import import_module
from importlib.util import find_spec
from typing import TYPE_CHECKING, Any

from usdslf.errors import InputError

if TYPE_CHECKING:  # it is asked before a USD library is chosen
    from usdslf.shot import Shot
    from usdslf.strokes.stroke import Stroke

QT_NEEDS = "on Debian libegl1 libgl1 libdbus-1-3 libxkbcommon-x11-0 libxcb-cursor0 libxcb-icccm4 libxcb-keysyms1"
DISPLAYS = ("DISPLAY", "WAYLAND_DISPLAY", "QT_QPA_PLATFORM")  # one is set where Qt can show a window on Linux

def require_viewer(is_seen: bool = True) -> None:
    """Tells whether a window can be shown here.

    Args:
        is_seen: somebody is to see it; False: Qt alone is needed.

    Raises: InputError without Qt, without a library that Qt needs, or without a display.
    """
    if find_spec("PySide6") is None:
        raise InputError("the viewer needs PySide6; install it with: pip install 'usdslf[viewer]'")
    try:
        import_module("PySide6.QtWidgets")
    except ImportError as error:
        say = " ".join(str(error).split())
        raise InputError(f"the viewer cannot load Qt ({say}); install what it needs: {QT_NEEDS}") from error
    if is_seen and sys.platform == "linux" and not any(map(os.environ.get, DISPLAYS)):
        raise InputError("there is no display to open a window on: DISPLAY is not set; use a screen, or ssh -X")


def view_shot(shot: Shot, strokes: Sequence[Stroke]) -> Any:
    """Shows a shot with strokes, and waits until the window is closed.

    Returns: the strokes that are on it then, and the Solution that was found of them.

    Raises: InputError where no window can be shown.
    """
    require_viewer()
    return import_module("hydra_viewer.ui.application").view_shot(shot, strokes)
