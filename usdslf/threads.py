"""Threads: work that is shared out over the processors.

thread_count() -> int                             processors that this process may use
map_ahead(pool, work, items, ahead) -> Iterator   results in order, with some more items being worked on
"""

from __future__ import annotations

import os
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from typing import TypeVar

Work = TypeVar("Work")
THREADS = "USDSLF_THREADS"  # environment variable: the most that a process takes, where several share a machine


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
