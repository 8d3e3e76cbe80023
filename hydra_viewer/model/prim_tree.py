"""Prim tree: the prims of a stage with their children, and a search among them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from usdslf import PrimRow, stage_prims

MOST_FOUND = 2000  # of a search


@dataclass(frozen=True, eq=False)
class PrimTree:
    """Rows of prims, parents before children.

    Attributes:
        rows: of all prims.
        children: rows of each row's children.
        top: rows without a parent.
        place: of each row among its parent's children.
    """

    rows: tuple[PrimRow, ...]
    children: tuple[tuple[int, ...], ...]
    top: tuple[int, ...]
    place: tuple[int, ...]

    @staticmethod
    def of(stage: Any) -> PrimTree:
        """Reads the tree of a Usd.Stage."""
        rows = tuple(stage_prims(stage))
        children: list[list[int]] = [[] for _ in rows]
        top: list[int] = []
        place = []
        for n, row in enumerate(rows):
            siblings = children[row.parent] if row.parent >= 0 else top
            place.append(len(siblings))
            siblings.append(n)
        return PrimTree(rows, tuple(tuple(c) for c in children), tuple(top), tuple(place))

    def find(self, text: str) -> list[int]:
        """Returns the rows whose name, type or path holds all words of a text, MOST_FOUND at most; case is nothing."""
        words = text.lower().split()
        found = []
        for n, row in enumerate(self.rows):
            said = f"{row.path} {row.type_name} {row.material}".lower()
            if all(word in said for word in words):
                found.append(n)
                if len(found) == MOST_FOUND:
                    break
        return found

    def row_of(self, path: str) -> int:
        """Returns the row of a prim, or of the nearest one above it, by its path; -1: none."""
        known = {row.path: n for n, row in enumerate(self.rows)}
        path = path.split("[")[0]
        while path and path not in known:
            path = path.rpartition("/")[0]
        return known.get(path, -1)
