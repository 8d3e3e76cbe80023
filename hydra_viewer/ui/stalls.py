"""Stalls: when the main thread did not answer, for how long, and what it did."""

from __future__ import annotations

import sys
import threading
import time
from dataclasses import dataclass

from PySide6.QtCore import QObject, QTimer

BEAT_MS = 5
STALL = 0.05  # seconds without an answer that people feel


@dataclass(frozen=True)
class Stall:
    """A time without an answer.

    Attributes:
        seconds: how long.
        where: the main thread's innermost lines of this program meanwhile, or "" where it was between them.
    """

    seconds: float
    where: str


class Stalls(QObject):
    """Watches the main thread from another one.

    Attributes:
        found: stalls so far.
    """

    def __init__(self, parent: QObject | None = None) -> None:
        super().__init__(parent)
        self.found: list[Stall] = []
        self._beat = time.perf_counter()
        self._where = ""
        self._is_stopped = threading.Event()
        self._main = threading.main_thread().ident or 0
        self._timer = QTimer(self)
        self._timer.timeout.connect(self._on_beat)
        self._timer.start(BEAT_MS)
        self._thread = threading.Thread(target=self._watch, name="viewer-stalls", daemon=True)
        self._thread.start()

    def stop(self) -> None:
        """Ends the watch."""
        self._timer.stop()
        self._is_stopped.set()
        self._thread.join()

    def _on_beat(self) -> None:
        now = time.perf_counter()
        if now - self._beat > STALL:
            self.found.append(Stall(now - self._beat, self._where))
        self._beat, self._where = now, ""

    def _watch(self) -> None:
        while not self._is_stopped.wait(BEAT_MS / 1000):
            if time.perf_counter() - self._beat > STALL / 2 and not self._where:
                self._where = _innermost(self._main)


def _innermost(thread: int) -> str:
    """The innermost lines of the viewer that a thread is in; keeps no frame, whose locals would live on."""
    frame, own = sys._current_frames().get(thread), list[str]()
    while frame is not None and len(own) < 3:
        name = frame.f_code.co_filename
        if "viewer" in name:
            own.append(f"{name.rpartition('/')[2]}:{frame.f_lineno} {frame.f_code.co_name}")
        frame = frame.f_back
    return " < ".join(own)
