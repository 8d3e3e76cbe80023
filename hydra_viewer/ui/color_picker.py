"""Colour picker: hue, saturation and value as the screen shows them.

It knows display code values alone; the panel brings them into the working space.
"""

from __future__ import annotations

from collections.abc import Sequence

from PySide6.QtCore import QPointF, QRectF, Qt, Signal
from PySide6.QtGui import QColor, QKeyEvent, QLinearGradient, QMouseEvent, QPainter, QPaintEvent, QPen
from PySide6.QtWidgets import QGridLayout, QLineEdit, QToolButton, QVBoxLayout, QWidget

from hydra_viewer.ui import theme, words

Code = tuple[float, float, float]
HUES, ROUND = 6, 3.0
STEP = 0.02  # of a key


class _Field(QWidget):
    """A rectangle to drag in; x and y are 0..1 from the lower left."""

    dragged = Signal(float, float)

    def __init__(self, height: int, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.setFixedHeight(height)
        self.setMinimumWidth(120)
        self.setFocusPolicy(Qt.FocusPolicy.StrongFocus)
        self.x_share = self.y_share = 0.0

    def _inner(self) -> QRectF:
        return QRectF(self.rect()).adjusted(1, 1, -1, -1)

    def _drag(self, event: QMouseEvent) -> None:
        r, at = self._inner(), event.position()
        x, y = (at.x() - r.x()) / max(r.width(), 1), 1 - (at.y() - r.y()) / max(r.height(), 1)
        self.dragged.emit(min(max(x, 0.0), 1.0), min(max(y, 0.0), 1.0))

    def mousePressEvent(self, event: QMouseEvent) -> None:
        self.setFocus(Qt.FocusReason.MouseFocusReason)
        self._drag(event)

    def mouseMoveEvent(self, event: QMouseEvent) -> None:
        self._drag(event)

    def keyPressEvent(self, event: QKeyEvent) -> None:
        steps = {
            Qt.Key.Key_Left: (-STEP, 0.0), Qt.Key.Key_Right: (STEP, 0.0), Qt.Key.Key_Up: (0.0, STEP),
            Qt.Key.Key_Down: (0.0, -STEP),
        }  # fmt: skip
        step = steps.get(Qt.Key(event.key()))
        if step is None:
            super().keyPressEvent(event)
            return
        self.dragged.emit(min(max(self.x_share + step[0], 0.0), 1.0), min(max(self.y_share + step[1], 0.0), 1.0))

    def _draw_mark(self, painter: QPainter, at: QPointF) -> None:
        painter.setBrush(Qt.BrushStyle.NoBrush)
        for color, width in ((QColor(0, 0, 0, 170), 3.0), (QColor("white"), 1.4)):
            painter.setPen(QPen(color, width))
            painter.drawEllipse(at, 5, 5)
        if self.hasFocus():
            painter.setPen(QPen(QColor(theme.FOCUS), 1))
            painter.drawRect(self._inner())


class _Square(_Field):
    """Saturation to the right, value upwards."""

    hue = 0.0

    def paintEvent(self, event: QPaintEvent) -> None:
        painter, r = QPainter(self), self._inner()
        painter.setRenderHint(QPainter.RenderHint.Antialiasing)
        across = QLinearGradient(r.topLeft(), r.topRight())
        across.setColorAt(0, QColor("white"))
        across.setColorAt(1, QColor.fromHsvF(min(self.hue, 0.9999), 1, 1))
        down = QLinearGradient(r.topLeft(), r.bottomLeft())
        down.setColorAt(0, QColor(0, 0, 0, 0))
        down.setColorAt(1, QColor(0, 0, 0, 255))
        painter.setPen(Qt.PenStyle.NoPen)
        for gradient in (across, down):
            painter.setBrush(gradient)
            painter.drawRoundedRect(r, ROUND, ROUND)
        self._draw_mark(painter, QPointF(r.x() + self.x_share * r.width(), r.bottom() - self.y_share * r.height()))


class _Hue(_Field):
    """Hue to the right."""

    def paintEvent(self, event: QPaintEvent) -> None:
        painter, r = QPainter(self), self._inner()
        painter.setRenderHint(QPainter.RenderHint.Antialiasing)
        across = QLinearGradient(r.topLeft(), r.topRight())
        for k in range(HUES + 1):
            across.setColorAt(k / HUES, QColor.fromHsvF(k / HUES % 1.0, 1, 1))
        painter.setPen(Qt.PenStyle.NoPen)
        painter.setBrush(across)
        painter.drawRoundedRect(r, ROUND, ROUND)
        self._draw_mark(painter, QPointF(r.x() + self.x_share * r.width(), r.center().y()))


class ColorPicker(QWidget):
    """Square, hue and hexadecimal field of one colour.

    Attributes:
        picked: Signal(object): code values (r, g, b) in 0..1 that somebody chose.
    """

    picked = Signal(object)

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._square, self._hue, self.hex = _Square(110), _Hue(16), QLineEdit()
        self._square.setToolTip(words.PICK_SQUARE)
        self._hue.setToolTip(words.PICK_HUE)
        self.hex.setToolTip(words.PICK_HEX)
        layout = QVBoxLayout(self)
        layout.setContentsMargins(0, 0, 0, 0)
        for each in (self._square, self._hue, self.hex):
            layout.addWidget(each)
        self._square.dragged.connect(self._on_square_dragged)
        self._hue.dragged.connect(self._on_hue_dragged)
        self.hex.editingFinished.connect(self._on_hex_edited)

    def show_color(self, code: Code) -> None:
        """Shows a colour, code values in 0..1."""
        color = QColor.fromRgbF(*code)
        h, s, v = color.hsvHueF(), color.hsvSaturationF(), color.valueF()
        if h >= 0 and s > 0:  # a grey has no hue of its own: the last one stays
            self._hue.x_share = self._square.hue = h
        self._square.x_share, self._square.y_share = s, v
        self.hex.setText(color.name())
        self._square.update()
        self._hue.update()

    def _emit(self) -> None:
        color = QColor.fromHsvF(min(self._square.hue, 0.9999), self._square.x_share, self._square.y_share)
        self.hex.setText(color.name())
        self._square.update()
        self._hue.update()
        self.picked.emit((color.redF(), color.greenF(), color.blueF()))

    def _on_square_dragged(self, x: float, y: float) -> None:
        self._square.x_share, self._square.y_share = x, y
        self._emit()

    def _on_hue_dragged(self, x: float, y: float) -> None:
        self._hue.x_share = self._square.hue = x
        self._emit()

    def _on_hex_edited(self) -> None:
        color = QColor(self.hex.text() if self.hex.text().startswith("#") else f"#{self.hex.text()}")
        if color.isValid():
            self.show_color((color.redF(), color.greenF(), color.blueF()))
            self.picked.emit((color.redF(), color.greenF(), color.blueF()))


class Swatches(QWidget):
    """Rows of small colours to take.

    Attributes:
        taken: Signal(int): the number of the one that was pressed.
    """

    taken = Signal(int)
    PER_ROW = 8

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._grid = QGridLayout(self)
        self._grid.setContentsMargins(0, 0, 0, 0)
        self._grid.setSpacing(3)
        self._buttons: list[QToolButton] = []
        self._names: list[str] = []  # of the colours, a button each

    def show_colors(self, codes: Sequence[Sequence[float]], tips: Sequence[str]) -> bool:
        """Shows colours, code values in 0..1, with a tooltip each; returns whether there are buttons that were not."""
        before = len(self._buttons)
        while len(self._buttons) < len(codes):
            number, button = len(self._buttons), QToolButton()
            button.setFixedSize(22, 22)
            button.clicked.connect(lambda _=False, n=number: self.taken.emit(n))
            self._grid.addWidget(button, number // self.PER_ROW, number % self.PER_ROW)
            self._grid.setColumnStretch(self.PER_ROW, 1)
            self._buttons.append(button)
            self._names.append("")
        for n, button in enumerate(self._buttons):
            button.setVisible(n < len(codes))
            if n < len(codes):
                name = QColor.fromRgbF(*(float(c) for c in codes[n])).name()
                if name != self._names[n]:  # a style sheet is read anew each time
                    self._names[n] = name
                    button.setStyleSheet(
                        f"QToolButton {{ background: {name}; border: 1px solid #222; border-radius: 2px; }}"
                        f"QToolButton:hover, QToolButton:focus {{ border: 1px solid {theme.TEXT}; }}"
                    )
                button.setToolTip(tips[n])
        return len(self._buttons) > before
