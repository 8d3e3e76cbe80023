"""Review tree: the changes of a look by material, each with a box that accepts it."""

from __future__ import annotations

import re
from collections.abc import Callable, Collection, Sequence

from PySide6.QtCore import QSignalBlocker, QSize, Qt, Signal
from PySide6.QtGui import QColor, QIcon, QPainter, QPixmap
from PySide6.QtWidgets import QTreeWidget, QTreeWidgetItem, QWidget

from hydra_viewer.model.verdict import Row
from hydra_viewer.ui import panel_words as words
from hydra_viewer.ui.swatches import swatch_icon, true_icon

NUMBER = Qt.ItemDataRole.UserRole
SWATCH, GAP = 14, 3  # pixels
LEAST_ROWS, MOST_ROWS = 3, 9  # that are seen without scrolling
WIDTHS = 118, 186  # of the first columns [pixels]
ROW = 24  # pixels, at most


class ReviewTree(QTreeWidget):
    """What can be accepted.

    Attributes:
        decided: Signal(str, bool): a target, and whether it is accepted.
        rows: what there is to decide, in the order of the tree.
    """

    decided = Signal(str, bool)

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.rows: tuple[Row, ...] = ()
        self.setHeaderLabels(words.REVIEW_COLUMNS)
        self.setIconSize(QSize(2 * SWATCH + GAP, SWATCH))
        self.setIndentation(8)
        self.setAlternatingRowColors(True)
        for column, width in enumerate(WIDTHS):
            self.header().resizeSection(column, width)
        self.setHorizontalScrollBarPolicy(Qt.ScrollBarPolicy.ScrollBarAlwaysOff)
        self.itemChanged.connect(self._on_checked)

    def show_rows(
        self, rows: Sequence[Row], rejected: Collection[str], shown: Callable[[Sequence[float]], QColor]
    ) -> None:
        """Shows changes, all accepted but the rejected targets; the selected one stays selected.

        Args:
            shown: the screen's colour of a scene-linear one.
        """
        before = self.selected
        with QSignalBlocker(self):
            self.clear()
            self.rows = tuple(rows)
            under: dict[str, QTreeWidgetItem] = {}
            for number, row in enumerate(self.rows):
                if row.material not in under:
                    under[row.material] = self._head(row)
                item = _item(row, number, row.target not in rejected)
                if row.colors:
                    item.setIcon(1, _both(*(shown(c) for c in row.colors)))
                under[row.material].addChild(item)
                if before is not None and row.target == before.target:
                    self.setCurrentItem(item)
        lines = min(max(len(self.rows) + len(under), LEAST_ROWS), MOST_ROWS)
        self.setFixedHeight(lines * ROW + self.header().sizeHint().height() + 6)
        self.setColumnHidden(2, not any(row.state for row in self.rows))
        first = next(iter(under.values())).child(0) if under else None
        if self.selected is None and first is not None:
            self.setCurrentItem(first)
        self.itemSelectionChanged.emit()

    def _head(self, row: Row) -> QTreeWidgetItem:
        head = QTreeWidgetItem([row.material.rsplit("/", 1)[-1]])
        head.setToolTip(0, row.material)
        self.addTopLevelItem(head)
        head.setFirstColumnSpanned(True)
        head.setExpanded(True)
        return head

    @property
    def selected(self) -> Row | None:
        """The change that is selected; None: none is."""
        items = self.selectedItems()
        number = items[0].data(0, NUMBER) if items else None
        return self.rows[number] if number is not None else None

    def _on_checked(self, item: QTreeWidgetItem, column: int) -> None:
        number = item.data(0, NUMBER)
        if number is not None and column == 0:
            self.decided.emit(self.rows[number].target, item.checkState(0) == Qt.CheckState.Checked)


def _item(row: Row, number: int, is_accepted: bool) -> QTreeWidgetItem:
    item = QTreeWidgetItem([row.name, _brief(f"{row.before} → {row.after}"), row.state])
    item.setFlags(item.flags() | Qt.ItemFlag.ItemIsUserCheckable)
    item.setCheckState(0, Qt.CheckState.Checked if is_accepted else Qt.CheckState.Unchecked)
    item.setData(0, NUMBER, number)
    item.setToolTip(0, row.target)
    item.setToolTip(1, f"{row.before} → {row.after}")
    item.setToolTip(2, row.state)
    return item


def _brief(values: str) -> str:
    """Values without the zero before the point: three numbers twice find room in the panel that way."""
    return re.sub(r"(?<![\d.])0(?=\.\d)", "", values)


def _both(before: QColor, after: QColor) -> QIcon:
    """Two swatches side by side."""
    pixmap = QPixmap(2 * (2 * SWATCH + GAP), 2 * SWATCH)
    pixmap.setDevicePixelRatio(2)
    pixmap.fill(Qt.GlobalColor.transparent)
    painter = QPainter(pixmap)
    for n, color in enumerate((before, after)):
        painter.drawPixmap(n * (SWATCH + GAP), 0, swatch_icon(color, SWATCH).pixmap(SWATCH, SWATCH))
    painter.end()
    return true_icon(pixmap)
