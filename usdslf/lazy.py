"""Lazy: a value that is made once, at first use, by one thread; others wait."""

from __future__ import annotations

from collections.abc import Callable
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
