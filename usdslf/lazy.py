"""A value that is made once, at first use, by one thread; others wait.

    Lazy      of an object, as a method that makes it
    Later     by itself, which may never be asked for
"""

from __future__ import annotations

import threading
from collections.abc import Callable
from contextlib import suppress
from typing import Any, Generic, TypeVar, overload

from usdslf.progress import wait_for

Value = TypeVar("Value")


class Lazy(Generic[Value]):
    """Such a value of an object that has a `lock`, as a method that makes it."""

    def __init__(self, make: Callable[[Any], Value]) -> None:
        self._make, self._name, self.__doc__ = make, make.__name__, make.__doc__

    @overload
    def __get__(self, owner: None, kind: type) -> Lazy[Value]: ...
    @overload
    def __get__(self, owner: object, kind: type) -> Value: ...
    def __get__(self, owner: Any, kind: type) -> Value | Lazy[Value]:
        if owner is None:
            return self
        # What is made stands in the instance's dictionary, where it is found before this.
        made, lock = vars(owner), owner.lock
        wait_for(lock)
        try:
            if self._name not in made:
                made[self._name] = self._make(owner)
            value: Value = made[self._name]
            return value
        finally:
            lock.release()


class Later(Generic[Value]):
    """Such a value by itself; what it is made of is let go when it is made."""

    def __init__(self, make: Callable[[], Value]) -> None:
        self._make: Callable[[], Value] | None = make
        self._made: list[Value] = []
        self._lock = threading.Lock()

    @staticmethod
    def of(value: Value) -> Later[Value]:
        """Returns one that is made already."""
        found = Later(lambda: value)
        found()
        return found

    def begin(self) -> None:
        """Begins to make it on a thread of its own; who asks for it then waits, and finds what went wrong."""

        def work() -> None:
            with suppress(Exception):
                self()

        if self._make is not None:
            threading.Thread(target=work, name="usdslf-later").start()

    def __call__(self) -> Value:
        """Returns the value."""
        wait_for(self._lock)
        try:
            if self._make is not None:
                self._made.append(self._make())
                self._make = None
            return self._made[0]
        finally:
            self._lock.release()
