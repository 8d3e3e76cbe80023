"""The viewer's window in this process, on Qt's screen without a screen, and a hand that moves mouse, pen and keys."""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

os.environ.setdefault("QT_QPA_PLATFORM", "offscreen")  # before Qt is asked for a window

from PySide6.QtCore import QEvent, QPoint, QPointF, Qt
from PySide6.QtGui import QInputDevice, QMouseEvent, QPointingDevice, QTabletEvent
from PySide6.QtTest import QTest
from PySide6.QtWidgets import QApplication, QWidget

from hydra_viewer.model.document import Files
from hydra_viewer.ui.application import make_application
from hydra_viewer.ui.window import Window

LEFT, MIDDLE, RIGHT = Qt.MouseButton.LeftButton, Qt.MouseButton.MiddleButton, Qt.MouseButton.RightButton
NOTHING, ALT, SHIFT = (
    Qt.KeyboardModifier.NoModifier,
    Qt.KeyboardModifier.AltModifier,
    Qt.KeyboardModifier.ShiftModifier,
)
CTRL = Qt.KeyboardModifier.ControlModifier
SMALL = {"elements": 250, "bounces": 2}
Place = tuple[float, float]  # 0..1 of a widget, from its top left


def wait_for(condition: Callable[[], bool], seconds: float = 120.0) -> None:
    """Lets events happen until a condition holds; fails where it does not in time."""
    application, began = QApplication.instance(), time.monotonic()
    while not condition():
        assert application is not None and time.monotonic() - began < seconds, "it did not happen"
        application.processEvents()
        time.sleep(0.005)


@contextmanager
def opened(stage: Path, strokes: Path | str = "", look: Path | str = "") -> Iterator[Window]:
    """A window on a shot, its picture there; closed at the end, unsaved strokes given up."""
    make_application()
    window = Window(SMALL)
    window.resize(900, 640)
    window.show()
    QTest.qWaitForWindowExposed(window)
    window.filing.open(Files(str(stage), str(strokes), str(look)))
    try:
        wait_for(lambda: window.document.shot is not None or bool(window.bar.text))
        if window.document.shot is not None:
            wait_for(lambda: window.painting.canvas.viewport.pixels() is not None)
        yield window
    finally:
        window.filing.autosave.forget()
        window.document.mark_saved(window.document.files, window.document.strokes)
        window.close()
        window.deleteLater()
        QApplication.processEvents()


def pixel(widget: QWidget, at: Place) -> QPoint:
    """The pixel of a widget at a place."""
    return QPoint(round(at[0] * widget.width()), round(at[1] * widget.height()))


def drag(
    widget: QWidget, path: list[Place], held: Qt.KeyboardModifier = NOTHING, button: Qt.MouseButton = LEFT
) -> None:
    """Presses a button, moves along a path, and lets go."""
    QTest.mousePress(widget, button, held, pixel(widget, path[0]))
    for at in path[1:]:
        _move(widget, pixel(widget, at), held, button)
    QTest.mouseRelease(widget, button, held, pixel(widget, path[-1]))


def press(widget: QWidget, path: list[Place], held: Qt.KeyboardModifier = NOTHING) -> None:
    """Presses the left button and moves along a path; does not let go."""
    QTest.mousePress(widget, LEFT, held, pixel(widget, path[0]))
    for at in path[1:]:
        _move(widget, pixel(widget, at), held, LEFT)


def _move(widget: QWidget, to: QPoint, held: Qt.KeyboardModifier, button: Qt.MouseButton) -> None:
    at, on_screen, none = QPointF(to), QPointF(widget.mapToGlobal(to)), Qt.MouseButton.NoButton
    event = QMouseEvent(QEvent.Type.MouseMove, at, on_screen, none, button, held)
    QApplication.sendEvent(widget, event)


def pen(widget: QWidget, path: list[tuple[float, float, float]]) -> None:
    """Draws with a tablet's pen along x, y and pressure."""
    device = QPointingDevice(
        "pen", 1, QInputDevice.DeviceType.Stylus, QPointingDevice.PointerType.Pen,
        QInputDevice.Capability.Position | QInputDevice.Capability.Pressure, 1, 1,
    )  # fmt: skip
    kinds = [QEvent.Type.TabletPress, *[QEvent.Type.TabletMove] * (len(path) - 1), QEvent.Type.TabletRelease]
    for kind, (x, y, pressure) in zip(kinds, [*path, path[-1]], strict=True):
        at = QPointF(pixel(widget, (x, y)))
        button = LEFT if kind != QEvent.Type.TabletMove else Qt.MouseButton.NoButton
        event = QTabletEvent(
            kind, device, at, QPointF(widget.mapToGlobal(at.toPoint())), pressure, 0, 0, 0, 0, 0, NOTHING, button, LEFT
        )
        QApplication.sendEvent(widget, event)


def solved(window: Window) -> None:
    """Waits until what the strokes ask for is found, shown and lit."""
    wait_for(lambda: window.worker.is_idle and window.document.is_solved)


def sentences(window: Window) -> str:
    """What the panel Understood says that was inferred."""
    return "\n".join(window.understanding_panel.sentences)
