"""Moves: how far each parameter of a material is meant to move.

Move                     of one parameter: an offset, a factor, or what is between
moves_of (edits.py)      of a solved change
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from usdslf.scene.records import F64

DARK = 0.002  # half an 8 bit step: nothing times a scale stays nothing
NAMES = {"diffuse": "diffuse", "specular": "specular", "glossiness": "roughness"}  # freed -> parameter


@dataclass(frozen=True)
class Move:
    """How far a parameter of C channels is meant to move: by an offset, or by a factor, within these."""

    low: tuple[float, ...]  # (C,) offset, 0 or less
    high: tuple[float, ...]  # (C,) offset, 0 or more
    least: tuple[float, ...] = ()  # (C,) factor, 1 or less; none: no factor
    most: tuple[float, ...] = ()  # (C,) factor, 1 or more

    @staticmethod
    def of(before: NDArray, after: NDArray, is_factor: bool = False) -> Move:
        """The move of means (C,): by their difference; by their ratio too, of a factor or where it gets darker."""
        b, a = np.atleast_1d(before).astype(np.float64), np.atleast_1d(after).astype(np.float64)
        ratio = np.where(b > DARK, a / np.maximum(b, DARK), 1.0)
        ratio = ratio if is_factor else np.minimum(ratio, 1.0)
        return Move(*(_plain(x) for x in (*_about(a - b, 0.0), *_about(ratio, 1.0))))

    @staticmethod
    def within(changes: NDArray) -> Move:
        """The move of changes (n, C) that differ from place to place."""
        return Move(_plain(np.minimum(changes.min(0), 0)), _plain(np.maximum(changes.max(0), 0)))

    def joined(self, other: Move) -> Move:
        """Returns the move that goes as far as either."""
        ends = zip((self.low, self.high, self.least, self.most), (other.low, other.high, other.least, other.most))
        wide = [np.stack(np.broadcast_arrays(*(a or (n,), b or (n,)))) for (a, b), n in zip(ends, (0, 0, 1, 1))]
        return Move(*(_plain(pick(x)) for x, pick in zip(wide, (_least, _most, _least, _most))))

    def between(self, p: F64) -> tuple[F64, F64]:
        """Returns the least and greatest values (n, C) that places with these values may have."""
        least, most = self.least or (1.0,), self.most or (1.0,)
        low = np.minimum(p + np.array(self.low), p * np.array(least))
        high = np.maximum(p + np.array(self.high), p * np.array(most))
        return np.minimum(p, np.clip(low, 0, 1)), np.maximum(p, np.clip(high, 0, 1))


def _least(x: NDArray) -> NDArray:
    return np.asarray(x.min(0))


def _most(x: NDArray) -> NDArray:
    return np.asarray(x.max(0))


def _about(x: F64, middle: float) -> tuple[F64, F64]:
    return np.minimum(x, middle), np.maximum(x, middle)


def _plain(x: NDArray) -> tuple[float, ...]:
    return tuple(float(v) for v in np.atleast_1d(x))
