"""Arrays that host and device work on in turns: rays are traced on the host, all else is done in kernels.

Where the device works in the host's memory nothing is copied; elsewhere `push` and `pull` copy.  Memory that nobody
holds any more is used again, by arrays of the same device: fresh pages cost more than most kernels that fill them.  All
devices of a process together, one of each shot, keep no more of it than SPARE_BYTES.
"""

from __future__ import annotations

import mmap
import threading
from collections import deque
from contextlib import suppress
from typing import Any
from weakref import WeakKeyDictionary, finalize

import numpy as np
import pyopencl as cl
from numpy.typing import DTypeLike, NDArray

from usdslf.gpu.device import Device
from usdslf.gpu.pages import pages_of_zeros

SPARE_BYTES = 1 << 30  # kept for arrays to come, at most, of all devices
STEPS = 8  # sizes between one power of two and the next that memory is given in

_Piece = tuple[int, mmap.mmap, Any]
"""Bytes, the host's memory, the device's buffer."""


class _Spare:
    """A piece that kernels may still work in: until none does its memory stays, whoever lets it go."""

    def __init__(self, piece: _Piece, done: Any) -> None:
        """Keeps a piece.

        Args:
            done: the event after which no kernel works in it.
        """
        self.size, self._piece, self._done = piece[0], piece, done

    @property
    def is_idle(self) -> bool:
        """Whether nothing works in it any more."""
        return bool(self._done.command_execution_status <= cl.command_execution_status.COMPLETE)  # below: an error

    def taken(self) -> _Piece:
        """Returns the piece, when nothing works in it any more."""
        self._done.wait()
        return self._piece

    def __del__(self) -> None:
        self._done.wait()


class Shared:
    """An array in the host's memory, `host`, and its twin on the device, `buffer`: the same memory where it can be."""

    def __init__(self, device: Device, shape: tuple[int, ...], dtype: DTypeLike, is_clean: bool = True) -> None:
        """Makes an array.

        Args:
            shape: of any size above 0.
            is_clean: of zeros; else of anything.
        """
        count = int(np.prod(shape))
        size = max(count * np.dtype(dtype).itemsize, 1)
        self._device, self._is_same = device, device.has_host_memory
        spare = _spare_of(device)
        room = _room_of(size)
        piece = _take(spare, room)
        is_new = piece is None
        size_of_piece, memory, self.buffer = piece or self._made(device, room)
        pages: NDArray[Any] = np.frombuffer(memory, np.uint8)
        self.host: NDArray[Any] = pages[: count * np.dtype(dtype).itemsize].view(dtype).reshape(shape)
        # when nobody holds the array or a part of it any more; kernels that were enqueued may still work in it
        finalize(pages, _give_back, device.queue, spare, (size_of_piece, memory, self.buffer)).atexit = False
        if is_clean and not is_new:
            self.host[...] = 0
            self.push()

    def _made(self, device: Device, size: int) -> _Piece:
        """Pages of zeros, aligned to one: what a device needs to take the memory as it is."""
        memory = pages_of_zeros(size)
        how = cl.mem_flags.USE_HOST_PTR if self._is_same else cl.mem_flags.COPY_HOST_PTR
        host = np.frombuffer(memory, np.uint8)
        return size, memory, cl.Buffer(device.context, cl.mem_flags.READ_WRITE | how, hostbuf=host)

    def push(self) -> None:
        """Gives what the host wrote to the device."""
        if not self._is_same:
            self._device.moved += self.host.nbytes
            cl.enqueue_copy(self._device.queue, self.buffer, self.host)

    def pull(self) -> None:
        """Waits for the device, and gives what it wrote to the host."""
        if self._is_same:
            self._device.finish()
        else:
            self._device.moved += self.host.nbytes
            cl.enqueue_copy(self._device.queue, self.host, self.buffer)


_SPARE: WeakKeyDictionary[Device, deque[_Spare]] = WeakKeyDictionary()
_lock = threading.RLock()  # of its keys; what is collected within may give memory back


def _spare_of(device: Device) -> deque[_Spare]:
    with _lock:
        return _SPARE.setdefault(device, deque())


def _room_of(size: int) -> int:
    """Bytes that are given for so many: whole pages, of a few sizes, so that memory fits again."""
    step = max(1 << max(size.bit_length() - 1 - STEPS.bit_length() + 1, 0), mmap.PAGESIZE)
    return -(-size // step) * step


def _give_back(queue: Any, spare: deque[_Spare], piece: _Piece) -> None:
    """Keeps memory for another array.

    Whoever lets an array go, a window's main thread too, does not wait for what was enqueued: who takes it does.
    """
    done = cl.enqueue_marker(queue)
    queue.flush()
    spare.append(_Spare(piece, done))
    _trim()


def _take(spare: deque[_Spare], room: int) -> _Piece | None:
    """Takes a piece of a size that nothing works in any more; None: there is none."""
    for found in tuple(spare):
        if found.size == room:
            try:
                spare.remove(found)
            except ValueError:  # another thread has taken it
                continue
            return found.taken()
    return None


def _trim() -> None:
    """Lets memory go that is too much: the oldest, of the device that keeps most, in which nothing works any more."""
    with _lock:
        all_spare = list(_SPARE.values())
    sizes = [sum(found.size for found in tuple(spare)) for spare in all_spare]
    for number in sorted(range(len(sizes)), key=sizes.__getitem__, reverse=True):
        for found in tuple(all_spare[number]):
            if sum(sizes) <= SPARE_BYTES:
                return
            if found.is_idle:
                with suppress(ValueError):  # another thread has taken it
                    all_spare[number].remove(found)
                sizes[number] -= found.size
