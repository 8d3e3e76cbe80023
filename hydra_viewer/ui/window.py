"""The window: the painting widget with its menus, panels and bars."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from PySide6.QtCore import Qt
from PySide6.QtGui import QAction, QCloseEvent, QKeySequence
from PySide6.QtWidgets import QDockWidget, QFileDialog, QMainWindow, QVBoxLayout, QWidget

from hydra_viewer.model.document import Files
from hydra_viewer.model.work import Opened, opening, saving
from hydra_viewer.ui import words
from hydra_viewer.ui.bars import MessageBar, ProgressRow
from hydra_viewer.ui.brush_panel import BrushPanel
from hydra_viewer.ui.painting_widget import PaintingWidget
from hydra_viewer.ui.sentence_panel import SentencePanel
from hydra_viewer.ui.stage_panel import StagePanel
from hydra_viewer.ui.viewports import ViewportMenu
from hydra_viewer.ui.worker import Job

LEFT, RIGHT = Qt.DockWidgetArea.LeftDockWidgetArea, Qt.DockWidgetArea.RightDockWidgetArea


class Window(QMainWindow):
    """A lookdev artist's window on a shot."""

    def __init__(self, options: Mapping[str, Any] | None = None) -> None:
        """Opens nothing yet.

        Args:
            options: of `Shot.open`.
        """
        super().__init__()
        self._options = dict(options or {})
        self.painting = PaintingWidget(parent=self)
        self.document, self.easel, self.worker = self.painting.document, self.painting.easel, self.painting.worker
        self.bar, self._progress = MessageBar(), ProgressRow()
        middle = QWidget()
        layout = QVBoxLayout(middle)
        layout.setContentsMargins(0, 0, 0, 0)
        layout.setSpacing(0)
        layout.addWidget(self.bar)
        layout.addWidget(self.painting, 1)
        self.setCentralWidget(middle)
        self.statusBar().addPermanentWidget(self._progress)
        self.stage_panel, self.brush_panel = StagePanel(self.document), BrushPanel(self.document, self.easel)
        self.sentence_panel = SentencePanel(self.document)
        self.add_panel(words.STAGE_PANEL, self.stage_panel, LEFT)
        self.add_panel(words.BRUSH_PANEL, self.brush_panel, RIGHT)
        self.add_panel(words.FOUND_PANEL, self.sentence_panel, RIGHT)
        self._make_menus()
        self.painting.failed.connect(self.bar.say)
        self.painting.noted.connect(lambda sentence: self.bar.say(sentence, is_error=False))
        self.worker.progressed.connect(self._progress.tell)
        self.worker.idle_changed.connect(self._progress.set_idle)
        self._progress.cancelled.connect(self.worker.cancel)
        for announcer in (self.document.files_changed, self.document.strokes_changed, self.document.shot_changed):
            announcer.connect(self._update_title)
        self.resize(1600, 1000)
        self._update_title()

    def add_panel(self, title: str, panel: QWidget, area: Qt.DockWidgetArea) -> QDockWidget:
        """Adds a panel at a side; returns its dock."""
        dock = QDockWidget(title, self)
        dock.setObjectName(title)
        dock.setWidget(panel)
        self.addDockWidget(area, dock)
        return dock

    # ── menus ──────────────────────────────────────────────────────────────────────────────────

    def action(
        self, words_of: tuple[str, str], do: Callable[[], object], key: QKeySequence.StandardKey | str | None = None
    ) -> QAction:
        """Returns an action with its shortcut in its tooltip.

        Args:
            words_of: its name, and what its tooltip adds.
            do: what it does.
            key: its shortcut; None: none.
        """
        action = QAction(words_of[0], self)
        if key is not None:
            action.setShortcut(QKeySequence(key))
        action.setToolTip(words.tooltip(*words_of, action.shortcut().toString()))
        action.triggered.connect(lambda _=False: do())
        self.addAction(action)
        return action

    def _make_menus(self) -> None:
        standard = QKeySequence.StandardKey
        file, edit = self.menuBar().addMenu(words.FILE), self.menuBar().addMenu(words.EDIT)
        file.addAction(self.action(words.OPEN, self._ask_stage, standard.Open))
        file.addAction(self.action(words.SAVE, self.save, standard.Save))
        file.addAction(self.action(words.SAVE_AS, self._ask_files, "Ctrl+Shift+S"))
        file.addSeparator()
        file.addAction(self.action(words.QUIT, self.close, standard.Quit))
        self.undo_action = self.action(words.UNDO, self.document.undo, standard.Undo)
        self.redo_action = self.action(words.REDO, self.document.redo, "Ctrl+Shift+Z")
        edit.addActions([self.undo_action, self.redo_action])
        edit.addAction(self.action(words.SOLVE, self.painting.solving.solve, "Ctrl+R"))
        edit.addAction(self.action(words.CANCEL, self.worker.cancel, "Ctrl+."))

        self.viewport_menu = ViewportMenu(self.painting.canvas, self)
        self.menuBar().addMenu(words.VIEW).addMenu(self.viewport_menu)

        camera = self.menuBar().addMenu(words.CAMERA)
        camera.addAction(self.action(words.FRAME, self.painting.frame_selected, "F"))

    def _update_title(self) -> None:
        files = self.document.files
        name = Path(files.stage).name if files.stage else words.NO_SHOT
        self.setWindowTitle(f"{name}[*] - {words.TITLE}")
        self.setWindowModified(not self.document.is_saved)
        self.undo_action.setEnabled(bool(self.document.undoes))
        self.redo_action.setEnabled(bool(self.document.redoes))

    # ── files ──────────────────────────────────────────────────────────────────────────────────

    def open(self, files: Files) -> None:
        """Opens a shot, and strokes on it, on the worker."""
        self.worker.start(Job("open", lambda: opening(files, self._options), self._take, self._fail))

    def save(self) -> None:
        """Writes strokes and look, on the worker; asks for names where there are none."""
        document = self.document
        if document.shot is None:
            return
        if not document.files.strokes:
            self._ask_files()
            return
        shot, found, strokes, files = document.shot, document.found, document.strokes, document.files
        done = lambda files: document.mark_saved(files, strokes)  # noqa: E731
        self.worker.start(Job("save", lambda: saving(shot, found, strokes, files), done, self._fail))

    def _take(self, opened: Opened) -> None:
        self.bar.hide()
        self.painting.show_shot(opened.shot, opened.files, opened.strokes)
        if opened.warnings:
            self.bar.say(opened.warnings[0], is_error=False)

    def _fail(self, sentence: str, error: BaseException) -> None:
        self.bar.say(sentence)

    def _ask_stage(self) -> None:
        name, _ = QFileDialog.getOpenFileName(self, words.OPEN[0], "", words.USD_FILES)
        if name:
            self.open(Files(name))

    def _ask_files(self) -> None:
        document = self.document
        beside = str(Path(document.files.stage).with_name("strokes.usda"))
        strokes, _ = QFileDialog.getSaveFileName(
            self, words.CHOOSE_STROKES, document.files.strokes or beside, words.USD_FILES
        )
        if not strokes:
            return
        look = document.files.look or str(Path(strokes).with_name("look.usda"))
        look, _ = QFileDialog.getSaveFileName(self, words.CHOOSE_LOOK, look, words.USD_FILES)
        if look:
            document.mark_saved(Files(document.files.stage, strokes, look), ())
            self.save()

    def closeEvent(self, event: QCloseEvent) -> None:
        self.painting.stop()
        super().closeEvent(event)
