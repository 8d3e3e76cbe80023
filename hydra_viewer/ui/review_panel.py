"""The panel Review: what the saved look changes, what is wrong with it, and what a person accepts of it."""

from __future__ import annotations

from PySide6.QtCore import QSignalBlocker, Qt, Signal
from PySide6.QtWidgets import (
    QFileDialog,
    QHBoxLayout,
    QLabel,
    QLineEdit,
    QPushButton,
    QTreeWidget,
    QTreeWidgetItem,
    QVBoxLayout,
    QWidget,
)

from hydra_viewer.model.document import Document
from hydra_viewer.model.verdict import Row, Verdict, rows_of
from hydra_viewer.ui import panel_words as words
from hydra_viewer.ui import theme
from hydra_viewer.ui.words import tooltip
from hydra_viewer.ui.worker import Job, Worker
from usdslf import LookReview, review_look, stepwise

TARGET = Qt.ItemDataRole.UserRole
REVIEW = "review"


class ReviewPanel(QWidget):
    """What the saved look changes.

    Attributes:
        verdict: what was decided; None: nothing was reviewed yet.
        tree: a row a change; what is checked is accepted.
        failed: Signal(str): a sentence.
    """

    failed = Signal(str)

    def __init__(self, document: Document, worker: Worker, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._document, self._worker = document, worker
        self.verdict: Verdict | None = None
        self.summary = QLabel(words.NOT_REVIEWED)
        self.summary.setWordWrap(True)
        self.summary.setMinimumWidth(40)
        self.tree = QTreeWidget()
        self.tree.setHeaderLabels(words.REVIEW_COLUMNS)
        self.tree.setMinimumHeight(140)
        self.tree.itemChanged.connect(self._on_checked)
        self.tree.itemSelectionChanged.connect(self._show_note)
        self.note = QLineEdit()
        self.note.setPlaceholderText(words.NOTE)
        self.note.textEdited.connect(self._take_note)
        self.findings = QLabel()
        self.findings.setWordWrap(True)
        self.findings.setMinimumWidth(40)
        self.findings.setTextInteractionFlags(Qt.TextInteractionFlag.TextSelectableByMouse)
        layout = QVBoxLayout(self)
        layout.setContentsMargins(8, 8, 8, 8)
        layout.setSpacing(6)
        layout.addLayout(self._buttons())
        for each in (self.summary, self.tree, self.note, self.findings):
            layout.addWidget(each)
        layout.addStretch(1)
        document.files_changed.connect(self._update)
        document.shot_changed.connect(self._forget)
        self._forget()

    def _buttons(self) -> QHBoxLayout:
        row = QHBoxLayout()
        row.setSpacing(4)
        self.review_button, self.save_button = QPushButton(words.REVIEW[0]), QPushButton(words.SAVE_VERDICT[0])
        for button, words_of, do in (
            (self.review_button, words.REVIEW, self.review), (self.save_button, words.SAVE_VERDICT, self._ask_file),
        ):  # fmt: skip
            button.setToolTip(tooltip(*words_of, ""))
            button.clicked.connect(lambda _=False, do=do: do())
            row.addWidget(button)
        return row

    # ── reviewing ──────────────────────────────────────────────────────────────────────────────

    def review(self) -> None:
        """Reviews the look as it was saved, on the worker."""
        document = self._document
        shot, look = document.shot, document.files.look
        if shot is None or not look:
            self.failed.emit(words.SAVE_FIRST)
            return
        path, ocio = shot.path, shot.ocio
        steps = lambda: stepwise(lambda: review_look(path, look, ocio))  # noqa: E731
        self._worker.start(Job(REVIEW, steps, self._take, lambda sentence, _: self.failed.emit(sentence)))

    def _take(self, found: LookReview) -> None:
        self.verdict = Verdict(found)
        with QSignalBlocker(self.tree):
            self.tree.clear()
            under: dict[str, QTreeWidgetItem] = {}
            for row in rows_of(found):
                if row.material not in under:
                    head = QTreeWidgetItem([row.material.rsplit("/", 1)[-1], "", ", ".join(row.strokes)])
                    head.setToolTip(0, row.material)
                    self.tree.addTopLevelItem(head)
                    head.setExpanded(True)
                    under[row.material] = head
                under[row.material].addChild(_item(row))
        for column, width in ((0, 124), (1, 110)):
            self.tree.header().resizeSection(column, width)
        values = found.as_values()["summary"]
        self.summary.setText(words.summary(values))
        self.summary.setStyleSheet(f"color: {theme.TEXT if not found.findings else '#e0988f'};")
        said = [f.message for f in found.findings] + [r.message for r in found.risks]
        self.findings.setText("\n\n".join(s.replace("/", "/\u200b") for s in said))
        self._update()

    def _forget(self) -> None:
        self.verdict = None
        self.tree.clear()
        self.summary.setText(words.NOT_REVIEWED)
        self.summary.setStyleSheet(f"color: {theme.DIM};")
        self.findings.clear()
        self._update()

    def _update(self) -> None:
        self.review_button.setEnabled(bool(self._document.files.look))
        self.save_button.setEnabled(self.verdict is not None)
        for each in (self.tree, self.note):
            each.setVisible(self.verdict is not None)

    # ── deciding ───────────────────────────────────────────────────────────────────────────────

    def _on_checked(self, item: QTreeWidgetItem, column: int) -> None:
        target = item.data(0, TARGET)
        if self.verdict is not None and target:
            self.verdict.decide(target, item.checkState(0) == Qt.CheckState.Checked)

    def _target(self) -> str:
        items = self.tree.selectedItems()
        return str(items[0].data(0, TARGET) or "") if items else ""

    def _show_note(self) -> None:
        target = self._target()
        self.note.setEnabled(bool(target))
        self.note.setText(self.verdict.notes.get(target, "") if self.verdict else "")

    def _take_note(self, text: str) -> None:
        if self.verdict is not None and self._target():
            self.verdict.notes[self._target()] = text

    def save_verdict(self, path: str) -> None:
        """Writes what was decided to a file."""
        if self.verdict is None:
            return
        try:
            self.verdict.write(path)
        except OSError as error:
            self.failed.emit(words.not_written(path, error.strerror or str(error)))

    def _ask_file(self) -> None:
        name, _ = QFileDialog.getSaveFileName(self, words.SAVE_VERDICT[0], "verdict.json", words.JSON_FILES)
        if name:
            self.save_verdict(name)


def _item(row: Row) -> QTreeWidgetItem:
    item = QTreeWidgetItem([row.name, f"{row.before} → {row.after}", row.state])
    item.setFlags(item.flags() | Qt.ItemFlag.ItemIsUserCheckable)
    item.setCheckState(0, Qt.CheckState.Checked)
    item.setData(0, TARGET, row.target)
    item.setToolTip(0, row.target)
    item.setToolTip(1, f"{row.before} → {row.after}")
    item.setToolTip(2, row.state)
    return item
