"""What pictures read of a light field beside its radiance: means, where light comes from, diffuse light."""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from usdslf.color import luminance
from usdslf.gpu.device import Device
from usdslf.gpu.launch import GROUP, groups
from usdslf.light_field.light_field import LightField
from usdslf.light_field.storage import constants_of
from usdslf.lights.sources import LightSet
from usdslf.render.guide import LightGuide
from usdslf.render.settings import KeepSums
from usdslf.render.wide_field import mean_of_blocks

if TYPE_CHECKING:
    from collections.abc import Mapping


@dataclass(frozen=True)
class Sums:
    """A light field, summed up on its device.

    Attributes:
        mean_d: (N, blocks, 3) mean radiance that is sent into each block of bins.
        arriving_d: (N,) mean luminance that arrives.
        guide_d: (N, blocks) cumulative chances of where it comes from.
        soft_d: (N, 3) indirect irradiance over pi.
        usual: mean luminance that is sent.
    """

    mean_d: Any
    arriving_d: Any
    guide_d: Any
    soft_d: Any
    usual: float

    @staticmethod
    def of(field: LightField, lights: LightSet) -> Sums:
        """Sums a light field up, as it is now.

        Args:
            lights: whose domes shine where rays escape.
        """
        device, n = field.device, len(field.elements)
        mean_d = mean_of_blocks(field)
        guide = LightGuide.of(field, mean_d, lights)
        soft_d = device.empty((n, 3), np.float32)
        device.kernel("live_field", "soft_irradiance", **constants_of(field.outgoing_d))(
            groups(n), (GROUP,), np.uint32(n), field.hit_d, field.outgoing_d, field.emission_d, field.cosine_d, soft_d
        )
        return Sums(mean_d, device.upload(guide.arriving), guide.cumulative_d, soft_d, usual_of(device, mean_d))

    @staticmethod
    def kept(field: LightField, lights: LightSet, keep: KeepSums) -> Sums:
        """The same of a light field that is kept between runs, read where they are."""
        made: list[Sums] = []

        def compute() -> Mapping[str, NDArray[Any]]:
            made.append(Sums.of(field, lights))
            return made[0]._arrays(field.device)

        found = keep(compute)
        if made:
            return made[0]
        on_device = {name: field.device.upload(array) for name, array in found.items() if array.ndim}
        return Sums(**on_device, usual=float(found["usual"]))

    def _arrays(self, device: Device) -> dict[str, NDArray[Any]]:
        arrays = {f.name: device.download(getattr(self, f.name)) for f in fields(self) if f.name != "usual"}
        return {**arrays, "usual": np.array(self.usual)}


def usual_of(device: Device, mean_d: Any) -> float:
    """Returns the mean luminance of means of blocks (N, blocks, 3)."""
    return float(luminance(device.download(mean_d).mean((0, 1))))
