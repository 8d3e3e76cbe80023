"""Rows of the bench about starting: from a process's first moment to the first live frame of a shot.

Kernels, weights and Python's byte code are as an earlier start left them, of few elements and without a cache of the
shot; of the shot nothing is kept at the first start, and what that one kept is there at the second.
"""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path

from usdslf.cache import cache_folder
from usdslf.cli.bench_timing import Timed
from usdslf.errors import UsdslfError
from usdslf.shot_cache import KINDS

AIM = 5  # times that a second start is to be faster
FEW = 100  # elements of the start that nothing is measured of


def start_steps(stage: str, elements: int, size: tuple[int, int], device: str | None) -> Iterator[Timed]:
    """Times two starts of one shot, one after the other.

    Args:
        stage: whose files are there.
        size: of the frame [pixels].

    Raises: UsdslfError where a start fails.
    """
    with tempfile.TemporaryDirectory(prefix="usdslf_starts_") as name:
        folder = Path(name)
        environment = {**os.environ, "XDG_CACHE_HOME": name, "PYTHONPYCACHEPREFIX": str(folder / "byte_code")}
        environment.pop("PYTHONDONTWRITEBYTECODE", None)  # an installation has it from its beginning
        _share_what_serves_all(folder)
        chosen = [device] if device else []
        _seconds([stage, str(FEW), "16", "9", *chosen], {**environment, "USDSLF_CACHE": "weights"})
        asked = [stage, str(elements), *map(str, size), *chosen]
        first, second = (_seconds(asked, {**environment, "USDSLF_CACHE": "all"}) for _ in range(2))
    yield Timed("first start to first live frame", first)
    yield Timed("second start to first live frame", second, f"{AIM} times faster", first / AIM)


def _share_what_serves_all(folder: Path) -> None:
    """Makes a user's cache folder that has all of this user's but what is kept of shots."""
    own = cache_folder()
    (folder / own.name).mkdir()
    beside = [path for path in own.parent.glob("*") if path != own]
    for path in [*beside, *(p for p in own.glob("*") if p.name.split("-")[0] not in KINDS)]:
        (folder / path.relative_to(own.parent)).symlink_to(path)


def _seconds(asked: list[str], environment: dict[str, str]) -> float:
    command = [sys.executable, "-m", "usdslf.cli.start_point", *asked]
    began = time.perf_counter()
    with subprocess.Popen(command, env=environment, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as run:
        assert run.stdout and run.stderr
        said = run.stdout.readline()
        seconds = time.perf_counter() - began
        reason = run.stderr.read().strip().splitlines()
    if not said:
        raise UsdslfError(f"a start cannot be measured: {(reason or ['no reason'])[-1]}")
    return seconds
