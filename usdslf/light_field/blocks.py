"""Blocks: elements in sixteens of one roughness level, as the kernels of a bounce take them.

An element between two levels is in a block of both, by its share; one under a clear coat in those of its coat too.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from usdslf.gpu.device import Device
from usdslf.surfaces.reflectance import LEVEL_COUNT, column_weights, model_of

if TYPE_CHECKING:
    from usdslf.light_field.surface import Surface

LANES = 16


@dataclass(frozen=True)
class Chunk:
    """Some blocks, `count` from the one of number `first` on.

    Attributes:
        order: (count * 16) elements, -1 for none.
        order_d: on the device, of all blocks.
    """

    order: NDArray[np.int32]
    order_d: Any
    first: int
    count: int


@dataclass(frozen=True)
class Blocks:
    """Blocks of one level: `order` (blocks * 16) elements, -1 for none, `parameters_d` (blocks, 12, 16)."""

    level: int
    count: int
    order: NDArray[np.int32]
    order_d: Any
    parameters_d: Any

    def of_chunk(self, first: int, count: int) -> Chunk:
        """Returns some of the blocks."""
        return Chunk(self.order[first * LANES : (first + count) * LANES], self.order_d, first, count)


def blocks_of_surface(device: Device, s: Surface, model: str, rows: NDArray) -> list[Blocks]:
    """Packs some elements, by their reflectance.

    Args:
        s: reflectance of all elements.
        rows: (r,) elements, distinct.
    """
    weights = column_weights(model, s.diffuse[rows], s.f0[rows], s.f90[rows]).reshape(len(rows), 12)
    diffuse, lobe = weights[:, :6], weights[:, 6:]
    low, share = levels_of(s.roughness[rows])
    parts = [
        (rows, low, np.concatenate([diffuse, lobe * (1 - share)[:, None]], 1)),
        (rows, low + 1, np.concatenate([0 * diffuse, lobe * share[:, None]], 1)),
    ]
    if np.any(s.clearcoat[rows] > 0) and model_of(model).has_coat:
        coat = np.repeat(np.stack([s.clearcoat * s.coat_f0, s.clearcoat], 1)[rows], 3, axis=1)
        low, share = levels_of(s.clearcoat_roughness[rows])
        parts += [
            (rows, low, np.concatenate([0 * diffuse, coat * (1 - share)[:, None]], 1)),
            (rows, low + 1, np.concatenate([0 * diffuse, coat * share[:, None]], 1)),
        ]
    return blocks_of_weights(device, *(np.concatenate(x) for x in zip(*parts, strict=True)))


def blocks_of_weights(device: Device, element: NDArray, level: NDArray, parameter: NDArray) -> list[Blocks]:
    """Packs rows of element (r,), level (r,) and weights of the columns (r, 12) into blocks."""
    used = np.any(parameter != 0, axis=1)
    element, level, parameter = element[used], level[used], parameter[used]
    blocks = []
    for j in np.unique(level):
        for part in _without_repeats(np.nonzero(level == j)[0], element):
            count = -(-len(part) // LANES)
            order = np.full(count * LANES, -1, np.int32)
            order[: len(part)] = element[part]
            p = np.zeros((count * LANES, 12), np.float32)
            p[: len(part)] = parameter[part]
            p = np.ascontiguousarray(p.reshape(count, LANES, 12).transpose(0, 2, 1))
            blocks.append(Blocks(int(j), count, order, device.upload(order), device.upload(p)))
    return blocks


def levels_of(roughness: NDArray) -> tuple[NDArray, NDArray]:
    """Returns the lower level (n,) of roughness (n,), and the share (n,) of the level above it."""
    x = np.clip(np.asarray(roughness, np.float64) * LEVEL_COUNT - 1, 0, LEVEL_COUNT - 1)
    low = np.minimum(np.floor(x + 1e-3).astype(np.int64), LEVEL_COUNT - 2)
    share = np.clip(x - low, 0, 1)
    return low, np.where(share < 2e-2, 0, share)


def _without_repeats(rows: NDArray, element: NDArray) -> Iterator[NDArray]:
    """Splits rows so that no element comes twice in one part: lanes of one launch must not share an element."""
    while len(rows):
        _, first = np.unique(element[rows], return_index=True)
        yield rows[np.sort(first)]
        rows = np.delete(rows, first)
