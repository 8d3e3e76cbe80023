"""Visibility: the operator G, which names what each element sees in each of its bins.

Rays are made by the device, traced by Embree on all processors, and the device names what they hit; batches of them
are at different steps at the same time.
"""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from queue import SimpleQueue
from time import perf_counter
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from usdslf.gpu.launch import GROUP, groups
from usdslf.gpu.shared import Shared
from usdslf.progress import tell
from usdslf.rays import LEAST_COSINE, RayTracer
from usdslf.sampling.hemisphere import D, bin_directions
from usdslf.scene.records import F32
from usdslf.threads import map_ahead

if TYPE_CHECKING:
    from usdslf.elements.elements import Elements
    from usdslf.elements.lookup import ElementLookup
    from usdslf.gpu.device import Device

BATCH = 64  # elements whose rays are traced and looked up at once; fewer wait for launches more often

Wanted = Callable[[slice], NDArray]
"""rows of elements -> which of their bins (n, D)."""


@dataclass(frozen=True)
class Visibility:
    """The operator G: one link for each element and bin."""

    hit: NDArray[np.uint32]  # (N, D) links of links.py
    rays: int
    seconds: float


def trace_visibility(elements: Elements, lookup: ElementLookup, tracer: RayTracer, device: Device) -> Visibility:
    """Traces a ray through the centre of every bin of every element and names what it hits.

    Source: Nguyen et al. 2013, 6.1.
    """
    began = perf_counter()
    n = len(elements)
    hit = np.empty(n * D, np.uint32)
    trace_bins(elements, lookup, tracer, device, hit, None)
    return Visibility(hit.reshape(n, D), n * D, perf_counter() - began)


def trace_bins(
    elements: Elements, lookup: ElementLookup, tracer: RayTracer, device: Device, hit: NDArray, wanted: Wanted | None
) -> int:
    """Traces the rays of some bins, writes what they hit, and returns how many they were.

    Args:
        hit: (N * D,) links, written where `wanted` is true.
        wanted: tells which bins of some elements; asked on several threads; None: all.
    """
    n = len(elements)
    workers = tracer.threads + (tracer.threads > 1)  # one of them waits for the device most of the time
    seer = _Seer(elements, lookup, tracer, device, workers)

    def see(first: int) -> int:
        rows = slice(first, min(first + BATCH, n))
        if wanted is None:
            return seer.see(slice(rows.start * D, rows.stop * D), hit)
        return seer.see((np.flatnonzero(wanted(rows)) + first * D).astype(np.uint32), hit)

    total = 0
    with ThreadPoolExecutor(workers) as pool:
        for first, count in map_ahead(pool, see, range(0, n, BATCH), 2 * workers):
            total += count
            tell(min(first + BATCH, n) / n)
    return total


def rays_of_bins(elements: Elements, tracer: RayTracer, device: Device, rows: slice) -> tuple[F32, F32]:
    """Returns origins and directions (n D, 3) of the rays of some elements, lifted where they are below the surface."""
    maker, room = _RayMaker(elements, tracer, device), _Room(device, (rows.stop - rows.start) * D)
    maker.make(slice(rows.start * D, rows.stop * D), room)
    return room.origin.host, room.direction.host


class _Room:
    """Arrays of a batch of rays, and of what they hit."""

    def __init__(self, device: Device, count: int) -> None:
        make = lambda shape, dtype=np.float32: Shared(device, shape, dtype, is_clean=False)  # noqa: E731
        self.ray, self.origin, self.direction = make((count,), np.uint32), make((count, 3)), make((count, 3))
        self.triangle, self.u, self.v = make((count,), np.int32), make((count,)), make((count,))
        self.distance, self.found = make((count,)), make((count,), np.uint32)
        self.back, self.link = make((3, count)), make((count,), np.uint32)

    @property
    def hits(self) -> tuple[Shared, ...]:
        """Triangle, u, v, distance."""
        return self.triangle, self.u, self.v, self.distance


class _RayMaker:
    """Makes rays of bins on the device."""

    def __init__(self, elements: Elements, tracer: RayTracer, device: Device) -> None:
        start = tracer.offset_points(elements.position, elements.geometric_normal, elements.triangle)
        of_elements = bin_directions().astype(np.float32), start, elements.geometric_normal, elements.frame
        self._of_elements_d = [device.upload(a) for a in of_elements]
        self._kernel = device.kernel("visibility", "rays_of_bins")

    def make(self, rays: slice | NDArray[np.uint32], room: _Room) -> int:
        """Makes rays of bins, numbered by element * D + bin, in a room; returns how many."""
        numbers = np.arange(rays.start, rays.stop, dtype=np.uint32) if isinstance(rays, slice) else rays
        count = len(numbers)
        room.ray.host[:count] = numbers
        room.ray.push()
        self._kernel(
            groups(count), (GROUP,), np.uint32(count), room.ray, np.float32(LEAST_COSINE),
            *self._of_elements_d, room.origin, room.direction,
        )  # fmt: skip
        room.origin.pull()
        room.direction.pull()
        return count


class _Seer:
    """Traces rays of bins and names what they hit, on several threads, each in a room of its own."""

    def __init__(
        self, elements: Elements, lookup: ElementLookup, tracer: RayTracer, device: Device, workers: int
    ) -> None:  # fmt: skip
        self._maker, self._tracer, self._tables = _RayMaker(elements, tracer, device), tracer, lookup.upload(device)
        self._placed_d = device.upload(_placed(elements))
        self._rooms: SimpleQueue[_Room] = SimpleQueue()
        for _ in range(workers):
            self._rooms.put(_Room(device, BATCH * D))
        self._kernels = [device.kernel("visibility", k) for k in ("entries_of_hits", "nearest_of_hits", "pack_hits")]

    def see(self, rays: slice | NDArray[np.uint32], hit: NDArray) -> int:
        """Writes links of rays (BATCH * D at most), numbered by element * D + bin; returns how many."""
        room = self._rooms.get()
        try:
            count = self._maker.make(rays, room)
            if count:
                columns = self._tracer.intersect_columns(room.origin.host[:count], room.direction.host[:count])
                for to, column in zip(room.hits, columns):
                    to.host[:count] = column
                    to.push()
                self._name(room, count)
                hit[rays] = room.link.host[:count]
            return count
        finally:
            self._rooms.put(room)

    def _name(self, room: _Room, count: int) -> None:
        entries_of_hits, nearest_of_hits, pack_hits = self._kernels
        t, size, n = self._tables, (groups(count), (GROUP,)), np.uint32(count)
        entries_of_hits(
            *size, n, room.direction, room.triangle, room.u, room.v, t.face_normal_d, t.cells_of_triangle_d,
            t.entry_of_cell_d, t.cell_count, room.found,
        )  # fmt: skip
        nearest_of_hits(
            *size, n, room.origin, room.direction, room.distance, t.elements_of_entry_d, self._placed_d,
            room.found, room.back,
        )  # fmt: skip
        pack_hits(*size, n, room.found, room.back, room.link)
        room.link.pull()


def _placed(elements: Elements) -> F32:
    """Position and the columns of the frame of each element (n, 4, 4), a line of the cache; at least one row."""
    placed = np.zeros((max(len(elements), 1), 4, 4), np.float32)
    placed[: len(elements), 0, :3], placed[: len(elements), 1:, :3] = elements.position, elements.frame.swapaxes(1, 2)
    return placed
