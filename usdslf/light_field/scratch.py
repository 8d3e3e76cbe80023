"""Scratch: arrays on the device that bounces of one light field write to."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass
from typing import Any, TypeVar

import numpy as np

from usdslf.gpu.device import Device
from usdslf.light_field.blocks import LANES
from usdslf.light_field.storage import Storage
from usdslf.light_field.symmetry import QUARTER, H
from usdslf.sampling.hemisphere import D

Kept = TypeVar("Kept")
CHUNK_BLOCKS = 24  # blocks whose light stays in the caches of a CPU


@dataclass
class Scratch:
    """Arrays that bounces of one light field write to, of chunks of CHUNK_BLOCKS blocks."""

    next_d: Any  # (N, D, 3)
    light_d: Any  # (CHUNK_BLOCKS, D, 3, LANES)
    sharp_d: Any  # the same, of what sharp lobes reflect
    folded_d: Any  # (CHUNK_BLOCKS, D / 4, 3, LANES) in the basis of symmetry.py
    cells_d: Any  # (CHUNK_BLOCKS, 2, QUARTER, 3, LANES) parts of it before the swap
    answer_d: Any  # (CHUNK_BLOCKS, D / 4, Y A B A B, 3, LANES) in that basis
    e_part_d: Any
    e_pi_d: Any
    difference_d: Any  # (N, 2)

    @staticmethod
    def of(device: Device, n: int, storage: Storage) -> Scratch:
        """Makes them for a light field of n elements."""
        make = lambda *shape: device.empty((CHUNK_BLOCKS, *shape, LANES), np.float32)  # noqa: E731
        return Scratch(
            device.empty((n, D, 3), storage.dtype), make(D, 3), make(D, 3), make(D // 4, 3), make(2 * QUARTER, 3),
            make(D // 4, 15), make(H, 3), make(3), device.empty((n, 2), np.float32),
        )  # fmt: skip


def taken(idle: deque[Kept]) -> Kept | None:
    """Takes what is idle, which other threads may do too; None where nothing is."""
    try:
        return idle.pop()
    except IndexError:
        return None
