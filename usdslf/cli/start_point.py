"""A start of the program, in a process of its own: a line is printed when the first live frame is there.

python -m usdslf.cli.start_point STAGE ELEMENTS WIDTH HEIGHT [DEVICE]
"""

from __future__ import annotations

import sys

from usdslf.pictures import live_picture
from usdslf.shot import Shot


def show(stage: str, elements: int, size: tuple[int, int], device: str | None = None) -> None:
    """Opens a shot and makes the first frame of its live picture."""
    shot = Shot.open(stage, device=device, elements=elements)
    next(live_picture(shot, size=size).frames(1))


if __name__ == "__main__":
    stage, elements, width, height, *device = sys.argv[1:]
    show(stage, int(elements), (int(width), int(height)), *device)
    print("shown", flush=True)
