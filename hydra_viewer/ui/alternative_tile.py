"""Alternative tile: an explanation as a button with its picture."""

from __future__ import annotations

from PySide6.QtCore import QRect, QRectF, QSize, Qt
from PySide6.QtGui import QColor, QFontMetrics, QImage, QPainter, QPainterPath, QPaintEvent, QPen, QPixmap
from PySide6.QtWidgets import QAbstractButton, QSizePolicy, QWidget

from hydra_viewer.model.previews import Preview
from hydra_viewer.model.understanding import Alternative
from hydra_viewer.ui import panel_words as words
from hydra_viewer.ui import theme

CAPTION = 38  # height of title and chance


class AlternativeTile(QAbstractButton):
    """A picture by an explanation, what it changes, and how likely it is; a click takes it.

    Attributes:
        alternative: that it is of.
        preview: whose picture it shows; None: none yet.
    """

    def __init__(self, alternative: Alternative, key: str = "", parent: QWidget | None = None) -> None:
        """Waits for its picture.

        Args:
            key: its shortcut; "": none.
        """
        super().__init__(parent)
        self._key = key
        self._drawn, self._drawn_as = QPixmap(), tuple[object, ...]()
        self.setFocusPolicy(Qt.FocusPolicy.StrongFocus)
        self.setCheckable(True)
        policy = QSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Minimum)
        policy.setHeightForWidth(True)
        self.setSizePolicy(policy)
        self.take(alternative)

    def take(self, alternative: Alternative) -> None:
        """Is of another alternative from now on, whose picture is still to come."""
        self.alternative, self._image, self._why_not = alternative, QImage(), ""
        self.preview: Preview | None = None
        self.setEnabled(True)
        self.setChecked(alternative.is_chosen)
        self.setAccessibleName(alternative.title)
        self.setText(alternative.title)
        changes = "\n".join(c.in_words for c in alternative.changes)
        head = f"{alternative.title}{f'  ({self._key})' if self._key else ''}"
        self.setToolTip("\n".join(filter(None, [head, changes])))
        self.update()

    def hasHeightForWidth(self) -> bool:
        return True

    def heightForWidth(self, width: int) -> int:
        return round(width * 2 / 3) + CAPTION

    def sizeHint(self) -> QSize:
        return QSize(140, self.heightForWidth(140))

    def minimumSizeHint(self) -> QSize:
        return QSize(90, self.heightForWidth(90))

    @property
    def has_picture(self) -> bool:
        """Whether its picture is there."""
        return not self._image.isNull()

    def show_picture(self, image: QImage) -> None:
        """Shows what it would look like."""
        self._image = image
        self.update()

    def forbid(self, why_not: str) -> None:
        """Says why it cannot be chosen."""
        self._why_not = why_not
        self.setEnabled(False)
        self.setToolTip(why_not)
        self.update()

    def nextCheckState(self) -> None:
        """It stays as it is: what is chosen is shown when it was found."""

    def paintEvent(self, event: QPaintEvent) -> None:
        """Draws itself where it looks otherwise than before: it is painted whenever something beside it changes."""
        ratio, font = self.devicePixelRatioF(), self.font().key()
        states = self.isEnabled(), self.isChecked(), self.hasFocus(), self.underMouse()
        key = self.size(), ratio, font, self.alternative, self._image.cacheKey(), self._why_not, states
        if key != self._drawn_as:
            self._drawn, self._drawn_as = QPixmap(self.size() * ratio), key
            self._drawn.setDevicePixelRatio(ratio)
            self._drawn.fill(Qt.GlobalColor.transparent)
            painter = QPainter(self._drawn)
            self._draw(painter)
            painter.end()
        painter = QPainter(self)
        painter.drawPixmap(0, 0, self._drawn)
        painter.end()

    def _draw(self, painter: QPainter) -> None:
        painter.setRenderHint(QPainter.RenderHint.Antialiasing)
        painter.setRenderHint(QPainter.RenderHint.SmoothPixmapTransform)
        r = QRectF(0, 0, self.width(), self.heightForWidth(self.width())).adjusted(1, 1, -1, -1)
        shape = QPainterPath()
        shape.addRoundedRect(r, 4, 4)
        is_lit = self.underMouse() and self.isEnabled()
        painter.fillPath(shape, QColor(theme.RAISED if is_lit else theme.FIELD))
        painter.setClipPath(shape)
        picture = QRect(1, 1, self.width() - 2, self.heightForWidth(self.width()) - CAPTION)
        if self.has_picture:
            painter.drawImage(picture, self._image)
        else:
            painter.fillRect(picture, QColor("#262626"))
            painter.setPen(QColor(theme.DIM))
            said = words.NOT_POSSIBLE if self._why_not else words.PICTURE_COMES
            painter.drawText(picture, Qt.AlignmentFlag.AlignCenter, said)
        painter.setClipping(False)
        self._draw_caption(painter, QRect(8, picture.bottom() + 4, self.width() - 16, CAPTION - 9))
        painter.setBrush(Qt.BrushStyle.NoBrush)
        painter.setPen(QPen(QColor(theme.ACCENT if self.isChecked() else "#262626"), 2 if self.isChecked() else 1))
        painter.drawPath(shape)
        if self.hasFocus():
            painter.setPen(QPen(QColor(theme.FOCUS), 1))
            painter.drawRoundedRect(r.adjusted(2, 2, -2, -2), 3, 3)

    def _draw_caption(self, painter: QPainter, where: QRect) -> None:
        metrics = QFontMetrics(self.font())
        painter.setPen(QColor(theme.TEXT if self.isEnabled() else theme.DIM))
        title = metrics.elidedText(self.alternative.brief, Qt.TextElideMode.ElideRight, where.width())
        painter.drawText(where, Qt.AlignmentFlag.AlignTop | Qt.AlignmentFlag.AlignLeft, title)
        painter.setPen(QColor(theme.DIM))
        chance = self.alternative.chance
        if chance is not None:
            at = Qt.AlignmentFlag.AlignBottom | Qt.AlignmentFlag.AlignLeft
            painter.drawText(where, at, words.chance(chance))
        if self.isChecked():
            painter.setPen(QColor(theme.ACCENT))
            painter.drawText(where, Qt.AlignmentFlag.AlignBottom | Qt.AlignmentFlag.AlignRight, words.CHOSEN)
