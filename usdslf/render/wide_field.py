"""The light field for wide rays: outgoing radiance averaged over blocks of 4 x 4 bins.

A gathered ray of a wide lobe stands for many bins of what it meets.  Reading one of them finds the highlights of
glossy elements by chance, which shows as bright blotches; their mean over the block has the same energy.
"""

from __future__ import annotations

from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from usdslf.gpu.device import Device
from usdslf.light_field.links import link_rays
from usdslf.light_field.storage import constants_of
from usdslf.sampling.hemisphere import D

BLOCK = 4  # bins on a side
GROUP = 64


class NearField(Protocol):
    """What is needed of a light field."""

    outgoing_d: Any
    lookup: Any


class WideField:
    """A light field, averaged over blocks of bins at the time it is made."""

    def __init__(self, device: Device, field: NearField) -> None:
        self._device, self._tables = device, field.lookup.upload(device)
        n = field.outgoing_d.shape[0]  # mean_d: (N, blocks, 3)
        blocks = D // BLOCK**2
        self.mean_d = device.empty((n, blocks, 3), np.float32)
        kernel = device.kernel("wide_field", "average_bins", BLOCK=BLOCK, **constants_of(field.outgoing_d))
        kernel((_up(n * blocks),), (GROUP,), np.uint32(n * blocks), field.outgoing_d, self.mean_d)

    def radiance_from_hits(
        self, triangle: NDArray, barycentric: NDArray, direction: NDArray
    ) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
        """Returns the averaged radiance (n, 3) of surfaces hit by rays, interpolated between near elements.

        And the luminance (n,) of the brightest of these elements.
        """
        n = len(triangle)
        if n == 0:
            return np.zeros((0, 3), np.float32), np.zeros(0, np.float32)
        links_d, weights_d = link_rays(self._device, self._tables, triangle, barycentric, direction)
        out_d = self._device.empty((n, 4), np.float32)
        kernel = self._device.kernel("wide_field", "follow_wide_links", BLOCK=BLOCK)
        near = np.uint32(links_d.shape[1])
        kernel((_up(n),), (GROUP,), np.uint32(n), near, links_d, weights_d, self.mean_d, out_d)
        out = self._device.download(out_d)
        return out[:, :3], out[:, 3]


def _up(n: int) -> int:
    return -(-n // GROUP) * GROUP
