"""Objects of Qt are freed on the main thread, whatever thread allocates meanwhile."""

from __future__ import annotations

import gc
import os
import threading
import weakref

os.environ.setdefault("QT_QPA_PLATFORM", "offscreen")

from kit.windows import wait_for
from PySide6.QtCore import QObject

from hydra_viewer.ui.application import make_application
from hydra_viewer.ui.collector import collect_anywhere, collect_here


class _Circle(QObject):
    """An object that only a search for cycles frees."""

    def __init__(self) -> None:
        super().__init__()
        self.me = self


def test_cycles_are_freed_on_the_main_thread() -> None:
    make_application()
    freed_on: list[int] = []
    collect_here()
    try:
        for _ in range(50):
            weakref.finalize(_Circle(), lambda: freed_on.append(threading.get_ident()))
        kept: list[list[int]] = []
        other = threading.Thread(target=lambda: kept.extend([n] for n in range(200_000)))
        other.start()
        other.join()
        assert not freed_on  # Python's own collector would have freed them on that thread
        wait_for(lambda: len(freed_on) == 50, 10)
    finally:
        collect_anywhere()
    assert set(freed_on) == {threading.get_ident()}
    assert gc.isenabled()


def test_what_a_window_left_is_freed_before_python_collects_again() -> None:
    make_application()
    collect_here()
    freed = weakref.finalize(_Circle(), lambda: None)
    assert freed.alive and not gc.isenabled()
    collect_anywhere()
    assert not freed.alive and gc.isenabled()
