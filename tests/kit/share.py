"""The share of a long suite that one of several runs side by side asks: `USDSLF_SHARE=1/2` is the second half.

The gate runs all tests on several Pythons at once.  Suites that count how often the numerics are right (hundreds of
solves, alike on all of them) are divided among those runs, so that one gate asks each case once.  Without the variable
a run asks all.
"""

from __future__ import annotations

import os
from collections.abc import Sequence
from typing import TypeVar

Item = TypeVar("Item")


def share_of(items: Sequence[Item]) -> list[Item]:
    """Returns every n-th of some items, from the k-th on, where the variable says k/n (0/1: all)."""
    number, count = _share()
    return list(items[number::count])


def rows_of_share(length: int) -> range:
    """Returns the part of so many rows, one after the other, that is this run's."""
    number, count = _share()
    return range(number * length // count, (number + 1) * length // count)


def first_of_share(length: int) -> int:
    """Returns the row of a list at which this run begins, so that runs side by side do not do the same at once."""
    return rows_of_share(length).start


def _share() -> tuple[int, int]:
    number, count = (int(x) for x in os.environ.get("USDSLF_SHARE", "0/1").split("/"))
    if not 0 <= number < count:
        raise ValueError(f"USDSLF_SHARE={number}/{count}: the first number is 0 to {count - 1}")
    return number, count
