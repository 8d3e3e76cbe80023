"""Columns of samples that stay on the device: what fits ask of them are means over dabs.

    DeviceColumns(device, columns_d, model)          read as an array (S, J, 4, 3) where somebody asks for samples
    DeviceColumns.means(first, d, f0, f90, tied)     what the dabs make of them, bilinear in the change of colours
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from usdslf.gpu.device import Device
from usdslf.gpu.launch import GROUP, groups
from usdslf.scene.records import F64
from usdslf.surfaces.reflectance import model_of


@dataclass(frozen=True)
class Means:
    """Means over the samples of n dabs: P, U, V, W of `Bilinear`, and U, W of a factor on d, V of one on F0."""

    p: F64  # (n, J, 3)
    u: F64
    v: F64
    w: F64
    factor_u: F64
    factor_w: F64
    factor_v: F64
    own: F64  # (S, 3) P of each sample of the dabs at the last level


class DeviceColumns:
    """X, Y, A, B of S samples at J levels, (S, J, 4, 3) on a device; the host's copy is made when it is asked for."""

    def __init__(self, device: Device, columns_d: Any, model: str) -> None:
        """Keeps an array of the device, that nobody writes to any more, and the reflectance model that it is of."""
        self.device, self.columns_d, self.model = device, columns_d, model

    @property
    def shape(self) -> tuple[int, ...]:
        """(S, J, 4, 3)."""
        shape: tuple[int, ...] = self.columns_d.shape
        return shape

    @property
    def nbytes(self) -> int:
        """Bytes on the device."""
        return int(self.columns_d.nbytes)

    @cached_property
    def host(self) -> NDArray[np.float32]:
        """All of them (S, J, 4, 3)."""
        return self.device.download(self.columns_d)

    def __array__(self, dtype: Any = None, copy: bool | None = None) -> NDArray:
        return np.array(self.host, dtype, copy=copy)

    def __getitem__(self, rows: Any) -> NDArray[np.float32]:
        """Returns a part, as that of an array."""
        found: NDArray[np.float32] = self.host[rows]
        return found

    def behind(self, first: int) -> NDArray[np.float32]:
        """Returns those of the samples from one on."""
        if first >= self.shape[0]:
            return np.zeros((0, *self.shape[1:]), np.float32)
        return self.device.download(self.columns_d[first:])

    def means(self, first: NDArray, d: NDArray, f0: NDArray, f90: NDArray, tied: bool) -> Means:
        """Returns what dabs make of their samples.

        Args:
            first: (n + 1,) first sample of each dab, and behind those of the last.
            d, f0, f90: (S, 3) of the samples.
            tied: F90 changes with F0, as in a metal of the metal workflow.
        """
        n, (levels, behind) = len(first) - 1, (self.shape[1], int(first[-1]))
        upload, device = self.device.upload, self.device
        means_d, own_d = device.empty((n, levels, 7, 3), np.float32), device.empty((max(behind, 1), 3), np.float32)
        device.kernel("evidence", "means_of_dabs", **model_of(self.model).constants)(
            groups(n * levels), (GROUP,), upload(first.astype(np.int32)), self.columns_d,
            *(upload(x.astype(np.float32)) for x in (d, f0, f90)), np.int32(tied), np.uint32(levels),
            np.uint32(n * levels), means_d, own_d,
        )  # fmt: skip
        means = device.download(means_d).astype(np.float64)
        own = device.download(own_d)[:behind].astype(np.float64)
        p, u, v, w, factor_u, factor_w, factor_v = np.moveaxis(means, 2, 0)
        return Means(p, u, v, w, factor_u, factor_w, factor_v, own)
