"""Links: what rays arrive at, element and bin packed in one number; host twin of kernels/links.cl.

    link = element << 10 | bin          ESCAPES: nothing is hit          BLOCKED: a side is hit that no light reaches

A ray that hits a surface is tied to the elements that are blended there, with their weights (elements/lookup.py).
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from usdslf.elements.lookup import BLEND, DeviceLookup
from usdslf.gpu.device import Device
from usdslf.gpu.launch import GROUP, groups
from usdslf.light_field.storage import constants_of
from usdslf.sampling.hemisphere import D

ESCAPES = np.uint32(0xFFFFFFFF)
BLOCKED = np.uint32(0xFFFFFFFE)
BIN_BITS = D.bit_length() - 1
MOST_ELEMENTS = 1 << (32 - BIN_BITS)  # whose links fit, less the two that are none


def is_link(links: NDArray) -> NDArray[np.bool_]:
    """Tells which links name an element."""
    named: NDArray[np.bool_] = links < BLOCKED
    return named


def element_of(links: NDArray) -> NDArray:
    """Returns the elements that links name; of those that name none it means nothing."""
    return links >> np.uint32(BIN_BITS)


def link_rays(
    device: Device, tables: DeviceLookup, triangle: NDArray, barycentric: NDArray, direction: NDArray
) -> tuple[Any, Any]:
    """Names on the device what rays arrive at.

    Args:
        tables: of `ElementLookup.upload`.
        triangle: (n,) that was hit, -1 for none.
        barycentric: (n, 2).
        direction: (n, 3) of travel, unit.

    Returns: device arrays: links (n, BLEND) uint32 of the bins that point back along the ray, or ESCAPES, or BLOCKED;
        and weights (n, BLEND) float32 that sum to 1, or to 0 where there is no light.
    """
    n = len(triangle)
    link_d = device.empty((max(n, 1), BLEND), np.uint32)
    weight_d = device.empty((max(n, 1), BLEND), np.float32)
    device.kernel("links", "link_rays")(
        groups(n), (GROUP,), np.uint32(n), device.upload(np.asarray(triangle, np.int32)),
        device.upload(np.asarray(barycentric, np.float32)), device.upload(np.asarray(direction, np.float32)),
        tables.face_normal_d, tables.corners_d, tables.cells_of_triangle_d, tables.entry_of_cell_d,
        tables.cell_count, tables.elements_of_entry_d, tables.position_d, tables.frames_d, link_d, weight_d,
    )  # fmt: skip
    return link_d, weight_d


def follow_links(device: Device, links_d: Any, weights_d: Any, sender_d: Any) -> NDArray[np.float32]:
    """Returns the radiance (n, 3) that links carry from a field (N, D, 3) on the device; 0 where they name nothing."""
    n = links_d.shape[0]
    radiance_d = device.empty((n, 3), np.float32)
    kernel = device.kernel("links", "follow_links", **constants_of(sender_d))
    kernel(groups(n), (GROUP,), links_d, weights_d, sender_d, np.uint32(n), radiance_d)
    return device.download(radiance_d)
