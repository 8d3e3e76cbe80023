"""Solving: whenever strokes change, what they ask for is found anew, on the worker, and what is stale is cancelled."""

from __future__ import annotations

import tempfile
from collections.abc import Callable
from pathlib import Path

from PySide6.QtCore import QObject, QTimer, Signal

from hydra_viewer.model.document import Document
from hydra_viewer.model.found import Found
from hydra_viewer.model.work import finding
from hydra_viewer.ui.worker import Job, Worker

KIND, WARM = "solve", "warm"
REST = 0.02  # seconds in which a stroke, or an answer, is shown


class Solving(QObject):
    """Keeps what was found up with the strokes.

    Attributes:
        failed: Signal(str): why the strokes ask for nothing that can be found.
        found: Signal(): another sentence, or another picture, is there.
    """

    failed = Signal(str)
    found = Signal()

    def __init__(
        self, document: Document, worker: Worker, needs_look: Callable[[], bool], parent: QObject | None = None
    ) -> None:  # fmt: skip
        """Solves nothing yet.

        Args:
            needs_look: whether the picture shows nothing of what was found until the look is written.
        """
        super().__init__(parent)
        self._document, self._worker, self._needs_look = document, worker, needs_look
        self._folder = tempfile.TemporaryDirectory(prefix="usdslf-looks-")
        self.destroyed.connect(self._folder.cleanup)  # by a host that does not stop it first
        document.strokes_changed.connect(self.solve)
        document.shot_changed.connect(self._on_shot_changed)

    def _on_shot_changed(self) -> None:
        """Drops what is being found on another shot; what was not found yet is found on this one."""
        self._worker.cancel(KIND)
        QTimer.singleShot(0, self, self._solve_rest)

    def _solve_rest(self) -> None:
        if not self._worker.is_doing(KIND):
            self.solve()

    def solve(self) -> None:
        """Finds what the active strokes ask for, in place of what is being found."""
        document, shot, strokes = self._document, self._document.shot, self._document.active
        if shot is None or document.is_shown:
            self._worker.cancel(KIND)
            return
        if not strokes:
            self._worker.cancel(KIND)
            self._take(None)
            return
        self._worker.cancel(WARM)
        folder, is_look_first = Path(self._folder.name), self._needs_look()
        steps = lambda: finding(shot, strokes, folder, is_look_first)  # noqa: E731
        self._worker.start(Job(KIND, steps, self._take, self._fail, self._take, rest=REST))

    def solve_again(self) -> None:
        """Finds anew what the strokes ask for, also where that was found already."""
        self._document.found = None
        self.solve()

    def stop(self) -> None:
        """Removes the looks that were only looked at."""
        self._folder.cleanup()

    def _take(self, found: Found | None) -> None:
        self._document.take_found(found)
        self.found.emit()

    def _fail(self, sentence: str, error: BaseException) -> None:
        self.failed.emit(sentence)
