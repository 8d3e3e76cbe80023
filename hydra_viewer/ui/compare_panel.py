"""The panel Compare: before and after, wipe, difference, and looks that were kept."""

from __future__ import annotations

from PySide6.QtCore import QSignalBlocker, Qt, Signal
from PySide6.QtGui import QKeyEvent
from PySide6.QtWidgets import (
    QComboBox,
    QDoubleSpinBox,
    QFormLayout,
    QHBoxLayout,
    QLabel,
    QPushButton,
    QVBoxLayout,
    QWidget,
)

from hydra_viewer.model.comparison import BEFORE, MODES, MOST_GAIN, Comparison
from hydra_viewer.model.document import Document
from hydra_viewer.ui import panel_words as words
from hydra_viewer.ui import theme
from hydra_viewer.ui.choice_row import choice_row
from hydra_viewer.ui.own_keys import KeyList
from hydra_viewer.ui.words import tooltip

FORGETS, SHOWS = (Qt.Key.Key_Delete, Qt.Key.Key_Backspace), (Qt.Key.Key_Return, Qt.Key.Key_Enter)


class _Snapshots(KeyList):
    """Kept looks; Enter shows one, Delete forgets it."""

    own_keys = FORGETS + SHOWS
    dropped = Signal()
    taken = Signal()

    def keyPressEvent(self, event: QKeyEvent) -> None:
        if event.key() in FORGETS:
            self.dropped.emit()
        elif event.key() in SHOWS:
            self.taken.emit()
        else:
            super().keyPressEvent(event)


class ComparePanel(QWidget):
    """How the picture is compared.

    Attributes:
        modes: buttons by mode.
        gain: of the difference.
        with_: what is compared with.
        snapshots: the kept looks.
    """

    def __init__(self, document: Document, comparison: Comparison, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._document, self._comparison = document, comparison
        layout = QVBoxLayout(self)
        layout.setContentsMargins(8, 8, 8, 8)
        layout.setSpacing(6)
        row, self.modes = choice_row(
            self, MODES, words.MODES, lambda mode: comparison.set(mode=mode), words.MODE_KEYS
        )
        layout.addLayout(row)
        form = QFormLayout()
        form.setVerticalSpacing(4)
        form.setLabelAlignment(Qt.AlignmentFlag.AlignVCenter)
        self.with_ = QComboBox()
        self.with_.activated.connect(lambda _=0: comparison.set(with_=self.with_.currentData()))
        self.gain = QDoubleSpinBox(decimals=0, minimum=1, maximum=MOST_GAIN)
        self.gain.setStepType(QDoubleSpinBox.StepType.AdaptiveDecimalStepType)
        self.gain.valueChanged.connect(lambda gain: comparison.set(gain=gain))
        form.addRow(words.COMPARE_WITH, self.with_)
        form.addRow(words.GAIN, self.gain)
        layout.addLayout(form)
        title = QLabel(words.SNAPSHOTS)
        title.setStyleSheet(f"color: {theme.DIM};")
        layout.addWidget(title)
        self.snapshots = _Snapshots()
        self.snapshots.setToolTip(words.SNAPSHOT_TIP)
        self.snapshots.setMaximumHeight(110)
        self.snapshots.itemDoubleClicked.connect(lambda _: self._show_snapshot())
        self.snapshots.taken.connect(self._show_snapshot)
        self.snapshots.dropped.connect(self.drop)
        layout.addWidget(self.snapshots)
        layout.addLayout(self._snapshot_row())
        layout.addStretch(1)
        comparison.changed.connect(self._update)
        document.found_changed.connect(self._update)
        self._update()

    def _snapshot_row(self) -> QHBoxLayout:
        row = QHBoxLayout()
        row.setSpacing(4)
        self.keep_button, self.drop_button = QPushButton(words.KEEP[0]), QPushButton(words.DROP[0])
        for button, words_of, do, key in (
            (self.keep_button, words.KEEP, self.keep, "K"), (self.drop_button, words.DROP, self.drop, "Del"),
        ):  # fmt: skip
            button.setToolTip(tooltip(*words_of, key))
            button.clicked.connect(lambda _=False, do=do: do())
            row.addWidget(button)
        return row

    # ── what a person does ─────────────────────────────────────────────────────────────────────

    def keep(self) -> None:
        """Keeps the look as it is now."""
        if self._document.shot is not None:
            self._comparison.keep(self._document.found)

    def drop(self) -> None:
        """Forgets the kept look that is selected."""
        item = self.snapshots.currentItem()
        if item is not None:
            self._comparison.drop(item.text())

    def _show_snapshot(self) -> None:
        item = self.snapshots.currentItem()
        if item is not None:
            self._comparison.set(with_=item.text(), mode="other")

    # ── what it shows ──────────────────────────────────────────────────────────────────────────

    def _update(self) -> None:
        state = self._comparison.state
        self.modes[state.mode].setChecked(True)
        self.modes["other"].setText(state.with_ or words.MODES["other"][0])
        names = [s.name for s in self._comparison.snapshots]
        with QSignalBlocker(self.gain), QSignalBlocker(self.with_), QSignalBlocker(self.snapshots):
            self.gain.setValue(state.gain)
            at = max(self.snapshots.currentRow(), 0)
            if names != [self.with_.itemData(n) for n in range(1, self.with_.count())] or not self.with_.count():
                self.with_.clear()
                self.with_.addItem(words.BEFORE, BEFORE)
                for name in names:
                    self.with_.addItem(name, name)
                self.snapshots.clear()
                self.snapshots.addItems(names)
            self.with_.setCurrentIndex(self.with_.findData(state.with_))
            self.snapshots.setCurrentRow(names.index(state.with_) if state.with_ in names else min(at, len(names) - 1))
        self.gain.setEnabled(state.mode == "difference")
        self.keep_button.setEnabled(self._document.shot is not None)
        self.drop_button.setEnabled(bool(names))
