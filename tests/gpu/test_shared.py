"""Arrays that host and device work on in turns: memory that a kernel may still work in stays."""

from __future__ import annotations

import gc
import threading
import weakref

import pyopencl as cl
import pytest

from usdslf.gpu import shared
from usdslf.gpu.device import open_device
from usdslf.gpu.shared import Shared


def test_memory_stays_until_no_kernel_works_in_it_though_its_device_is_gone() -> None:
    """What was enqueued when a shot is dropped goes on; its memory was unmapped under it."""
    device = open_device()
    gate = cl.UserEvent(device.context)
    array = Shared(device, (1 << 14,), "float32")
    memory = weakref.ref(array.host.base.base.obj)
    assert type(memory()).__name__ == "mmap"
    cl.enqueue_barrier(device.queue, wait_for=[gate])  # something that is under way
    held = [device, array]
    del device, array

    def drop() -> None:
        held.clear()
        gc.collect()

    thread = threading.Thread(target=drop)
    thread.start()
    try:
        thread.join(0.3)
        assert thread.is_alive() and memory() is not None
    finally:
        gate.set_status(cl.command_execution_status.COMPLETE)
        thread.join(20)
    assert not thread.is_alive() and memory() is None


def kept() -> int:
    """Bytes that are kept for arrays to come."""
    gc.collect()
    return sum(found.size for spare in shared._SPARE.values() for found in spare)


def test_devices_together_keep_no_more_than_is_said(monkeypatch: pytest.MonkeyPatch) -> None:
    """The oldest goes first, at once and not with the next array, and not what a kernel may still work in."""
    piece = 1 << 20
    monkeypatch.setattr(shared, "_SPARE", weakref.WeakKeyDictionary())  # what others keep is none of it
    monkeypatch.setattr(shared, "SPARE_BYTES", 3 * piece)
    devices = [open_device() for _ in range(4)]
    for device in devices:
        arrays = [Shared(device, (piece,), "uint8") for _ in range(3)]
        for array in arrays:
            array.host[0] = 7
        device.finish()
        while arrays:
            arrays.pop()
            device.finish()  # each is idle when the next one goes
    assert 2 * piece <= kept() <= 4 * piece  # the last one is told by the next
    last = Shared(devices[-1], (piece,), "uint8", is_clean=False)
    assert last.host[0] == 7  # used again
    gate = cl.UserEvent(devices[0].context)
    cl.enqueue_marker(devices[0].queue, wait_for=[gate])
    busy = [Shared(devices[0], (piece,), "uint8", is_clean=False) for _ in range(6)]
    busy.clear()
    assert kept() >= 6 * piece
    gate.set_status(cl.command_execution_status.COMPLETE)
    devices[0].finish()
    del last
    assert kept() <= 4 * piece
