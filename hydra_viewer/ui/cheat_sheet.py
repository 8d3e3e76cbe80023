"""Cheat sheet: all keys and what the mouse does, in one window."""

from __future__ import annotations

from collections.abc import Sequence

from PySide6.QtCore import Qt
from PySide6.QtGui import QAction, QKeySequence
from PySide6.QtWidgets import QDialog, QDialogButtonBox, QGridLayout, QHBoxLayout, QLabel, QVBoxLayout, QWidget

from hydra_viewer.ui import theme, words

COLUMNS = 2


class CheatSheet(QDialog):
    """Keys of actions, by menu, and gestures."""

    def __init__(self, menus: Sequence[tuple[str, Sequence[QAction]]], parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.setWindowTitle(words.KEYS[0].replace("&", ""))
        groups: list[tuple[str, Sequence[tuple[str, str]]]] = [(words.MOUSE, words.GESTURES)]
        for name, actions in menus:
            keyed = [(a.shortcut().toString(QKeySequence.SequenceFormat.NativeText), _plain(a.text())) for a in actions]
            groups.append((_plain(name), [(key, text) for key, text in keyed if key]))
        sides = [QVBoxLayout() for _ in range(COLUMNS)]
        heights = [0] * COLUMNS
        for title, rows in groups:
            lowest = heights.index(min(heights))
            heights[lowest] += len(rows) + 2
            sides[lowest].addWidget(_group(title, rows))
        across = QHBoxLayout()
        across.setSpacing(28)
        for side in sides:
            side.addStretch(1)
            across.addLayout(side)
        buttons = QDialogButtonBox(QDialogButtonBox.StandardButton.Close)
        buttons.rejected.connect(self.reject)
        layout = QVBoxLayout(self)
        layout.addLayout(across)
        layout.addWidget(buttons)


def _plain(text: str) -> str:
    return text.replace("&", "").replace(" …", "")


def _group(title: str, rows: Sequence[tuple[str, str]]) -> QWidget:
    group = QWidget()
    grid = QGridLayout(group)
    grid.setContentsMargins(0, 0, 0, 12)
    grid.setHorizontalSpacing(16)
    grid.setColumnStretch(1, 1)
    head = QLabel(title)
    head.setStyleSheet(f"color: {theme.ACCENT}; font-weight: bold;")
    grid.addWidget(head, 0, 0, 1, 2)
    for n, (key, text) in enumerate(rows, start=1):
        label = QLabel(key)
        label.setStyleSheet(f"color: {theme.TEXT}; background: {theme.FIELD}; padding: 1px 6px; border-radius: 2px;")
        grid.addWidget(label, n, 0, Qt.AlignmentFlag.AlignLeft)
        grid.addWidget(QLabel(text), n, 1)
    return group
