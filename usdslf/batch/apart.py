"""Apart: one job in a process of its own, watched.

    run_apart(job, limits, hear, stop) -> Result      of a failure its cause and sentence; never raises for one

A crash, a hang beyond its time, more memory than it may have: each ends this job alone.
"""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import dataclass
from queue import Empty, SimpleQueue
from typing import IO, Any

from usdslf.batch.job import Event, Job, Limits, Result
from usdslf.threads import THREADS

LOOKED_AT = 0.05  # seconds between two looks at a process
MOST_SAID = 300  # letters of what a process said when it crashed
Hear = Callable[[Event], None]


class Stopped(Exception):
    """The run was stopped; the job was ended before it was done."""


@dataclass
class _Watched:
    """A process and what it told so far."""

    process: subprocess.Popen[str]
    lines: SimpleQueue[str | None]
    began: float
    most_memory: int = 0
    answer: Mapping[str, Any] | None = None  # its last word


def run_apart(job: Job, limits: Limits, hear: Hear | None = None, stop: threading.Event | None = None) -> Result:
    """Runs a job in a process of its own.

    Args:
        job: of a `Plan`.
        limits: beyond which it is ended.
        hear: told how far it is.
        stop: ends it when it is set.

    Returns: its result, or of a failure the cause and a sentence.

    Raises: Stopped.
    """
    tell = hear or (lambda event: None)
    with tempfile.TemporaryFile("w+", encoding="utf-8", errors="replace") as talk:
        watched = _start(job, limits, talk)
        tell(Event(job.name, "started", pid=watched.process.pid))
        try:
            cause, why = _watch(watched, job, limits, tell, stop)
        finally:
            _end(watched.process)
        code = watched.process.returncode
        if watched.answer is None and not cause:
            cause, why = "crash", _of_crash(code, talk, watched)
    took = {"seconds": round(time.monotonic() - watched.began, 3), "memory": watched.most_memory}
    if not cause and watched.answer is not None:
        if "done" in watched.answer:
            return Result.of_values({**watched.answer["done"], **took})
        cause, why = "error", str(watched.answer.get("error", ""))
    return Result.of_values({"job": job.name, "kind": job.kind, "is_done": False, "why": why, "cause": cause, **took})


def _start(job: Job, limits: Limits, talk: IO[str]) -> _Watched:
    count = str(max(1, limits.threads))
    names = ("POCL_MAX_PTHREAD_COUNT", "POCL_CPU_MAX_CU_COUNT", "OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", THREADS)
    process = subprocess.Popen(
        [sys.executable, "-m", "usdslf.batch.child"], stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=talk,
        text=True, encoding="utf-8", env={**os.environ, **dict.fromkeys(names, count)}, start_new_session=True,
    )  # fmt: skip
    lines: SimpleQueue[str | None] = SimpleQueue()
    threading.Thread(target=_read, args=(process.stdout, lines), daemon=True).start()
    try:
        assert process.stdin is not None
        process.stdin.write(job.as_json() + "\n")
        process.stdin.flush()
    except BrokenPipeError:  # it ended already, and says so
        pass
    return _Watched(process, lines, time.monotonic())


def _read(stream: IO[str] | None, lines: SimpleQueue[str | None]) -> None:
    for line in stream or ():
        lines.put(line)
    lines.put(None)


def _watch(w: _Watched, job: Job, limits: Limits, tell: Hear, stop: threading.Event | None) -> tuple[str, str]:
    """Waits for the end of a process; returns cause and sentence where it has to be ended."""
    while True:
        try:
            line = w.lines.get(timeout=LOOKED_AT)
        except Empty:
            line = ""
        if line is None:
            w.process.wait()
            return "", ""
        if line:
            told = _told(line)
            if "step" in told:
                tell(Event(job.name, "running", str(told["step"]), float(told.get("share", 0)), w.process.pid))
            elif told:
                w.answer = told
        if stop is not None and stop.is_set():
            raise Stopped(job.name)
        if time.monotonic() - w.began > limits.seconds:
            return "time", f"it took longer than {limits.seconds:g} s and was ended; raise limits.seconds"
        w.most_memory = max(w.most_memory, resident(w.process.pid))
        if limits.memory and w.most_memory > limits.memory:
            had = f"{w.most_memory / 2**30:.2g} GiB where it may have {limits.memory / 2**30:.2g}"
            return "memory", f"it took {had} and was ended; raise limits.memory or lower `elements`"


def _told(line: str) -> dict[str, Any]:
    try:
        told = json.loads(line)
    except ValueError:
        return {}
    return told if isinstance(told, dict) else {}


def resident(pid: int) -> int:
    """Returns the resident memory of a process [bytes]; 0 where the system does not say."""
    try:
        with open(f"/proc/{pid}/statm", encoding="ascii") as file:
            return int(file.read().split()[1]) * os.sysconf("SC_PAGE_SIZE")
    except (OSError, ValueError, IndexError):
        return 0


def _end(process: subprocess.Popen[str]) -> None:
    """Ends a process with all that it started, and closes its pipes."""
    with suppress(ProcessLookupError, PermissionError):
        os.killpg(process.pid, signal.SIGKILL)
    process.wait()
    for stream in (process.stdin, process.stdout):
        try:
            if stream is not None:
                stream.close()
        except BrokenPipeError:
            pass


def _of_crash(code: int, talk: IO[str], watched: _Watched) -> str:
    """The sentence of a process that ended without a word."""
    talk.seek(0)
    said = [line.strip() for line in talk.read().splitlines() if line.strip()]
    last = f": {said[-1][:MOST_SAID]}" if said else ""
    if code < 0:
        of = signal_in_words(-code) + ("" if code == -signal.SIGKILL else last)
        return f"its process was ended by {of} (it had {watched.most_memory / 2**30:.2g} GiB)"
    return f"its process ended with exit code {code}{last}"


def signal_in_words(number: int) -> str:
    """Returns the name of a signal that ended a process, and who may have sent it."""
    name = signal.Signals(number).name if number in set(signal.Signals) else f"signal {number}"
    return f"{name}, as the system does where memory runs out" if number == signal.SIGKILL else name
