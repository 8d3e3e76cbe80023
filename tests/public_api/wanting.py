"""Functions and a class with docstrings that leave things out, for the test of the check."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from usdslf.errors import UsdslfError


def told(values: NDArray[np.float32], size: int) -> NDArray[np.float32]:
    """Returns values (n,) again.

    Args:
        values: (n,) numbers.
        size: in pixels.
    """
    return values[:size]


def untold() -> None:
    return None


def shape(values: NDArray[np.float32], other: int) -> NDArray[np.float32]:
    """Returns values.

    Args:
        values: numbers.
    """
    return values * other


def fails() -> None:
    """Fails."""
    raise UsdslfError("always")


@dataclass(frozen=True)
class Thing:
    """A thing.

    Attributes:
        name: of it.
    """

    name: str
    color: tuple[float, float, float] = (0.0, 0.0, 0.0)

    @property
    def radius(self) -> float:
        """How large it is."""
        return 1.0

    def solve(self) -> int:
        """Solves."""
        return 1
