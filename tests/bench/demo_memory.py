"""Peak memory of `usdslf demo --all` against that of its largest figure alone, without pictures.

    python tests/bench/demo_memory.py [--elements 1000] [NAME ...]

prints a table in Markdown, each figure in a process of its own and then all of them in one.  With names, `all` means
those.  What is kept between figures shows as a ratio above one.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path

if __name__ == "__main__":
    sys.path[:0] = [str(Path(__file__).resolve().parents[2])]

from usdslf.errors import UsdslfError
from usdslf.gallery import ENTRIES, demo


def peak_mb() -> float:
    """Peak resident memory [MB] of this process, of Linux."""
    line = next(x for x in Path("/proc/self/status").read_text().splitlines() if x.startswith("VmHWM"))
    return int(line.split()[1]) / 1024


def peaks(names: Sequence[str], elements: int) -> list[float]:
    """Runs figures in this process; returns its peak [MB] after each."""
    found: list[float] = []
    with tempfile.TemporaryDirectory() as folder:
        lines = demo.run_demos(
            names, False, folder, None, None, None, lambda step, share: None, elements=elements, pictures=False
        )
        try:
            for line in lines:
                if not line.startswith(" "):  # the name of the next, or the index at the end
                    found.append(peak_mb())
        except UsdslfError as error:
            print(error, file=sys.stderr)
            found.append(peak_mb())
    return found[1:]


def in_process(names: Sequence[str], elements: int) -> list[float]:
    """`peaks` in a process of its own."""
    command = [sys.executable, __file__, "--peaks", "--elements", str(elements), *names]
    said = subprocess.run(command, check=True, capture_output=True, text=True).stdout
    found: list[float] = json.loads(said.splitlines()[-1])
    return found


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("names", nargs="*", metavar="NAME")
    parser.add_argument("--elements", type=int, default=1000, help="of each figure")
    parser.add_argument("--peaks", action="store_true", help=argparse.SUPPRESS)
    told = parser.parse_args()
    names = told.names or [e.name for e in ENTRIES]
    if told.peaks:
        print(json.dumps(peaks(names, told.elements)))
        return
    sys.stdout.reconfigure(line_buffering=True)  # type: ignore[union-attr]
    print("| figure | alone [MB] | peak so far, all in one process [MB] |\n|---|---|---|")
    alone = [in_process([name], told.elements)[-1] for name in names]
    together = in_process(names, told.elements)
    for row in zip(names, alone, together, strict=True):
        print("| {} | {:.0f} | {:.0f} |".format(*row))
    print(f"\nall / largest: {together[-1] / max(alone):.2f}")


if __name__ == "__main__":
    main()
