"""Comparison: what is shown instead of, or beside, the picture as it is now; and snapshots of the look.

before      the shot without its look
snapshot    the look as it was when it was kept
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hydra_viewer.model.announcer import Announcer
from hydra_viewer.model.found import Found

MODES = ("now", "other", "wipe", "difference")
MOST_GAIN = 64.0
BEFORE = ""  # name of the shot without its look


@dataclass(frozen=True, eq=False)
class Snapshot:
    """A look that was kept to come back to.

    Attributes:
        name: of it.
        found: that it shows; None: the shot without a look.
    """

    name: str
    found: Found | None


@dataclass(frozen=True)
class Compared:
    """How pictures are compared.

    Attributes:
        mode: now: the picture alone | other: what it is compared with alone | wipe: that on the left of a line |
            difference: how far they are apart.
        with_: name of a snapshot; BEFORE: the shot without its look.
        split: of the wipe, 0..1 of the picture's width.
        gain: of the difference, 1..MOST_GAIN.
    """

    mode: str = "now"
    with_: str = BEFORE
    split: float = 0.5
    gain: float = 4.0


class Comparison:
    """How the picture is compared, and whom to tell.

    Attributes:
        state: how.
        snapshots: in the order in which they were kept.
        changed: whom to tell.
    """

    def __init__(self) -> None:
        self.state = Compared()
        self.snapshots: tuple[Snapshot, ...] = ()
        self.changed = Announcer()

    def set(self, **values: Any) -> None:
        """Changes how is compared; split and gain are kept in their range."""
        state = replace(self.state, **values)
        assert state.mode in MODES, state.mode
        state = replace(state, split=min(max(state.split, 0.0), 1.0), gain=min(max(state.gain, 1.0), MOST_GAIN))
        if state != self.state:
            self.state = state
            self.changed()

    def toggle(self, mode: str) -> None:
        """Goes to a mode, or back to the picture alone where it is there already."""
        self.set(mode="now" if self.state.mode == mode else mode)

    def keep(self, found: Found | None) -> Snapshot:
        """Keeps a look; it is numbered."""
        numbers = [int(s.name.split()[-1]) for s in self.snapshots]
        snapshot = Snapshot(f"Look {max(numbers, default=0) + 1}", found)
        self.snapshots = (*self.snapshots, snapshot)
        self.changed()
        return snapshot

    def drop(self, name: str) -> None:
        """Forgets a snapshot; what was compared with it is compared with the shot as it was."""
        self.snapshots = tuple(s for s in self.snapshots if s.name != name)
        if self.state.with_ == name:
            self.state = replace(self.state, with_=BEFORE)
        self.changed()

    def clear(self) -> None:
        """Forgets all: another shot is there."""
        self.snapshots, self.state = (), Compared()
        self.changed()

    def flip(self, by: int) -> None:
        """Shows the next (1) or previous (-1) of: the picture as it is now, before, snapshots."""
        names = [BEFORE, *(s.name for s in self.snapshots)]
        places = [("now", self.state.with_), *(("other", name) for name in names)]
        here = (names.index(self.state.with_) + 1) if self.state.mode == "other" else 0
        mode, with_ = places[(here + by) % len(places)]
        self.set(mode=mode, with_=with_)

    @property
    def other(self) -> Found | None:
        """The look that is compared with; None: none, the shot as it was."""
        return next((s.found for s in self.snapshots if s.name == self.state.with_), None)


def difference(now: NDArray, other: NDArray, gain: float) -> NDArray[np.float32]:
    """Returns how far two pictures are apart, channel by channel, as a picture to look at.

    Args:
        now, other: (h, w, 3) scene-linear; `other` may be of another size.
        gain: factor.

    Returns: (h, w, 3), `gain` times their absolute difference.
    """
    h, w = now.shape[:2]
    rows, columns = (np.arange(n) * m // n for n, m in zip((h, w), other.shape[:2]))
    apart: NDArray[np.float32] = np.float32(gain) * np.abs(np.float32(now) - other[rows][:, columns])
    return apart
