"""Pages of memory that a processor's kernels work in.

Light is read from arrays of hundreds of megabytes at random: with pages of 4 KiB most reads wait for the page's
address, so that large pages are asked for where the system gives them.
"""

from __future__ import annotations

import mmap
from contextlib import suppress

LARGE = 1 << 21  # bytes of a large page


def pages_of_zeros(size: int) -> mmap.mmap:
    """Returns memory of `size` bytes, aligned to a page; what nobody writes to costs nothing."""
    if not hasattr(mmap, "MAP_PRIVATE"):
        return mmap.mmap(-1, size)
    memory = mmap.mmap(-1, size, mmap.MAP_PRIVATE | mmap.MAP_ANONYMOUS)
    if size >= LARGE and hasattr(mmap, "MADV_HUGEPAGE"):
        with suppress(OSError):  # a system without them
            memory.madvise(mmap.MADV_HUGEPAGE)
    return memory
