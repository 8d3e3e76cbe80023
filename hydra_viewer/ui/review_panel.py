"""The panel Review: what the saved look changes, by pictures and numbers, and what a person accepts of it."""

from __future__ import annotations

from pathlib import Path

from PySide6.QtCore import QSignalBlocker, Qt, Signal
from PySide6.QtGui import QColor
from PySide6.QtWidgets import (
    QComboBox,
    QDoubleSpinBox,
    QFileDialog,
    QHBoxLayout,
    QLabel,
    QLineEdit,
    QPushButton,
    QVBoxLayout,
    QWidget,
)

from hydra_viewer.model.comparison import MOST_GAIN
from hydra_viewer.model.document import Document
from hydra_viewer.model.easel import Easel
from hydra_viewer.model.reviewing import details_of, reviewing, switching
from hydra_viewer.model.verdict import Verdict, rows_of
from hydra_viewer.ui import panel_words as words
from hydra_viewer.ui import theme
from hydra_viewer.ui.choice_row import choice_row
from hydra_viewer.ui.review_details import ReviewDetails
from hydra_viewer.ui.review_picture import MAGNIFIED, MODES, ReviewPicture
from hydra_viewer.ui.review_tree import ReviewTree
from hydra_viewer.ui.swatches import shown
from hydra_viewer.ui.words import tooltip
from hydra_viewer.ui.worker import Job, Worker
from usdslf import LookReview
from usdslf.review import Review, page_of

REVIEW, SWITCH = "review", "switch"
WRONG = "#e0988f"


