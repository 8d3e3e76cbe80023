"""An hour of an artist's work in a few minutes: strokes, undo, redo, camera moves, switches between shots.

    python tests/bench/viewer_hour.py [STROKES [MINUTES]]     500 by default, and as long as they take

Prints memory as it goes, and fails where work is lost.  Memory may grow while caches fill, in the first third; what it
grows by after that is printed.  What the C library keeps of freed memory is given back before it is measured, where
that can be done: it comes and goes.
"""

from __future__ import annotations

import ctypes
import gc
import math
import resource
import sys
import tempfile
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from kit.moving_stages import crowd, roll
from kit.windows import ALT, CTRL, SHIFT, drag, opened, solved, wait_for
from PySide6.QtCore import Qt
from PySide6.QtTest import QTest

from hydra_viewer.model.document import Files
from hydra_viewer.ui.window import Window
from usdslf import read_strokes

PER_SHOT = 25
ON_TABLE = np.array([[0.35, 0.85], [0.4, 0.87], [0.45, 0.86]])


@dataclass
class Hour:
    """What was done, and how much memory the process had after each shot [MiB]."""

    strokes: int = 0
    lost: int = 0
    memory: list[float] = field(default_factory=list)


def work(
    count: int, folder: Path, minutes: float = math.inf, per_shot: int = PER_SHOT,
    say: Callable[[str], None] = lambda said: None,
) -> Hour:  # fmt: skip
    """Paints strokes on two shots in turn, and counts those that did not reach their file.

    Args:
        minutes: after which no other shot is begun.
        per_shot: strokes before the shot is saved and another one opened.
        say: told after each shot.
    """
    hour, rng, until = Hour(), np.random.default_rng(0), time.monotonic() + 60 * minutes
    stages = []
    for name, build in (("roll", roll), ("crowd", crowd)):
        (folder / name).mkdir()
        stages.append(build(folder / name))
    with opened(stages[0], stages[0].with_name("strokes_0.usda"), stages[0].with_name("look.usda")) as window:
        number = 0
        while hour.strokes < count and time.monotonic() < until:
            painted = min(per_shot, count - hour.strokes)
            _paint_shot(window, painted, rng)
            hour.strokes += painted
            window.filing.save()
            wait_for(lambda: window.worker.is_idle and window.document.is_saved)
            hour.lost += painted - len(read_strokes(window.document.files.strokes))
            number += 1
            stage = stages[number % 2]
            before = window.document.shot
            window.filing.open(Files(str(stage), str(stage.with_name(f"strokes_{number}.usda")), ""))
            wait_for(lambda before=before: window.document.shot is not before)
            _give_back()
            hour.memory.append(_resident())
            say(f"{hour.strokes} strokes, {hour.lost} lost, {hour.memory[-1]:.0f} MiB")
    return hour


def _paint_shot(window: Window, count: int, rng: np.random.Generator) -> None:
    """Strokes on one shot, with what an artist does between them."""
    canvas = window.painting.canvas
    for n in range(count):
        drag(canvas, [tuple(p) for p in ON_TABLE + rng.uniform(-0.1, 0.1, 2) * [1, 0.5]])
        if n % 4 == 1:
            QTest.keyClick(window, Qt.Key.Key_Z, CTRL)
            QTest.keyClick(window, Qt.Key.Key_Z, CTRL | SHIFT)
        if n % 3 == 2:
            drag(canvas, [(0.5, 0.5), tuple(0.5 + rng.uniform(-0.05, 0.05, 2))], ALT)
            QTest.keyClick(window, Qt.Key.Key_0)
        if n % 12 == 11:
            solved(window)
    solved(window)


def _give_back() -> None:
    """Frees what nobody holds, also what the C library keeps of it."""
    gc.collect()
    trim = getattr(ctypes.CDLL(None), "malloc_trim", None) if sys.platform == "linux" else None
    if trim is not None:
        trim(0)


def _resident() -> float:
    """Memory of this process [MiB]; 0 where the system does not say."""
    said = Path("/proc/self/statm")
    return int(said.read_text().split()[1]) * resource.getpagesize() / 2**20 if said.exists() else 0.0


def growth(memory: list[float]) -> float:
    """Returns what memory grows by from one shot to the next, once the first third is over [MiB]."""
    steady = memory[len(memory) // 3 :]
    return float(np.polyfit(range(len(steady)), steady, 1)[0]) if len(steady) > 1 else 0.0


if __name__ == "__main__":
    with tempfile.TemporaryDirectory() as made:
        count, minutes = (float(x) for x in (*sys.argv[1:], *("500", "inf")[len(sys.argv) - 1 :]))
        found = work(int(count), Path(made), minutes, say=partial(print, flush=True))
    print(f"{found.strokes} strokes, {found.lost} lost; MiB after each shot: {[round(m) for m in found.memory]}")
    print(f"{growth(found.memory):.2f} MiB from one shot to the next after warm-up")
    sys.exit(1 if found.lost else 0)
