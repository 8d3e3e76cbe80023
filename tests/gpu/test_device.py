"""The OpenCL device: a program that a driver's cache gives back damaged is built again."""

from __future__ import annotations

import subprocess
import sys
import textwrap
import threading
import time
from typing import Any

import numpy as np
import pyopencl as cl
import pytest

from usdslf.errors import KernelBuildError
from usdslf.gpu.device import Device, open_device
from usdslf.gpu.shared import Shared
from usdslf.gpu.source import kernel_source
from usdslf.inference.ahead import programs_of_answers
from usdslf.render.live.ahead import programs_of_pictures


class Damaged:
    """A program without its kernels."""

    def __getattr__(self, name: str) -> Any:
        raise AttributeError(name)


def test_a_damaged_program_is_built_again(monkeypatch: pytest.MonkeyPatch) -> None:
    device, built = Device(open_device().context), []
    whole = Device._build

    def build(self: Device, stem: str, constants: dict[str, Any]) -> Any:
        built.append(constants)
        return Damaged() if len(built) == 1 else whole(self, stem, constants)

    monkeypatch.setattr(Device, "_build", build)
    kernel = device.kernel("unsharp_mask", "misfit")
    assert len(built) == 2 and built[1] != built[0]  # other options: not the same entry of the cache
    assert device.kernel("unsharp_mask", "misfit") is kernel and len(built) == 2


def test_what_is_built_for_a_device_is_built_once(monkeypatch: pytest.MonkeyPatch) -> None:
    kernel = open_device().kernel("unsharp_mask", "misfit")
    monkeypatch.setattr(Device, "_build", lambda *_: pytest.fail("built again"))
    assert open_device().kernel("unsharp_mask", "misfit") is not kernel  # arguments are each device's own


def test_a_program_that_does_not_build_says_where(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("usdslf.gpu.device.kernel_source", lambda stem: "kernel void fill(global float *x) { x = y; }")
    device = open_device()
    with pytest.raises(KernelBuildError, match=r"kernels/fill\.cl does not build on .*; update the device's driver"):
        device.kernel("fill", "fill")
    assert np.array_equal(device.download(device.zeros((3,), np.float32)), np.zeros(3))


@pytest.mark.filterwarnings("ignore::pyopencl.CompilerWarning")
def test_compilers_have_nothing_to_say_of_programs() -> None:
    """Some write it to the terminal, past Python: a first start would begin with it."""
    context = open_device().context
    programs = [*programs_of_pictures("preview_surface"), *programs_of_answers("preview_surface")]
    for stem, constants in [*programs, ("light_field", {}), ("visibility", {})]:
        named = {**constants, "BUILD": time.time_ns() % 10**9}  # not a cache's entry
        options = [f"-D{name}={value}" for name, value in named.items()]
        built = cl.Program(context, kernel_source(stem)).build(options=["-cl-std=CL1.2", *options])
        log = built.get_build_info(context.devices[0], cl.program_build_info.LOG)
        assert not log.strip(), f"{stem}: {log}"


def test_arrays_that_nobody_holds_last_until_their_kernels_are_done() -> None:
    """In a process of its own: where the memory goes with the array, the kernels end the process."""
    script = textwrap.dedent(
        '''
        import numpy as np
        import pyopencl as cl
        from usdslf.gpu.device import open_device

        device = open_device(None)
        source = """kernel void slow(global float *x)
        {
            float y = get_global_id(0);
            for (int i = 0; i < 400; ++i) y = 0.5f * y + 1.0f;
            x[get_global_id(0)] = y;
        }"""
        kernel = cl.Program(device.context, source).build().slow
        held = device.empty((1 << 20,), np.float32)
        for x in (held, device.zeros((1 << 20,), np.float32), device.empty((1 << 20,), np.float32)):
            kernel(device.queue, x.shape, None, x.base_data)
        del x
        assert (device.download(held) == 2).all()
        '''
    )
    run = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=False)
    assert run.returncode == 0, run.stderr


def test_who_lets_an_array_go_does_not_wait_and_who_takes_its_memory_does() -> None:
    """A main thread that forgets a picture is not held up by what the device is at."""
    device, shape = open_device(), (1 << 16,)
    held = Shared(device, shape, np.float32)
    address, gate = held.host.ctypes.data, cl.UserEvent(device.context)
    cl.enqueue_marker(device.queue, wait_for=[gate])  # all that is enqueued waits for it
    del held  # would stand still here
    taken = list[Shared]()
    taking = threading.Thread(target=lambda: taken.append(Shared(device, shape, np.float32, is_clean=False)))
    taking.start()
    taking.join(0.1)
    assert not taken
    gate.set_status(cl.command_execution_status.COMPLETE)
    taking.join(60)
    assert taken[0].host.ctypes.data == address