class ReviewPanel(QWidget):
    """What the saved look changes.

    Attributes:
        verdict: what was decided; None: nothing was reviewed yet.
        review: with pictures; None: not there yet.
        tree: a row a change; what is checked is accepted.
        picture: of one view.
        views: which one.
        modes, gain: how it is shown: buttons by mode; what differences are magnified by.
        details: of the selected change.
        failed: Signal(str): a sentence.
    """

    failed = Signal(str)

    def __init__(self, document: Document, easel: Easel, worker: Worker, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._document, self._easel, self._worker = document, easel, worker
        self.verdict: Verdict | None = None
        self.review: Review | None = None
        self.summary = _wrapped(words.NOT_REVIEWED)
        self.tree, self.details, self.picture, self.views = ReviewTree(), ReviewDetails(), ReviewPicture(), QComboBox()
        self.note, self.switch = QLineEdit(), QPushButton()
        self.note.setPlaceholderText(words.NOTE)
        self.views.setToolTip(words.REVIEW_VIEW_TIP)
        self.views.setSizeAdjustPolicy(QComboBox.SizeAdjustPolicy.AdjustToMinimumContentsLengthWithIcon)
        self._said = {title: (_title(title), _wrapped("")) for title in (words.SURVIVES, words.FINDINGS, words.FROM)}
        self._lay_out()
        self.tree.decided.connect(self._decide)
        self.tree.itemSelectionChanged.connect(self._show_selected)
        self.note.textEdited.connect(self._take_note)
        self.switch.clicked.connect(lambda _=False: self._switch())
        self.views.activated.connect(lambda _=0: self._show_view())
        document.files_changed.connect(self._update)
        document.shot_changed.connect(self._forget)
        easel.display_changed.connect(self._show_view)
        self._forget()

    # ── layout ─────────────────────────────────────────────────────────────────────────────────

    def _lay_out(self) -> None:
        layout = QVBoxLayout(self)
        layout.setContentsMargins(8, 8, 8, 8)
        layout.setSpacing(6)
        layout.addLayout(self._buttons())
        layout.addWidget(self.summary)
        modes = self._mode_row()
        row = QHBoxLayout()
        row.addWidget(self.views, 1)
        row.addWidget(self.gain)
        layout.addLayout(row)
        layout.addLayout(modes)
        for each in (self.picture, self.tree, self.details):
            layout.addWidget(each)
        row = QHBoxLayout()
        row.addWidget(self.note, 1)
        row.addWidget(self.switch)
        layout.addLayout(row)
        for title, text in self._said.values():
            layout.addWidget(title)
            layout.addWidget(text)
        layout.addStretch(1)

    def _buttons(self) -> QHBoxLayout:
        row = QHBoxLayout()
        row.setSpacing(4)
        self.review_button, self.save_button, self.page_button = (
            QPushButton(w[0]) for w in (words.REVIEW, words.SAVE_VERDICT, words.SAVE_PAGE)
        )
        for button, words_of, do in (
            (self.review_button, words.REVIEW, self.start), (self.save_button, words.SAVE_VERDICT, self._ask_verdict),
            (self.page_button, words.SAVE_PAGE, self._ask_page),
        ):  # fmt: skip
            button.setToolTip(tooltip(*words_of, ""))
            button.setStyleSheet("padding: 3px 2px;")
            button.clicked.connect(lambda _=False, do=do: do())
            row.addWidget(button)
        return row

    def _mode_row(self) -> QHBoxLayout:
        row, self.modes = choice_row(self, MODES, words.REVIEW_MODES, self._set_mode)
        for button in self.modes.values():
            button.setStyleSheet("padding: 3px 3px;")
        self.modes[self.picture.mode].setChecked(True)
        self.gain = QDoubleSpinBox(decimals=0, minimum=1, maximum=MOST_GAIN, prefix=words.TIMES)
        self.gain.setValue(self.picture.gain)
        self.gain.setStepType(QDoubleSpinBox.StepType.AdaptiveDecimalStepType)
        self.gain.setToolTip(words.REVIEW_GAIN)
        self.gain.setAccessibleName(words.GAIN)
        self.gain.valueChanged.connect(self.picture.set_gain)
        self._set_mode(self.picture.mode)
        return row

    def _set_mode(self, mode: str) -> None:
        self.picture.set_mode(mode)
        self.gain.setEnabled(mode in MAGNIFIED)

    # ── reviewing ──────────────────────────────────────────────────────────────────────────────

    def start(self) -> None:
        """Reviews the look as it was saved, on the worker: what is said of it, then pictures."""
        document = self._document
        shot, look = document.shot, document.files.look
        if shot is None or not (look and Path(look).is_file()):
            self.failed.emit(words.SAVE_FIRST)
            return
        self.picture.clear()
        steps = lambda: reviewing(shot, look)  # noqa: E731
        self._worker.start(Job(REVIEW, steps, self._take_pictures, self._fail, self._take))

    def _take(self, said: LookReview) -> None:
        """What was said of it; decisions of an earlier review of the same look stay."""
        before = self.verdict
        self.verdict, self.review = Verdict(said), None
        rows = rows_of(said)
        if before is not None and before.review.look == said.look:
            targets = {row.target for row in rows}
            self.verdict.rejected = before.rejected & targets
            self.verdict.notes = {t: note for t, note in before.notes.items() if t in targets}
        self.tree.show_rows(rows, self.verdict.rejected, self._shown)
        self.summary.setText(words.summary(said.as_values()["summary"]))
        self.summary.setStyleSheet(f"color: {WRONG if said.findings else theme.TEXT};")
        risks = [f"{r.message} ({r.source})" for r in said.risks]
        self._say(words.SURVIVES, risks, words.ALL_SURVIVES)
        self._say(words.FINDINGS, [*(f.message for f in said.findings), *said.validator_errors], words.NO_FINDINGS)
        self._say(words.FROM, [words.provenance({"look": said.look, "sha256": said.look_hash, **said.provenance})], "")
        self._update()

    def _take_pictures(self, review: Review) -> None:
        self.review = review
        with QSignalBlocker(self.views):
            self.views.clear()
            for seen in review.views:
                kind = seen.pictures.view.kind
                self.views.addItem(words.view_name(seen.pictures.view.name, kind))
        self._show_view()
        self._show_selected()
        self._update()

    def _say(self, title: str, sentences: list[str], otherwise: str) -> None:
        label = self._said[title][1]
        label.setText("\n\n".join(s.replace("/", "/\u200b") for s in sentences) or otherwise)

    def _fail(self, sentence: str, error: BaseException) -> None:
        self.failed.emit(sentence)

    def _forget(self) -> None:
        self.verdict = self.review = None
        self.tree.clear()
        self.views.clear()
        self.picture.clear()
        self.details.show_details(None, self._shown)
        self.summary.setText(words.NOT_REVIEWED)
        self.summary.setStyleSheet(f"color: {theme.DIM};")
        self._update()

    def _update(self) -> None:
        self.review_button.setEnabled(bool(self._document.files.look))
        self.save_button.setEnabled(self.verdict is not None)
        self.page_button.setEnabled(self.review is not None)
        said = (x for pair in self._said.values() for x in pair)
        own = (self.views, self.picture, self.tree, self.details, self.note, self.switch, self.gain)
        parts = (*own, *self.modes.values(), *said)
        for each in parts:
            each.setVisible(self.verdict is not None)
        self._show_selected()

    def _show_view(self) -> None:
        shot, number = self._document.shot, self.views.currentIndex()
        if self.review is not None and shot is not None and number >= 0:
            self.picture.show_view(self.review, number, shot, self._easel.display)

    def _shown(self, linear: object) -> QColor:
        shot = self._document.shot
        assert shot is not None
        return shown(linear, shot, self._easel.display)  # type: ignore[arg-type]

    # ── the selected change ────────────────────────────────────────────────────────────────────

    def _show_selected(self) -> None:
        row, verdict = self.tree.selected, self.verdict
        for each in (self.note, self.switch):
            each.setEnabled(row is not None)
        self.note.setText(verdict.notes.get(row.target, "") if verdict and row else "")
        words_of = words.ON if row is not None and row.is_off else words.OFF
        self.switch.setText(words_of[0])
        self.switch.setToolTip(tooltip(*words_of, ""))
        found = details_of(verdict.review, self.review, row.material) if verdict and row else None
        self.details.show_details(found, self._shown)

    def _decide(self, target: str, is_accepted: bool) -> None:
        if self.verdict is not None:
            self.verdict.decide(target, is_accepted)

    def _take_note(self, text: str) -> None:
        row = self.tree.selected
        if self.verdict is not None and row is not None:
            self.verdict.notes[row.target] = text

    def _switch(self) -> None:
        """Switches the selected change off or on in the look's file, and reviews it again."""
        row, look = self.tree.selected, self._document.files.look
        if row is not None and look:
            steps = lambda: switching(look, row.target, row.is_off)  # noqa: E731
            self._worker.start(Job(SWITCH, steps, lambda _: self.start(), self._fail))

    # ── files ──────────────────────────────────────────────────────────────────────────────────

    def save_verdict(self, path: str) -> None:
        """Writes what was decided to a file."""
        if self.verdict is None:
            return
        try:
            self.verdict.write(path)
        except OSError as error:
            self.failed.emit(words.not_written(path, error.strerror or str(error)))

    def save_page(self, path: str) -> None:
        """Writes the review as a page."""
        if self.review is None:
            return
        try:
            Path(path).write_text(page_of(self.review), encoding="utf-8")
        except OSError as error:
            self.failed.emit(words.not_written(path, error.strerror or str(error)))

    def _ask_verdict(self) -> None:
        name, _ = QFileDialog.getSaveFileName(self, words.SAVE_VERDICT[1], self._beside(".verdict.json"),
                                              words.JSON_FILES)  # fmt: skip
        if name:
            self.save_verdict(name)

    def _ask_page(self) -> None:
        name, _ = QFileDialog.getSaveFileName(self, words.SAVE_PAGE[1], self._beside(".review.html"), words.HTML_FILES)
        if name:
            self.save_page(name)

    def _beside(self, suffix: str) -> str:
        return str(Path(self._document.files.look).with_suffix(suffix))


def _wrapped(text: str) -> QLabel:
    label = QLabel(text)
    label.setTextFormat(Qt.TextFormat.PlainText)
    label.setWordWrap(True)
    label.setMinimumWidth(40)
    label.setTextInteractionFlags(Qt.TextInteractionFlag.TextSelectableByMouse)
    return label


def _title(text: str) -> QLabel:
    label = QLabel(text)
    label.setStyleSheet(f"color: {theme.DIM}; font-weight: bold; margin-top: 4px;")
    return label
