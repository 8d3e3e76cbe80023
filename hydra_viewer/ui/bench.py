"""Bench: how long an artist waits, measured in the window itself by events as a mouse sends them.

measure(stage, size) -> {"rows": [...], "stalls": [...]}
"""

from __future__ import annotations

import time
from collections.abc import Callable
from statistics import median
from typing import Any

from PySide6.QtCore import QEvent, QObject, QPoint, QPointF, Qt
from PySide6.QtGui import QMouseEvent
from PySide6.QtWidgets import QApplication, QWidget

from hydra_viewer.model.document import Files
from hydra_viewer.ui.application import make_application
from hydra_viewer.ui.stalls import Stalls
from hydra_viewer.ui.window import Window

SIZE = (900, 450)  # of the picture [pixels]
LEFT, NO_BUTTON = Qt.MouseButton.LeftButton, Qt.MouseButton.NoButton
ALT, NO_KEY = Qt.KeyboardModifier.AltModifier, Qt.KeyboardModifier.NoModifier
STROKES = (((0.30, 0.58), (0.36, 0.55)), ((0.44, 0.62), (0.47, 0.66)), ((0.55, 0.40), (0.56, 0.48)))
LIMITS: dict[str, float | None] = {
    "orbit frame": 0.1, "pointer to brush mark": 0.03, "release to sentence": 0.5, "release to picture": 1.0,
    "release to light followed": None, "release to its picture": None,
}  # fmt: skip
"""Steps, with the seconds that each may take; None: not said."""
GIVE_UP = 120.0  # seconds


class _Painted(QObject):
    """Counts what a widget paints."""

    count = 0

    def eventFilter(self, watched: QObject, event: QEvent) -> bool:
        if event.type() == QEvent.Type.Paint:
            self.count += 1
        return False


def measure(stage: str, options: dict[str, Any]) -> dict[str, Any]:
    """Opens a window on a stage, orbits and paints; returns rows with seconds and limits, and stalls.

    Args:
        stage: path.
        options: of `Shot.open`.
    """
    make_application()
    window = Window(options)
    canvas = window.painting.canvas
    canvas.setFixedSize(*SIZE)
    window.show()
    _rest(0.5)
    stalls = Stalls()
    found: dict[str, list[float]] = {name: [] for name in LIMITS}
    try:
        window.filing.open(Files(stage))
        _wait(lambda: canvas.viewport.pixels() is not None)
        _rest(1.0)
        found["orbit frame"] = _orbit(window)
        window.painting.look_through(None)
        _rest(1.0)
        for path in STROKES:
            _paint(window, path, found)
            _wait(lambda: window.worker.is_idle)
            _rest(1.0)
    finally:
        stalls.stop()
    window.filing.autosave.forget()
    window.document.mark_saved(window.document.files, window.document.strokes)
    window.close()
    rows = [
        {"step": name, "seconds": median(times), "worst": max(times), "limit_seconds": LIMITS[name]}
        for name, times in found.items()
    ]
    return {"rows": rows, "stalls": [vars(stall) for stall in stalls.found]}


def _orbit(window: Window, steps: int = 20) -> list[float]:
    """Seconds from each move of the mouse to the picture of it."""
    canvas, times, pictures = window.painting.canvas, list[float](), list[int]()
    count = lambda: pictures.append(0)  # noqa: E731
    canvas.viewport.changed.connect(count)
    _send(canvas, QEvent.Type.MouseButtonPress, (0.5, 0.5), ALT)
    for n in range(steps):
        before, began = len(pictures), time.perf_counter()
        _send(canvas, QEvent.Type.MouseMove, (0.5 + 0.01 * (n + 1), 0.5), ALT)
        _wait(lambda before=before: len(pictures) > before)  # type: ignore[misc]
        times.append(time.perf_counter() - began)
    _send(canvas, QEvent.Type.MouseButtonRelease, (0.5 + 0.01 * steps, 0.5), ALT)
    canvas.viewport.changed.disconnect(count)
    return times[2:]  # the first ones find out how large a picture may be


def _paint(window: Window, path: tuple[tuple[float, float], ...], found: dict[str, list[float]]) -> None:
    """A stroke: seconds to each mark, to the sentence and the picture under it, and to both with the light followed."""
    canvas, document, painted = window.painting.canvas, window.document, _Painted()
    canvas.overlay.installEventFilter(painted)
    (x, y), (u, v) = path
    _send(canvas, QEvent.Type.MouseButtonPress, (x, y), NO_KEY)
    for n in range(1, 11):
        before, began = painted.count, time.perf_counter()
        _send(canvas, QEvent.Type.MouseMove, (x + (u - x) * n / 10, y + (v - y) * n / 10), NO_KEY)
        _wait(lambda before=before: painted.count > before)  # type: ignore[misc]
        found["pointer to brush mark"].append(time.perf_counter() - began)
    canvas.overlay.removeEventFilter(painted)
    was, began = document.found, time.perf_counter()
    seen = _Seen(window, was)
    _send(canvas, QEvent.Type.MouseButtonRelease, (u, v), NO_KEY)
    _wait(lambda: seen.is_whole)
    for name, at in seen.times.items():
        found[name].append(at - began)
    seen.stop()


class _Seen(QObject):
    """Notes when an artist sees what: the sentence, the picture under it, and both with the light followed.

    Attributes:
        times: by step, of `time.perf_counter`.
    """

    def __init__(self, window: Window, before: object) -> None:
        super().__init__()
        self.times: dict[str, float] = {}
        self._window, self._before = window, before
        window.explaining.groups_changed.connect(self._read)
        window.painting.canvas.viewport.changed.connect(self._look)

    def _note(self, name: str) -> None:
        self.times.setdefault(name, time.perf_counter())

    def _read(self) -> None:
        document = self._window.document
        if self._window.understanding_panel.sentences and document.found is not self._before:
            self._note("release to sentence")
            if document.is_solved:
                self._note("release to light followed")

    def _look(self) -> None:
        found = self._window.document.found
        if found is None or found is self._before or found.shot is None:
            return
        shown = self._window.painting.canvas.viewport.shown
        if shown is not None and shown.edited is found.shot:
            self._note("release to picture")
            if shown.is_lit and found.is_lit:
                self._note("release to its picture")

    @property
    def is_whole(self) -> bool:
        return len(self.times) == 4

    def stop(self) -> None:
        """Looks no more."""
        self._window.explaining.groups_changed.disconnect(self._read)
        self._window.painting.canvas.viewport.changed.disconnect(self._look)


def _send(widget: QWidget, kind: QEvent.Type, at: tuple[float, float], held: Qt.KeyboardModifier) -> None:
    to = QPoint(round(at[0] * widget.width()), round(at[1] * widget.height()))
    button = NO_BUTTON if kind == QEvent.Type.MouseMove else LEFT
    buttons = NO_BUTTON if kind == QEvent.Type.MouseButtonRelease else LEFT
    on_screen = QPointF(widget.mapToGlobal(to))
    QApplication.sendEvent(widget, QMouseEvent(kind, QPointF(to), on_screen, button, buttons, held))


def _wait(condition: Callable[[], bool]) -> None:
    began = time.perf_counter()
    while not condition():
        if time.perf_counter() - began > GIVE_UP:
            raise TimeoutError("the window did not answer")
        QApplication.processEvents()
        time.sleep(0.001)


def _rest(seconds: float) -> None:
    until = time.perf_counter() + seconds
    _wait(lambda: time.perf_counter() > until)
