"""Batches of a final picture that are worked on at the same time: one is traced while another one is in kernels."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from concurrent.futures import FIRST_COMPLETED, ThreadPoolExecutor, wait
from queue import SimpleQueue
from weakref import finalize

from usdslf.progress import TOLD_EVERY, tell
from usdslf.render.live.gather import GatherRoom
from usdslf.render.live.scene import Geometry

AT_ONCE = 2  # batches, where there are as many threads


class Rooms:
    """Rooms of batches, each of which one batch is in at a time."""

    def __init__(self, geometry: Geometry) -> None:
        """Makes AT_ONCE rooms; one where rays are traced by one thread."""
        self._rooms: SimpleQueue[GatherRoom] = SimpleQueue()
        count = min(AT_ONCE, geometry.tracer.threads)
        for _ in range(count):
            self._rooms.put(GatherRoom(geometry))
        self._pool = ThreadPoolExecutor(count, thread_name_prefix="usdslf-batches") if count > 1 else None
        if self._pool:
            finalize(self, self._pool.shutdown, wait=False)

    def each(self, work: Callable[[GatherRoom, int], None], batches: Iterable[int]) -> None:
        """Does work in a room for each batch, and tells meanwhile; what was begun goes on where that is cancelled.

        Args:
            work: changes nothing that others of the batches read.
            batches: numbers that say which.
        """
        pool = self._pool
        if pool is None:
            for batch in batches:
                self._in_room(work, batch)
                tell()
            return
        waiting = {pool.submit(self._in_room, work, batch) for batch in batches}
        try:
            while waiting:
                done, waiting = wait(waiting, TOLD_EVERY, FIRST_COMPLETED)
                for one in done:
                    one.result()
                tell()
        finally:
            for one in waiting:
                one.cancel()

    def _in_room(self, work: Callable[[GatherRoom, int], None], batch: int) -> None:
        room = self._rooms.get()
        try:
            work(room, batch)
        finally:
            self._rooms.put(room)
