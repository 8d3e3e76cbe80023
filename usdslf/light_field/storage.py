"""Storage: how the light of elements lies on the device, within a budget of memory.

    storage_within(memory, fixed, emission) -> Storage       MemoryError_ where nothing fits

    bytes of an element         float32     float16
    ------------------------    -------     -------
    all of it on the device       40960       22528     links, fixed light, outgoing radiance twice
    streamed                      28672       16384     outgoing radiance twice; links and fixed light by blocks

Streamed, links and fixed light stay with the host, and come to the device for the blocks that need them; the same
numbers are added in the same order, so that results are the same to the last bit.  float16 is taken where it changes
what is stored by less than ERROR.  Stylizing a shot takes three times as much again, in any case.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from usdslf.errors import MemoryError_
from usdslf.gpu.device import Device
from usdslf.sampling.hemisphere import D

ERROR = 1e-3  # relative (L1), that storage in half floats may change light by
BRIGHTEST = 1.6e4  # light above it may outgrow half floats, which end at 65504, where surfaces add more to it
PART = 4096  # elements whose error is measured at once
LINK = 4  # bytes


@dataclass(frozen=True)
class Storage:
    """How a light field is stored.

    Attributes:
        dtype: of fixed light and of outgoing radiance on the device, float32 or float16.
        is_streamed: links and fixed light stay with the host.
        error: relative (L1), of what is stored; 0 for float32.
    """

    dtype: type[np.floating[Any]] = np.float32
    is_streamed: bool = False
    error: float = 0.0

    @property
    def bytes_of_element(self) -> int:
        """On the device, at most, when others look at the light or bounce it."""
        light = 3 * D * np.dtype(self.dtype).itemsize
        # streamed: a bounce holds radiance twice; what follows it radiance, and for a while links and fixed light
        return LINK * D + (2 if self.is_streamed else 3) * light

    @property
    def in_words(self) -> str:
        """What is to be said of it; "" where it is as usual."""
        said = []
        if self.dtype == np.float16:
            said.append(f"as float16, which changes it by {100 * self.error:.3f} %")
        if self.is_streamed:
            said.append("streamed through the device by blocks")
        return f"--memory: light is stored {' and '.join(said)}" if said else ""


USUAL = Storage()


def storage_within(memory: float | None, fixed: NDArray, emission: NDArray) -> Storage:
    """Chooses how light is stored.

    Args:
        memory: of the light field on the device [GiB]; None: whatever the usual storage needs.
        fixed: (N, D, 3) light that no edit changes.
        emission: (N, 3) of the elements.

    Raises: MemoryError_ where it does not fit in any way.
    """
    n = len(emission)
    if memory is None or _fits(USUAL, n, memory):
        return USUAL
    error = max(half_error(fixed), half_error(emission))
    half = [Storage(np.float16, is_streamed, error) for is_streamed in (False, True)] if error < ERROR else []
    for storage in (*half, Storage(is_streamed=True)):
        if _fits(storage, n, memory):
            return storage
    raise _refused(n, memory, half[-1] if half else Storage(is_streamed=True))


def check_memory(memory: float | None, elements: int, device: Device) -> None:
    """Raises MemoryError_ where the light field of so many elements, of any light, fits a budget [GiB] in no way.

    Args:
        memory: None: all of the device.
    """
    if memory is None:
        require_device(device, elements, USUAL)
    elif not _fits(least := Storage(np.float16, True), elements, memory):
        raise _refused(elements, memory, least)


def require_device(device: Device, elements: int, storage: Storage) -> None:
    """Raises MemoryError_ where the light field of so many elements does not fit a device."""
    light = elements * D * 3 * np.dtype(storage.dtype).itemsize
    device.require(elements * storage.bytes_of_element, f"{elements} elements", light)


def half_error(light: NDArray) -> float:
    """Returns how much storage in half floats changes light (n, ...), relative (L1); inf where some is too bright."""
    apart = total = 0.0
    for first in range(0, len(light), PART):
        part = np.asarray(light[first : first + PART], np.float32)
        if part.max(initial=0.0) > BRIGHTEST:
            return float("inf")
        apart += float(np.abs(part.astype(np.float16).astype(np.float32) - part).sum(dtype=np.float64))
        total += float(np.abs(part).sum(dtype=np.float64))
    return apart / total if total > 0 else 0.0


def constants_of(light_d: Any) -> dict[str, int]:
    """Returns the build constants of kernels that read or write light (N, D, 3) of the device."""
    return {"HALF_LIGHT": 1} if light_d.dtype == np.float16 else {}


def _fits(storage: Storage, elements: int, memory: float) -> bool:
    return elements * storage.bytes_of_element <= memory * 2**30


def _refused(elements: int, memory: float, least: Storage) -> MemoryError_:
    return MemoryError_(
        f"the light field of {elements} elements needs {elements * least.bytes_of_element / 2**30:.3f} GiB of the "
        f"device at least, but --memory allows {memory:g}; lower --elements or raise --memory"
    )
