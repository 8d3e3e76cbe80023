"""Runs: who owns each of many members, and which of many numbers are equal.

What `np.repeat` and `np.unique` do, by calls that give Python's lock away or are short.  Those two hold it, .1 to .5 s
for what four million triangles have, in which a window stands still; so does `np.cumsum` where it converts.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

I64 = NDArray[np.int64]

BLOCK = 1 << 19  # members that are written in one call, which holds the lock for 2 ms
SPREAD = 4  # keys of a range of so many times their count are looked up in a table, others are sorted


def owners(counts: NDArray[np.integer]) -> I64:
    """Returns the number of the run that each member is of, for runs of `counts` (n,) members: (sum of counts,)."""
    ends = np.cumsum(counts.astype(np.int64))
    out = np.empty(int(ends[-1]) if len(ends) else 0, np.int64)
    run = begin = 0
    while run < len(counts):
        after = max(int(np.searchsorted(ends, begin + BLOCK, "right")), run + 1)
        end = int(ends[after - 1])
        out[begin:end] = np.repeat(np.arange(run, after), counts[run:after]) if after > run + 1 else run
        run, begin = after, end
    return out


def numbered(keys: NDArray[np.integer]) -> tuple[NDArray, I64]:
    """Returns the different keys (k,) among many (n,), ascending, and the number (n,) of each key among them."""
    if not len(keys):
        return keys, np.zeros(0, np.int64)
    low = keys.min()
    if int(keys.max()) - int(low) < SPREAD * len(keys):
        at = (keys - low).astype(np.int64) if keys.dtype.kind == "u" else keys.astype(np.int64) - int(low)
        is_there = np.zeros(int(at.max()) + 1, np.int64)
        is_there[at] = 1
        return np.flatnonzero(is_there).astype(keys.dtype) + low, (np.cumsum(is_there) - 1)[at]
    order = np.argsort(keys)
    ascending = keys[order]
    is_new = np.ones(len(keys), np.int64)
    is_new[1:] = ascending[1:] != ascending[:-1]
    number = np.empty(len(keys), np.int64)
    number[order] = np.cumsum(is_new) - 1
    return ascending[np.flatnonzero(is_new)], number


def distinct(values: NDArray[Any]) -> NDArray[Any]:
    """Returns the distinct numbers of an array, ascending, as `np.unique`, which loads numpy.ma first: 25 ms."""
    ordered = np.sort(values, axis=None)
    return ordered[np.append(True, ordered[1:] != ordered[:-1])] if len(ordered) else ordered


def first_places(number: I64, count: int) -> I64:
    """Returns the first place (count,) of each of the numbers 0 .. count - 1 among many (n,)."""
    first = np.empty(count, np.int64)
    first[number[::-1]] = np.arange(len(number))[::-1]  # of several that are written to one place, the last one stays
    return first
