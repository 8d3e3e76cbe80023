"""The panel Stage: the tree of prims with their types, a search, and what is selected."""

from __future__ import annotations

from typing import Any

from PySide6.QtCore import (
    QAbstractItemModel,
    QItemSelectionModel,
    QModelIndex,
    QObject,
    QPersistentModelIndex,
    Qt,
    QTimer,
    Signal,
)
from PySide6.QtGui import QColor
from PySide6.QtWidgets import QHeaderView, QLineEdit, QTreeView, QVBoxLayout, QWidget

from hydra_viewer.model.document import Document
from hydra_viewer.model.prim_tree import PrimTree
from hydra_viewer.ui import theme, words

Index = QModelIndex | QPersistentModelIndex
NO_INDEX = QModelIndex()
Role = Qt.ItemDataRole
EMPTY = PrimTree((), (), (), ())


class StageModel(QAbstractItemModel):
    """A tree of prims; while something is searched for, a list of what was found."""

    def __init__(self, parent: QObject | None = None) -> None:
        super().__init__(parent)
        self._tree, self._searched = EMPTY, ""
        self._found: list[int] = []

    def show_tree(self, tree: PrimTree) -> None:
        """Shows another stage."""
        self.beginResetModel()
        self._tree = tree
        self._found = tree.find(self._searched) if self._searched else []
        self.endResetModel()

    def search(self, text: str) -> None:
        """Shows what a text finds; "": all."""
        self.beginResetModel()
        self._searched = text.strip()
        self._found = self._tree.find(self._searched) if self._searched else []
        self.endResetModel()

    def path(self, index: Index) -> str:
        """Returns the path of a prim."""
        return self._tree.rows[index.internalId()].path

    def type_name(self, index: Index) -> str:
        """Returns the type of a prim."""
        return self._tree.rows[index.internalId()].type_name

    def index_of(self, path: str) -> QModelIndex:
        """Returns the index of a prim, by its path; an invalid one where it is not shown."""
        row = self._tree.row_of(path)
        if row < 0:
            return QModelIndex()
        if self._searched:
            return self.createIndex(self._found.index(row), 0, row) if row in self._found else QModelIndex()
        return self.createIndex(self._tree.place[row], 0, row)

    def _children(self, parent: Index) -> Any:
        if self._searched:
            return () if parent.isValid() else self._found
        return self._tree.children[parent.internalId()] if parent.isValid() else self._tree.top

    def index(self, row: int, column: int, parent: Index = NO_INDEX) -> QModelIndex:
        children = self._children(parent)
        return self.createIndex(row, column, children[row]) if 0 <= row < len(children) else QModelIndex()

    def parent(self, index: Index = NO_INDEX) -> Any:
        if not index.isValid() or self._searched:
            return QModelIndex()
        above = self._tree.rows[index.internalId()].parent
        return self.createIndex(self._tree.place[above], 0, above) if above >= 0 else QModelIndex()

    def rowCount(self, parent: Index = NO_INDEX) -> int:
        return len(self._children(parent)) if parent.column() <= 0 else 0

    def columnCount(self, parent: Index = NO_INDEX) -> int:
        return len(words.COLUMNS)

    def headerData(self, section: int, orientation: Qt.Orientation, role: int = Role.DisplayRole) -> Any:
        is_shown = role == Role.DisplayRole and orientation == Qt.Orientation.Horizontal
        return words.COLUMNS[section] if is_shown else None

    def data(self, index: Index, role: int = Role.DisplayRole) -> Any:
        row = self._tree.rows[index.internalId()]
        if role == Role.DisplayRole:
            return (row.path if self._searched else row.name) if index.column() == 0 else row.type_name
        if role == Role.ToolTipRole:
            return f"{row.path}\n{words.shows_material(row.material)}" if row.material else row.path
        if role == Role.ForegroundRole and (index.column() == 1 or not (row.is_gprim or row.type_name == "Camera")):
            return QColor(theme.DIM) if index.column() == 1 else None
        return None


class StagePanel(QWidget):
    """The prims of the shot.

    Attributes:
        camera_chosen: Signal(str): the path of a camera to look through.
    """

    camera_chosen = Signal(str)

    def __init__(self, document: Document, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._document, self.model, self._filled = document, StageModel(self), EMPTY
        self.search, self.tree = QLineEdit(), QTreeView()
        self.search.setPlaceholderText(words.SEARCH)
        self.search.setClearButtonEnabled(True)
        self.tree.setModel(self.model)
        self.tree.setUniformRowHeights(True)
        self.tree.setAlternatingRowColors(True)
        self.tree.header().setSectionResizeMode(0, QHeaderView.ResizeMode.Stretch)
        self.tree.header().setSectionResizeMode(1, QHeaderView.ResizeMode.ResizeToContents)
        self.tree.header().setStretchLastSection(False)
        self.tree.setMinimumWidth(260)
        layout = QVBoxLayout(self)
        layout.setContentsMargins(4, 4, 4, 4)
        layout.addWidget(self.search)
        layout.addWidget(self.tree)
        self.search.textChanged.connect(self._on_searched)
        self.tree.selectionModel().currentChanged.connect(self._on_current_changed)
        self.tree.doubleClicked.connect(self._on_double_clicked)
        document.shot_changed.connect(lambda: QTimer.singleShot(0, self, self._fill))  # the picture is asked for first
        document.selection_changed.connect(self._show_selection)

    def _fill(self) -> None:
        """Shows another tree; at another frame it is the same, and stays as it was unfolded."""
        tree = self._document.prims or EMPTY
        if tree is not self._filled:
            self._filled = tree
            self.model.show_tree(tree)
            self.tree.expandToDepth(1)

    def _on_searched(self, text: str) -> None:
        self.model.search(text)
        self.tree.expandToDepth(1)
        self._show_selection()

    def _on_current_changed(self, current: QModelIndex, before: QModelIndex) -> None:
        if current.isValid():
            self._document.select(self.model.path(current))

    def _on_double_clicked(self, index: QModelIndex) -> None:
        if self.model.type_name(index) == "Camera":
            self.camera_chosen.emit(self.model.path(index))

    def _show_selection(self) -> None:
        index = self.model.index_of(self._document.selected) if self._document.selected else QModelIndex()
        if not index.isValid():
            self.tree.selectionModel().clear()
        elif index.internalId() != self.tree.currentIndex().internalId() or not self.tree.currentIndex().isValid():
            both = QItemSelectionModel.SelectionFlag.ClearAndSelect | QItemSelectionModel.SelectionFlag.Rows
            self.tree.selectionModel().setCurrentIndex(index, both)
            self.tree.scrollTo(index)
