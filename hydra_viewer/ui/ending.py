"""Ending: threads end before Python does, also where a program ends by an error with its window open."""

from __future__ import annotations

import atexit
from collections.abc import Callable
from weakref import WeakMethod


def stop_at_exit(stop: Callable[[], object]) -> None:
    """Calls a method when Python ends, if its object is there then.

    Args:
        stop: bound method, which may have been called before.
    """
    mine = WeakMethod(stop)
    atexit.register(lambda: (found := mine()) and found())
