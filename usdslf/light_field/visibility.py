"""Visibility: the operator G, which names what each element sees in each of its bins.

Rays are traced by Embree on all processors, and the device looks up the elements that they hit meanwhile.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from time import perf_counter
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from usdslf.progress import tell
from usdslf.rays import LEAST_COSINE, RayTracer
from usdslf.sampling.hemisphere import D, bin_directions
from usdslf.scene.records import F32

if TYPE_CHECKING:
    from usdslf.elements.elements import Elements
    from usdslf.elements.lookup import ElementLookup
    from usdslf.gpu.device import Device

BATCH = 64  # elements whose rays are traced and looked up at once

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

    Embree and the device work at the same time, on different batches.

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
    start = tracer.offset_points(elements.position, elements.geometric_normal, elements.triangle)
    bins = bin_directions().astype(np.float32)
    tables = lookup.upload(device)
    bins_d, start_d, frames_d = device.upload(bins), device.upload(start), device.upload(elements.frame)
    geometric_d = device.upload(elements.geometric_normal)
    kernel = device.kernel("visibility", "pack_hits")
    packed_d = [device.empty((BATCH * D,), np.uint32) for _ in range(2)]

    def trace(first: int) -> tuple[NDArray, ...]:
        rows = slice(first, min(first + BATCH, n))
        rays = np.arange(first * D, rows.stop * D, dtype=np.uint32)
        if wanted is None:
            direction = outgoing_directions(elements, bins, rows)
            origin = np.broadcast_to(start[rows, None], direction.shape)
            return rays, *tracer.intersect_columns(origin.reshape(-1, 3), direction.reshape(-1, 3))
        chosen = np.flatnonzero(wanted(rows))
        if not len(chosen):
            return (rays[:0],) * 5
        direction = outgoing_directions(elements, bins, rows).reshape(-1, 3).take(chosen, 0)
        return rays[chosen], *tracer.intersect_columns(start[rows].take(chosen // D, 0), direction)

    batches = (columns for _, columns in tracer.map_ahead(trace, range(0, n, BATCH)))
    total = 0
    for turn, (rays, *columns) in enumerate(_filled_batches(batches, BATCH * D)):
        count = len(rays)
        kernel(
            (BATCH * D,),  # always the same: a CPU compiles a kernel for each size
            None,
            np.uint32(count),
            device.upload(rays),
            np.float32(LEAST_COSINE),
            *(device.upload(x) for x in columns),
            bins_d,
            start_d,
            geometric_d,
            frames_d,
            tables.face_normal_d,
            tables.cells_of_triangle_d,
            tables.entry_of_cell_d,
            tables.cell_count,
            tables.elements_of_entry_d,
            tables.position_d,
            packed_d[turn % 2],
        )
        hit[rays] = device.download(packed_d[turn % 2])[:count]
        total += count
        tell(total / (n * D) if wanted is None else None)
    return total


def _filled_batches(batches: Iterable[tuple[NDArray, ...]], size: int) -> Iterator[tuple[NDArray, ...]]:
    """Joins small batches, each some columns of one length, as long as `size` rows are enough for them."""
    waiting: list[tuple[NDArray, ...]] = []
    count = 0
    for batch in batches:
        if waiting and count + len(batch[0]) > size:
            yield _joined(waiting)
            waiting, count = [], 0
        if len(batch[0]):
            waiting.append(batch)
            count += len(batch[0])
    if waiting:
        yield _joined(waiting)


def _joined(batches: list[tuple[NDArray, ...]]) -> tuple[NDArray, ...]:
    if len(batches) == 1:
        return batches[0]
    return tuple(np.concatenate(columns) for columns in zip(*batches, strict=True))


def outgoing_directions(elements: Elements, bins: F32, rows: slice) -> F32:
    """World directions (n, D, 3) of bins (D, 3) of some elements, lifted where they are below the surface."""
    normal = elements.geometric_normal[rows]
    direction = bins @ elements.frame[rows]
    # The lowest bins are 3.5 degrees above the horizon.
    leaning = np.flatnonzero((normal * elements.normal[rows]).sum(1) < np.cos(np.radians(3.2)))
    if len(leaning):
        cosine = (direction[leaning] @ normal[leaning, :, None])[..., 0]
        which, bin_ = np.nonzero(cosine < LEAST_COSINE)
        low = leaning[which], bin_
        lifted = direction[low] + (LEAST_COSINE - cosine[which, bin_])[:, None] * normal[low[0]]
        direction[low] = lifted / np.linalg.norm(lifted, axis=1, keepdims=True)
    return direction

