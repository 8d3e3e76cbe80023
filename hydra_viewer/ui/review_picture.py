"""Review picture: a view before and after a look, wiped, their difference, or what changes by light alone."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from PySide6.QtCore import QPointF, QRect, QRectF, QSize, Qt
from PySide6.QtGui import (
    QColor,
    QImage,
    QKeyEvent,
    QMouseEvent,
    QPainter,
    QPainterPath,
    QPaintEvent,
    QPen,
    QResizeEvent,
)
from PySide6.QtWidgets import QSizePolicy, QWidget

from hydra_viewer.model.comparison import difference
from hydra_viewer.model.display import DisplaySettings
from hydra_viewer.model.reviewing import heat_map
from hydra_viewer.ui import panel_words as words
from hydra_viewer.ui import theme
from hydra_viewer.ui.swatches import shown_picture
from usdslf import Shot
from usdslf.review import Review

MODES = ("before", "after", "wipe", "difference", "indirect")
GAIN = 4.0  # of the difference
STEP = 0.02  # of the wipe, a key
TAG = 8  # between a tag and the picture's rim


class ReviewPicture(QWidget):
    """One view; left and right arrow or the mouse move the wipe.

    Attributes:
        mode: one of MODES.
        split: of the wipe, 0..1 of the width.
        images: by what they show.
        view: number of the view; -1: none.
    """

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.mode, self.split = "wipe", 0.5
        self.images: dict[str, QImage] = {}
        self.view = -1
        self._dabs: list[tuple[float, float, float]] = []
        self._outline = QPainterPath()
        self._aspect = 16 / 9
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
        apart = difference(p.after, p.before, GAIN * 2.0**lit.exposure)
        heat = np.ascontiguousarray(heat_map(p.indirect))
        h, w = heat.shape[:2]
        self.images = {
            "before": shown_picture(p.before, shot, lit), "after": shown_picture(p.after, shot, lit),
            "difference": shown_picture(apart, shot, DisplaySettings()),
            "indirect": QImage(heat.data, w, h, 3 * w, QImage.Format.Format_RGB888).copy(),
        }  # fmt: skip
        self._dabs, self._outline = [dab for stroke in seen.strokes for dab in stroke.dabs], QPainterPath()
        self.view, self._aspect = number, w / h
        self.updateGeometry()
        self.update()

    def clear(self) -> None:
        """Shows nothing."""
        self.images, self.view, self._dabs = {}, -1, []
        self.update()

    def set_mode(self, mode: str) -> None:
        """Shows it in one of MODES."""
        self.mode = mode
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
            painter.drawImage(r, self.images[self.mode])
        if self.images and self.mode != "indirect":
            self._draw_dabs(painter)
        if self.images and self.mode == "wipe":
            self._draw_line(painter, self.split * r.width())
        if self.hasFocus():
            painter.setBrush(Qt.BrushStyle.NoBrush)
            painter.setPen(QPen(QColor(theme.FOCUS), 2))
            painter.drawRect(QRectF(r).adjusted(1, 1, -1, -1))

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
        for text, flag in ((words.REVIEW_MODES["before"][0], Qt.AlignmentFlag.AlignLeft),
                           (words.REVIEW_MODES["after"][0], Qt.AlignmentFlag.AlignRight)):  # fmt: skip
            wide, high = painter.fontMetrics().horizontalAdvance(text) + 12, painter.fontMetrics().height() + 4
            left = TAG if flag == Qt.AlignmentFlag.AlignLeft else self.width() - wide - TAG
            tag = QRectF(left, self.height() - high - TAG, wide, high)
            painter.setPen(Qt.PenStyle.NoPen)
            painter.setBrush(QColor(30, 30, 30, 190))
            painter.drawRoundedRect(tag, 3, 3)
            painter.setPen(QColor(theme.TEXT))
            painter.drawText(tag, Qt.AlignmentFlag.AlignCenter, text)
