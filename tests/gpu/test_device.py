"""The OpenCL device: a program that a driver's cache gives back damaged is built again."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from usdslf.errors import KernelBuildError
from usdslf.gpu.device import Device, open_device


class Damaged:
    """A program without its kernels."""

    def __getattr__(self, name: str) -> Any:
        raise AttributeError(name)


def test_a_damaged_program_is_built_again(monkeypatch: pytest.MonkeyPatch) -> None:
    device, built = open_device(), []
    whole = Device._build

    def build(self: Device, stem: str, constants: dict[str, Any]) -> Any:
        built.append(constants)
        return Damaged() if len(built) == 1 else whole(self, stem, constants)

    monkeypatch.setattr(Device, "_build", build)
    kernel = device.kernel("unsharp_mask", "misfit")
    assert len(built) == 2 and built[1] != built[0]  # other options: not the same entry of the cache
    assert device.kernel("unsharp_mask", "misfit") is kernel and len(built) == 2


def test_a_program_that_does_not_build_says_where(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("usdslf.gpu.device.kernel_source", lambda stem: "kernel void fill(global float *x) { x = y; }")
    device = open_device()
    with pytest.raises(KernelBuildError, match=r"kernels/fill\.cl does not build on .*; update the device's driver"):
        device.kernel("fill", "fill")
    assert np.array_equal(device.download(device.zeros((3,), np.float32)), np.zeros(3))
