"""Incoming: what light arrives at elements by: links and fixed light, on the device or streamed to it by blocks."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from usdslf.gpu.device import Device
from usdslf.light_field.blocks import Chunk
from usdslf.light_field.storage import Storage


class Incoming:
    """Links (N, D) and fixed light (N, D, 3) of the elements; they never change."""

    def __init__(self, device: Device, hit: NDArray, fixed: NDArray, storage: Storage) -> None:
        """Uploads them, or keeps them where they are."""
        self._device, self._storage = device, storage
        self._hit, self._fixed = np.asarray(hit, np.uint32), np.asarray(fixed, np.float32)
        self._resident: tuple[Any, Any] | None = None
        if not storage.is_streamed:
            self._resident = self._uploaded(slice(None))
            del self._hit, self._fixed  # the host's are whose they were

    def _uploaded(self, rows: slice | NDArray) -> tuple[Any, Any]:
        hit, fixed = self._hit[rows], self._fixed[rows]
        return self._device.upload(hit), self._device.upload(fixed.astype(self._storage.dtype, copy=False))

    @property
    def hit_d(self) -> Any:
        """Links of all elements."""
        return self._resident[0] if self._resident else self._device.upload(self._hit)

    @property
    def fixed_d(self) -> Any:
        """Fixed light of all elements."""
        if self._resident:
            return self._resident[1]
        return self._device.upload(self._fixed.astype(self._storage.dtype, copy=False))

    def of_chunk(self, chunk: Chunk) -> tuple[Any, Any, bool]:
        """Returns links and fixed light for a chunk of blocks; whether they are of its lanes, not of all elements."""
        if self._resident:
            return *self._resident, False
        return *self._uploaded(np.maximum(chunk.order, 0)), True
