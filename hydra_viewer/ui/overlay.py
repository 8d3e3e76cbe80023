"""Overlay: what is drawn over the picture: strokes, the brush on the surface, what is selected, the film's frame.

It takes no events; the canvas below it does.
"""

from __future__ import annotations

import time
from dataclasses import dataclass
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray
from PySide6.QtCore import QPointF, QRect, QRectF, QSize, Qt, QTimer
from PySide6.QtGui import QColor, QImage, QPainter, QPainterPath, QPaintEvent, QPen, QPixmap, QPolygonF
from PySide6.QtWidgets import QWidget

from hydra_viewer.model.brush_color import shot_color, shown_colors
from hydra_viewer.ui import theme
from hydra_viewer.ui.marks import DARK, LIGHT, Marks, draw_cross, draw_marks, lay
from usdslf import Camera, Pick, Stroke, film_aspect, pick, project_points

if TYPE_CHECKING:
    from hydra_viewer.model.document import Document
    from hydra_viewer.model.easel import Easel
    from hydra_viewer.model.painting import PenPath

RING = 48  # corners of the brush's ring
LEAST_PRESSURE = 0.1
LAYING, DRAWING = 0.015, 0.01  # seconds at a time in which strokes are laid on the picture, and drawn


class _Same:
    """Equal to what holds the same object; it holds it, so that no other one gets its address."""

    def __init__(self, held: object) -> None:
        self._held = held

    def __eq__(self, other: object) -> bool:
        return isinstance(other, _Same) and other._held is self._held

    def __hash__(self) -> int:
        return id(self._held)


@dataclass(frozen=True, eq=False)
class _Layer:
    """Strokes that are drawn.

    Attributes:
        view: camera and size that they are drawn for.
        looks: marks and colour of each.
        picture: with all of them.
    """

    view: tuple[object, ...]
    looks: list[tuple[Marks, int]]
    picture: QPixmap

    @staticmethod
    def of(view: tuple[object, ...], size: QSize, ratio: float) -> _Layer:
        """Returns one with nothing drawn."""
        picture = QPixmap(size * ratio)
        picture.setDevicePixelRatio(ratio)
        picture.fill(Qt.GlobalColor.transparent)
        return _Layer(view, [], picture)

    def begins(self, view: tuple[object, ...], looks: list[tuple[Marks, int]]) -> bool:
        """Whether what is wanted begins with what is drawn."""
        return self.view == view and self.looks == looks[: len(self.looks)]

    def going_on(self, drawn: list[tuple[Marks, QColor | None]], looks: list[tuple[Marks, int]]) -> _Layer:
        """Returns one with more of what is wanted, as much as is quick."""
        picture, done, until = QPixmap(self.picture), len(self.looks), time.perf_counter() + DRAWING
        painter = QPainter(picture)
        painter.setRenderHint(QPainter.RenderHint.Antialiasing)
        while done < len(drawn) and (done == len(self.looks) or time.perf_counter() < until):
            draw_marks(painter, *drawn[done])
            done += 1
        painter.end()
        return _Layer(self.view, looks[:done], picture)


