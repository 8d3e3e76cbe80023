"""How long other threads wait for Python while a call is made."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable

import numpy as np


def waits_during(call: Callable[[], object]) -> tuple[float, float]:
    """Returns the longest time [s] in which a thread that wakes each millisecond did not run, and that of the call."""
    woke, is_done = [time.perf_counter()], threading.Event()

    def wake() -> None:
        while not is_done.is_set():
            time.sleep(0.001)
            woke.append(time.perf_counter())

    other = threading.Thread(target=wake)
    other.start()
    began = time.perf_counter()
    call()
    ended = time.perf_counter()
    is_done.set()
    other.join()
    return float(np.diff(np.clip([*woke, ended], began, ended)).max()), ended - began
