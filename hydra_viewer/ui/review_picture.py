"""Review picture: before and after a look, wiped, in turns, their difference, or what changes by light alone."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from PySide6.QtCore import QPointF, QRect, QRectF, QSize, Qt, QTimer
from PySide6.QtGui import (
    QColor,
    QHideEvent,
    QImage,
    QKeyEvent,
    QMouseEvent,
    QPainter,
    QPainterPath,
    QPaintEvent,
    QPen,
    QResizeEvent,
    QShowEvent,
)
from PySide6.QtWidgets import QSizePolicy, QWidget

from hydra_viewer.model.comparison import MOST_GAIN, difference
from hydra_viewer.model.display import DisplaySettings
from hydra_viewer.model.reviewing import heat_map
from hydra_viewer.ui import panel_words as words
from hydra_viewer.ui import theme
from hydra_viewer.ui.swatches import shown_picture
from usdslf import Shot
from usdslf.review import Review

MODES = ("before", "after", "wipe", "blink", "difference", "indirect")
MAGNIFIED = ("difference", "indirect")  # modes that have a gain
BLINK = 600  # milliseconds that each picture is shown, as on the page of `usdslf review`
GAIN = 4.0  # of the difference, at first
STEP = 0.02  # of the wipe, a key
TAG = 8  # between a tag and the picture's rim


class ReviewPicture(QWidget):
    """One view; left and right arrow or the mouse move the wipe.

    Attributes:
        mode: one of MODES.
        split: of the wipe, 0..1 of the width.
        gain: of what is magnified, 1..MOST_GAIN.
        shows_after: of the two pictures that blink, the second one is shown.
        images: by what they show.
        view: number of the view; -1: none.
    """

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.mode, self.split, self.gain, self.shows_after = "wipe", 0.5, GAIN, False
        self.images: dict[str, QImage] = {}
        self.view = -1
        self._dabs: list[tuple[float, float, float]] = []
        self._outline = QPainterPath()
        self._aspect = 16 / 9
        self._seen: tuple[Review, int, Shot, DisplaySettings] | None = None
        self._blinking = QTimer(self)
        self._blinking.setInterval(BLINK)
        self._blinking.timeout.connect(self._blink)
        policy = QSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Minimum)
        policy.setHeightForWidth(True)
        self.setSizePolicy(policy)
        self.setFocusPolicy(Qt.FocusPolicy.StrongFocus)
        self.setAccessibleName(words.REVIEW_PICTURE)
        self.setToolTip(words.REVIEW_PICTURE_TIP)

    def hasHeightForWidth(self) -> bool:
        return True

    def heightForWidth(self, width: int) -> int:
        return round(width / self._aspect)

    def sizeHint(self) -> QSize:
        return QSize(340, self.heightForWidth(340))

    def show_view(self, review: Review, number: int, shot: Shot, display: DisplaySettings) -> None:
        """Shows a view of a review.

        Args:
            number: of the view.
            shot: whose colour conversions are used.
            display: of the window's picture.
        """
        seen = review.views[number]
        p = seen.pictures
        lit = replace(display, exposure=display.exposure + p.exposure)
        h, w = p.indirect.shape[:2]
        self.images = {"before": shown_picture(p.before, shot, lit), "after": shown_picture(p.after, shot, lit)}
        self._seen = review, number, shot, lit
        self._magnify()
        self._dabs, self._outline = [dab for stroke in seen.strokes for dab in stroke.dabs], QPainterPath()
        self.view, self._aspect = number, w / h
        self.updateGeometry()
        self.update()

    def _magnify(self) -> None:
        """Makes the pictures that have a gain."""
        if self._seen is None:
            return
        review, number, shot, lit = self._seen
        p = review.views[number].pictures
        apart = difference(p.after, p.before, self.gain * 2.0**lit.exposure)
        heat = np.ascontiguousarray(heat_map(p.indirect, self.gain / GAIN))
        h, w = heat.shape[:2]
        self.images["difference"] = shown_picture(apart, shot, DisplaySettings())
        self.images["indirect"] = QImage(heat.data, w, h, 3 * w, QImage.Format.Format_RGB888).copy()

    def set_gain(self, gain: float) -> None:
        """Magnifies differences by a factor, 1..MOST_GAIN."""
        self.gain = min(max(gain, 1.0), MOST_GAIN)
        self._magnify()
        self.update()

    def clear(self) -> None:
        """Shows nothing."""
        self.images, self.view, self._dabs, self._seen = {}, -1, [], None
        self.update()

    def set_mode(self, mode: str) -> None:
        """Shows it in one of MODES."""
        self.mode, self.shows_after = mode, False
        self._keep_blinking()
        self.update()

    def _keep_blinking(self) -> None:
        """Changes the picture in time where that is asked for and seen."""
        if self.mode == "blink" and self.isVisible():
            self._blinking.start()
        else:
            self._blinking.stop()

    def _blink(self) -> None:
        self.shows_after = not self.shows_after
        self.update()

    # ── events ─────────────────────────────────────────────────────────────────────────────────

    def _wipe_to(self, split: float) -> None:
        self.split = min(max(split, 0.0), 1.0)
        self.update()

    def mousePressEvent(self, event: QMouseEvent) -> None:
        self._wipe_to(event.position().x() / max(self.width(), 1))

    def mouseMoveEvent(self, event: QMouseEvent) -> None:
        self._wipe_to(event.position().x() / max(self.width(), 1))

    def keyPressEvent(self, event: QKeyEvent) -> None:
        step = {Qt.Key.Key_Left: -STEP, Qt.Key.Key_Right: STEP}.get(Qt.Key(event.key()))
        if step is None:
            super().keyPressEvent(event)
        else:
            self._wipe_to(self.split + step)

    def resizeEvent(self, event: QResizeEvent) -> None:
        self._outline = QPainterPath()

    def showEvent(self, event: QShowEvent) -> None:
        self._keep_blinking()

    def hideEvent(self, event: QHideEvent) -> None:
        self._keep_blinking()

    def paintEvent(self, event: QPaintEvent) -> None:
        painter, r = QPainter(self), self.rect()
        painter.setRenderHint(QPainter.RenderHint.Antialiasing)
        painter.setRenderHint(QPainter.RenderHint.SmoothPixmapTransform)
        if not self.images:
            painter.fillRect(r, QColor(theme.FIELD))
            painter.setPen(QColor(theme.DIM))
            painter.drawText(r, Qt.AlignmentFlag.AlignCenter, words.PICTURES_COME)
        elif self.mode == "wipe":
            painter.drawImage(r, self.images["after"])
            x = round(self.split * r.width())
            painter.setClipRect(QRect(0, 0, x, r.height()))
            painter.drawImage(r, self.images["before"])
            painter.setClipping(False)
        else:
            painter.drawImage(r, self.images[self._shown])
        if self.images and self.mode != "indirect":
            self._draw_dabs(painter)
        if self.images and self.mode == "wipe":
            self._draw_line(painter, self.split * r.width())
            self._draw_tag(painter, "before", is_left=True)
            self._draw_tag(painter, "after", is_left=False)
        elif self.images and self.mode == "blink":
            self._draw_tag(painter, self._shown, is_left=not self.shows_after)
        if self.hasFocus():
            painter.setBrush(Qt.BrushStyle.NoBrush)
            painter.setPen(QPen(QColor(theme.FOCUS), 2))
            painter.drawRect(QRectF(r).adjusted(1, 1, -1, -1))

    @property
    def _shown(self) -> str:
        """The picture that is shown alone."""
        if self.mode == "blink":
            return "after" if self.shows_after else "before"
        return self.mode

    def _draw_dabs(self, painter: QPainter) -> None:
        """The rim of what was painted."""
        if self._outline.isEmpty() and self._dabs:
            outline = QPainterPath()
            outline.setFillRule(Qt.FillRule.WindingFill)
            for x, y, radius in self._dabs:
                r = max(radius * self.width(), 2.0)
                outline.addEllipse(QPointF(x * self.width(), y * self.height()), r, r)
            self._outline = outline.simplified()
        painter.setBrush(Qt.BrushStyle.NoBrush)
        for pen in (QPen(QColor(0, 0, 0, 150), 2.4), QPen(QColor(255, 255, 255, 210), 1.0)):
            painter.setPen(pen)
            painter.drawPath(self._outline)

    def _draw_line(self, painter: QPainter, x: float) -> None:
        for pen in (QPen(QColor(0, 0, 0, 140), 3), QPen(QColor("white"), 1.2)):
            painter.setPen(pen)
            painter.drawLine(QPointF(x, 0), QPointF(x, self.height()))

    def _draw_tag(self, painter: QPainter, which: str, is_left: bool) -> None:
        """Names a picture, at the bottom of one side."""
        text = words.REVIEW_MODES[which][0]
        wide, high = painter.fontMetrics().horizontalAdvance(text) + 12, painter.fontMetrics().height() + 4
        left = TAG if is_left else self.width() - wide - TAG
        tag = QRectF(left, self.height() - high - TAG, wide, high)
        painter.setPen(Qt.PenStyle.NoPen)
        painter.setBrush(QColor(30, 30, 30, 190))
        painter.drawRoundedRect(tag, 3, 3)
        painter.setPen(QColor(theme.TEXT))
        painter.drawText(tag, Qt.AlignmentFlag.AlignCenter, text)
