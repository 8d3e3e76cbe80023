"""Collecting: cycles of Python objects are freed on the main thread while there are windows.

Python looks for cycles on whatever thread allocates at the moment.  A widget that is freed on a worker's thread takes
the program down with it, as Qt's objects belong to the main thread.  So Python's own collector is switched off while a
window lives, and a timer of the main thread does what it would have done.

    collect_here()      from now on; once is enough
    collect_anywhere()  when the last window is gone: frees what it left, and gives the work back to Python
"""

from __future__ import annotations

import gc
import time

from PySide6.QtCore import QCoreApplication, QEvent, Qt, QTimer
from PySide6.QtGui import QGuiApplication

EVERY = 50  # milliseconds
OLDEST_EVERY = 10.0  # seconds, at least, between collections of all there is, which people may feel

_timers: list[QTimer] = []
_last = [0.0]  # time of the last collection of all there is


def collect_here() -> None:
    """Frees cycles on this thread only, which is the main thread and runs Qt's events."""
    if not _timers:
        timer = QTimer()
        timer.timeout.connect(_collect)
        _timers.append(timer)
    if not _timers[0].isActive():
        gc.disable()
        gc.collect()
        gc.freeze()  # what there is now is not looked through again and again
        _timers[0].start(EVERY)


def collect_anywhere() -> None:
    """Frees what windows left, on this thread, and lets Python collect again by itself."""
    for timer in _timers:
        timer.stop()
    QCoreApplication.sendPostedEvents(None, QEvent.Type.DeferredDelete)
    gc.unfreeze()
    gc.collect()
    gc.enable()


def _collect() -> None:
    """Collects as old a generation as Python's own collector would, the oldest rarely and never in a stroke."""
    count, most = gc.get_count(), gc.get_threshold()
    if count[0] > most[0] > 0:
        generation = max((g for g in (1, 2) if count[g] > most[g] > 0), default=0)
        now = time.monotonic()
        is_busy = now - _last[0] < OLDEST_EVERY or QGuiApplication.mouseButtons() != Qt.MouseButton.NoButton
        if generation == 2 and not is_busy:
            _last[0] = now
        gc.collect(min(generation, 1) if is_busy else generation)
