"""Progress: what long steps say of themselves, who hears it, and how they are cancelled.

    with step("light", seconds): ...         names what is done now, and takes its time
    tell(share)                              called between blocks, deep inside: how much of the step is done
    told(results), in_blocks(count, size)    results, or the rows of each block, told after each
    tell_during(call)                        what cannot be split: the same, again and again until the call is done
    with hearing(hear): ...                  whoever listens; what it raises ends the work at that block
    stepwise(work) -> Generator[Progress]    a function as a generator, which `close` cancels
    run(steps, say) -> what they return      a generator to its end

The listener is a context variable, so that a block says how far it is without every function between it and the
listener passing a callback on, and so that work on other threads has listeners of its own.  The other way, deep steps
that are generators themselves, would make a generator of each function above a loop, and could not work on several
threads.  `stepwise` is a listener too: the work runs on one thread of its own, which stands still at each `tell` until
the generator is asked for more.  Nothing is done that was not asked for, and `close` ends it where it stands.

Blocks cannot be small everywhere: a tree is built, a picture is read, a kernel is compiled in one call of a library,
and how long that takes is the scene's affair.  `tell_during` makes such calls on a thread of their own, so that the
thread that waits for them can say so, and be cancelled, at any time.  A call that nobody waits for any more goes on to
its next `tell`, or to its end, and what it found is dropped.

Work that is cancelled leaves nothing half changed where it only makes new values, as all steps do, and writes files
beside their place.  Files are written and renamed within `undisturbed`, where nothing is cancelled, and which what was
cancelled does not enter any more.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Generator, Iterator
from contextlib import contextmanager, nullcontext, suppress
from contextvars import ContextVar, copy_context
from dataclasses import dataclass
from queue import Empty, SimpleQueue
from typing import Any, Generic, TypeVar

Result = TypeVar("Result")
TOLD_EVERY = 0.05  # seconds, at least, where something is waited for


@dataclass(frozen=True)
class Progress:
    """How far a step is.

    Attributes:
        step: its name, say "visibility".
        share: of it that is done, 0..1; it never falls.
    """

    step: str
    share: float


Hear = Callable[[Progress], None]
Say = Callable[[str, float], None]
"""Told the name of a step and how much of it is done, 0..1.  What it raises ends the work, `Cancelled` best of all."""


class Cancelled(BaseException):
    """Work was cancelled.  No `Exception`, so that nothing takes it for a failure that it can mend."""


class _Step:
    """A step that is being done."""

    def __init__(self, name: str) -> None:
        self.name, self.share, self.inner = name, 0.0, 0.0


class _Call:
    """A call that is being made on another thread."""

    def __init__(self) -> None:
        self.is_abandoned = False
        self.lock = threading.Lock()  # held by who cancels, or writes what is not cancelled

    def go_on(self) -> None:
        """Raises Cancelled where nobody waits for it any more."""
        if self.is_abandoned:
            raise Cancelled


_heard_by: ContextVar[Hear | None] = ContextVar("heard_by", default=None)
_now: ContextVar[_Step | None] = ContextVar("step", default=None)
_quiet: ContextVar[bool] = ContextVar("undisturbed", default=False)
_call: ContextVar[_Call | None] = ContextVar("call", default=None)  # that this is the thread of
_interrupted = threading.Event()  # by Ctrl-C, within what is undisturbed


def tell(share: float | None = None) -> None:
    """Says that a block is done: the place where work can be cancelled.

    Args:
        share: of the step of now that is done, 0..1; None: a block whose share of it is not known.

    Raises: what the listener raises.
    """
    if _quiet.get():
        return
    if _interrupted.is_set() and threading.current_thread() is threading.main_thread():
        raise KeyboardInterrupt
    hear = _heard_by.get()
    if hear is None:
        return
    now = _now.get() or _Step("")
    if share is not None:
        now.share = min(max(now.share, share), 1.0)
    hear(Progress(now.name, now.share))


def told(results: Iterator[Result]) -> Iterator[Result]:
    """Yields what an iterator yields, and tells after each."""
    for result in results:
        yield result
        tell()


def in_blocks(count: int, size: int) -> Iterator[slice]:
    """Yields the rows of each block of `size` of `count`, and tells after it."""
    for first in range(0, count, size):
        yield slice(first, min(first + size, count))
        tell()


def tell_during(call: Callable[[], Result]) -> Result:
    """Makes a call on another thread, and tells meanwhile, every TOLD_EVERY seconds and whatever it tells itself.

    Args:
        call: only makes new values, of what nobody changes: if it is cancelled here, it goes on to its next `tell`.  It
            asks for no lock that is held here, so for nothing of a Shot that is being made.

    Returns: what it returns.  Where nobody listens it is made on this thread.

    Raises: what it raises, and what the listener raises, at once.
    """
    hear = _heard_by.get()
    if hear is None or _quiet.get() or _call.get() is not None:
        return call()
    outcome, made = _Outcome[Result](), _Call()

    def pass_on(progress: Progress) -> None:
        made.go_on()
        outcome.told.put(progress)

    def make_call() -> Result:
        _call.set(made)
        return call()

    now = _now.get() or _Step("")
    outcome.told.put(Progress(now.name, now.share))
    # Python waits for it at its end: a thread that is cut off in a library's call takes the process down.
    outcome.start("usdslf-call", make_call, pass_on, is_daemon=False)
    _hear_until_done(hear, outcome.told, made)
    return outcome.take()


class _Outcome(Generic[Result]):
    """What work on a thread of its own comes to; `told` says how far it is, and None at its end."""

    def __init__(self) -> None:
        self.told: SimpleQueue[Progress | None] = SimpleQueue()
        self._results: list[Result] = []
        self._errors: list[BaseException] = []

    def start(self, name: str, work: Callable[[], Result], hear: Hear, is_daemon: bool) -> threading.Thread:
        """Begins the work, heard by `hear`, in this context."""

        def work_through() -> None:
            try:
                with hearing(hear):
                    self._results.append(work())
            except BaseException as error:
                self._errors.append(error)
            self.told.put(None)

        thread = threading.Thread(target=copy_context().run, args=(work_through,), name=name, daemon=is_daemon)
        thread.start()
        return thread

    def take(self) -> Result:
        """Returns what the ended work returned, or raises what it raised; once, so that no error holds itself."""
        if self._errors:
            raise self._errors.pop()
        return self._results.pop()


def _hear_until_done(hear: Hear, told: SimpleQueue[Progress | None], call: _Call) -> None:
    """Passes on what a call tells, and its last word again while it tells nothing, but not while it writes."""
    latest = told.get()
    try:
        while latest is not None:
            if call.lock.acquire(blocking=False):
                try:
                    hear(latest)
                except BaseException:
                    call.is_abandoned = True
                    raise
                finally:
                    call.lock.release()
            with suppress(Empty):
                latest = told.get(timeout=TOLD_EVERY)
    finally:
        with call.lock:
            call.is_abandoned = True


@contextmanager
def step(name: str, seconds: dict[str, float] | None = None) -> Iterator[None]:
    """Names what is done now; tells its beginning and its end.

    Args:
        seconds: by step; takes the time of this one, less that of steps within it, if it comes to its end.
    """
    outer, mine = _now.get(), _Step(name)
    token = _now.set(mine)
    began = time.perf_counter()
    try:
        tell(0.0)
        yield
        tell(1.0)
    finally:
        _now.reset(token)
        spent = time.perf_counter() - began
        if outer is not None:
            outer.inner += spent
    if seconds is not None:
        seconds[name] = seconds.get(name, 0.0) + spent - mine.inner


@contextmanager
def hearing(hear: Hear) -> Iterator[None]:
    """Makes a listener hear what is told within, on this thread."""
    token = _heard_by.set(hear)
    try:
        yield
    finally:
        _heard_by.reset(token)


@contextmanager
def undisturbed() -> Iterator[None]:
    """Lets nothing be cancelled within: what writes a file and renames it, or deletes some that belong together."""
    call = _call.get()
    with call.lock if call and not _quiet.get() else nullcontext():
        if call:
            call.go_on()
        token = _quiet.set(True)
        try:
            yield
        finally:
            _quiet.reset(token)
    tell()


def interrupt(*_: object) -> None:
    """Takes a SIGINT on the main thread: ends its work here, or where it next may be disturbed.

    Raises: KeyboardInterrupt.
    """
    _interrupted.set()
    if not _quiet.get():
        raise KeyboardInterrupt


def forget_interrupt() -> None:
    """Forgets an interrupt, before the next work."""
    _interrupted.clear()


def stepwise(work: Callable[[], Result]) -> Generator[Progress, None, Result]:
    """Makes a generator of work that tells how far it is; it returns what the work returns, and raises what it raises.

    `close` cancels the work: `Cancelled` is raised where it stands.
    """
    outcome = _Outcome[Result]()
    go_on, closed = threading.Semaphore(0), threading.Event()

    def hear(progress: Progress) -> None:
        if not closed.is_set():
            outcome.told.put(progress)
            go_on.acquire()
        if closed.is_set():
            raise Cancelled

    thread = outcome.start("usdslf-steps", work, hear, is_daemon=True)
    try:
        while (progress := outcome.told.get()) is not None:
            yield progress
            go_on.release()
    finally:
        closed.set()
        go_on.release()
        thread.join()
    return outcome.take()


def run(steps: Generator[Progress, None, Result], say: Say | None = None) -> Result:
    """Runs a generator of steps to its end, and returns what it returns.

    Args:
        steps: of `solve`, `stylize_shot` or `stepwise`.
        say: told each; what it raises closes the generator and is raised here.
    """
    try:
        while True:
            progress = next(steps)
            if say is not None:
                say(progress.step, progress.share)
    except StopIteration as end:
        found: Result = end.value
        return found
    finally:
        steps.close()


def wait_for(lock: Any) -> None:
    """Acquires a lock (of threading), telling that it waits meanwhile."""
    while not lock.acquire(timeout=TOLD_EVERY):
        tell()
