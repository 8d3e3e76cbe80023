"""Arrays that host and device work on in turns: memory that a kernel may still work in stays."""

from __future__ import annotations

import gc
import threading
import weakref

import pyopencl as cl

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
