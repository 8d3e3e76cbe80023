"""Kernels of live pictures, built on a thread of their own while a shot is read that will be looked at."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from contextlib import contextmanager

from usdslf.errors import UsdslfError
from usdslf.gpu.device import Device, open_device
from usdslf.render.live.scene import constants_of_kernels

STEMS = ("live_camera", "live_surfaces", "live_gather", "live_entries", "live_combine")  # in a first frame's order


@contextmanager
def built_ahead(device: str | Device | None, model: str) -> Iterator[None]:
    """Builds meanwhile what pictures of light in float32 ask for; who asks for it sooner waits for it, or builds it.

    Args:
        device: or its number or name.
        model: of reflectance.
    """
    stopped = threading.Event()

    def build() -> None:
        try:
            opened = device if isinstance(device, Device) else open_device(device)
            for stem in STEMS:
                if stopped.is_set():
                    return
                opened.build(stem, **constants_of_kernels(model))
        except UsdslfError:  # who needs it finds the same, and says it
            return

    threading.Thread(target=build, name="usdslf-kernels").start()
    try:
        yield
    finally:
        stopped.set()
