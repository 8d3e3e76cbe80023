"""Stalls: when the main thread did not answer, for how long, and why.

Either it worked itself (`own`), or another thread held Python's lock in one call (`held`: the watching thread did not
get it either), or the processors were somebody else's.
"""

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
        own: seconds that the main thread worked in it.
        held: seconds, the longest of it, that nobody got Python's lock.
        where: the main thread's innermost lines of this program meanwhile, or "" where it was between them.
    """

    seconds: float
    own: float
    held: float
    where: str


class Stalls(QObject):
    """Watches the main thread from another one.

    Attributes:
        found: stalls so far.
    """

    def __init__(self, parent: QObject | None = None) -> None:
        super().__init__(parent)
        self.found: list[Stall] = []
        self._beat, self._worked = time.perf_counter(), time.thread_time()
        self._where, self._held = "", 0.0
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
        now, worked = time.perf_counter(), time.thread_time()
        if now - self._beat > STALL:
            self.found.append(Stall(now - self._beat, worked - self._worked, self._held, self._where))
        self._beat, self._worked, self._where, self._held = now, worked, "", 0.0

    def _watch(self) -> None:
        while True:
            asked = time.perf_counter()
            if self._is_stopped.wait(BEAT_MS / 1000):
                return
            now = time.perf_counter()
            self._held = max(self._held, now - asked - BEAT_MS / 1000)
            if now - self._beat > STALL / 2 and not self._where:
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
