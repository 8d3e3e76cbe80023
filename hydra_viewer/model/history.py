"""History: undo and redo, as states that were."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Generic, TypeVar

State = TypeVar("State")


@dataclass
class History(Generic[State]):
    """A state, those before it and, after undo, those behind it, each with what led to it.

    States never change, so that undo is exact: the very state of before comes back.
    """

    now: State
    _past: list[tuple[str, State]] = field(default_factory=list)
    _future: list[tuple[str, State]] = field(default_factory=list)

    @property
    def undoes(self) -> str:
        """What undo would take back, in words; "": nothing."""
        return self._past[-1][0] if self._past else ""

    @property
    def redoes(self) -> str:
        """What redo would do again, in words; "": nothing."""
        return self._future[-1][0] if self._future else ""

    def do(self, what: str, state: State) -> None:
        """Goes on to another state; what was undone before cannot be redone any more."""
        self._past.append((what, self.now))
        self._future.clear()
        self.now = state

    def undo(self) -> bool:
        """Goes back a state; returns whether there was one."""
        return self._go(self._past, self._future)

    def redo(self) -> bool:
        """Goes on to what was undone last; returns whether there was something."""
        return self._go(self._future, self._past)

    def _go(self, there: list[tuple[str, State]], back: list[tuple[str, State]]) -> bool:
        if not there:
            return False
        what, state = there.pop()
        back.append((what, self.now))
        self.now = state
        return True
