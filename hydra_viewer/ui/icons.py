"""Icons, drawn: a stroke of one grey, sharp at any size of pixel."""

from __future__ import annotations

from collections.abc import Callable
from math import cos, pi, sin

from PySide6.QtCore import QPointF, QRectF, Qt
from PySide6.QtGui import QColor, QIcon, QPainter, QPainterPath, QPen, QPixmap

from hydra_viewer.ui import theme

SIZE = 20  # of the drawing, and of an icon in logical pixels


def _brush(p: QPainterPath) -> None:
    p.moveTo(16.5, 3.5)
    p.lineTo(9.5, 10.5)
    p.moveTo(9.5, 10)
    p.cubicTo(6, 10, 6.5, 14.5, 3, 16)
    p.cubicTo(7, 17.5, 11, 15.5, 10.5, 11.5)


def _stamp(p: QPainterPath) -> None:
    p.addEllipse(QPointF(10, 5), 2.6, 2.6)
    for x in (8.8, 11.2):
        p.moveTo(x, 7.5)
        p.lineTo(x, 11)
    p.addRect(QRectF(4, 11, 12, 3))
    p.moveTo(4, 17)
    p.lineTo(16, 17)


def _sun(p: QPainterPath) -> None:
    p.addEllipse(QPointF(10, 10), 3.2, 3.2)
    for k in range(8):
        x, y = cos(k * pi / 4), sin(k * pi / 4)
        p.moveTo(10 + 5.2 * x, 10 + 5.2 * y)
        p.lineTo(10 + 7.4 * x, 10 + 7.4 * y)


def _moon(p: QPainterPath) -> None:
    whole, bite = QPainterPath(), QPainterPath()
    whole.addEllipse(QPointF(9.5, 10.5), 6.5, 6.5)
    bite.addEllipse(QPointF(12.5, 8), 5.6, 5.6)
    p.addPath(whole - bite)


def _drop(p: QPainterPath) -> None:
    p.moveTo(10, 3)
    p.cubicTo(13, 7.5, 15, 9.5, 15, 12)
    p.cubicTo(15, 18.5, 5, 18.5, 5, 12)
    p.cubicTo(5, 9.5, 7, 7.5, 10, 3)


def _edge(p: QPainterPath) -> None:
    p.moveTo(10, 3.5)
    p.lineTo(17, 16.5)
    p.lineTo(3, 16.5)
    p.closeSubpath()
    p.moveTo(10, 3.5)
    p.lineTo(10, 16.5)


def _lock(p: QPainterPath) -> None:
    p.addRoundedRect(QRectF(4.5, 9, 11, 8), 1.5, 1.5)
    p.moveTo(6.8, 9)
    p.lineTo(6.8, 6.5)
    p.cubicTo(6.8, 2.4, 13.2, 2.4, 13.2, 6.5)
    p.lineTo(13.2, 9)


def _arrow(p: QPainterPath) -> None:
    p.moveTo(5, 3)
    for x, y in ((5, 15), (8.2, 12.2), (10.4, 17), (12.4, 16), (10.2, 11.4), (14.5, 11)):
        p.lineTo(x, y)
    p.closeSubpath()


def _dropper(p: QPainterPath) -> None:
    p.moveTo(3, 17)
    for x, y in ((4, 13.5), (10.5, 7), (13, 9.5), (6.5, 16)):
        p.lineTo(x, y)
    p.closeSubpath()
    p.moveTo(9, 5.5)
    p.lineTo(14.5, 11)
    p.moveTo(12, 7.8)
    p.lineTo(15.5, 4.3)


def _play(p: QPainterPath) -> None:
    p.moveTo(6, 4)
    p.lineTo(16, 10)
    p.lineTo(6, 16)
    p.closeSubpath()


def _pause(p: QPainterPath) -> None:
    p.addRect(QRectF(5.5, 4, 3, 12))
    p.addRect(QRectF(11.5, 4, 3, 12))


def _gate(p: QPainterPath) -> None:
    p.addRect(QRectF(2.5, 4, 15, 12))
    p.addRect(QRectF(5, 6.5, 10, 7))


SHAPES: dict[str, Callable[[QPainterPath], None]] = {
    "replace": _brush, "clone": _stamp, "brighten": _sun, "darken": _moon, "blur": _drop, "sharpen": _edge,
    "fixate": _lock, "select": _arrow, "paint": _brush, "eyedropper": _dropper, "play": _play, "pause": _pause,
    "gate": _gate,
}  # fmt: skip


def shape(name: str) -> QPainterPath:
    """Returns the lines of an icon, in a square of SIZE."""
    path = QPainterPath()
    SHAPES[name](path)
    return path


def icon(name: str) -> QIcon:
    """Returns an icon by its name, one of SHAPES."""
    made = QIcon()
    for state, color in ((QIcon.Mode.Normal, theme.TEXT), (QIcon.Mode.Disabled, "#777777")):
        for scale in (1, 2):
            pixmap = QPixmap(SIZE * scale, SIZE * scale)
            pixmap.setDevicePixelRatio(scale)
            pixmap.fill(Qt.GlobalColor.transparent)
            painter = QPainter(pixmap)
            painter.setRenderHint(QPainter.RenderHint.Antialiasing)
            painter.setPen(
                QPen(QColor(color), 1.5, Qt.PenStyle.SolidLine, Qt.PenCapStyle.RoundCap, Qt.PenJoinStyle.RoundJoin)
            )
            painter.drawPath(shape(name))
            painter.end()
            made.addPixmap(pixmap, state)
    return made
