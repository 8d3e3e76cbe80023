"""Progress: calls that cannot be split, told meanwhile, cancelled at once, and what comes of them then."""

from __future__ import annotations

import subprocess
import sys
import textwrap
import threading
from contextvars import ContextVar
from pathlib import Path
from typing import Any

import pytest

from usdslf import Cancelled, Progress, progress, run, stepwise
from usdslf.progress import hearing, in_blocks, interrupt, step, tell, tell_during, undisturbed
from usdslf.replacing import replacing
from usdslf.threads import map_ahead

FOREVER = 60.0  # seconds that a test waits for what has to come


class Stands:
    """A call that stands still until it is let go, as one of a library does that tells nothing."""

    def __init__(self) -> None:
        self.began, self.may_go_on, self.ended = threading.Event(), threading.Event(), threading.Event()
        self.thread: threading.Thread | None = None

    def __call__(self) -> str:
        self.thread = threading.current_thread()
        self.began.set()
        assert self.may_go_on.wait(FOREVER)
        self.ended.set()
        return "found"


def cancel_when(condition: threading.Event) -> Any:
    """A listener that cancels once something has happened."""

    def hear(told: Progress) -> None:
        if condition.is_set():
            raise Cancelled

    return hear


def test_a_call_that_says_nothing_is_told_meanwhile(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(progress, "TOLD_EVERY", 0.001)
    call, heard = Stands(), []

    def hear(told: Progress) -> None:
        heard.append(told)
        if len(heard) == 20:
            call.may_go_on.set()

    with hearing(hear), step("a tree"):
        tell(0.25)
        assert tell_during(call) == "found"
    assert heard[2:20] == [Progress("a tree", 0.25)] * 18
    assert call.thread is not threading.main_thread()


def test_a_call_is_cancelled_while_it_stands_still() -> None:
    call = Stands()
    with pytest.raises(Cancelled), hearing(cancel_when(call.began)):
        tell_during(call)
    assert not call.ended.is_set()  # nobody waited for it
    call.may_go_on.set()
    assert call.thread is not None
    call.thread.join(FOREVER)
    assert call.ended.is_set()


def test_an_interrupt_ends_the_wait_for_a_call(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(progress, "_interrupted", threading.Event())
    call = Stands()

    def hear(told: Progress) -> None:
        if call.began.is_set():
            interrupt()  # as the handler of SIGINT does on this thread

    with pytest.raises(KeyboardInterrupt), hearing(hear):
        tell_during(call)
    assert not call.ended.is_set()
    call.may_go_on.set()


def test_a_call_that_was_cancelled_goes_no_further_than_its_next_word(tmp_path: Path) -> None:
    """It ends at the next `tell`, and where it would write a file, which it does not."""
    for next_word in (tell, lambda: replacing(tmp_path / "file").__enter__()):
        call, done, left = Stands(), [], []

        def work(call: Stands = call, left: list[Any] = left, done: list[int] = done, word: Any = next_word) -> None:
            call()
            try:
                word()
            except BaseException as error:
                left.append(error)
                raise
            done.append(1)

        with pytest.raises(Cancelled), hearing(cancel_when(call.began)):
            tell_during(work)
        call.may_go_on.set()
        assert call.thread is not None
        call.thread.join(FOREVER)
        assert [type(e) for e in left] == [Cancelled] and not done
        assert not list(tmp_path.iterdir())


def test_what_a_call_writes_is_written_before_it_can_be_cancelled(tmp_path: Path) -> None:
    file, call, wished = tmp_path / "file", Stands(), threading.Event()

    def write() -> None:
        with undisturbed():
            wished.set()  # from here on the listener would cancel
            threading.Timer(0.2, call.may_go_on.set).start()
            call()
            file.write_text("whole")

    with pytest.raises(Cancelled), hearing(cancel_when(wished)):
        tell_during(write)
    assert file.read_text() == "whole"  # at once: the cancel has waited for it


def test_a_call_tells_its_own_steps_and_raises_its_own_errors() -> None:
    heard: list[Progress] = []
    mark: ContextVar[int] = ContextVar("mark", default=0)
    mark.set(3)

    def call() -> int:
        for rows in in_blocks(10, 4):
            tell(rows.stop / 10)
        assert tell_during(threading.current_thread) is threading.current_thread()  # one wait is enough
        if mark.get() == 4:
            raise ValueError("no such thing")
        return mark.get()

    with hearing(heard.append), step("count"):
        assert tell_during(call) == 3
        assert [p.share for p in dict.fromkeys(heard)] == [0.0, 0.4, 0.8, 1.0]
        assert all(p.step == "count" for p in heard)
        mark.set(4)
        with pytest.raises(ValueError, match="no such thing"):
            tell_during(call)


def test_where_nobody_listens_or_nothing_may_be_cancelled_a_call_is_made_where_it_stands() -> None:
    assert tell_during(threading.current_thread) is threading.current_thread()
    with hearing(lambda told: None), undisturbed():
        assert tell_during(threading.current_thread) is threading.current_thread()


def test_a_generator_of_steps_is_closed_while_a_call_stands_still() -> None:
    call = Stands()
    steps = stepwise(lambda: tell_during(call))
    next(steps)
    assert call.began.wait(FOREVER)
    steps.close()
    assert not call.ended.is_set()
    call.may_go_on.set()
    assert run(stepwise(lambda: tell_during(lambda: 3))) == 3


def test_the_end_of_a_process_waits_for_a_call_that_nobody_waits_for() -> None:
    """Cut off in a library's call, its thread would take the process down: "terminate called ..."."""
    script = textwrap.dedent(
        """
        import time
        from usdslf.progress import stepwise, tell_during

        steps = stepwise(lambda: tell_during(lambda: (time.sleep(0.3), print("to its end"))))
        next(steps)
        steps.close()
        print("closed")
        """
    )
    ended = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True)
    assert ended.stdout.split("\n") == ["closed", "to its end", ""]


def test_work_ahead_that_nobody_asks_for_is_dropped() -> None:
    from concurrent.futures import ThreadPoolExecutor

    done: list[int] = []
    first = threading.Event()

    def work(item: int) -> int:
        if item:
            assert first.wait(FOREVER)
        done.append(item)
        return item

    with ThreadPoolExecutor(1) as pool:
        results = map_ahead(pool, work, range(100), 10)
        pool.submit(lambda: None).result()
        assert next(results) == (0, 0)
        results.close()
        first.set()
    assert len(done) <= 2  # the one that was being worked on, at most


def test_work_ahead_comes_in_order() -> None:
    from concurrent.futures import ThreadPoolExecutor

    with ThreadPoolExecutor(3) as pool:
        assert list(map_ahead(pool, lambda i: i * i, range(20), 4)) == [(i, i * i) for i in range(20)]
