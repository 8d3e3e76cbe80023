"""Overlay: what is drawn over the picture: strokes, the brush on the surface, the film's frame, marks.

It takes no events; the canvas below it does.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray
from PySide6.QtCore import QPointF, QRectF, Qt
from PySide6.QtGui import QColor, QPainter, QPainterPath, QPaintEvent, QPen
from PySide6.QtWidgets import QWidget

from hydra_viewer.model.display import display_codes
from usdslf import Camera, Pick, Stroke, color_of, film_aspect, pick, project_points

if TYPE_CHECKING:
    from hydra_viewer.model.document import Document
    from hydra_viewer.model.easel import Easel
    from hydra_viewer.model.painting import PenPath

RING = 48  # corners of the brush's ring
DARK, LIGHT = QColor(0, 0, 0, 150), QColor(255, 255, 255, 220)


@dataclass(frozen=True, eq=False)
class _Marks:
    """A stroke as it lies on the picture."""

    stroke: Stroke
    outline: QPainterPath


class Overlay(QWidget):
    """Strokes, brush and marks over the picture."""

    def __init__(self, document: Document, easel: Easel, parent: QWidget) -> None:
        super().__init__(parent)
        self.setAttribute(Qt.WidgetAttribute.WA_TransparentForMouseEvents)
        self.setAttribute(Qt.WidgetAttribute.WA_NoSystemBackground)
        self._document, self._easel = document, easel
        self._path: PenPath | None = None
        self._at: tuple[float, float] | None = None
        self._seen: Pick | None = None
        self._laid: list[_Marks] = []
        self._laid_as: tuple[int, ...] = ()
        document.strokes_changed.connect(self.update)
        easel.brush_changed.connect(self.update)
        easel.drawn_changed.connect(self.update)

    def draw_path(self, path: PenPath | None) -> None:
        """Draws the stroke that is being painted; None: none is."""
        self._path = path
        self.update()

    def point_at(self, at: tuple[float, float] | None) -> None:
        """Draws the brush at a pixel of the widget; None: nowhere."""
        self._at = at
        shot, view = self._document.shot, self._easel.view
        self._seen = None
        if at is not None and shot is not None and view is not None:
            place = at[0] / max(self.width(), 1), at[1] / max(self.height(), 1)
            self._seen = pick(shot, view.camera, place, self._aspect)
        self.update()

    @property
    def _aspect(self) -> float:
        return self.width() / max(self.height(), 1)

    def paintEvent(self, event: QPaintEvent) -> None:
        view = self._easel.view
        if view is None or self._document.shot is None:
            return
        painter = QPainter(self)
        painter.setRenderHint(QPainter.RenderHint.Antialiasing)
        if self._easel.drawn != "hidden":
            for marks in self._marks(view.camera):
                self._draw_stroke(painter, marks)
        if self._easel.has_gate:
            self._draw_gate(painter, view.camera)
        if self._path is not None:
            self._draw_path(painter, self._path)
        if self._at is not None and self._easel.pointer == "paint":
            self._draw_brush(painter, view.camera, self._at)

    # ── strokes ────────────────────────────────────────────────────────────────────────────────

    def _marks(self, camera: Camera) -> list[_Marks]:
        """The strokes on the picture, laid anew only where camera, size or strokes changed."""
        key = (id(camera), self.width(), self.height(), *(id(s) for s in self._document.active))
        if self._laid_as != key:
            self._laid, self._laid_as = [self._lay(s, camera) for s in self._document.active], key
        return self._laid

    def _lay(self, stroke: Stroke, camera: Camera) -> _Marks:
        shot = self._document.shot
        assert shot is not None
        s = stroke.seen_from(shot.scene.origin)
        at, _ = project_points(camera, s.points, self._aspect)
        side, _ = project_points(camera, s.points + camera.world_from_camera[:3, 0], self._aspect)
        pixels = at * [self.width(), self.height()]
        radius = 0.5 * s.widths * np.abs(side[:, 0] - at[:, 0]) * self.width()
        cuts = np.cumsum(s.counts)[:-1]
        outline = QPainterPath()
        outline.setFillRule(Qt.FillRule.WindingFill)
        for curve, radii in zip(np.split(pixels, cuts), np.split(radius, cuts)):
            if np.isfinite(curve).all() and np.isfinite(radii).all():
                outline.addPath(_swept(curve, radii))
        return _Marks(s, outline.simplified())

    def _draw_stroke(self, painter: QPainter, marks: _Marks) -> None:
        is_raw = self._easel.drawn == "paint"
        color = self._shown(marks.stroke.colors.mean(0)) if is_raw else QColor(0, 0, 0, 0)
        if is_raw:
            painter.fillPath(marks.outline, color)
        painter.setBrush(Qt.BrushStyle.NoBrush)
        for pen in (QPen(DARK, 2.6), QPen(LIGHT, 1.0)):
            painter.setPen(pen)
            painter.drawPath(marks.outline)

    def _draw_path(self, painter: QPainter, path: PenPath) -> None:
        brush = self._easel.brush
        places = np.array(path.places) * [self.width(), self.height(), 1]
        radius = brush.radius * self.height()
        color = self._shown(np.array(brush.color))
        pen = QPen(color, 2 * radius, Qt.PenStyle.SolidLine, Qt.PenCapStyle.RoundCap, Qt.PenJoinStyle.RoundJoin)
        for a, b in pairwise(places):
            pen.setWidthF(2 * radius * (max(float(b[2]), 0.1) if brush.uses_pressure else 1.0))
            painter.setPen(pen)
            painter.drawLine(QPointF(a[0], a[1]), QPointF(b[0], b[1]))
        if len(places) == 1:
            painter.setPen(Qt.PenStyle.NoPen)
            painter.setBrush(color)
            r = radius * (max(float(places[0, 2]), 0.1) if brush.uses_pressure else 1.0)
            painter.drawEllipse(QPointF(places[0, 0], places[0, 1]), r, r)

    def _shown(self, linear: NDArray) -> QColor:
        shot = self._document.shot
        assert shot is not None
        color = color_of(shot.scene.ocio or None, shot.scene.working_space)
        codes = display_codes(np.asarray(linear, np.float32)[None, None], self._easel.display, color)
        return QColor(*(int(c) for c in codes[0, 0]))

    # ── the brush, and the film's frame ────────────────────────────────────────────────────────

    def _draw_brush(self, painter: QPainter, camera: Camera, at: tuple[float, float]) -> None:
        """A ring on the surface, about its normal; a circle where there is none."""
        radius = self._easel.brush.radius * self.height()
        ring = self._ring(camera)
        painter.setBrush(Qt.BrushStyle.NoBrush)
        for pen in (QPen(DARK, 2.6), QPen(LIGHT, 1.2)):
            painter.setPen(pen)
            if ring is None:
                painter.drawEllipse(QPointF(*at), radius, radius)
            else:
                painter.drawPolygon([QPointF(x, y) for x, y in ring])

    def _ring(self, camera: Camera) -> NDArray | None:
        seen = self._seen
        if seen is None:
            return None
        here, _ = project_points(camera, seen.point[None], self._aspect)
        above, _ = project_points(camera, seen.point[None] + camera.world_from_camera[:3, 1], self._aspect)
        radius = self._easel.brush.radius / max(abs(float(above[0, 1] - here[0, 1])), 1e-9)
        normal = seen.normal.astype(np.float64)
        across = np.cross(normal, [1.0, 0, 0] if abs(normal[0]) < 0.7 else [0, 1.0, 0])
        across /= np.linalg.norm(across)
        angle = np.linspace(0, 2 * np.pi, RING, endpoint=False)[:, None]
        points = seen.point + radius * (np.cos(angle) * across + np.sin(angle) * np.cross(normal, across))
        ring, _ = project_points(camera, points, self._aspect)
        return ring * [self.width(), self.height()] if np.isfinite(ring).all() else None

    def _draw_gate(self, painter: QPainter, camera: Camera) -> None:
        """The frame of the film; what lies outside it is dimmed."""
        w, h, aspect = self.width(), self.height(), film_aspect(camera)
        wide, high = min(w, h * aspect), min(h, w / aspect)
        gate = QRectF((w - wide) / 2, (h - high) / 2, wide, high)
        outside = QPainterPath()
        outside.addRect(QRectF(self.rect()))
        inside = QPainterPath()
        inside.addRect(gate)
        painter.fillPath(outside - inside, QColor(0, 0, 0, 130))
        painter.setPen(QPen(LIGHT, 1))
        painter.setBrush(Qt.BrushStyle.NoBrush)
        painter.drawRect(gate)


def _swept(curve: NDArray, radii: NDArray) -> QPainterPath:
    """What a disk covers that moves along a curve."""
    path = QPainterPath()
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
