"""Ends the viewer's process again and again, each time while it is at something else; prints how it ended.

    python tests/bench/viewer_ends.py [TIMES] [ELEMENTS]      10 and 2000 by default; fails where one did not end well

A window is closed some time after a stroke was painted: while it is solved, shown, lit, or while pictures are made.
"""

from __future__ import annotations

import subprocess
import sys
import tempfile
import time
from pathlib import Path

TESTS = Path(__file__).resolve().parents[1]
FIRST, EVERY = 0.05, 0.17  # seconds after the stroke, of the first end and between ends
USUAL = "This plugin does not support propagateSizeHints()"  # says Qt without a screen


def end_once(seconds: float, elements: int, folder: Path) -> None:
    """Paints on a small shot in a window, closes it after some seconds, and returns; the process is to end then."""
    sys.path.insert(0, str(TESTS))
    from kit.painted_table import ON_RED, write_table
    from kit.windows import SMALL, drag, wait_for
    from PySide6.QtTest import QTest

    from hydra_viewer.model.document import Files
    from hydra_viewer.ui.application import make_application
    from hydra_viewer.ui.window import Window

    make_application()
    window = Window(SMALL | {"elements": elements})
    window.resize(900, 640)
    window.show()
    window.filing.open(Files(str(write_table(folder))))
    wait_for(lambda: window.painting.canvas.viewport.pixels() is not None)
    drag(window.painting.canvas, list(ON_RED))
    assert len(window.document.strokes) == 1
    QTest.qWait(round(1000 * seconds))
    window.filing.autosave.forget()
    window.document.mark_saved(window.document.files, window.document.strokes)
    window.close()
    print("closed", flush=True)


def main(times: int, elements: int) -> int:
    """Returns how many ended badly."""
    bad = 0
    for number in range(times):
        seconds = FIRST + number * EVERY
        with tempfile.TemporaryDirectory() as folder:
            began = time.monotonic()
            command = [sys.executable, __file__, "--once", str(seconds), str(elements), folder]
            run = subprocess.run(command, capture_output=True, text=True, check=False)
        said = [line for line in run.stderr.splitlines() if line != USUAL]
        is_well = run.returncode == 0 and run.stdout == "closed\n" and not said
        bad += not is_well
        how = "well" if is_well else f"badly, exit code {run.returncode}: {' '.join(said[-3:])}"
        spent = time.monotonic() - began
        print(f"closed {seconds:.2f} s after a stroke: ended {how}, {spent:.1f} s in all", flush=True)
    print(f"{bad} of {times} ended badly")
    return bad


if __name__ == "__main__":
    if sys.argv[1:2] == ["--once"]:
        end_once(float(sys.argv[2]), int(sys.argv[3]), Path(sys.argv[4]))
    else:
        given = [int(x) for x in sys.argv[1:]]
        sys.exit(min(main(*given, *(10, 2000)[len(given) :]), 1))
