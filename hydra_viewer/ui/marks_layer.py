"""Marks layer: what a scope covers and where to dab next, over the picture."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from PySide6.QtCore import QEvent, QObject, QPointF, QRectF, Qt
from PySide6.QtGui import QColor, QFontMetrics, QImage, QPainter, QPaintEvent, QPen
from PySide6.QtWidgets import QWidget

from hydra_viewer.model.document import Document
from hydra_viewer.model.easel import Easel
from hydra_viewer.model.understanding import title_of
from hydra_viewer.ui import panel_words as words
from hydra_viewer.ui import theme
from hydra_viewer.ui.explaining import Explaining, Marked
from hydra_viewer.ui.highlight import rim
from hydra_viewer.ui.swatches import shown
from usdslf import project_points

RADIUS = 13.0


class MarksLayer(QWidget):
    """Lies over another widget, whose size it has; takes no events."""

    def __init__(self, document: Document, easel: Easel, explaining: Explaining, below: QWidget) -> None:
        super().__init__(below)
        self._document, self._easel, self._explaining = document, easel, explaining
        self._mask: NDArray | None = None
        self._image = QImage()
        self.setAttribute(Qt.WidgetAttribute.WA_TransparentForMouseEvents)
        self.setAttribute(Qt.WidgetAttribute.WA_NoSystemBackground)
        below.installEventFilter(self)
        explaining.marks_changed.connect(self.update)
        easel.view_changed.connect(self._on_view_changed)
        self._fit(below)

    def eventFilter(self, watched: QObject, event: QEvent) -> bool:
        """Keeps the size of what it lies over."""
        if event.type() == QEvent.Type.Resize and isinstance(watched, QWidget):
            self._fit(watched)
        return False

    def _fit(self, below: QWidget) -> None:
        self.setGeometry(below.rect())
        self._explaining.aspect = below.width() / max(below.height(), 1)

    def _on_view_changed(self) -> None:
        self._explaining.hide_scope()  # it is of another camera
        self.update()

    def paintEvent(self, event: QPaintEvent) -> None:
        painter = QPainter(self)
        painter.setRenderHint(QPainter.RenderHint.Antialiasing)
        painter.setRenderHint(QPainter.RenderHint.SmoothPixmapTransform)
        mask = self._explaining.mask
        if mask is not None:
            if mask is not self._mask:
                self._mask, self._image = mask, rim(mask > 0, QColor(theme.COVERED), hatched=True)
            painter.drawImage(self.rect(), self._image)
        if self._explaining.marked is not None:
            self._draw_dab(painter, self._explaining.marked)

    # ── where to dab next ──────────────────────────────────────────────────────────────────────

    @property
    def dab_place(self) -> QPointF | None:
        """Where the mark is [pixels]; None: there is none on the picture."""
        marked, view = self._explaining.marked, self._easel.view
        if marked is None or view is None:
            return None
        aspect = self.width() / max(self.height(), 1)
        at, _ = project_points(view.camera, np.array([marked.dab.position]), aspect)
        return QPointF(at[0, 0] * self.width(), at[0, 1] * self.height()) if np.isfinite(at).all() else None

    def _draw_dab(self, painter: QPainter, marked: Marked) -> None:
        at, shot = self.dab_place, self._document.shot
        if at is None or shot is None:
            return
        painter.setBrush(Qt.BrushStyle.NoBrush)
        for pen in (QPen(QColor(0, 0, 0, 170), 4.5), QPen(QColor(theme.ACCENT), 2)):
            painter.setPen(pen)
            painter.drawEllipse(at, RADIUS, RADIUS)
            for x, y in ((1, 0), (-1, 0), (0, 1), (0, -1)):
                painter.drawLine(at + QPointF(x, y) * (RADIUS + 2), at + QPointF(x, y) * (RADIUS + 8))
        rows = [
            (shown(color, shot, self._easel.display), title_of(id_)) for id_, color in marked.dab.expected.items()
        ]
        self._draw_legend(painter, at, rows, words.DECIDES if marked.dab.is_decisive else words.HARDLY_DECIDES)

    def _draw_legend(self, painter: QPainter, at: QPointF, rows: list[tuple[QColor, str]], said: str) -> None:
        """The colours that the explanations expect, beside the mark, where there is room."""
        metrics = QFontMetrics(self.font())
        line, wide = metrics.height() + 6, max(metrics.horizontalAdvance(t) for t in (said, *(t for _, t in rows)))
        box = QRectF(0, 0, wide + 46, line * (len(rows) + 1) + 10)
        x = at.x() + 30 if at.x() + 30 + box.width() < self.width() - 4 else at.x() - 30 - box.width()
        box.moveTo(x, min(max(at.y() - box.height() / 2, 4), max(self.height() - box.height() - 4, 4)))
        painter.setPen(QPen(QColor("#1e1e1e"), 1))
        painter.setBrush(QColor(46, 46, 46, 235))
        painter.drawRoundedRect(box, 4, 4)
        y = box.top() + 5
        for color, title in rows:
            painter.setPen(QPen(QColor("#1e1e1e"), 1))
            painter.setBrush(color)
            painter.drawRoundedRect(QRectF(box.left() + 8, y + 2, 22, line - 5), 2, 2)
            painter.setPen(QColor(theme.TEXT))
            text = QRectF(box.left() + 38, y, wide, line)
            painter.drawText(text, Qt.AlignmentFlag.AlignVCenter | Qt.AlignmentFlag.AlignLeft, title)
            y += line
        painter.setPen(QColor(theme.DIM))
        text = QRectF(box.left() + 8, y, wide + 30, line)
        painter.drawText(text, Qt.AlignmentFlag.AlignVCenter | Qt.AlignmentFlag.AlignLeft, said)
