"""The panel Stage: the tree of prims."""

from __future__ import annotations

from PySide6.QtWidgets import QTreeWidget, QTreeWidgetItem, QVBoxLayout, QWidget

from hydra_viewer.model.document import Document
from usdslf import stage_prims


class StagePanel(QWidget):
    """The prims of the shot."""

    def __init__(self, document: Document, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._document = document
        self.tree = QTreeWidget(columnCount=2)
        self.tree.setHeaderHidden(True)
        layout = QVBoxLayout(self)
        layout.setContentsMargins(0, 0, 0, 0)
        layout.addWidget(self.tree)
        document.shot_changed.connect(self._fill)

    def _fill(self) -> None:
        self.tree.clear()
        shot = self._document.shot
        if shot is None:
            return
        items: list[QTreeWidgetItem] = []
        for row in stage_prims(shot.stage):
            parent = items[row.parent] if row.parent >= 0 else self.tree.invisibleRootItem()
            items.append(QTreeWidgetItem(parent, [row.name, row.type_name]))
        self.tree.expandToDepth(1)
