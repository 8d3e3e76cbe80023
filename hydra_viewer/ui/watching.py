"""Watching: whether files of the shot change on the disk."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from PySide6.QtCore import QFileSystemWatcher, QObject, QTimer, Signal

SETTLED_MS = 400  # without another change: a file is often written in several steps


class Watching(QObject):
    """Watches the layers of a shot.

    Attributes:
        changed: Signal(): some changed, and have settled.
    """

    changed = Signal()

    def __init__(self, parent: QObject | None = None) -> None:
        super().__init__(parent)
        self._files: dict[str, tuple[int, int]] = {}
        self._watcher, self._timer = QFileSystemWatcher(self), QTimer(self)
        self._timer.setSingleShot(True)
        self._timer.setInterval(SETTLED_MS)
        self._watcher.fileChanged.connect(lambda _: self._timer.start())
        self._watcher.directoryChanged.connect(lambda _: self._timer.start())
        self._timer.timeout.connect(self._look)

    def watch(self, files: Sequence[str]) -> None:
        """Watches files, in place of those of before; their folders too, as files are renamed into place."""
        old = [*self._watcher.files(), *self._watcher.directories()]
        if old:
            self._watcher.removePaths(old)
        self._files = {file: _stamp(file) for file in files}
        new = [*files, *{str(Path(file).parent) for file in files}]
        if new:
            self._watcher.addPaths(new)

    def _look(self) -> None:
        now = {file: _stamp(file) for file in self._files}
        if now != self._files:
            self.watch(list(now))
            self.changed.emit()


def _stamp(file: str) -> tuple[int, int]:
    """Time of last change and size of a file, zeros where there is none."""
    try:
        status = Path(file).stat()
    except OSError:
        return 0, 0
    return status.st_mtime_ns, status.st_size
