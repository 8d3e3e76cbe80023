"""Blocks: elements in sixteens between the same two roughness levels, as the kernels of a bounce take them.

An element under a clear coat is in a block of its coat too, which adds to what the other one makes.
"""

from __future__ import annotations

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
    """Blocks between two levels, or at one of them.

    Attributes:
        levels: one or two, the lower first.
        count: blocks.
        order: (blocks * 16) elements, -1 for none; `order_d` on the device.
        parameters_d: (blocks, 6 + 6 levels, 16): dx, dy, then F0 and F90 of the share of each level.
        adds: to what is there.
    """

    levels: tuple[int, ...]
    count: int
    order: NDArray[np.int32]
    order_d: Any
    parameters_d: Any
    adds: bool

    def of_chunk(self, first: int, count: int) -> Chunk:
        """Returns some of the blocks."""
        return Chunk(self.order[first * LANES : (first + count) * LANES], self.order_d, first, count)


def blocks_of_surface(device: Device, s: Surface, model: str, rows: NDArray) -> list[Blocks]:
    """Packs some elements, by their reflectance.

    Args:
        s: reflectance of all elements.
        rows: (r,) elements, distinct.
    """
    weights = column_weights(model, s.diffuse[rows], s.f0[rows], s.f90[rows])
    blocks = blocks_of_weights(device, rows, weights, s.roughness[rows])
    coated = rows[s.clearcoat[rows] > 0]
    if len(coated) and model_of(model).has_coat:
        coat = np.repeat(np.stack([s.clearcoat * s.coat_f0, s.clearcoat], 1)[coated][..., None], 3, axis=2)
        weights = np.concatenate([np.zeros_like(coat), coat], 1)
        blocks += blocks_of_weights(device, coated, weights, s.clearcoat_roughness[coated], adds=True)
    return blocks


def blocks_of_weights(
    device: Device, element: NDArray, weights: NDArray, roughness: NDArray, adds: bool = False
) -> list[Blocks]:
    """Packs elements by weights of their columns.

    Args:
        element: (r,) distinct.
        weights: (r, 4, 3) of X, Y, A, B.
        roughness: (r,) of their lobe.
        adds: to what is there.
    """
    low, share = levels_of(roughness)
    flat = weights.reshape(len(element), 12)
    lower, upper = flat[:, 6:] * (1 - share)[:, None], flat[:, 6:] * share[:, None]
    uses = np.stack([lower.any(1), upper.any(1)], 1)
    uses[~uses.any(1), 0] = True
    blocks = []
    for kind in np.unique(2 * low + uses[:, 1] + 64 * uses[:, 0]):
        rows = np.flatnonzero(2 * low + uses[:, 1] + 64 * uses[:, 0] == kind)
        has_lower, has_upper = uses[rows[0]]
        parts = [flat[rows, :6], *([lower[rows]] if has_lower else []), *([upper[rows]] if has_upper else [])]
        first = int(low[rows[0]])
        levels = (*([first] if has_lower else []), *([first + 1] if has_upper else []))
        values, count = np.concatenate(parts, 1), -(-len(rows) // LANES)
        order = np.full(count * LANES, -1, np.int32)
        order[: len(rows)] = element[rows]
        p = np.zeros((count * LANES, values.shape[1]), np.float32)
        p[: len(rows)] = values
        p = np.ascontiguousarray(p.reshape(count, LANES, -1).transpose(0, 2, 1))
        blocks.append(Blocks(levels, count, order, device.upload(order), device.upload(p), adds))
    return blocks


def levels_of(roughness: NDArray) -> tuple[NDArray, NDArray]:
    """Returns the lower level (n,) of roughness (n,), and the share (n,) of the level above it."""
    x = np.clip(np.asarray(roughness, np.float64) * LEVEL_COUNT - 1, 0, LEVEL_COUNT - 1)
    low = np.minimum(np.floor(x + 1e-3).astype(np.int64), LEVEL_COUNT - 2)
    share = np.clip(x - low, 0, 1)
    return low, np.where(share < 2e-2, 0, share)
