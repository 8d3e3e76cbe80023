"""Worker: steps generators on a thread, so that the main thread is never blocked.

A job is a generator of Progress, and of what is whole already; each is handed on by a signal to the main thread.  A new
job of the same kind cancels the one that it makes stale; `cancel` cancels them all.  While a job is alone, those that
are begun meanwhile wait for it, also where it was cancelled and has not ended yet.
"""

from __future__ import annotations

import queue
import threading
from collections.abc import Callable, Generator
from contextlib import suppress
from dataclasses import dataclass, field
from typing import Any

from PySide6.QtCore import QObject, Signal

from hydra_viewer.ui import words
from hydra_viewer.ui.ending import stop_at_exit
from hydra_viewer.ui.giving_way import give_way
from usdslf import Cancelled, Progress, UsdslfError

THREADS = 4  # that are there from the beginning
Steps = Callable[[], Generator[Any, None, Any]]


@dataclass(eq=False)
class Job:
    """Work under way.

    Attributes:
        kind: one job of a kind runs at a time.
        steps: makes its generator, on the worker's thread.
        part, done, failed: told what is whole already, the result, or a sentence and the error; on the main thread.
        is_quiet: it is too short to be told of.
        rest: seconds that it waits before it begins, and after each part, so that the main thread shows what there is
            first: threads that compute in Python would make that take twice as long.
        is_alone: it cancels all others, and begins when they have ended.
        is_cancelled, has_ended: what became of it.
    """

    kind: str
    steps: Steps
    done: Callable[[Any], None]
    failed: Callable[[str, BaseException], None]
    part: Callable[[Any], None] = lambda part: None
    is_quiet: bool = False
    rest: float = 0.0
    is_alone: bool = False
    is_cancelled: threading.Event = field(default_factory=threading.Event)
    has_ended: threading.Event = field(default_factory=threading.Event)


class Worker(QObject):
    """Runs jobs, each on a thread of its own, which waits for the next one afterwards.

    Attributes:
        progressed: Signal(str, float): step and share of the job that was begun last.
        idle_changed: Signal(bool): whether nothing is done.
    """

    progressed = Signal(str, float)
    idle_changed = Signal(bool)
    _told = Signal(object, str, object)

    def __init__(self, parent: QObject | None = None) -> None:
        super().__init__(parent)
        self._jobs: dict[str, Job] = {}
        self._running: list[Job] = []  # cancelled ones too, until they have ended
        self._asked: queue.SimpleQueue[tuple[Job, list[Job]] | None] = queue.SimpleQueue()
        self._threads: list[threading.Thread] = []
        for _ in range(THREADS):
            self._add_thread()
        self._told.connect(self._hear)
        self._is_gone = False
        self.destroyed.connect(lambda: self._on_destroyed())  # not as a method of what is gone by then
        stop_at_exit(self._end)

    @property
    def is_idle(self) -> bool:
        """Whether nothing is done."""
        return all(job.is_quiet for job in self._jobs.values())

    def is_doing(self, kind: str) -> bool:
        """Whether a job of a kind is under way."""
        return kind in self._jobs

    def start(self, job: Job) -> None:
        """Begins a job; one of the same kind is cancelled, and tells nothing any more."""
        was_idle = self.is_idle
        for stale in [j for j in self._jobs.values() if job.is_alone or j.kind == job.kind]:
            stale.is_cancelled.set()
            del self._jobs[stale.kind]
        self._jobs[job.kind] = job
        self._running = [j for j in self._running if not j.has_ended.is_set()]
        before = [j for j in self._running if job.is_alone or j.is_alone]
        self._running.append(job)
        if len(self._running) > len(self._threads):
            self._add_thread()
        self._asked.put((job, before))
        if was_idle != self.is_idle:
            self.idle_changed.emit(self.is_idle)

    def cancel(self, kind: str = "") -> None:
        """Cancels the job of a kind; "": all.  One that is alone counts until it has ended."""
        was_idle = self.is_idle
        for job in [j for j in self._jobs.values() if kind in ("", j.kind)]:
            job.is_cancelled.set()
            if not job.is_alone:
                del self._jobs[job.kind]
        if was_idle != self.is_idle:
            self.idle_changed.emit(self.is_idle)

    def stop(self) -> None:
        """Cancels all and waits until it has ended."""
        self.cancel()
        self._end()

    def _on_destroyed(self) -> None:
        """By a host that does not stop it first: lets the threads end, and waits for none."""
        self._is_gone = True
        self._let_end()

    def _let_end(self) -> None:
        for job in self._running:
            job.is_cancelled.set()
        for _ in self._threads:
            self._asked.put(None)

    def _end(self) -> None:
        """Ends all threads, without a word: Qt may be gone."""
        self._let_end()
        for thread in self._threads:
            thread.join(timeout=10)
        self._threads = []

    def _add_thread(self) -> None:
        """Begins a thread, which takes its time: so some are there before they are needed."""
        thread = threading.Thread(target=self._serve, name=f"viewer-{len(self._threads)}", daemon=True)
        self._threads.append(thread)
        thread.start()

    def _serve(self) -> None:
        """On a thread: runs what is asked, one after another."""
        give_way()
        while (asked := self._asked.get()) is not None:
            job, before = asked
            for other in before:
                other.has_ended.wait()
            try:
                self._run(job)
            finally:
                job.has_ended.set()
            del asked, job, before  # what they hold is not kept until the next one comes

    def _run(self, job: Job) -> None:
        """On a thread."""
        steps = job.steps()
        try:
            job.is_cancelled.wait(job.rest)
            while not job.is_cancelled.is_set():
                told = next(steps)
                is_part = not isinstance(told, Progress)
                self._tell(job, "part" if is_part else "progress", told)
                if is_part:
                    job.is_cancelled.wait(job.rest)
            self._tell(job, "cancelled", None)
        except StopIteration as end:
            self._tell(job, "done", end.value)
        except Cancelled:
            self._tell(job, "cancelled", None)
        except Exception as error:
            self._tell(job, "failed", error)
        finally:
            steps.close()

    def _tell(self, job: Job, what: str, value: Any) -> None:
        """On a thread."""
        if not self._is_gone:
            with suppress(RuntimeError):  # it goes just now
                self._told.emit(job, what, value)

    def _hear(self, job: Job, what: str, value: Any) -> None:
        """On the main thread."""
        if self._jobs.get(job.kind) is not job:
            return  # it was cancelled meanwhile
        if what == "progress":
            if not job.is_quiet:
                self.progressed.emit(value.step, value.share)
            return
        if what == "part":
            job.part(value)
            return
        del self._jobs[job.kind]
        if what == "done" and not job.is_cancelled.is_set():
            job.done(value)
        elif what == "failed":
            job.failed(str(value) if isinstance(value, UsdslfError) else words.internal(value), value)
        if self.is_idle and not job.is_quiet:
            self.idle_changed.emit(True)
