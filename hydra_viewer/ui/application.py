"""The application: one window, from the command line's arguments."""

from __future__ import annotations

import argparse
import json
import signal
import sys
from collections.abc import Callable, Mapping, Sequence
from importlib import import_module
from typing import Any

from PySide6.QtCore import QTimer
from PySide6.QtWidgets import QApplication

from hydra_viewer.model.document import Files
from hydra_viewer.ui import words
from hydra_viewer.ui.collector import collect_anywhere
from hydra_viewer.ui.theme import apply_theme
from hydra_viewer.ui.window import Window
from usdslf import Shot, Solution, Stroke

OPTIONS: dict[str, Callable[[str], Any]] = {
    "frame": float, "device": str, "ocio": str, "elements": int, "bounces": int, "refine": int, "model": str,
    "missing_dome": str,
}  # fmt: skip
"""Of `Shot.open`, and what each is read as."""

SWITCH = 1e-4
"""Seconds that the main thread waits for Python's lock where another one computes in Python; each of its calls into Qt
gives the lock up, and three threads that want it, too, make it wait for ten times that."""


def make_application() -> QApplication:
    """Returns the application, the one that runs already where there is one, with the theme."""
    existing = QApplication.instance()
    if isinstance(existing, QApplication):
        return existing
    sys.setswitchinterval(SWITCH)
    application = QApplication([words.TITLE])
    application.setApplicationName(words.TITLE)
    apply_theme(application)
    return application


def view(files: Files, options: Mapping[str, Any] | None = None) -> int:
    """Shows a shot until the window is closed; returns the exit code.

    Args:
        files: stage, strokes and look; "" for what there is not.
        options: of `Shot.open`.
    """
    application = make_application()
    window = Window(options)
    window.show()
    if files.stage:
        window.filing.open(files)
    signal.signal(signal.SIGINT, lambda *_: window.close())
    beat = QTimer(window)  # Python hears of signals between events only
    beat.timeout.connect(lambda: None)
    beat.start(200)
    return application.exec()


def view_shot(shot: Shot, strokes: Sequence[Stroke]) -> tuple[tuple[Stroke, ...], Solution]:
    """Shows a shot until the window is closed; returns the strokes on it then, and what was found of them.

    Args:
        shot: that another program has open.
        strokes: on it.
    """
    application = make_application()
    window = Window()
    window.filing.asks = False  # the strokes go back to who asked for the window
    window.show()
    window.filing.open_shot(shot, strokes)
    application.exec()
    document = window.document
    is_solved = document.is_solved and document.found is not None
    result = document.strokes, document.found.solution if is_solved and document.found else Solution()
    window.deleteLater()
    del window, document
    collect_anywhere()
    return result


def main(arguments: list[str] | None = None) -> int:
    """Runs `python -m hydra_viewer`, whose options are those of the command line's `view`."""
    parser = argparse.ArgumentParser(prog="usdslf view", description=words.PROGRAM)
    for name in ("stage", "strokes", "look"):
        parser.add_argument(name, nargs="?", default="", metavar=name.upper())
    parser.add_argument("--make-preview", action="store_true")
    parser.add_argument("--bench", action="store_true", help=argparse.SUPPRESS)
    for name, kind in OPTIONS.items():
        parser.add_argument(f"--{name.replace('_', '-')}", type=kind)
    given = vars(parser.parse_args(arguments))
    files = Files(*(given.pop(name) for name in ("stage", "strokes", "look")))
    is_bench = given.pop("bench")
    options = {name: value for name, value in given.items() if value is not None}
    if is_bench:
        print(json.dumps(import_module("hydra_viewer.ui.bench").measure(files.stage, options)))
        return 0
    return view(files, options)
