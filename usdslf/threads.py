"""Threads: work that is shared out over the processors.

thread_count() -> int                             processors that this process may use
map_ahead(pool, work, items, ahead) -> Iterator   results in order, with some more items being worked on
with one_blas_thread(): ...                       numpy's linear algebra on the thread that asks
"""

from __future__ import annotations

import functools
import os
import threading
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import contextmanager
from typing import Any, TypeVar

Work = TypeVar("Work")
THREADS = "USDSLF_THREADS"  # environment variable: the most that a process takes, where several share a machine
BLAS_THREADS = ("OPENBLAS_NUM_THREADS", "GOTO_NUM_THREADS", "OMP_NUM_THREADS")  # the first that is set counts
"""Whoever sets one wants other threads than ours."""


def thread_count() -> int:
    """Returns how many processors this process may use: all that the system gives it, or as many as THREADS says."""
    there = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    said = os.environ.get(THREADS, "")
    return max(1, min(there, int(said)) if said.isdecimal() else there)


def map_ahead(
    pool: ThreadPoolExecutor, work: Callable[[int], Work], items: Iterable[int], ahead: int
) -> Iterator[tuple[int, Work]]:
    """Yields (item, work(item)) in order, working on `ahead` more items meanwhile.

    What waits is dropped where nobody asks any more: an error, or work that is cancelled between two items.
    """
    waiting: deque[tuple[int, Future[Work]]] = deque()
    try:
        for item in items:
            waiting.append((item, pool.submit(work, item)))
            if len(waiting) > ahead:
                first, result = waiting.popleft()
                yield first, result.result()
        while waiting:
            first, result = waiting.popleft()
            yield first, result.result()
    finally:
        for _, result in waiting:
            result.cancel()


class _Limited:
    """Those who are within `one_blas_thread`, on any thread, and what undoes it after the last of them."""

    lock = threading.Lock()
    count = 0
    limit: Any = None


@contextmanager
def one_blas_thread() -> Iterator[None]:
    """Keeps numpy's and scipy's linear algebra on the thread that asks: theirs wait by turning.

    On processors that something else works on, theirs or the device's, matrices of some hundred rows take ten times as
    long by several threads.  The number is the process's, so that it counts for all threads as long as one is within.
    """
    if any(name in os.environ for name in BLAS_THREADS):
        yield
        return
    with _Limited.lock:
        if not _Limited.count:
            _Limited.limit = _libraries().limit(limits=1, user_api="blas")
        _Limited.count += 1
    try:
        yield
    finally:
        with _Limited.lock:
            _Limited.count -= 1
            if not _Limited.count:
                _Limited.limit.restore_original_limits()


@functools.cache
def _libraries() -> Any:
    """The libraries of linear algebra that are loaded."""
    from threadpoolctl import ThreadpoolController

    return ThreadpoolController()
