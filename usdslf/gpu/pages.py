"""Pages of memory that a processor's kernels work in.

Light is read from arrays of hundreds of megabytes at random: with pages of 4 KiB most reads wait for the page's
address, so that large pages are asked for where the system gives them.
"""

from __future__ import annotations

import ctypes
import mmap
import sys
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


def ask_for_large_pages(address: int, size: int) -> None:
    """Asks for large pages within `size` bytes of memory at an address, which nobody wrote to yet: a wish, no more."""
    if sys.platform == "linux" and hasattr(mmap, "MADV_HUGEPAGE"):
        first = -(-address // mmap.PAGESIZE) * mmap.PAGESIZE
        ctypes.CDLL(None).madvise(ctypes.c_void_p(first), ctypes.c_size_t(address + size - first), mmap.MADV_HUGEPAGE)
