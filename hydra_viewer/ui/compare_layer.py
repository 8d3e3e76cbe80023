"""Compare layer: the picture beside another one: wiped, or the difference of both.

The other picture is made by a second viewport of the same kind, so that it is what that renderer shows.  It is there
once something was compared, and rests while nothing is: to end its thread would keep people waiting.
"""

from __future__ import annotations

import numpy as np
from PySide6.QtCore import QEvent, QObject, QPointF, QRect, Qt, QTimer
from PySide6.QtGui import QColor, QImage, QKeyEvent, QMouseEvent, QPainter, QPaintEvent, QPen
from PySide6.QtWidgets import QWidget

from hydra_viewer.model.comparison import Comparison, difference
from hydra_viewer.model.document import Document
from hydra_viewer.model.easel import Easel
from hydra_viewer.model.found import Found
from hydra_viewer.ui import panel_words as words
from hydra_viewer.ui import theme
from hydra_viewer.ui.canvas import Canvas
from hydra_viewer.ui.swatches import shown_picture
from hydra_viewer.ui.viewport import Shown, Viewport
from usdslf import Shot

HANDLE = 13  # width of the line that is dragged [pixels]
PIXELS = 300_000  # of a difference
WAIT_MS = 80  # between two differences


class _Handle(QWidget):
    """The line of a wipe."""

    def __init__(self, comparison: Comparison, parent: QWidget) -> None:
        super().__init__(parent)
        self._comparison, self._canvas = comparison, parent
        self.setCursor(Qt.CursorShape.SplitHCursor)
        self.setFocusPolicy(Qt.FocusPolicy.StrongFocus)

    def mousePressEvent(self, event: QMouseEvent) -> None:
        event.accept()

    def mouseMoveEvent(self, event: QMouseEvent) -> None:
        at = self.mapToParent(event.position().toPoint()).x()
        self._comparison.set(split=at / max(self._canvas.width(), 1))

    def keyPressEvent(self, event: QKeyEvent) -> None:
        steps = {Qt.Key.Key_Left: -0.02, Qt.Key.Key_Right: 0.02}
        step = steps.get(Qt.Key(event.key()))
        if step is None:
            super().keyPressEvent(event)
        else:
            self._comparison.set(split=self._comparison.state.split + step)

    def paintEvent(self, event: QPaintEvent) -> None:
        painter = QPainter(self)
        painter.setRenderHint(QPainter.RenderHint.Antialiasing)
        x, y = self.width() / 2, self.height() / 2
        color = QColor(theme.ACCENT if self.hasFocus() else "white")
        for pen in (QPen(QColor(0, 0, 0, 140), 3), QPen(color, 1.2)):
            painter.setPen(pen)
            painter.drawLine(QPointF(x, 0), QPointF(x, self.height()))
        painter.setBrush(QColor(theme.PANEL))
        painter.drawEllipse(QPointF(x, y), 5.5, 5.5)


class _Difference(QWidget):
    """Shows how far two pictures are apart."""

    def __init__(self, parent: QWidget) -> None:
        super().__init__(parent)
        self.setAttribute(Qt.WidgetAttribute.WA_TransparentForMouseEvents)
        self.image = QImage()

    def show_image(self, image: QImage) -> None:
        """Shows a difference; a null image: it comes."""
        self.image = image
        self.update()

    def paintEvent(self, event: QPaintEvent) -> None:
        painter = QPainter(self)
        painter.fillRect(self.rect(), QColor("black"))
        painter.setRenderHint(QPainter.RenderHint.SmoothPixmapTransform)
        painter.drawImage(self.rect(), self.image)
        if self.image.isNull():
            painter.setPen(QColor(theme.DIM))
            painter.drawText(self.rect(), Qt.AlignmentFlag.AlignCenter, words.PICTURES_COME)


