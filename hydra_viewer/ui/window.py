"""The window: the painting widget with its menus, panels and bars."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from PySide6.QtCore import Qt
from PySide6.QtGui import QCloseEvent, QKeySequence
from PySide6.QtWidgets import QDockWidget, QLabel, QMainWindow, QScrollArea, QVBoxLayout, QWidget

from hydra_viewer.model.comparison import Comparison
from hydra_viewer.ui import panel_words, words
from hydra_viewer.ui.actions import Actions, add_camera_actions, add_paint_actions, add_view_actions
from hydra_viewer.ui.bars import FoldedNote, MessageBar, ProgressRow
from hydra_viewer.ui.brush_panel import BrushPanel
from hydra_viewer.ui.cheat_sheet import CheatSheet
from hydra_viewer.ui.compare_layer import CompareLayer
from hydra_viewer.ui.compare_panel import ComparePanel
from hydra_viewer.ui.display_menu import FalseColorLegend
from hydra_viewer.ui.explaining import Explaining
from hydra_viewer.ui.filing import Filing
from hydra_viewer.ui.marks_layer import MarksLayer
from hydra_viewer.ui.painting_widget import PaintingWidget
from hydra_viewer.ui.panel_actions import add_compare_actions, add_panel_actions, add_understanding_actions
from hydra_viewer.ui.review_panel import ReviewPanel
from hydra_viewer.ui.stage_panel import StagePanel
from hydra_viewer.ui.strokes_panel import StrokesPanel
from hydra_viewer.ui.tab_order import tab_through
from hydra_viewer.ui.timeline import Timeline
from hydra_viewer.ui.understanding_panel import UnderstandingPanel
from hydra_viewer.ui.view_bar import ViewBar
from hydra_viewer.ui.viewports import ViewportMenu

LEFT, RIGHT = Qt.DockWidgetArea.LeftDockWidgetArea, Qt.DockWidgetArea.RightDockWidgetArea

LEFT_WIDTH, RIGHT_WIDTH = 300, 376  # of panels, at least [pixels]


class Window(QMainWindow):
    """A lookdev artist's window on a shot.

    Attributes:
        painting: the picture and what belongs to it; `document`, `easel` and `worker` are its own.
        filing: opens, saves, recovers.
        bar: sentences for people.
        docks: of the panels.
    """

    def __init__(self, options: Mapping[str, Any] | None = None) -> None:
        """Opens nothing yet.

        Args:
            options: of `Shot.open`.
        """
        super().__init__()
        self.docks: list[QDockWidget] = []
        self.painting = PaintingWidget(parent=self)
        self.document, self.easel, self.worker = self.painting.document, self.painting.easel, self.painting.worker
        self.bar, self._progress = MessageBar(self.painting), ProgressRow()
        self.filing = Filing(self.painting, self.bar, dict(options or {}), self)
        self.view_bar, self.timeline = ViewBar(self.painting), Timeline(self.document, self.worker)
        self._lay_out()
        self.actions_of = Actions(self)
        self._make_menus()
        self.painting.failed.connect(self.bar.say)
        self.painting.noted.connect(lambda sentence: self.bar.say(sentence, is_error=False))
        self.document.message_changed.connect(lambda: self.bar.say(self.document.message))
        self.worker.progressed.connect(self._progress.tell)
        self.worker.idle_changed.connect(self._progress.set_idle)
        self._progress.cancelled.connect(self.worker.cancel)
        for announcer in (self.document.files_changed, self.document.strokes_changed, self.document.shot_changed):
            announcer.connect(self._update_title)
        self.setDockNestingEnabled(True)
        self.resize(1600, 1000)
        self._update_title()

    def _lay_out(self) -> None:
        middle = QWidget()
        layout = QVBoxLayout(middle)
        layout.setContentsMargins(0, 0, 0, 0)
        layout.setSpacing(0)
        layout.addWidget(self.view_bar)
        layout.addWidget(self.painting, 1)
        layout.addWidget(self.timeline)
        self.setCentralWidget(middle)
        self._drawn_by = QLabel(self.painting.canvas.kind.name)
        self._drawn_by.setProperty("isDim", True)
        self._drawn_by.setContentsMargins(8, 0, 0, 0)
        self._note = FoldedNote()
        self.bar.folded.connect(self._note.show_note)
        self.statusBar().addWidget(self._drawn_by)
        self.statusBar().addWidget(self._note, 1)
        self.statusBar().addPermanentWidget(self._progress)
        self.stage_panel, self.brush_panel = StagePanel(self.document), BrushPanel(self.document, self.easel)
        self.stage_panel.camera_chosen.connect(self.painting.look_through)
        left = self.add_panel(words.STAGE_PANEL, self.stage_panel, LEFT)
        brush = self.add_panel(words.BRUSH_PANEL, self.brush_panel, LEFT)
        self._add_panels_of_strokes()
        self.resizeDocks([left], [330], Qt.Orientation.Horizontal)
        self.resizeDocks([left, brush], [310, 630], Qt.Orientation.Vertical)

    def _add_panels_of_strokes(self) -> None:
        document, easel, canvas = self.document, self.easel, self.painting.canvas
        self.explaining, self.comparison = Explaining(document, easel, self.worker, self), Comparison()
        self.explaining.failed.connect(self.bar.say)
        self.marks = MarksLayer(document, easel, self.explaining, canvas.overlay)
        self.compare_layer = CompareLayer(document, easel, self.comparison, canvas)
        self.understanding_panel = UnderstandingPanel(document, easel, self.explaining)
        self.strokes_panel = StrokesPanel(document, easel, self.explaining, self.painting.solving.solve_again)
        self.compare_panel = ComparePanel(document, self.comparison)
        above = self.add_panel(words.FOUND_PANEL, self.understanding_panel, RIGHT)
        below = self.add_panel(panel_words.STROKES_PANEL, self.strokes_panel, RIGHT)
        self.review_panel = ReviewPanel(document, easel, self.worker)
        self.review_panel.failed.connect(self.bar.say)
        self.tabifyDockWidget(below, self.add_panel(panel_words.COMPARE_PANEL, self.compare_panel, RIGHT))
        self.tabifyDockWidget(above, self.add_panel(panel_words.REVIEW_PANEL, self.review_panel, RIGHT))
        for each in (above, below):
            each.raise_()
        self.resizeDocks([above, below], [600, 340], Qt.Orientation.Vertical)
        self.resizeDocks([above, below], [350, 350], Qt.Orientation.Horizontal)

    def add_panel(self, title: str, panel: QWidget, area: Qt.DockWidgetArea) -> QDockWidget:
        """Adds a panel at a side; returns its dock."""
        dock, scrolled = QDockWidget(title, self), QScrollArea()
        scrolled.setWidget(panel)
        scrolled.setWidgetResizable(True)
        scrolled.setFrameShape(QScrollArea.Shape.NoFrame)
        scrolled.setHorizontalScrollBarPolicy(Qt.ScrollBarPolicy.ScrollBarAlwaysOff)
        scrolled.setMinimumWidth(LEFT_WIDTH if area == LEFT else RIGHT_WIDTH)
        dock.setObjectName(title)
        dock.setWidget(scrolled)
        self.addDockWidget(area, dock)
        tab_through(panel)
        self.docks.append(dock)
        return dock

    def _make_menus(self) -> None:
        standard, actions, filing = QKeySequence.StandardKey, self.actions_of, self.filing
        file = actions.menu(words.FILE)
        actions.add(file, words.OPEN, filing.ask_stage, standard.Open)
        actions.add(file, words.OPEN_STROKES, filing.ask_strokes, "Ctrl+Shift+O")
        actions.add(file, words.RELOAD_SHOT, filing.reload, "F5")
        file.addSeparator()
        actions.add(file, words.SAVE, filing.save, standard.Save)
        actions.add(file, words.SAVE_AS, filing.save_as, "Ctrl+Shift+S")
        file.addSeparator()
        actions.add(file, words.QUIT, self.close, standard.Quit)
        edit = actions.menu(words.EDIT)
        self.undo_action = actions.add(edit, words.UNDO, self.document.undo, standard.Undo)
        self.redo_action = actions.add(edit, words.REDO, self.document.redo, "Ctrl+Shift+Z")
        edit.addSeparator()
        actions.add(edit, words.SOLVE, self.painting.solving.solve_again, "Ctrl+R")
        actions.add(edit, words.CANCEL, self.worker.cancel, "Ctrl+.")
        add_paint_actions(actions, self.easel)
        add_understanding_actions(actions, self.understanding_panel)
        add_camera_actions(actions, self.painting)
        view = add_view_actions(actions, self.easel)
        play = actions.add(view, words.PLAY, self.timeline.play.toggle, words.PLAY_KEY)
        play.setShortcutContext(Qt.ShortcutContext.WidgetShortcut)  # elsewhere space presses what has the keys
        self.painting.canvas.addAction(play)
        view.addSeparator()
        self.viewport_menu = ViewportMenu(self.painting.canvas, self)
        self.viewport_menu.triggered.connect(lambda _: self._drawn_by.setText(self.painting.canvas.kind.name))
        view.addMenu(self.viewport_menu)
        view.addMenu(self.view_bar.display_menu)
        shows = [*self.view_bar.display_menu.channels.values(), self.view_bar.display_menu.reset]
        self.addActions(shows)
        actions.list_too([*self.viewport_menu.actions(), *shows])
        self.legend = FalseColorLegend(self.easel, self.painting.canvas)
        add_panel_actions(actions, self.docks, self.painting.canvas)
        add_compare_actions(actions, self.comparison, self.compare_panel)
        actions.add(actions.menu(words.HELP), words.KEYS, self.show_keys, "F1")

    def show_keys(self) -> None:
        """Shows the cheat sheet."""
        CheatSheet(self.actions_of.menus, self).show()

    def _update_title(self) -> None:
        files = self.document.files
        name = Path(files.stage).name if files.stage else words.NO_SHOT
        self.setWindowTitle(f"{name}[*] - {words.TITLE}")
        self.setWindowModified(not self.document.is_saved)
        for action, words_of, what in (
            (self.undo_action, words.UNDO, self.document.undoes), (self.redo_action, words.REDO, self.document.redoes),
        ):  # fmt: skip
            action.setEnabled(bool(what))
            action.setText(f"{words_of[0]} {what}".rstrip())

    def closeEvent(self, event: QCloseEvent) -> None:
        if not self.filing.may_leave(self.close):
            event.ignore()
            return
        self.compare_layer.stop()
        self.painting.stop()
        self.filing.autosave.stop()
        super().closeEvent(event)
