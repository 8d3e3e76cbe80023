"""What is said of strokes beside their answers: sentences that know which strokes they are about."""

from __future__ import annotations

from collections.abc import Sequence
from enum import Enum


class About(Enum):
    """What a remark is about."""

    PLACE = "where it was painted"
    PAINT = "what was painted"
    TIE = "explanations that are about as likely"


class Remark(str):
    """A sentence about strokes, wherever sentences go: their prims, a colon, and what is said.

    Attributes:
        strokes: prims of the strokes that it is about.
        what: is said, without their names.
        about: its kind, which code may ask for instead of reading its words.
    """

    strokes: tuple[str, ...]
    what: str
    about: About

    def __new__(cls, strokes: Sequence[str], what: str, about: About) -> Remark:
        """Makes the sentence."""
        made = super().__new__(cls, f"{', '.join(strokes)}: {what}")
        made.strokes, made.what, made.about = tuple(strokes), what, about
        return made

    def __getnewargs__(self) -> tuple[tuple[str, ...], str, About]:  # type: ignore[override]
        """What a copy is made of."""
        return self.strokes, self.what, self.about