class CompareLayer(QObject):
    """Shows on a canvas what a Comparison says.

    Attributes:
        other: the second viewport; None: nothing was compared yet.
        is_beside: it shows something.
        handle: the line of the wipe.
    """

    def __init__(self, document: Document, easel: Easel, comparison: Comparison, canvas: Canvas) -> None:
        super().__init__(canvas)
        self._document, self._easel, self._comparison, self._canvas = document, easel, comparison, canvas
        self.other: Viewport | None = None
        self._now = canvas.viewport
        self._stage, self.is_beside = "", False
        self._shows: tuple[Found | None] | None = None
        self._is_there = False  # the other picture
        self._clip, self.handle = QWidget(canvas), _Handle(comparison, canvas)
        self._clip.setAttribute(Qt.WidgetAttribute.WA_TransparentForMouseEvents)
        self.difference = _Difference(self._clip)
        for each in (self._clip, self.handle):
            each.hide()
        self._timer = QTimer(self, singleShot=True, interval=WAIT_MS)
        self._timer.timeout.connect(self._show_difference)
        canvas.installEventFilter(self)
        canvas.letting_go.connect(lambda: comparison.set(mode="now"))
        comparison.changed.connect(self._update)
        document.found_changed.connect(self._update)
        document.shot_changed.connect(self._on_shot_changed)
        easel.view_changed.connect(self._show_view)
        easel.display_changed.connect(self._show_display)

    def eventFilter(self, watched: QObject, event: QEvent) -> bool:
        """Keeps its places when the canvas has another size."""
        if event.type() == QEvent.Type.Resize:
            self._lay_out()
        elif event.type() == QEvent.Type.ChildAdded and self.other is not None:
            QTimer.singleShot(0, self, self._update)  # it may be another viewport
        return False

    # ── what is shown ──────────────────────────────────────────────────────────────────────────

    def _on_shot_changed(self) -> None:
        """Of another stage nothing is kept; at another frame of the same one looks are."""
        stage, self._shows = self._document.files.stage, None
        if stage == self._stage:
            self._comparison.set(mode="now")
        else:
            self._stage = stage
            self._comparison.clear()

    def _update(self) -> None:
        state, shot = self._comparison.state, self._document.shot
        self.is_beside = shot is not None and state.mode in ("wipe", "difference")
        self._canvas.show_instead(
            Shown.of(shot, self._comparison.other) if shot is not None and state.mode == "other" else None
        )
        if self._now is not self._canvas.viewport:
            self._end()
        if self.is_beside and shot is not None:
            self._begin(shot)
        elif self.other is not None and self._shows is not None:
            self._shows = None
            self.other.show_shot(None)
        self._lay_out()

    def _begin(self, shot: Shot) -> None:
        if self.other is None:
            self._now = self._canvas.viewport
            self.other = self._canvas.kind.make(self._clip)
            self._canvas.beside.append(self.other)
            self.other.widget.setAttribute(Qt.WidgetAttribute.WA_TransparentForMouseEvents)
            self.other.changed.connect(self._on_other_changed)
            self._now.changed.connect(self._timer.start)
            self._show_display()
            self._lay_out()
            self.other.widget.show()
        if self._shows is None:
            self._is_there = False
            self._show_view()
        if self._shows != (self._comparison.other,):
            self._shows = (self._comparison.other,)
            self.other.show_shot(Shown.of(shot, self._comparison.other))

    def _on_other_changed(self) -> None:
        if not self._is_there:
            self._is_there = True
            self._lay_out()
        self._timer.start()

    def _end(self) -> None:
        self._now, self._shows = self._canvas.viewport, None
        if self.other is None:
            return
        self._timer.stop()
        self._canvas.end(self.other)
        self.other = None

    def stop(self) -> None:
        """Ends the second viewport's threads."""
        self._end()

    def _show_view(self) -> None:
        if self.other is not None and self.is_beside and self._easel.view is not None:
            self.other.set_camera(self._easel.view.camera, self._easel.is_moving)

    def _show_display(self) -> None:
        if self.other is not None:
            self.other.set_display(self._easel.display)

    # ── places ─────────────────────────────────────────────────────────────────────────────────

    def _lay_out(self) -> None:
        state, w, h = self._comparison.state, self._canvas.width(), self._canvas.height()
        is_wipe, is_difference = (self.is_beside and state.mode == m for m in ("wipe", "difference"))
        self._clip.setVisible(is_wipe or is_difference)
        self.handle.setVisible(is_wipe)
        self.difference.setVisible(is_difference)
        if self.other is None:
            return
        at = round(state.split * w)
        seen = at if is_wipe else w
        # a viewport that is hidden makes no picture: until it has one, it is there and takes no place
        self._clip.setGeometry(0, 0, seen if self._is_there else 1, h)
        self.other.widget.setGeometry(QRect(0, 0, w, h))
        self.difference.setGeometry(0, 0, w, h)
        self.difference.raise_()
        self._clip.stackUnder(self._canvas.overlay)
        self.handle.setGeometry(at - HANDLE // 2, 0, HANDLE, h)
        self.handle.raise_()
        self._timer.start()

    def _show_difference(self) -> None:
        shot, state = self._document.shot, self._comparison.state
        if self.other is None or shot is None or state.mode != "difference":
            return
        now, other = self._canvas.viewport.pixels(), self.other.pixels()
        if now is None or other is None:
            return
        if now.shape != other.shape:  # one is coarse still: every edge would be a difference
            self.difference.show_image(QImage())
            return
        step = max(1, int(np.ceil((now.shape[0] * now.shape[1] / PIXELS) ** 0.5)))
        apart = difference(now[::step, ::step], other[::step, ::step], state.gain)
        self.difference.show_image(shown_picture(apart, shot, self._easel.display))
