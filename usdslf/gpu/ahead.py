"""Programs of kernels, built on a thread of their own while what will run them is being made."""

from __future__ import annotations

import threading
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from typing import Any

from usdslf.errors import UsdslfError
from usdslf.gpu.device import Device, open_device

Programs = Sequence[tuple[str, Mapping[str, Any]]]
"""Stems of files of kernels, with the constants that each is built with, in the order in which they are needed."""


@contextmanager
def built_ahead(device: str | Device | None, programs: Programs) -> Iterator[None]:
    """Builds programs meanwhile; who asks for one sooner waits for it, or builds it.

    Args:
        device: or its number or name.
    """
    if isinstance(device, Device) and all(device.has_built(stem, **constants) for stem, constants in programs):
        yield
        return
    stopped = threading.Event()

    def build() -> None:
        try:
            opened = device if isinstance(device, Device) else open_device(device)
            for stem, constants in programs:
                if stopped.is_set():
                    return
                opened.build(stem, **constants)
        except UsdslfError:  # who needs it finds the same, and says it
            return

    threading.Thread(target=build, name="usdslf-kernels").start()
    try:
        yield
    finally:
        stopped.set()