class Overlay(QWidget):
    """Strokes, brush and marks over the picture.

    Attributes:
        path: of the stroke that is being painted; None: none is.
    """

    def __init__(self, document: Document, easel: Easel, parent: QWidget) -> None:
        super().__init__(parent)
        self.setAttribute(Qt.WidgetAttribute.WA_TransparentForMouseEvents)
        self.setAttribute(Qt.WidgetAttribute.WA_NoSystemBackground)
        self._document, self._easel = document, easel
        self._rims: dict[str, QImage] = {}
        self.path: PenPath | None = None
        self._at: tuple[float, float] | None = None
        self._seen: Pick | None = None
        self._has_focus_ring = False
        self._ring: QPolygonF | None = None
        self._ring_of: tuple[Pick | None, Camera | None] = None, None
        self._ring_size = 0.0, 0
        self._laid: dict[int, Marks] = {}  # by stroke
        self._laid_as: tuple[object, ...] = ()
        self._colors: dict[tuple[float, ...], QColor] = {}
        for announcer in (document.shot_changed, easel.display_changed):
            announcer.connect(self._colors.clear)
        self._layer = self._next_layer = _Layer((), [], QPixmap())  # what is shown, and what is being drawn
        for announcer in (document.strokes_changed, easel.brush_changed, easel.drawn_changed):
            announcer.connect(self.update)

    def draw_path(self, path: PenPath | None) -> None:
        """Draws the stroke that is being painted; None: none is."""
        self.path = path
        self.update()

    def point_at(self, at: tuple[float, float] | None) -> None:
        """Draws the brush at a pixel of the widget; None: nowhere."""
        shot, view = self._document.shot, self._easel.view
        before = self._brush_rect()
        self._at, self._seen = at, None
        if at is not None and shot is not None and view is not None and self._easel.pointer == "paint":
            place = at[0] / max(self.width(), 1), at[1] / max(self.height(), 1)
            self._seen = pick(shot, view.camera, place, self._aspect)
        if self.path is None:
            self.update(before.united(self._brush_rect()))

    def set_focus_ring(self, is_there: bool) -> None:
        """Shows that keys come here, or not."""
        self._has_focus_ring = is_there
        self.update()

    def set_rim(self, name: str, rim: QImage | None) -> None:
        """Draws the rim of something, in place of the one of the same name; None: no more."""
        self._rims.pop(name, None)
        if rim is not None:
            self._rims[name] = rim
        self.update()

    @property
    def rim_names(self) -> tuple[str, ...]:
        """Of the rims that are drawn."""
        return tuple(self._rims)

    @property
    def _aspect(self) -> float:
        return self.width() / max(self.height(), 1)

    def _brush_rect(self) -> QRect:
        """What the brush's ring may cover."""
        if self._at is None:
            return QRect()
        r = int(2.5 * self._easel.brush.radius * self.height()) + 8
        return QRect(int(self._at[0]) - r, int(self._at[1]) - r, 2 * r, 2 * r)

    def paintEvent(self, event: QPaintEvent) -> None:
        view = self._easel.view
        if view is None or self._document.shot is None:
            return
        painter = QPainter(self)
        painter.setRenderHint(QPainter.RenderHint.Antialiasing)
        painter.setRenderHint(QPainter.RenderHint.SmoothPixmapTransform)
        if not self._easel.is_moving:
            for rim in self._rims.values():
                painter.drawImage(self.rect(), rim)
        painter.drawPixmap(0, 0, self._strokes_drawn(view.camera))
        if self._easel.has_gate:
            self._draw_gate(painter, view.camera)
        if self._easel.brush.tool == "clone":
            self._draw_source(painter, view.camera)
        if self.path is not None:
            self._draw_path(painter, self.path)
        if self._at is not None and self._easel.pointer == "paint":
            self._draw_brush(painter, view.camera, self._at)
        if self._has_focus_ring:
            painter.setBrush(Qt.BrushStyle.NoBrush)
            painter.setPen(QPen(QColor(theme.FOCUS), 2))
            painter.drawRect(self.rect().adjusted(1, 1, -1, -1))
        painter.end()  # not when the frame goes, which a profiler may keep

    # ── strokes ────────────────────────────────────────────────────────────────────────────────

    def _strokes_drawn(self, camera: Camera) -> QPixmap:
        """The strokes, drawn anew only where they look otherwise than before.

        As many as are quick: the others follow at once, and until then those that were drawn before stay.
        """
        drawn = [
            (m, self._paint_of(m)) for m in self._marks(camera)
            if self._easel.drawn != "hidden" or self._is_awaited(m.stroke)
        ]  # fmt: skip
        view = *self._laid_as, self.devicePixelRatioF()
        looks = [(m, paint.rgba() if paint is not None else 0) for m, paint in drawn]
        layers = [each for each in (self._next_layer, self._layer) if each.begins(view, looks)]
        layer = layers[0] if layers else _Layer.of(view, self.size(), self.devicePixelRatioF())
        if len(layer.looks) < len(looks):
            layer = layer.going_on(drawn, looks)
        self._next_layer = layer
        if len(layer.looks) == len(looks) or self._layer.view != view:
            self._layer = layer
        if len(layer.looks) < len(looks):
            QTimer.singleShot(0, self, self.update)
        return self._layer.picture

    def _marks(self, camera: Camera) -> list[Marks]:
        """The strokes on the picture; those that are new, or all where the camera moved, are laid.

        As many as are quick: the others follow at once, or when the camera rests.
        """
        shot = self._document.shot
        assert shot is not None
        key = (_Same(camera), _Same(shot), self.width(), self.height())
        known = self._laid if key == self._laid_as else {}
        size, until = (self.width(), self.height()), time.perf_counter() + LAYING
        self._laid, self._laid_as = {}, key
        for stroke in self._document.active:
            marks = known.get(id(stroke))
            if marks is not None and marks.stroke is stroke:
                self._laid[id(stroke)] = marks
            elif time.perf_counter() < until:
                self._laid[id(stroke)] = lay(stroke, shot, camera, size)
        if len(self._laid) < len(self._document.active) and not self._easel.is_moving:
            QTimer.singleShot(0, self, self.update)
        return list(self._laid.values())

    def _is_awaited(self, stroke: Stroke) -> bool:
        """Whether what a stroke asks for is not shown yet: its paint is, raw, until then."""
        found = self._document.found
        return found is None or found.shot is None or all(s is not stroke for s in found.strokes)

    def _paint_of(self, marks: Marks) -> QColor | None:
        stroke = marks.stroke
        if self._is_awaited(stroke) or (self._easel.drawn == "paint" and stroke.tool != "fixate"):
            return self._raw_color(stroke.tool, stroke.colors.mean(0))
        return None

    def _draw_path(self, painter: QPainter, path: PenPath) -> None:
        """The stroke as it is painted, raw."""
        brush = self._easel.brush
        places = np.array(path.places) * [self.width(), self.height(), 1]
        share = np.maximum(places[:, 2], LEAST_PRESSURE) if brush.uses_pressure else np.ones(len(places))
        widths = 2 * brush.radius * self.height() * share
        raw = self._raw_color(brush.tool, np.array(brush.color))
        pen = QPen(raw, 1, Qt.PenStyle.SolidLine, Qt.PenCapStyle.RoundCap, Qt.PenJoinStyle.RoundJoin)
        dots = [*pairwise(places[:, :2]), (places[-1, :2], places[-1, :2] + [0.01, 0])]
        for (a, b), width in zip(dots, (*widths[1:], widths[-1])):
            pen.setWidthF(float(width))
            painter.setPen(pen)
            painter.drawLine(QPointF(*a), QPointF(*b))

    def _raw_color(self, tool: str, color: NDArray) -> QColor:
        """Of paint on the screen; tools without a colour are drawn in a veil."""
        veils = {
            "brighten": QColor(255, 255, 255, 110), "darken": QColor(0, 0, 0, 110), "blur": QColor(150, 170, 200, 110),
            "sharpen": QColor(230, 210, 150, 110), "fixate": QColor(90, 90, 90, 140),
            "clone": QColor(150, 200, 160, 120),
        }  # fmt: skip
        return veils[tool] if tool in veils else self._shown(color)

    def _shown(self, linear: NDArray) -> QColor:
        """A colour on the screen, looked up where it was shown before."""
        shot, key = self._document.shot, tuple(linear.tolist())
        assert shot is not None
        if key not in self._colors:
            r, g, b = (float(c) for c in shown_colors(linear, self._easel.display, shot_color(shot))[0])
            self._colors[key] = QColor.fromRgbF(r, g, b)
        return self._colors[key]

    # ── the brush, and the film's frame ────────────────────────────────────────────────────────

    def _draw_brush(self, painter: QPainter, camera: Camera, at: tuple[float, float]) -> None:
        """A ring on the surface, about its normal; a circle where there is none."""
        radius = self._easel.brush.radius * self.height()
        size = radius, self.width()
        if self._ring_of[0] is not self._seen or self._ring_of[1] is not camera or self._ring_size != size:
            self._ring = self._ring_on(self._seen, camera)
            self._ring_of, self._ring_size = (self._seen, camera), size
        painter.setBrush(Qt.BrushStyle.NoBrush)
        for pen in (QPen(DARK, 2.6), QPen(LIGHT, 1.2)):
            painter.setPen(pen)
            if self._ring is None:
                painter.drawEllipse(QPointF(*at), radius, radius)
            else:
                painter.drawPolygon(self._ring)
        painter.drawPoint(QPointF(*at))

    def _ring_on(self, seen: Pick | None, camera: Camera) -> QPolygonF | None:
        if seen is None:
            return None
        here, _ = project_points(camera, seen.point[None], self._aspect)
        above, _ = project_points(camera, seen.point[None] + camera.world_from_camera[:3, 1], self._aspect)
        radius = self._easel.brush.radius / max(abs(float(above[0, 1] - here[0, 1])), 1e-9)
        normal = seen.normal.astype(np.float64)
        across = np.cross(normal, [1.0, 0, 0] if abs(normal[0]) < 0.7 else [0, 1.0, 0])
        across /= max(float(np.linalg.norm(across)), 1e-12)
        angle = np.linspace(0, 2 * np.pi, RING, endpoint=False)[:, None]
        points = seen.point + radius * (np.cos(angle) * across + np.sin(angle) * np.cross(normal, across))
        ring, _ = project_points(camera, points, self._aspect)
        if not np.isfinite(ring).all():
            return None
        return QPolygonF([QPointF(x * self.width(), y * self.height()) for x, y in ring.tolist()])

    def _draw_source(self, painter: QPainter, camera: Camera) -> None:
        """Where tool clone copies from."""
        source = self._easel.brush.clone_source
        if source is not None:
            at, _ = project_points(camera, np.array([source]), self._aspect)
            if np.isfinite(at).all():
                draw_cross(painter, QPointF(at[0, 0] * self.width(), at[0, 1] * self.height()))

    def _draw_gate(self, painter: QPainter, camera: Camera) -> None:
        """The frame of the film; what lies outside it is dimmed."""
        w, h, aspect = self.width(), self.height(), film_aspect(camera)
        wide, high = min(w, h * aspect), min(h, w / aspect)
        gate = QRectF((w - wide) / 2, (h - high) / 2, wide, high)
        outside, inside = QPainterPath(), QPainterPath()
        outside.addRect(QRectF(self.rect()))
        inside.addRect(gate)
        painter.fillPath(outside - inside, QColor(0, 0, 0, 130))
        painter.setPen(QPen(LIGHT, 1))
        painter.setBrush(Qt.BrushStyle.NoBrush)
        painter.drawRect(gate)
