"""Swatches: colours and values as the screen shows them, before and after."""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray
from PySide6.QtCore import QPointF, QRectF, QSize, Qt
from PySide6.QtGui import QColor, QIcon, QImage, QPainter, QPaintEvent, QPen, QPixmap
from PySide6.QtWidgets import QSizePolicy, QWidget

from hydra_viewer.model.brush_color import shot_color, shown_colors
from hydra_viewer.model.display import DisplaySettings, display_codes
from hydra_viewer.ui import theme
from usdslf import Color, Shot

EDGE = QColor("#262626")
ROW = QSize(120, 20)  # pixels, at least


def shown(linear: Sequence[float] | NDArray, shot: Shot, display: DisplaySettings) -> QColor:
    """Returns what the screen shows of a colour.

    Args:
        linear: (3,) scene-linear.
        shot: whose colour conversions are used.
        display: of the picture beside it.
    """
    r, g, b = (float(c) for c in np.asarray(linear))
    return QColor.fromRgbF(*_codes((r, g, b), display, shot_color(shot)))


@lru_cache(maxsize=1024)
def _codes(linear: tuple[float, float, float], display: DisplaySettings, color: Color) -> tuple[float, float, float]:
    """Code values of a colour: a conversion takes a millisecond, and the same ones are shown again and again."""
    r, g, b = (float(c) for c in shown_colors(linear, display, color)[0])
    return r, g, b


def shown_picture(linear: NDArray, shot: Shot, display: DisplaySettings) -> QImage:
    """Returns what the screen shows of a picture (h, w, 3), scene-linear."""
    return image_of(display_codes(linear, display, shot_color(shot)))


def image_of(codes: NDArray[np.uint8]) -> QImage:
    """Returns code values (h, w, 3) as an image."""
    codes = np.ascontiguousarray(codes)
    h, w = codes.shape[:2]
    return QImage(codes.data, w, h, 3 * w, QImage.Format.Format_RGB888).copy()


def swatch_icon(color: QColor, size: int = 14) -> QIcon:
    """Returns a square of a colour."""
    pixmap = QPixmap(2 * size, 2 * size)
    pixmap.setDevicePixelRatio(2)
    pixmap.fill(Qt.GlobalColor.transparent)
    painter = QPainter(pixmap)
    painter.setRenderHint(QPainter.RenderHint.Antialiasing)
    painter.setPen(QPen(EDGE, 1))
    painter.setBrush(color)
    painter.drawRoundedRect(QRectF(0.5, 0.5, size - 1, size - 1), 2, 2)
    painter.end()
    return true_icon(pixmap)


def true_icon(pixmap: QPixmap) -> QIcon:
    """Returns an icon of colours that people judge: a selected row does not tint it."""
    found = QIcon(pixmap)
    found.addPixmap(pixmap, QIcon.Mode.Selected)
    return found


class _Row(QWidget):
    """A line of a card, as wide as there is room."""

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.setFixedHeight(ROW.height())
        self.setSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Fixed)

    def sizeHint(self) -> QSize:
        return ROW


class ColorChange(_Row):
    """A colour before and after, side by side."""

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._colors = QColor(), QColor()

    def show_colors(self, before: QColor, after: QColor) -> None:
        """Shows a colour before and after."""
        self._colors = before, after
        self.update()

    def paintEvent(self, event: QPaintEvent) -> None:
        painter = QPainter(self)
        painter.setRenderHint(QPainter.RenderHint.Antialiasing)
        painter.setPen(QPen(EDGE, 1))
        gap = 18.0
        wide = (self.width() - gap) / 2 - 0.5
        for x, color in zip((0.5, wide + gap), self._colors):
            painter.setBrush(color)
            painter.drawRoundedRect(QRectF(x, 0.5, wide, self.height() - 1), 2, 2)
        _draw_arrow(painter, QPointF(wide + gap / 2, self.height() / 2))


class ValueChange(_Row):
    """A value 0..1 on a line: where it was, where it is, and the range that the paint allows."""

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._before = self._after = 0.0
        self._ends: tuple[float, float] | None = None

    def show_values(self, before: float, after: float, ends: tuple[float, float] | None) -> None:
        """Shows a value before and after, and the ends of its range; None: not known."""
        self._before, self._after, self._ends = before, after, ends
        self.update()

    def paintEvent(self, event: QPaintEvent) -> None:
        painter = QPainter(self)
        painter.setRenderHint(QPainter.RenderHint.Antialiasing)
        y, left, wide = self.height() / 2, 6.0, self.width() - 12.0
        at = lambda value: left + wide * min(max(value, 0.0), 1.0)  # noqa: E731
        painter.setPen(QPen(QColor(theme.FIELD), 4, Qt.PenStyle.SolidLine, Qt.PenCapStyle.RoundCap))
        painter.drawLine(QPointF(left, y), QPointF(left + wide, y))
        if self._ends is not None:
            painter.setPen(QPen(QColor("#7d6a2a"), 8, Qt.PenStyle.SolidLine, Qt.PenCapStyle.FlatCap))
            low, high = at(self._ends[0]), at(self._ends[1])
            painter.drawLine(QPointF(low, y), QPointF(max(high, low + 2), y))
        painter.setPen(QPen(QColor(theme.DIM), 1.5))
        painter.setBrush(QColor(theme.PANEL))
        painter.drawEllipse(QPointF(at(self._before), y), 3.6, 3.6)
        painter.setPen(QPen(QColor("#262626"), 1))
        painter.setBrush(QColor(theme.ACCENT))
        painter.drawEllipse(QPointF(at(self._after), y), 5, 5)


def _draw_arrow(painter: QPainter, at: QPointF) -> None:
    painter.setPen(QPen(QColor(theme.DIM), 1.5, Qt.PenStyle.SolidLine, Qt.PenCapStyle.RoundCap))
    x, y = at.x(), at.y()
    painter.drawLine(QPointF(x - 5, y), QPointF(x + 5, y))
    painter.drawLine(QPointF(x + 2, y - 3), QPointF(x + 5, y))
    painter.drawLine(QPointF(x + 2, y + 3), QPointF(x + 5, y))
