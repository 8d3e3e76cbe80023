"""Where light comes from, roughly, at every element: a distribution that gathered rays are drawn from.

The light field knows the light that arrives at its elements from surfaces.  Rays of wide lobes are drawn half by
that, so that a small bright patch of a ceiling, or a window, is found by many rays and not by chance.  The
distribution is constant over blocks of bins of the element nearest to a point.

Source: Jensen 1995, Importance Driven Path Tracing using the Photon Map.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Protocol

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from usdslf.color import luminance
from usdslf.elements.neighbours import NONE
from usdslf.gpu.device import Device
from usdslf.light_field.storage import constants_of
from usdslf.lights.sources import LightSet
from usdslf.render.wide_field import BLOCK
from usdslf.sampling.blue_noise import surface_coordinates
from usdslf.sampling.hemisphere import SIDE, D, bin_directions
from usdslf.scene.records import F32, I32
from usdslf.threads import thread_count

if TYPE_CHECKING:
    from usdslf.elements.elements import Elements

BLOCKS = D // BLOCK**2
SHARE = 0.5  # of the rays that are not drawn from a specular lobe
EVEN = 0.05  # of the guided rays, spread evenly
GROUP = 64
ABOUT = 6  # elements that say how bright it is about each


class GuidingField(Protocol):
    """What is needed of a light field."""

    surface: Any
    lookup: Any
    elements: Any

    @property
    def hit_d(self) -> Any: ...
    @property
    def fixed_d(self) -> Any: ...


class LightGuide:
    """The distributions of all elements, on the device."""

    def __init__(self, device: Device, field: GuidingField | None, mean_d: Any, lights: LightSet) -> None:
        """Sums the light field up; without one nothing is guided.

        Args:
            mean_d: `WideField.mean_d` of the same field.
        """
        self.field = field
        if field is None:
            self.frames_d = device.zeros((1, 9), np.float32)
            self.cumulative_d = device.zeros((1, BLOCKS), np.float32)
            self.arriving = np.zeros(1, np.float32)
            return
        n = mean_d.shape[0]
        light_d = device.empty((n, BLOCKS, 3), np.float32)
        fixed_d, emitted_d = field.fixed_d, device.upload(luminance(field.surface.emission))
        kernel = device.kernel("guide", "guiding_light", BLOCK=BLOCK, **constants_of(fixed_d))
        size = -(-n * BLOCKS // GROUP) * GROUP
        kernel((size,), (GROUP,), np.uint32(n * BLOCKS), field.hit_d, mean_d, fixed_d, emitted_d, light_d)
        arrives, escapes, total = np.moveaxis(device.download(light_d), 2, 0)
        # mean luminance, weighted by the cosine, of all light at each element (N,), no less than about it
        arriving = (total.sum(1) / bin_directions()[:, 2].sum()).astype(np.float32)
        self.arriving = np.maximum(arriving, mean_about(arriving, field.elements))
        frames = np.asarray(field.elements.frame, np.float32).reshape(n, 3, 3)
        if lights.domes:
            arrives = arrives + escapes * self._sky(frames, lights)
        whole = arrives.sum(1, keepdims=True)
        share = np.where(whole > 0, arrives / np.where(whole > 0, whole, 1), 1 / BLOCKS)
        cumulative = np.cumsum((1 - EVEN) * share + EVEN / BLOCKS, 1, dtype=np.float64)
        self.cumulative_d = device.upload((cumulative / cumulative[:, -1:]).astype(np.float32))
        self.frames_d = device.upload(frames)

    @staticmethod
    def _sky(frames: F32, lights: LightSet) -> F32:
        """Returns the luminance (N, blocks) of the domes about the middle of each block, bounded by its mean.

        The bound keeps a sun, which is sampled as a light, from taking all rays.
        """
        bins = bin_directions().reshape(SIDE // BLOCK, BLOCK, SIDE // BLOCK, BLOCK, 3).mean((1, 3)).reshape(-1, 3)
        middle = bins / np.linalg.norm(bins, axis=1, keepdims=True)
        directions = np.einsum("bk,nkj->nbj", middle.astype(np.float32), frames)
        out = luminance(lights.background(directions.reshape(-1, 3), 2 * np.pi / BLOCKS))
        return np.minimum(out, 8 * out.mean()).reshape(len(frames), -1)

    def elements_of(self, triangle: NDArray, barycentric: NDArray, is_front: NDArray) -> I32:
        """Returns the element (n,) whose distribution serves each point, -1 for none."""
        if self.field is None:
            return np.full(len(triangle), -1, np.int32)
        lookup = self.field.lookup
        entry = lookup.entry(triangle, barycentric, np.where(is_front, 1, -1))
        none = entry == NONE
        if not len(lookup.elements_of_entry):
            return np.full(len(triangle), -1, np.int32)
        first = lookup.elements_of_entry[np.where(none, 0, entry), 0]
        return np.where(none | (first == NONE), -1, first.astype(np.int64)).astype(np.int32)


def mean_about(value: F32, elements: Elements) -> F32:
    """Means (N,) of values (N,) of each element and those nearest on its side of its part, whatever stands between.

    The element that serves a point may lie in the dark below what stands beside the point, or behind a wall there.
    """
    group = elements.part.astype(np.int64) * 2 + (elements.side < 0)
    number = np.bincount(group)
    spacing = np.sqrt(np.bincount(group, elements.area) / np.maximum(number, 1))
    where = surface_coordinates(elements.position, elements.normal, group, spacing[group])
    k = min(ABOUT, len(value))
    near = cKDTree(where).query(where, k=k, workers=thread_count())[1].reshape(len(value), k)
    same = group[near] == group[:, None]
    mean: F32 = ((value[near] * same).sum(1) / same.sum(1)).astype(np.float32)
    return mean
