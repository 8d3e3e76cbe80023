"""Filing: opens, saves, recovers and reloads; asks before unsaved work is lost."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from PySide6.QtCore import QObject
from PySide6.QtWidgets import QFileDialog, QMessageBox, QWidget

from hydra_viewer.model.autosave import Autosave, Recovered
from hydra_viewer.model.document import Files
from hydra_viewer.model.work import Opened, opening, preparing, reopening, saving
from hydra_viewer.ui import words
from hydra_viewer.ui.bars import MessageBar
from hydra_viewer.ui.painting_widget import PaintingWidget
from hydra_viewer.ui.watching import Watching
from hydra_viewer.ui.worker import Job
from usdslf import Camera, Shot, Stroke

Answer = QMessageBox.StandardButton


class Filing(QObject):
    """The files of a window's document.

    Attributes:
        asks: about strokes that are not saved; False: somebody else keeps them.
    """

    def __init__(self, painting: PaintingWidget, bar: MessageBar, options: dict[str, Any], window: QWidget) -> None:
        super().__init__(window)
        self._painting, self._bar, self._options, self._window = painting, bar, options, window
        self._document, self._worker = painting.document, painting.worker
        self.asks = True
        self.autosave, self._watching = Autosave(self._document), Watching(self)
        self._watching.changed.connect(self._on_stage_changed)
        self._worker.idle_changed.connect(lambda is_idle: self.autosave.hold(not is_idle and self.autosave.is_held))

    # ── open ───────────────────────────────────────────────────────────────────────────────────

    def open(self, files: Files) -> None:
        """Opens a shot, and strokes on it, on the worker; asks about what is not saved first."""
        if self.may_leave(lambda: self.open(files)):
            self._worker.start(Job("open", lambda: opening(files, self._options), self._take, self._fail))

    def open_shot(
        self, shot: Shot, strokes: Sequence[Stroke] = (), camera: Callable[[Shot], Camera] | None = None
    ) -> None:
        """Takes in a shot that another program has open; asks about what is not saved first.

        Args:
            shot: its light is made on the worker.
            strokes: on it.
            camera: returns what it is looked at through; None: its first one.
        """

        def take(opened: Opened) -> None:
            self._take(opened)
            if camera is not None:
                self._painting.look_through(camera(shot))

        if self.may_leave(lambda: self.open_shot(shot, strokes, camera)):
            steps = lambda: preparing(shot, Files(shot.path), tuple(strokes))  # noqa: E731
            self._worker.start(Job("open", steps, take, self._fail))

    def reload(self) -> None:
        """Reads the shot anew from the disk; strokes stay, and are put on it again."""
        shot, files = self._document.shot, self._document.files
        if shot is not None:
            self._bar.hide()  # the question whether to, where it is there
            self.autosave.hold(True)
            is_shown = self._painting.canvas.let_go()
            is_read = lambda: self.autosave.is_writing or is_shown()  # noqa: E731
            steps = lambda: reopening(shot, files, self._options, is_read)  # noqa: E731
            self._worker.start(Job("open", steps, self._take_again, self._fail, is_alone=True))

    def _take(self, opened: Opened) -> None:
        self._bar.clear()
        self.autosave.pause()
        self._painting.show_shot(opened)
        self.autosave.begin()
        self._watching.watch(opened.layers)
        if opened.left is not None:
            self._offer(opened.left)
        elif opened.warnings:
            self._bar.say(opened.warnings[0], is_error=False)

    def _take_again(self, opened: Opened) -> None:
        self.autosave.hold(False)
        self._document.take_shot(opened.shot, None, opened.prims)
        self._watching.watch(opened.layers)
        self._painting.solving.solve()

    def _offer(self, left: Recovered) -> None:
        at = time.strftime("%H:%M, %d %B", time.localtime(left.kept_at))
        document = self._document
        self._bar.say(
            words.found_unsaved(len(left.strokes), at),
            is_error=False,
            answers={
                words.RECOVER: lambda: document.change_strokes(words.recovery(), left.strokes),
                words.DISCARD: self.autosave.forget,
            },
        )

    def _on_stage_changed(self) -> None:
        self._bar.say(words.STAGE_CHANGED, is_error=False, answers={words.RELOAD: self.reload})

    def _fail(self, sentence: str, error: BaseException) -> None:
        self._bar.say(sentence)

    # ── save ───────────────────────────────────────────────────────────────────────────────────

    def save(self, then: Callable[[], object] = lambda: None) -> None:
        """Writes strokes and look, on the worker; asks for names where there are none.

        Args:
            then: what comes when both are on the disk.
        """
        document = self._document
        if document.shot is not None and document.files.strokes:
            self._save_to(document.files, then)
        elif document.shot is not None:
            self.save_as(then)

    def save_as(self, then: Callable[[], object] = lambda: None) -> None:
        """Asks where strokes and look go, and writes them; `then` as of `save`."""
        files = self._document.files
        beside = Path(files.stage or "shot.usda")
        strokes = self._ask_name(words.CHOOSE_STROKES, files.strokes or str(beside.with_name("strokes.usda")))
        if strokes:
            look = self._ask_name(words.CHOOSE_LOOK, files.look or str(Path(strokes).with_name("look.usda")))
            if look:
                self._save_to(replace(files, strokes=strokes, look=look), then)

    def _save_to(self, files: Files, then: Callable[[], object]) -> None:
        document = self._document
        shot, found, strokes = document.shot, document.found, document.strokes
        assert shot is not None

        def done(files: Files) -> None:
            self.autosave.forget()
            document.mark_saved(files, strokes)
            if not document.is_saved:  # they go on being painted meanwhile
                self.autosave.keep()
            then()

        self._worker.start(Job("save", lambda: saving(shot, found, strokes, files), done, self._fail))

    def may_leave(self, then: Callable[[], object]) -> bool:
        """Asks about strokes that are not saved; returns whether they may be lost.

        Args:
            then: what was to be done, done once they are saved where that is the answer.
        """
        if self._document.is_saved or self._document.shot is None or not self.asks:
            return True
        asked = QMessageBox(QMessageBox.Icon.Question, words.TITLE, words.NOT_SAVED, parent=self._window)
        asked.setInformativeText(words.NOT_SAVED_MORE)
        asked.setStandardButtons(Answer.Save | Answer.Discard | Answer.Cancel)
        asked.setDefaultButton(Answer.Save)
        answer = Answer(asked.exec())
        if answer == Answer.Save:
            self.save(then)
            return False
        if answer == Answer.Discard:
            self.autosave.forget()
            return True
        return False

    # ── names ──────────────────────────────────────────────────────────────────────────────────

    def ask_stage(self) -> None:
        """Asks for a shot, and opens it."""
        name, _ = QFileDialog.getOpenFileName(self._window, words.OPEN[0], "", words.USD_FILES)
        if name:
            self.open(Files(name))

    def ask_strokes(self) -> None:
        """Asks for a stroke layer, and opens the shot with it."""
        name, _ = QFileDialog.getOpenFileName(self._window, words.OPEN_STROKES[0], "", words.USD_FILES)
        if name and self._document.files.stage:
            self.open(replace(self._document.files, strokes=name))

    def _ask_name(self, title: str, proposed: str) -> str:
        name, _ = QFileDialog.getSaveFileName(self._window, title, proposed, words.USD_FILES)
        return name
