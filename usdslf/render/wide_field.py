"""The light field for wide rays: outgoing radiance averaged over blocks of 4 x 4 bins.

A gathered ray of a wide lobe stands for many bins of what it meets.  Reading one of them finds the highlights of
glossy elements by chance, which shows as bright blotches; their mean over the block has the same energy.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from usdslf.gpu.launch import GROUP, groups
from usdslf.light_field.light_field import LightField
from usdslf.light_field.storage import constants_of
from usdslf.sampling.hemisphere import D

BLOCK = 4  # bins on a side


def mean_of_blocks(field: LightField) -> Any:
    """Returns the radiance (N, blocks, 3) of a light field as it is now, on its device."""
    n = field.outgoing_d.shape[0]
    blocks = D // BLOCK**2
    mean_d = field.device.empty((n, blocks, 3), np.float32)
    kernel = field.device.kernel("wide_field", "average_bins", BLOCK=BLOCK, **constants_of(field.outgoing_d))
    kernel(groups(n * blocks), (GROUP,), np.uint32(n * blocks), field.outgoing_d, mean_d)
    return mean_d
