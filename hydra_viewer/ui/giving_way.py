"""Giving way: threads that compute run after the one that people wait for.

A thread that begins another hands its priority on, so what libraries begin on a thread that gives way (OpenCL's and
Embree's workers) gives way, too.
"""

from __future__ import annotations

import os
import sys
import threading
from contextlib import suppress

NICER = 10  # of the steps of `nice`


def give_way() -> None:
    """Lets the thread that calls it run after others; only Linux knows priorities of single threads."""
    if sys.platform == "linux":
        with suppress(OSError):
            own = threading.get_native_id()
            os.setpriority(os.PRIO_PROCESS, own, min(os.getpriority(os.PRIO_PROCESS, own) + NICER, 19))
