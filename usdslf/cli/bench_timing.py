"""Rows of the bench before they are printed: a step, its time, and what it is measured by."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass

from usdslf.gpu.device import Device

REPEATS = 3


@dataclass(frozen=True)
class Timed:
    """A step that was timed.

    Attributes:
        step: its name.
        seconds: that it took.
        limit, limit_seconds: what it could not be quicker than, in words and by measurement; None: nothing known.
        moved: bytes between host and device; None: not counted.
        rays: that were cast; None: none, or not counted.
        size: bytes that it reads and writes.
        paper: milliseconds in the paper's table; 0: not there.
    """

    step: str
    seconds: float
    limit: str = ""
    limit_seconds: float | None = None
    moved: int | None = None
    rays: int | None = None
    size: int = 0
    paper: int = 0


def best(work: Callable[[], object], repeats: int = 0) -> float:
    """Least time of some runs [s]; 0: of REPEATS."""
    found = []
    for _ in range(repeats or REPEATS):
        began = time.perf_counter()
        work()
        found.append(time.perf_counter() - began)
    return min(found)


def moved_by(device: Device, work: Callable[[], object]) -> int:
    """Bytes that some work moves between host and device."""
    before = device.moved
    work()
    return device.moved - before
