"""Announcer: who wants to know of a change is told, in the order in which they asked."""

from __future__ import annotations

from collections.abc import Callable


class Announcer:
    """A list of listeners; called, it calls them."""

    def __init__(self) -> None:
        self._listeners: list[Callable[[], None]] = []

    def connect(self, listener: Callable[[], None]) -> None:
        """Tells a listener of each change from now on."""
        self._listeners.append(listener)

    def __call__(self) -> None:
        """Tells all listeners."""
        for listener in list(self._listeners):
            listener()
