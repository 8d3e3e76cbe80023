"""The worker: what is alone has the shot for itself, and who waits for the end of all work is not told too early."""

from __future__ import annotations

import os
import sys
import threading
from collections.abc import Generator
from types import SimpleNamespace
from typing import Any, cast

os.environ.setdefault("QT_QPA_PLATFORM", "offscreen")

import pytest
import shiboken6
from kit.windows import wait_for
from PySide6.QtWidgets import QWidget

from hydra_viewer.model.document import Document
from hydra_viewer.model.easel import Easel
from hydra_viewer.ui.application import make_application
from hydra_viewer.ui.canvas import Canvas
from hydra_viewer.ui.live_viewport import _KEPT, LiveViewport
from hydra_viewer.ui.painting_widget import PaintingWidget
from hydra_viewer.ui.viewport import Shown, ViewportKind
from hydra_viewer.ui.worker import Job, Worker
from usdslf import Progress


class Bench:
    """A worker, and jobs that go on until they are let."""

    def __init__(self) -> None:
        make_application()
        self.worker = Worker()
        self.let, self.begun = ({n: threading.Event() for n in "ab"} for _ in range(2))
        self.running = list[str]()
        self.most, self.done, self.idle = 0, list[str](), list[bool]()
        self.worker.idle_changed.connect(self.idle.append)

    def start(self, name: str, kind: str, is_alone: bool = False) -> None:
        done, failed = lambda _: self.done.append(name), lambda *_: None
        self.worker.start(Job(kind, lambda: self._steps(name), done, failed, is_alone=is_alone))

    def _steps(self, name: str) -> Generator[Progress, None, None]:
        self.running.append(name)
        self.nice = os.getpriority(os.PRIO_PROCESS, threading.get_native_id()) if sys.platform == "linux" else 0
        self.begun[name].set()
        try:
            yield Progress("read", 0.0)
            assert self.let[name].wait(20)  # as a call that cannot be split
            yield Progress("read", 1.0)
        finally:
            self.running.remove(name)


@pytest.fixture
def bench() -> Bench:
    return Bench()


def test_what_begins_while_a_job_is_alone_waits_for_it(bench: Bench) -> None:
    bench.start("a", "open", is_alone=True)
    wait_for(lambda: bench.running == ["a"])
    bench.start("b", "solve")
    assert not bench.begun["b"].wait(0.1) and bench.running == ["a"]
    bench.let["a"].set()
    wait_for(lambda: bench.running == ["b"])
    bench.let["b"].set()
    wait_for(lambda: bench.done == ["a", "b"])
    assert bench.idle == [False, True]


def test_all_work_has_ended_only_when_a_cancelled_job_that_is_alone_has(bench: Bench) -> None:
    bench.start("a", "open", is_alone=True)
    wait_for(lambda: bench.running == ["a"])
    bench.worker.cancel()
    assert not bench.worker.is_idle and bench.idle == [False]
    bench.start("b", "open", is_alone=True)
    bench.let["a"].set()
    wait_for(lambda: bench.running == ["b"])
    bench.let["b"].set()
    wait_for(lambda: bench.worker.is_idle)
    assert bench.done == ["b"] and bench.idle == [False, True]


def test_a_job_that_takes_the_place_of_another_tells_nobody_that_all_has_ended(bench: Bench) -> None:
    bench.start("a", "solve")
    bench.start("b", "open", is_alone=True)
    assert bench.idle == [False]
    for name in "ab":
        bench.let[name].set()
    wait_for(lambda: bench.worker.is_idle)
    assert bench.done == ["b"] and bench.idle == [False, True]



@pytest.mark.skipif(sys.platform != "linux", reason="only Linux knows priorities of single threads")
def test_work_gives_way_to_the_thread_that_people_wait_for(bench: Bench) -> None:
    own = os.getpriority(os.PRIO_PROCESS, threading.get_native_id())
    bench.start("a", "solve")
    bench.let["a"].set()
    wait_for(lambda: bench.done == ["a"])
    assert bench.nice == min(own + 10, 19)


class Reading(LiveViewport):
    """A viewport that reads its stage until it is told that it has ended."""

    def __init__(self, parent: QWidget) -> None:
        super().__init__(parent)
        self.is_reading, self.asked = False, list[Shown | None]()

    @property
    def holds_stage(self) -> bool:
        return self.is_reading

    def show_shot(self, shown: Shown | None) -> None:
        self.asked.append(shown)
        self.is_reading |= shown is not None


def test_a_stage_is_read_anew_when_no_viewport_reads_it_any_more() -> None:
    make_application()
    document, shot = Document(), cast(Any, SimpleNamespace())
    canvas = Canvas(document, Easel(), Worker(), ViewportKind("reading", Reading))
    document.shot = shot
    document.found_changed()
    first, beside = canvas.viewport, Reading(canvas)
    beside.is_reading = True
    canvas.beside.append(beside)
    canvas.use_viewport(ViewportKind("another", Reading))
    second = canvas.viewport
    is_read = canvas.let_go()
    count = len(second.asked)
    for viewport in (first, beside, second):
        assert is_read()
        viewport.is_reading = False
    assert not is_read()
    document.found_changed()  # an undo meanwhile
    assert len(second.asked) == count and not is_read()
    canvas.hold(False)
    assert len(second.asked) == count + 1
    for viewport in (beside, second):
        viewport.stop()


def test_a_widget_that_its_host_destroys_lets_its_threads_end() -> None:
    make_application()
    before, kept = set(threading.enumerate()), set(_KEPT)
    host = QWidget()
    widget = PaintingWidget(parent=host)
    begun = set(threading.enumerate()) - before
    assert len(begun) > 4 and set(_KEPT) > kept
    shiboken6.delete(host)
    del widget
    wait_for(lambda: not any(thread.is_alive() for thread in begun) and set(_KEPT) <= kept, 20)
