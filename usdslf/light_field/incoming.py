"""Incoming: what light arrives at elements by: links and fixed light, on the device or streamed to it by blocks."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from usdslf.gpu.device import Device
from usdslf.lazy import Later
from usdslf.light_field.blocks import Chunk
from usdslf.light_field.storage import Storage


class Incoming:
    """Links (N, D) and fixed light (N, D, 3) of the elements; they never change, and are taken when asked for."""

    def __init__(
        self, device: Device, hit: Callable[[], NDArray], fixed: Callable[[], NDArray], storage: Storage
    ) -> None:  # fmt: skip
        """Remembers where they come from.

        Args:
            hit, fixed: give the host's, which are copied to the device unless they are streamed.
        """
        self._device, self._storage = device, storage
        # no method, which would have what is never asked for hold itself
        self._upload_light = upload = partial(_upload_light, device, storage)
        self._hit = Later(lambda: np.asarray(hit(), np.uint32))
        self._fixed = Later(lambda: np.asarray(fixed(), np.float32))
        self._hit_d: Later[Any] = Later(lambda: device.upload(np.asarray(hit(), np.uint32)))
        self._fixed_d: Later[Any] = Later(lambda: upload(np.asarray(fixed(), np.float32)))

    @property
    def hit_d(self) -> Any:
        """Links of all elements."""
        return self._device.upload(self._hit()) if self._storage.is_streamed else self._hit_d()

    @property
    def fixed_d(self) -> Any:
        """Fixed light of all elements."""
        return self._upload_light(self._fixed()) if self._storage.is_streamed else self._fixed_d()

    def of_chunk(self, chunk: Chunk) -> tuple[Any, Any, bool]:
        """Returns links and fixed light for a chunk of blocks; whether they are of its lanes, not of all elements."""
        if not self._storage.is_streamed:
            return self._hit_d(), self._fixed_d(), False
        rows = np.maximum(chunk.order, 0)
        return self._device.upload(self._hit()[rows]), self._upload_light(self._fixed()[rows]), True


def _upload_light(device: Device, storage: Storage, light: NDArray) -> Any:
    return device.upload(light.astype(storage.dtype, copy=False))
