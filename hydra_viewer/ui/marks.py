"""Marks: how strokes lie on the picture of a camera, laid once for each camera, and drawn."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from PySide6.QtCore import QPointF, Qt
from PySide6.QtGui import QColor, QPainter, QPainterPath, QPainterPathStroker, QPen, QPolygonF, QTransform

from hydra_viewer.ui.icons import SIZE, shape
from usdslf import Camera, Shot, Stroke, are_seen, project_points

DARK, LIGHT = QColor(0, 0, 0, 150), QColor(255, 255, 255, 220)
EVEN = 1.25  # greatest radius over the least, of a curve that is drawn as evenly wide


@dataclass(frozen=True, eq=False)
class Marks:
    """A stroke as it lies on the picture, what is hidden left out.

    Attributes:
        stroke: that it is of.
        outline: of what the brush covered [pixels].
        middle: of its points [pixels]; None: nothing of it is seen.
    """

    stroke: Stroke
    outline: QPainterPath
    middle: QPointF | None


def lay(stroke: Stroke, shot: Shot, camera: Camera, size: tuple[int, int]) -> Marks:
    """Returns a stroke's marks.

    Args:
        size: of the picture [logical pixels].
    """
    width, height = size
    aspect = width / max(height, 1)
    s = stroke.seen_from(shot.scene.origin)
    at, _ = project_points(camera, s.points, aspect)
    side, _ = project_points(camera, s.points + camera.world_from_camera[:3, 0], aspect)
    pixels = at * [width, height]
    radius = 0.5 * s.widths * np.abs(side[:, 0] - at[:, 0]) * width
    is_seen = are_seen(shot, camera, s.points, aspect) & np.isfinite(radius)
    outline = QPainterPath()
    outline.setFillRule(Qt.FillRule.WindingFill)
    cuts = np.cumsum(s.counts)[:-1]
    for rows in np.split(np.arange(len(pixels)), cuts):
        for part in np.split(rows, np.flatnonzero(np.diff(is_seen[rows].astype(int))) + 1):
            if len(part) and is_seen[part[0]]:
                outline.addPath(_swept(pixels[part], radius[part]))
    middle = QPointF(*pixels[is_seen].mean(0)) if is_seen.any() else None
    return Marks(stroke, outline.simplified(), middle)


def draw_marks(painter: QPainter, marks: Marks, paint: QColor | None) -> None:
    """Draws a stroke.

    Args:
        paint: its colour on the screen; None: its outline alone.
    """
    if paint is not None:
        painter.fillPath(marks.outline, paint)
    painter.setBrush(Qt.BrushStyle.NoBrush)
    for pen in (QPen(DARK, 2.6), QPen(LIGHT, 1.0)):
        painter.setPen(pen)
        painter.drawPath(marks.outline)
    if marks.stroke.tool == "fixate" and marks.middle is not None:
        draw_lock(painter, marks.middle)


def draw_lock(painter: QPainter, at: QPointF) -> None:
    """Draws a lock on the surface."""
    lock = QTransform.fromTranslate(at.x() - SIZE / 2, at.y() - SIZE / 2).map(shape("fixate"))
    painter.setBrush(QColor(0, 0, 0, 120))
    for color, width in ((QColor(0, 0, 0, 190), 4.0), (QColor("white"), 1.6)):
        painter.setPen(QPen(color, width, Qt.PenStyle.SolidLine, Qt.PenCapStyle.RoundCap))
        painter.drawPath(lock)
        painter.setBrush(Qt.BrushStyle.NoBrush)


def draw_cross(painter: QPainter, at: QPointF) -> None:
    """Draws a cross with a ring, where tool clone copies from."""
    for pen in (QPen(DARK, 3.0), QPen(LIGHT, 1.4)):
        painter.setPen(pen)
        painter.drawEllipse(at, 6, 6)
        painter.drawLine(QPointF(at.x() - 10, at.y()), QPointF(at.x() + 10, at.y()))
        painter.drawLine(QPointF(at.x(), at.y() - 10), QPointF(at.x(), at.y() + 10))


def _swept(curve: NDArray, radii: NDArray) -> QPainterPath:
    """What a disk covers that moves along a curve."""
    path = QPainterPath()
    if len(curve) > 1 and radii.max() < EVEN * radii.min():
        line = QPolygonF([QPointF(*p) for p in curve])
        path.addPolygon(line)
        stroker = QPainterPathStroker()
        stroker.setWidth(2 * float(radii.mean()))
        stroker.setCapStyle(Qt.PenCapStyle.RoundCap)
        stroker.setJoinStyle(Qt.PenJoinStyle.RoundJoin)
        return stroker.createStroke(path)
    path.setFillRule(Qt.FillRule.WindingFill)
    for (x, y), r in zip(curve, radii):
        path.addEllipse(QPointF(x, y), r, r)
    for (a, b), r in zip(pairwise(curve), np.minimum(radii[:-1], radii[1:])):
        along = b - a
        length = float(np.hypot(*along))
        if length > 1e-6:
            side = np.array([-along[1], along[0]]) / length * r
            corners = [a + side, b + side, b - side, a - side]
            path.moveTo(QPointF(*corners[0]))
            for corner in corners[1:]:
                path.lineTo(QPointF(*corner))
            path.closeSubpath()
    return path
