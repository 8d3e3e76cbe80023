"""Importance: how much the light that elements send does to what is seen along rays.

    met_along(count, links, weights) -> (N,)    how much of rays ends at each element
    seen_from(field, met) -> (N,)               how much each matters to who sees along them

Importance goes the way of light the other way round.  An element matters by its share of the rays, and by what those
reflect of it that matter themselves,

    m = s + T m        (T m)_i = sum_j F_ji rho_j m_j        F_ji A_j = F_ij A_i: F_ij = sum of c_d over links of i to j

with c the cosines of an element's bins, of sum 1, rho its albedo and A its area: who is seen sees, and as much.
REFLECTIONS of it are followed; what is further away is as if it came from everywhere, all elements share alike in it.

Source: Smits, Arvo, Salesin 1992 (importance for radiosity).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from usdslf.elements.elements import Elements
from usdslf.gpu.launch import GROUP, groups
from usdslf.light_field.light_field import LightField
from usdslf.light_field.links import element_of, is_link
from usdslf.light_field.surface import albedo

REFLECTIONS = 2  # that are followed; each costs a look at all links


def met_along(count: int, links: NDArray, weights: NDArray) -> NDArray[np.float64]:
    """Returns how many rays end at each of `count` elements.

    Args:
        links, weights: (n, BLEND) of the rays.
    """
    named = is_link(links)
    return np.bincount(element_of(links[named]), weights[named], minlength=count).astype(np.float64)


def seen_from(field: LightField, met: NDArray[np.float64]) -> NDArray[np.float64]:
    """Returns how much elements (N,) matter to who sees them along rays, by their share of the rays.

    Args:
        field: whose reflectance of now counts.
        met: (N,) rays that end at each: of all strokes together, as it costs the same.
    """
    n, last = len(field.elements), met
    found, reflects = last.copy(), albedo(field.surface).astype(np.float64)
    area = _areas(field.elements)
    for _ in range(REFLECTIONS):
        last = area * _mean_of_seen(field, reflects * last / area)
        found += last
    further = float(last @ reflects) / max(1 - float(reflects.mean()), 0.1)
    return found + further / n


def _areas(elements: Elements) -> NDArray[np.float64]:
    """Areas (N,), none without any."""
    area = elements.area.astype(np.float64)
    return np.maximum(area, 1e-6 * max(float(area.mean()), 1e-30))


def _mean_of_seen(field: LightField, value: NDArray) -> NDArray[np.float64]:
    """Means (N,) by cosine of a number (N,) that elements have, over what each element sees."""
    device, n = field.device, len(value)
    mean_d, most = device.empty((n,), np.float32), max(float(value.max(initial=0)), 1e-300)
    device.kernel("importance", "mean_of_seen")(
        groups(n), (GROUP,), field.hit_d, device.upload((value / most).astype(np.float32)),
        field.cosine_d, np.uint32(n), mean_d,
    )  # fmt: skip
    return most * device.download(mean_d).astype(np.float64)
