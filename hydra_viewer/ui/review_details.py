"""Review details: who asked for a change, how well it came out, what else was weighed, what changes unpainted."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from PySide6.QtCore import Qt
from PySide6.QtGui import QColor
from PySide6.QtWidgets import QGridLayout, QLabel, QVBoxLayout, QWidget

from hydra_viewer.model.reviewing import Details
from hydra_viewer.ui import panel_words as words
from hydra_viewer.ui import theme
from hydra_viewer.ui.swatches import swatch_icon

SWATCH = 18  # pixels
MOST = 5  # explanations that are listed


class ReviewDetails(QWidget):
    """Lines about what a look changes of one material."""

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._layout = QVBoxLayout(self)
        self._layout.setContentsMargins(0, 0, 0, 0)
        self._layout.setSpacing(4)
        self._lines: list[QWidget] = []

    def show_details(self, details: Details | None, shown: Callable[[Sequence[float]], QColor]) -> None:
        """Shows what belongs to a change; None: nothing.

        Args:
            shown: the screen's colour of a scene-linear one.
        """
        for line in self._lines:
            self._layout.removeWidget(line)
            line.hide()
            line.deleteLater()
        self._lines = []
        if details is None:
            return
        if details.strokes:
            self._add(_label(words.asked_by(details.strokes), theme.TEXT))
        if details.residuals:
            self._add(_label(words.residuals(*details.residuals), theme.TEXT))
        if details.painted:
            self._add(self._colors(details, shown))
        if len(details.weighed) > 1:
            self._add(_label(words.WEIGHED, theme.DIM))
            self._add(_table([words.weighed(w.title, w.chance, w.cost) for w in details.weighed[:MOST]]))
        if details.unpainted:
            names = [p.rsplit("/", 1)[-1] for p in details.unpainted]
            also = _label(words.changes_too(names), theme.TEXT)
            also.setToolTip("\n".join(details.unpainted[:20]))
            self._add(also)

    def _add(self, line: QWidget) -> None:
        self._layout.addWidget(line)
        self._lines.append(line)

    def _colors(self, details: Details, shown: Callable[[Sequence[float]], QColor]) -> QWidget:
        row = QWidget()
        grid = QGridLayout(row)
        grid.setContentsMargins(0, 0, 0, 0)
        grid.setHorizontalSpacing(6)
        colors = (words.REVIEW_PAINTED, details.painted), (words.REVIEW_BEFORE, details.before), (
            words.REVIEW_AFTER, details.after,
        )  # fmt: skip
        for n, (title, color) in enumerate(colors):
            swatch = QLabel()
            swatch.setPixmap(swatch_icon(shown(color), SWATCH).pixmap(SWATCH, SWATCH))
            swatch.setToolTip(" ".join(f"{c:.3f}" for c in color))
            grid.addWidget(swatch, 0, 2 * n)
            grid.addWidget(_label(title, theme.DIM), 0, 2 * n + 1)
            grid.setColumnStretch(2 * n + 1, 1)
        return row


def _label(text: str, color: str) -> QLabel:
    label = QLabel(text.replace("/", "/\u200b"))
    label.setTextFormat(Qt.TextFormat.PlainText)
    label.setWordWrap(len(text) > 24)
    label.setMinimumWidth(30)
    label.setStyleSheet(f"color: {color};")
    return label


def _table(rows: Sequence[Sequence[str]]) -> QWidget:
    table = QWidget()
    grid = QGridLayout(table)
    grid.setContentsMargins(8, 0, 0, 0)
    grid.setVerticalSpacing(1)
    grid.setColumnStretch(0, 1)
    for r, row in enumerate(rows):
        for c, text in enumerate(row):
            cell = _label(text, theme.TEXT if r == 0 else theme.DIM)
            cell.setWordWrap(False)
            grid.addWidget(cell, r, c, Qt.AlignmentFlag.AlignLeft if c == 0 else Qt.AlignmentFlag.AlignRight)
    return table
