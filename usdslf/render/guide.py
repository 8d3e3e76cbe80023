"""Where light comes from, roughly, at every element: a distribution that gathered rays are drawn from.

The light field knows the light that arrives at its elements from surfaces.  Rays of wide lobes are drawn half by
that, so that a small bright patch of a ceiling, or a window, is found by many rays and not by chance.  The
distribution is constant over blocks of bins of the element nearest to a point.

Source: Jensen 1995, Importance Driven Path Tracing using the Photon Map.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from usdslf.cache import address, arrays
from usdslf.color import luminance
from usdslf.gpu.launch import GROUP, groups
from usdslf.light_field.light_field import LightField
from usdslf.light_field.storage import constants_of
from usdslf.lights.sources import LightSet
from usdslf.render.wide_field import BLOCK
from usdslf.sampling.blue_noise import surface_coordinates
from usdslf.sampling.hemisphere import SIDE, D, bin_directions
from usdslf.sampling.nearest import tree_of
from usdslf.scene.records import F32
from usdslf.threads import thread_count

if TYPE_CHECKING:
    from usdslf.elements.elements import Elements

BLOCKS = D // BLOCK**2
SHARE = 0.5  # of the rays that are not drawn from a specular lobe
EVEN = 0.05  # of the guided rays, spread evenly
ABOUT = 6  # elements that say how bright it is about each


@dataclass(frozen=True)
class LightGuide:
    """The distributions of all N elements."""

    cumulative_d: Any  # (N, blocks) chances of where light comes from, on the device
    arriving: F32  # (N,) mean luminance, weighted by the cosine, of all light at each, no less than about it

    @staticmethod
    def of(field: LightField, mean_d: Any, lights: LightSet) -> LightGuide:
        """Sums a light field up.

        Args:
            field: as it is now.
            mean_d: its means of blocks, of wide_field.py.
            lights: whose domes shine where rays escape.
        """
        device, n = field.device, mean_d.shape[0]
        light_d = device.empty((n, BLOCKS, 3), np.float32)
        fixed_d, emitted_d = field.fixed_d, device.upload(luminance(field.surface.emission))
        kernel = device.kernel("guide", "guiding_light", BLOCK=BLOCK, **constants_of(fixed_d))
        kernel(groups(n * BLOCKS), (GROUP,), np.uint32(n * BLOCKS), field.hit_d, mean_d, fixed_d, emitted_d, light_d)
        arrives, escapes, total = np.moveaxis(device.download(light_d), 2, 0)
        arriving = (total.sum(1) / bin_directions()[:, 2].sum()).astype(np.float32)
        arriving = np.maximum(arriving, mean_about(arriving, field.elements))
        if lights.domes:
            frames = np.asarray(field.elements.frame, np.float32).reshape(n, 3, 3)
            arrives = arrives + escapes * _sky(frames, lights)
        whole = arrives.sum(1, keepdims=True)
        share = np.where(whole > 0, arrives / np.where(whole > 0, whole, 1), 1 / BLOCKS)
        cumulative = np.cumsum((1 - EVEN) * share + EVEN / BLOCKS, 1, dtype=np.float64)
        return LightGuide(device.upload((cumulative / cumulative[:, -1:]).astype(np.float32)), arriving)


def _sky(frames: F32, lights: LightSet) -> F32:
    """Returns the luminance (N, blocks) of the domes about the middle of each block, bounded by its mean.

    The bound keeps a sun, which is sampled as a light, from taking all rays.
    """
    bins = bin_directions().reshape(SIDE // BLOCK, BLOCK, SIDE // BLOCK, BLOCK, 3).mean((1, 3)).reshape(-1, 3)
    middle = bins / np.linalg.norm(bins, axis=1, keepdims=True)
    directions = middle.astype(np.float32) @ frames
    out = luminance(lights.background(directions.reshape(-1, 3), 2 * np.pi / BLOCKS))
    return np.minimum(out, 8 * out.mean()).reshape(len(frames), -1)


def mean_about(value: F32, elements: Elements) -> F32:
    """Means (N,) of values (N,) of each element and those nearest on its side of its part, whatever stands between.

    The element that serves a point may lie in the dark below what stands beside the point, or behind a wall there.
    """
    group = elements.part.astype(np.int64) * 2 + (elements.side < 0)
    number = np.bincount(group)
    spacing = np.sqrt(np.bincount(group, elements.area) / np.maximum(number, 1))
    where = surface_coordinates(elements.position, elements.normal, group, spacing[group])
    k = min(ABOUT, len(value))

    def search() -> dict[str, NDArray]:
        return {"near": tree_of(where).query(where, k=k, workers=thread_count())[1].reshape(len(value), k)}

    near = arrays(address("near", 1, where.tobytes(), k), search, of_shot=True)["near"]
    same = group[near] == group[:, None]
    mean: F32 = ((value[near] * same).sum(1) / same.sum(1)).astype(np.float32)
    return mean
