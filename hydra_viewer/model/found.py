"""Found: what strokes ask for, as it is shown: the solution, its look, and the shot under it."""

from __future__ import annotations

from dataclasses import dataclass

from usdslf import Look, Shot, Solution, Stroke


@dataclass(frozen=True, eq=False)
class Found:
    """What was found of strokes.

    Attributes:
        strokes: that it is of, the active ones.
        solution: what they ask for.
        look: as a layer in a folder of the viewer's own; None: not written yet.
        shot: under what was found; None: not there yet.
        is_lit: the light field of that shot is made; until then others see the change only where they are painted.
        is_first: it is of the light as it was: what the change sends round is being followed.
    """

    strokes: tuple[Stroke, ...]
    solution: Solution
    look: Look | None = None
    shot: Shot | None = None
    is_lit: bool = False
    is_first: bool = False

    @property
    def is_whole(self) -> bool:
        """Whether nothing more comes."""
        return self.is_lit and self.look is not None
