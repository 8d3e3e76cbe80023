"""Batches of rows that are gathered side by side: while one waits for the device, or for Python, others trace rays.

Each batch has a room of its own, and each room a queue of the device.  What is gathered does not depend on batches, nor
on which of them is done first.
"""

from __future__ import annotations

import threading
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor, wait
from queue import SimpleQueue
from weakref import finalize

import numpy as np
from numpy.typing import NDArray

from usdslf.gpu.device import Device
from usdslf.progress import tell
from usdslf.render.live.gather import BATCH, Add, Draw, GatherRoom, Numbers, gather_batch
from usdslf.render.live.scene import Geometry, LiveScene
from usdslf.render.live.view import Rows

FEWEST = 1 << 13  # rows of a batch, where there are more: launches of fewer cost more than they do

_Said = tuple[int, BaseException | None]
"""Number of a batch that has another frame, or that failed."""


class GatherRooms:
    """Rooms for batches, and threads that work in them."""

    def __init__(self, geometry: Geometry) -> None:
        """Makes a room for each thread that may trace rays, and one more, for one waits most of the time."""
        self.lock = threading.RLock()  # of all that works with them
        self._numbers = Numbers(geometry)
        threads = geometry.tracer.threads
        self._count = threads + (threads > 1)
        self._free: SimpleQueue[tuple[Device, GatherRoom]] = SimpleQueue()
        for k in range(self._count):
            device = geometry.device.beside(k)
            self._free.put((device, GatherRoom(device, geometry.sources.streams)))
        self._pool = ThreadPoolExecutor(self._count, thread_name_prefix="usdslf-gather")
        finalize(self, self._pool.shutdown, wait=False)

    def batches(self, rows: NDArray[np.uint32]) -> list[NDArray[np.uint32]]:
        """Shares rows (n,) out, in order: BATCH at most, as many for each room."""
        count = -(-len(rows) // BATCH)
        count = max(count, min(-(-count // self._count) * self._count, len(rows) // FEWEST), 1)
        return [part for part in np.array_split(rows, count) if len(part)]

    def gather(
        self, scene: LiveScene, part: Rows, batches: Sequence[NDArray[np.uint32]], draws: Sequence[Draw], add: Add,
        done: Callable[[int], None] = lambda nth: None,
    ) -> None:  # fmt: skip
        """Gathers frames of batches, and tells between frames of a batch; a batch's frames are done in order.

        Args:
            batches: of different rows of the part, BATCH at most.
            draws: which numbers each frame takes.
            add: what is done with what was gathered, on any thread.
            done: called on this thread with the number of each batch that has had all frames; where a listener raises,
                batches that were under way come to the end of their frame first.
        """
        numbers = [self._numbers.of(draw) for draw in draws]
        scene.geometry.device.finish()  # what is read was made in its queue
        said: SimpleQueue[_Said] = SimpleQueue()
        is_over = threading.Event()

        def work(nth: int) -> None:
            device, room = self._free.get()
            try:
                for frame, (draw, drawn) in enumerate(zip(draws, numbers)):
                    if frame and is_over.is_set():
                        return
                    gather_batch(scene.on(device), room, part, batches[nth], (draw, drawn), add, frame)
                    said.put((nth, None))
            except BaseException as error:
                said.put((nth, error))
            finally:
                self._free.put((device, room))

        had = [0] * len(batches)

        def hear() -> None:
            nth, error = said.get()
            if error is not None:
                raise error
            had[nth] += 1
            if had[nth] == len(draws):
                done(nth)

        started = [self._pool.submit(work, nth) for nth in range(len(batches))]
        try:
            for left in reversed(range(len(batches) * len(draws))):
                hear()
                if left:
                    tell()
        finally:
            is_over.set()
            wait([one for one in started if not one.cancel()])
            while not said.empty():
                hear()
