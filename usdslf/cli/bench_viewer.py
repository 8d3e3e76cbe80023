"""The bench of the viewer: its own measurements on the demo's shot, in a process of its own."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from usdslf.errors import UsdslfError
from usdslf.gallery import still_life
from usdslf.usd.build_stage import write_stage
from usdslf.viewing import require_viewer


def measure_viewer(elements: int, device: str | None) -> dict[str, Any]:
    """Returns what the viewer measured: rows with seconds, the worst and the limit, and stalls of its main thread.

    Args:
        elements: surface elements of the shot.
        device: OpenCL device, by number or name.

    Raises: InputError without Qt, UsdslfError where the viewer fails.
    """
    require_viewer(is_seen=False)
    environment = dict(os.environ)
    if sys.platform == "linux" and not any(environment.get(k) for k in ("DISPLAY", "WAYLAND_DISPLAY")):
        environment["QT_QPA_PLATFORM"] = "offscreen"
    with tempfile.TemporaryDirectory() as folder:
        stage = write_stage(still_life.build(Path(folder)), Path(folder))
        asked = [f"--elements={elements}", *([f"--device={device}"] if device else [])]
        command = [sys.executable, "-m", "hydra_viewer", "--bench", *asked, "--", str(stage)]
        run = subprocess.run(command, env=environment, capture_output=True, text=True, check=False)
    if run.returncode != 0:
        raise UsdslfError(f"the viewer cannot be measured: {(run.stderr.strip().splitlines() or ['no reason'])[-1]}")
    found: dict[str, Any] = json.loads(run.stdout)
    return found


def lines_of_viewer(found: dict[str, Any]) -> Iterator[str]:
    """Yields the lines of a table."""
    yield f"{'the viewer, 900 x 450':<26}{'median':>10}{'worst':>10}{'at most':>10}"
    for row in found["rows"]:
        times = (row[k] for k in ("seconds", "worst", "limit_seconds"))
        yield f"{row['step']:<26}" + "".join(f"{1000 * t:>7.0f} ms" if t is not None else f"{'-':>10}" for t in times)
    stalls = found["stalls"]
    yield f"main thread: {len(stalls)} stalls above 50 ms" if stalls else "main thread: no stall above 50 ms"
    for stall in sorted(stalls, key=lambda s: -s["seconds"])[:8]:
        parts = f"of it own work {1000 * stall['own']:.0f}, Python's lock held elsewhere {1000 * stall['held']:.0f}"
        yield f"  {1000 * stall['seconds']:.0f} ms, {parts}  {stall['where']}".rstrip()
