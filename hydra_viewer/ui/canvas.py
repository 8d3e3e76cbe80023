"""Canvas: a viewport with strokes and the brush over it; takes mouse, pen and wheel.

left button             paint, select or pick a colour, as the pointer is set
Alt + left, middle, right   orbit, pan, dolly; the wheel dollies too
Ctrl + left             pick a colour; with tool clone: the place that it copies
B + left                change the brush's size;  Shift + left  a straight line
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray
from PySide6.QtCore import QEvent, QPointF, QRect, Qt, Signal
from PySide6.QtGui import (
    QColor,
    QContextMenuEvent,
    QEnterEvent,
    QFocusEvent,
    QKeyEvent,
    QMouseEvent,
    QResizeEvent,
    QTabletEvent,
    QWheelEvent,
)
from PySide6.QtWidgets import QWidget

from hydra_viewer.model.navigation import dollied
from hydra_viewer.model.painting import stroke_of
from hydra_viewer.ui import theme, words
from hydra_viewer.ui.gestures import At, Click, Gesture, Navigate, Paint, Resize
from hydra_viewer.ui.highlight import rim, shown_at
from hydra_viewer.ui.overlay import Overlay
from hydra_viewer.ui.viewport import Shown, Viewport, ViewportKind
from hydra_viewer.ui.worker import Job, Worker
from usdslf import Camera, Pick, Shot, UsdslfError, pick

if TYPE_CHECKING:
    from hydra_viewer.model.document import Document
    from hydra_viewer.model.easel import Easel
    from hydra_viewer.model.painting import PenPath

LEFT, MIDDLE, RIGHT = Qt.MouseButton.LeftButton, Qt.MouseButton.MiddleButton, Qt.MouseButton.RightButton
ALT, CTRL, SHIFT = (
    Qt.KeyboardModifier.AltModifier,
    Qt.KeyboardModifier.ControlModifier,
    Qt.KeyboardModifier.ShiftModifier,
)
BY_KEYS = (Qt.FocusReason.TabFocusReason, Qt.FocusReason.BacktabFocusReason, Qt.FocusReason.ShortcutFocusReason)
WHEEL = 0.15  # doublings of the distance a notch


class Canvas(QWidget):
    """The picture to paint on.

    Attributes:
        failed: Signal(str): a sentence for the error bar.
        noted: Signal(str): a sentence on what is shown.
        progress: Signal(float): of the picture, 0..1.
        letting_go: Signal(): the stage is to be read anew, nobody may read it any more.
        kind: of the viewport.
        beside: further viewports that may be reading the stage.
    """

    failed = Signal(str)
    noted = Signal(str)
    progress = Signal(float)
    letting_go = Signal()

    def __init__(
        self, document: Document, easel: Easel, worker: Worker, kind: ViewportKind, parent: QWidget | None = None
    ) -> None:  # fmt: skip
        super().__init__(parent)
        self.document, self.easel, self._worker = document, easel, worker
        self._shows: NDArray[np.int32] | None = None  # which mesh each of some pixels shows
        self._gesture: Gesture | None = None
        self._button = LEFT  # that it began with
        # What the stroke under way is painted on: stage and stroke layer, shot, camera.
        self._painted_on: tuple[tuple[str, str], Shot, Camera] | None = None
        self._is_resizing_key_down = False
        self._is_held = self._has_let_go = False
        self._instead: Shown | None = None
        self.beside: list[Viewport] = []
        self.setMinimumSize(320, 180)
        self.setFocusPolicy(Qt.FocusPolicy.StrongFocus)
        self.setMouseTracking(True)
        self.setAttribute(Qt.WidgetAttribute.WA_TabletTracking)
        self.overlay = Overlay(document, easel, self)
        self.viewport: Viewport = self._made(kind)
        document.shot_changed.connect(self._on_shot_changed)
        document.found_changed.connect(self._show_shot)
        document.selection_changed.connect(self._show_selection)
        easel.view_changed.connect(self._show_view)
        easel.display_changed.connect(lambda: self.viewport.set_display(easel.display))
        self._show_shot()

    # ── the viewport ───────────────────────────────────────────────────────────────────────────

    def _made(self, kind: ViewportKind) -> Viewport:
        self.kind = kind
        viewport = kind.make(self)
        viewport.failed.connect(self.failed)
        viewport.noted.connect(self.noted)
        viewport.progress.connect(self.progress)
        viewport.widget.setAttribute(Qt.WidgetAttribute.WA_TransparentForMouseEvents)
        viewport.widget.setGeometry(self.rect())
        viewport.widget.show()
        self.overlay.raise_()
        return viewport

    def use_viewport(self, kind: ViewportKind) -> None:
        """Shows the picture by another viewport; camera, display and shot stay."""
        self.end(self.viewport)
        self.viewport = self._made(kind)
        self.viewport.set_display(self.easel.display)
        self.viewport.hold(self._is_held)
        self._show_shot()
        self._show_view()

    def end(self, viewport: Viewport) -> None:
        """Ends a viewport; it may read the stage until the picture that it makes is there."""
        self.beside = [v for v in self.beside if v.holds_stage and v is not viewport] + [viewport]
        viewport.widget.hide()
        viewport.stop()
        viewport.widget.deleteLater()

    def stop(self) -> None:
        """Ends the viewport's threads."""
        self.viewport.finish()

    def hold(self, is_held: bool) -> None:
        """Leaves the processor to other work; see `Viewport.hold`."""
        self._is_held = is_held
        if self._has_let_go and not is_held:
            self._has_let_go = False
            self._show_shot()
        self.viewport.hold(is_held)

    def _on_shot_changed(self) -> None:
        self._end_stroke()
        self._shows, self._instead, self._has_let_go = None, None, False
        self._show_shot()

    def show_instead(self, shown: Shown | None) -> None:
        """Shows another look than what was found, or the shot without one; None: what was found."""
        if shown is not None or self._instead is not None:
            self._instead = shown
            self._show_shot()

    def _show_shot(self) -> None:
        if self._has_let_go:
            return
        shot, found = self.document.shot, self.document.found
        if shot is None:
            self.viewport.show_shot(None)
        elif self._instead is not None:
            self.viewport.show_shot(self._instead)
        elif found is None or found.shot is not None:  # else what is shown stays until there is something to show
            self.viewport.show_shot(Shown.of(shot, found))
        self.overlay.update()

    def let_go(self) -> Callable[[], bool]:
        """Lets all viewports give back the stage until another shot is shown, or all work is done.

        Returns: a function that says whether the stage may still be read.
        """
        self.letting_go.emit()
        self._has_let_go = True
        self.viewport.let_go()
        reading = [self.viewport, *self.beside]
        return lambda: any(v.holds_stage for v in reading)

    def _show_view(self) -> None:
        if self.easel.view is not None:
            self._end_stroke()
            self.viewport.set_camera(self.easel.view.camera, self.easel.is_moving)
        self._shows = None
        if not self.easel.is_moving:
            self._show_selection()
        self.overlay.update()

    # ── what is selected ───────────────────────────────────────────────────────────────────────

    def _show_selection(self) -> None:
        """Draws the rim of what is selected; where it shows is found first."""
        shot, view, path = self.document.shot, self.easel.view, self.document.selected
        if not path or shot is None or view is None:
            self.overlay.set_rim("selected", None)
        elif self._shows is None:
            size = self.width(), self.height()
            steps = lambda: shown_at(shot, view.camera, size)  # noqa: E731
            self._worker.start(Job("rim", steps, self._take_shown, lambda *_: None, is_quiet=True))
        else:
            below = path.rstrip("/") + "/"
            is_in = [m.path == path or m.path.startswith((below, f"{path}[")) for m in shot.scene.meshes]
            inside = np.array([*is_in, False])[self._shows]
            self.overlay.set_rim("selected", rim(inside, QColor(theme.ACCENT)) if inside.any() else None)

    def _take_shown(self, shows: NDArray[np.int32]) -> None:
        self._shows = shows
        self._show_selection()

    # ── places ─────────────────────────────────────────────────────────────────────────────────

    @property
    def aspect(self) -> float:
        """Width / height of the picture."""
        return self.width() / max(self.height(), 1)

    def place(self, at: At) -> At:
        """Returns where in the picture, 0..1 from its top left, a pixel of the widget is."""
        return at[0] / max(self.width(), 1), at[1] / max(self.height(), 1)

    def pick(self, at: At) -> Pick | None:
        """Returns what is seen at a pixel of the widget."""
        if self.document.shot is None or self.easel.view is None:
            return None
        return pick(self.document.shot, self.easel.view.camera, self.place(at), self.aspect)

    # ── painting ───────────────────────────────────────────────────────────────────────────────

    def draw_path(self, path: PenPath | None) -> None:
        """Draws the stroke that is being painted, in its raw colour."""
        self.overlay.draw_path(path)

    def finish_stroke(self, path: PenPath) -> None:
        """Makes a stroke of a path and puts it on the shot."""
        document, easel, on = self.document, self.easel, self._painted_on
        if on is None:
            return
        brush = easel.brush
        try:
            stroke = stroke_of(*on[1:], path, brush, self.aspect, document.next_name)
        except UsdslfError as error:
            self.failed.emit(str(error))
            return
        easel.set_brush(brush.used())
        document.change_strokes(words.painted(brush.tool), [*document.strokes, stroke])

    def _end_stroke(self) -> None:
        """Ends the stroke under way where the picture under it goes: as far as it was painted, on what was seen."""
        gesture, on, view, document = self._gesture, self._painted_on, self.easel.view, self.document
        if not isinstance(gesture, Paint) or on is None or view is None:
            return
        files, shot, camera = on
        if document.shot is not shot or view.camera is not camera:
            self._gesture = None
            if self._files == files:
                gesture.release((0.0, 0.0))
            else:
                gesture.cancel()
            self._painted_on = None

    @property
    def _files(self) -> tuple[str, str]:
        """Stage and stroke layer that are open."""
        return self.document.files.stage, self.document.files.strokes

    def take_color(self, at: At) -> None:
        """Takes the colour of the picture for the brush, scene-linear."""
        pixels = self.viewport.pixels()
        if pixels is None:
            return
        h, w = pixels.shape[:2]
        x, y = self.place(at)
        color = pixels[min(max(int(y * h), 0), h - 1), min(max(int(x * w), 0), w - 1)]
        r, g, b = (float(c) for c in np.maximum(color, 0))
        self.easel.set_brush(color=(r, g, b))

    def _take_source(self, at: At) -> None:
        found = self.pick(at)
        if found is not None:
            x, y, z = (float(v) for v in found.point)
            self.easel.set_brush(clone_source=(x, y, z))
            self.overlay.update()

    def _select(self, at: At) -> None:
        found = self.pick(at)
        self.document.select(found.path if found is not None else "")

    # ── events ─────────────────────────────────────────────────────────────────────────────────

    def _gesture_of(self, button: Qt.MouseButton, held: Qt.KeyboardModifier, at: At, pressure: float) -> Gesture | None:
        easel = self.easel
        if easel.view is None:
            return None
        kinds = {LEFT: "orbit", MIDDLE: "pan", RIGHT: "dolly"}
        if held & ALT and button in kinds:
            return Navigate(easel, kinds[button], at, self.height())
        if button is MIDDLE:
            return Navigate(easel, "pan", at, self.height())
        if button is not LEFT:
            return None
        if self._is_resizing_key_down:
            return Resize(easel, at, self.height())
        if held & CTRL:
            return Click(self._take_source if easel.brush.tool == "clone" else self.take_color, at)
        if easel.pointer == "select":
            return Click(self._select, at)
        if easel.pointer == "eyedropper":
            return Click(self.take_color, at)
        if self.document.shot is None:
            return None
        self._painted_on = self._files, self.document.shot, easel.view.camera
        return Paint(self, at, pressure)

    def _press(self, button: Qt.MouseButton, held: Qt.KeyboardModifier, at: At, pressure: float = 1.0) -> None:
        self.setFocus(Qt.FocusReason.MouseFocusReason)
        if self._gesture is None:
            self._gesture, self._button = self._gesture_of(button, held, at, pressure), button

    def _move(self, held: Qt.KeyboardModifier, at: At, pressure: float = 1.0) -> None:
        self.overlay.point_at(at)
        if self._gesture is not None:
            self._gesture.move(at, pressure, bool(held & SHIFT))

    def _release(self, button: Qt.MouseButton, at: At) -> None:
        if button != self._button:
            return
        gesture, self._gesture = self._gesture, None
        if gesture is not None:
            gesture.release(at)
        self._painted_on = None  # which would keep a shot that is closed

    def mousePressEvent(self, event: QMouseEvent) -> None:
        self._press(event.button(), event.modifiers(), _at(event.position()))

    def mouseMoveEvent(self, event: QMouseEvent) -> None:
        self._move(event.modifiers(), _at(event.position()))

    def mouseReleaseEvent(self, event: QMouseEvent) -> None:
        self._release(event.button(), _at(event.position()))

    def tabletEvent(self, event: QTabletEvent) -> None:
        at, pressure = _at(event.position()), event.pressure()
        if event.type() == QEvent.Type.TabletPress:
            self._press(event.button(), event.modifiers(), at, pressure)
        elif event.type() == QEvent.Type.TabletMove:
            self._move(event.modifiers(), at, pressure)
        else:
            self._release(event.button(), at)
        event.accept()  # else it comes again as a mouse event

    def wheelEvent(self, event: QWheelEvent) -> None:
        if self.easel.view is not None and self._gesture is None:
            self.easel.look_from(dollied(self.easel.view, WHEEL * event.angleDelta().y() / 120))

    def contextMenuEvent(self, event: QContextMenuEvent) -> None:
        event.accept()

    def enterEvent(self, event: QEnterEvent) -> None:
        self.overlay.point_at(_at(event.position()))

    def leaveEvent(self, event: QEvent) -> None:
        self.overlay.point_at(None)

    def focusInEvent(self, event: QFocusEvent) -> None:
        self.overlay.set_focus_ring(event.reason() in BY_KEYS)

    def focusOutEvent(self, event: QFocusEvent) -> None:
        self.overlay.set_focus_ring(False)
        self._is_resizing_key_down = False

    def keyPressEvent(self, event: QKeyEvent) -> None:
        if event.key() == Qt.Key.Key_Escape and self._gesture is not None:
            gesture, self._gesture = self._gesture, None
            gesture.cancel()
        elif event.key() == Qt.Key.Key_B:
            self._is_resizing_key_down = True
        else:
            super().keyPressEvent(event)

    def keyReleaseEvent(self, event: QKeyEvent) -> None:
        if event.key() == Qt.Key.Key_B and not event.isAutoRepeat():
            self._is_resizing_key_down = False
        super().keyReleaseEvent(event)

    def resizeEvent(self, event: QResizeEvent) -> None:
        rect = QRect(0, 0, self.width(), self.height())
        self.viewport.widget.setGeometry(rect)
        self.overlay.setGeometry(rect)
        self._shows = None
        self._show_selection()


def _at(point: QPointF) -> At:
    return point.x(), point.y()
