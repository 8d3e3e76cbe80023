"""The panel Strokes: the list of what was painted, and what can be changed of it afterwards."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

from PySide6.QtCore import QItemSelectionModel, QSignalBlocker, Qt, QTimer, Signal
from PySide6.QtGui import QColor, QDropEvent, QIcon, QKeyEvent
from PySide6.QtWidgets import (
    QAbstractItemView,
    QHBoxLayout,
    QHeaderView,
    QLabel,
    QPushButton,
    QTreeWidgetItem,
    QVBoxLayout,
    QWidget,
)

from hydra_viewer.model.brush_color import shot_color, shown_colors
from hydra_viewer.model.document import Document
from hydra_viewer.model.easel import Easel
from hydra_viewer.model.stroke_edits import changed, deleted, described, moved, placed, recolored, toggled
from hydra_viewer.ui import panel_words as words
from hydra_viewer.ui.explaining import Explaining
from hydra_viewer.ui.icons import icon
from hydra_viewer.ui.own_keys import KeyTree
from hydra_viewer.ui.stroke_fields import StrokeFields
from hydra_viewer.ui.swatches import swatch_icon
from hydra_viewer.ui.words import tooltip
from usdslf import Stroke

NAME = Qt.ItemDataRole.UserRole
CTRL = Qt.KeyboardModifier.ControlModifier


class StrokeTree(KeyTree):
    """The list itself.

    Attributes:
        deleted, toggled: Signal(): of the selected strokes.
        moved: Signal(int): of the selected strokes, -1 up, 1 down.
        dropped: Signal(): rows are in another order.
    """

    own_keys = (Qt.Key.Key_Space, Qt.Key.Key_Delete, Qt.Key.Key_Backspace, Qt.Key.Key_Up, Qt.Key.Key_Down, Qt.Key.Key_A)
    deleted = Signal()
    toggled = Signal()
    moved = Signal(int)
    dropped = Signal()

    def keyPressEvent(self, event: QKeyEvent) -> None:
        key, is_ctrl = event.key(), bool(event.modifiers() & CTRL)
        if key == Qt.Key.Key_Space:
            self.toggled.emit()
        elif key in (Qt.Key.Key_Delete, Qt.Key.Key_Backspace):
            self.deleted.emit()
        elif is_ctrl and key in (Qt.Key.Key_Up, Qt.Key.Key_Down):
            self.moved.emit(-1 if key == Qt.Key.Key_Up else 1)
        else:
            super().keyPressEvent(event)

    def dropEvent(self, event: QDropEvent) -> None:
        super().dropEvent(event)
        QTimer.singleShot(0, self, self.dropped.emit)


class StrokesPanel(QWidget):
    """What was painted.

    Attributes:
        tree: a row a stroke, in the order in which they count.
        fields: tool, mode, colour and scope of the selected ones.
    """

    def __init__(
        self, document: Document, easel: Easel, explaining: Explaining, solve_again: Callable[[], object],
        parent: QWidget | None = None,
    ) -> None:  # fmt: skip
        super().__init__(parent)
        self._document, self._easel, self._explaining = document, easel, explaining
        self._known_icons: dict[str, QIcon] = {}
        self.tree, self.fields = self._make_tree(), StrokeFields(document, easel)
        self._empty, self._shown = QLabel(words.NO_STROKES), tuple[Stroke, ...]()
        layout = QVBoxLayout(self)
        layout.setContentsMargins(8, 8, 8, 8)
        layout.setSpacing(6)
        for each in (self._empty, self.tree):
            layout.addWidget(each)
        layout.addLayout(self._buttons(solve_again))
        layout.addWidget(self.fields)
        layout.addStretch(1)
        self.fields.value_changed.connect(self._change)
        self.fields.color_changed.connect(self._recolor)
        document.strokes_changed.connect(self._fill)
        for announcer in (document.shot_changed, easel.display_changed):
            announcer.connect(self._fill_anew)
        explaining.groups_changed.connect(self._say_understood)
        self._fill()

    def _make_tree(self) -> StrokeTree:
        tree = StrokeTree()
        tree.setHeaderLabels(words.COLUMNS)
        tree.setRootIsDecorated(False)
        tree.setUniformRowHeights(True)
        tree.setMinimumHeight(110)
        tree.setSelectionMode(QAbstractItemView.SelectionMode.ExtendedSelection)
        tree.setDragDropMode(QAbstractItemView.DragDropMode.InternalMove)
        tree.setDefaultDropAction(Qt.DropAction.MoveAction)
        header = tree.header()
        for column, width in ((0, 94), (1, 78)):
            header.setSectionResizeMode(column, QHeaderView.ResizeMode.Interactive)
            header.resizeSection(column, width)
        header.setStretchLastSection(True)
        tree.setHorizontalScrollBarPolicy(Qt.ScrollBarPolicy.ScrollBarAlwaysOff)
        tree.itemChanged.connect(self._on_checked)
        tree.itemSelectionChanged.connect(self._on_selected)
        tree.toggled.connect(self.toggle)
        tree.deleted.connect(self.delete)
        tree.moved.connect(self.shift)
        tree.dropped.connect(self._reorder)
        return tree

    def _buttons(self, solve_again: Callable[[], object]) -> QHBoxLayout:
        row = QHBoxLayout()
        row.setSpacing(4)
        self.buttons: dict[str, QPushButton] = {}
        for words_of, do, key in (
            (words.UP, lambda: self.shift(-1), "Ctrl+Up"), (words.DOWN, lambda: self.shift(1), "Ctrl+Down"),
            (words.DELETE, self.delete, "Del"), (words.SOLVE_AGAIN, solve_again, "Ctrl+R"),
        ):  # fmt: skip
            button = QPushButton(words_of[0])
            button.setToolTip(tooltip(*words_of, key))
            button.clicked.connect(lambda _=False, do=do: do())
            self.buttons[words_of[0]] = button
            row.addWidget(button)
        return row

    # ── rows ───────────────────────────────────────────────────────────────────────────────────

    def _fill_anew(self) -> None:
        """Makes all rows: colours are shown otherwise, or rows stand elsewhere."""
        self._shown = ()
        self.tree.clear()
        self._fill()

    def _fill(self) -> None:
        """Makes the rows of the first stroke that is another and of all after it; those before it stay."""
        strokes, before = self._document.strokes, self._shown
        current, known = self.tree.currentItem(), {s.name for s in before}
        # what is painted now is looked at, not what was selected before
        names = set(self.selected) if known.issuperset(s.name for s in strokes) else set()
        at = current.data(0, NAME) if current else ""
        same = next((i for i, (a, b) in enumerate(zip(strokes, before)) if a is not b), min(len(strokes), len(before)))
        self._shown = strokes
        with QSignalBlocker(self.tree):
            while self.tree.topLevelItemCount() > same:
                self.tree.takeTopLevelItem(same)
            for stroke, icon_of_it in zip(strokes[same:], self._icons(strokes[same:])):
                self.tree.addTopLevelItem(self._row(stroke, icon_of_it))
            for row, stroke in enumerate(strokes):
                item = self.tree.topLevelItem(row)
                if item is not None and item.isSelected() != (stroke.name in names):
                    item.setSelected(stroke.name in names)
                if item is not None and stroke.name == at:
                    self.tree.setCurrentItem(item, 0, QItemSelectionModel.SelectionFlag.NoUpdate)
        self._empty.setVisible(not strokes)
        self._say_understood()
        self._on_selected()

    def _icons(self, strokes: Sequence[Stroke]) -> list[QIcon]:
        """Of rows: the colour that was painted, or the tool; colours are converted all at once."""
        shot = self._document.shot
        if shot is None or not strokes:
            return [icon(s.tool) for s in strokes]
        colors = shown_colors([s.colors.mean(0) for s in strokes], self._easel.display, shot_color(shot))
        found = []
        for stroke, color in zip(strokes, colors.tolist()):
            name = QColor.fromRgbF(*color).name() if stroke.tool == "replace" else stroke.tool
            if name not in self._known_icons:
                self._known_icons[name] = swatch_icon(QColor(name)) if name.startswith("#") else icon(name)
            found.append(self._known_icons[name])
        return found

    def _row(self, stroke: Stroke, icon_of_it: QIcon) -> QTreeWidgetItem:
        item = QTreeWidgetItem([described(stroke), ", ".join(p.rsplit("/", 1)[-1] for p in stroke.surfaces), ""])
        flags = Qt.ItemFlag.ItemIsEnabled | Qt.ItemFlag.ItemIsSelectable | Qt.ItemFlag.ItemIsUserCheckable
        item.setFlags(flags | Qt.ItemFlag.ItemIsDragEnabled)
        item.setCheckState(0, Qt.CheckState.Checked if stroke.active else Qt.CheckState.Unchecked)
        item.setData(0, NAME, stroke.name)
        item.setIcon(0, icon_of_it)
        item.setToolTip(0, f"{stroke.name}: {described(stroke)}")
        item.setToolTip(1, "\n".join(stroke.surfaces))
        return item

    def _say_understood(self) -> None:
        said = {name: group for group in self._explaining.groups for name in group.strokes}
        with QSignalBlocker(self.tree):
            for row in range(self.tree.topLevelItemCount()):
                item = self.tree.topLevelItem(row)
                if item is None:
                    continue
                group = said.get(item.data(0, NAME))
                is_on = item.checkState(0) == Qt.CheckState.Checked
                chosen = group.chosen if group and is_on else None
                title = words.understood_as(chosen.brief, group.is_chosen_by_hand) if group and chosen else ""
                text, tip = title if is_on else words.SWITCHED_OFF, group.sentence if group and is_on else ""
                if (item.text(2), item.toolTip(2)) != (text, tip):
                    item.setText(2, text)
                    item.setToolTip(2, tip)

    @property
    def selected(self) -> tuple[str, ...]:
        """Names of the selected strokes."""
        return tuple(item.data(0, NAME) for item in self.tree.selectedItems())

    def select(self, names: tuple[str, ...]) -> None:
        """Selects strokes by their names."""
        for row in range(self.tree.topLevelItemCount()):
            item = self.tree.topLevelItem(row)
            if item is not None:
                item.setSelected(item.data(0, NAME) in names)

    # ── changes ────────────────────────────────────────────────────────────────────────────────

    def toggle(self) -> None:
        """Switches the selected strokes off or on."""
        self._do(words.SWITCHED, toggled(self._document.strokes, self.selected))

    def delete(self) -> None:
        """Removes the selected strokes; the next one is selected."""
        strokes, names = self._document.strokes, self.selected
        if not names:
            return
        last = max(i for i, s in enumerate(strokes) if s.name in names)
        left = deleted(strokes, names)
        following = [s.name for s in strokes[last + 1 :]] or [s.name for s in left[-1:]]
        self._do(words.DELETED, left)
        self.select(tuple(following[:1]))

    def shift(self, by: int) -> None:
        """Moves the selected strokes up (-1) or down (1)."""
        self._do(words.MOVED, moved(self._document.strokes, self.selected, by))

    def _reorder(self) -> None:
        items = [self.tree.topLevelItem(row) for row in range(self.tree.topLevelItemCount())]
        order = [item.data(0, NAME) for item in items if item is not None]
        self._shown = ()  # its rows stand elsewhere
        self._do(words.MOVED, placed(self._document.strokes, order))

    def _change(self, field: str, value: Any) -> None:
        name = words.edited(field, f"{100 * value:.0f} %" if field == "strength" else value)
        self._do(name, changed(self._document.strokes, self.selected, **{field: value}))

    def _recolor(self, color: tuple[float, float, float]) -> None:
        self._do(words.RECOLORED, recolored(self._document.strokes, self.selected, color))

    def _do(self, what: str, strokes: tuple[Stroke, ...]) -> None:
        if self.selected or what == words.MOVED:
            self._document.change_strokes(what, strokes)

    def _on_checked(self, item: QTreeWidgetItem, column: int) -> None:
        name, is_on = item.data(0, NAME), item.checkState(0) == Qt.CheckState.Checked
        strokes = self._document.strokes
        if any(s.name == name and s.active != is_on for s in strokes):
            # rows are made anew, which has to wait until this one has said its change
            change = lambda: self._document.change_strokes(words.SWITCHED, toggled(strokes, (name,)))  # noqa: E731
            QTimer.singleShot(0, self, change)

    def _on_selected(self) -> None:
        names = self.selected
        for name, button in self.buttons.items():
            button.setEnabled(bool(names) if name != words.SOLVE_AGAIN[0] else bool(self._document.active))
        self._explaining.look_at(names)
        self.fields.show_strokes([s for s in self._document.strokes if s.name in names])
