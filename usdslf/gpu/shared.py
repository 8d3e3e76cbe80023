"""Arrays that host and device work on in turns: rays are traced on the host, all else is done in kernels.

Where the device works in the host's memory nothing is copied; elsewhere `push` and `pull` copy.
"""

from __future__ import annotations

import mmap
from typing import Any
from weakref import finalize

import numpy as np
import pyopencl as cl
from numpy.typing import DTypeLike, NDArray

from usdslf.gpu.device import Device


class Shared:
    """An array in the host's memory, `host`, and its twin on the device, `buffer`: the same memory where it can be."""

    def __init__(self, device: Device, shape: tuple[int, ...], dtype: DTypeLike) -> None:
        """Makes an array of zeros.

        Args:
            shape: of any size above 0.
        """
        count = int(np.prod(shape))
        size = max(count * np.dtype(dtype).itemsize, 1)
        # whole pages, aligned to one: what a device needs to take the memory as it is
        self._memory = mmap.mmap(-1, -(-size // mmap.PAGESIZE) * mmap.PAGESIZE)
        self.host: NDArray[Any] = np.frombuffer(self._memory, dtype, count).reshape(shape)
        self._queue = device.queue
        self._is_same = device.has_host_memory
        flags = cl.mem_flags.READ_WRITE
        if self._is_same:
            self.buffer = cl.Buffer(device.context, flags | cl.mem_flags.USE_HOST_PTR, hostbuf=self.host)
        else:
            self.buffer = cl.Buffer(device.context, flags | cl.mem_flags.COPY_HOST_PTR, hostbuf=self.host)
        # kernels that were enqueued may still work in the memory when nobody holds it any more
        finalize(self, _wait, device.queue, self._memory).atexit = False

    def push(self) -> None:
        """Gives what the host wrote to the device."""
        if not self._is_same:
            cl.enqueue_copy(self._queue, self.buffer, self.host)

    def pull(self) -> None:
        """Waits for the device, and gives what it wrote to the host."""
        if self._is_same:
            self._queue.finish()
        else:
            cl.enqueue_copy(self._queue, self.host, self.buffer)


def _wait(queue: Any, memory: mmap.mmap) -> None:
    """Keeps memory until all that was enqueued is done."""
    queue.finish()
    del memory
