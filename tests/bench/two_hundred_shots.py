"""Two hundred small shots in one run: memory and open files of the runner, memory and time of the jobs.

    python tests/bench/two_hundred_shots.py [SOLVED] [SHOWN] [WORKERS]   60 are solved, 140 shown under a look, by 2

Each shot is a file of its own with a colour of its own, each job a process of its own.  Printed for each tenth of the
run: resident memory, open files and threads of the runner, the most memory and the mean time of a job.
"""

from __future__ import annotations

import os
import shutil
import sys
import tempfile
import threading
import time
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))
sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

import numpy as np
from kit.batch_shots import write_look, write_manifest, write_shot

from usdslf.batch import Event, plan, run_batch
from usdslf.batch.apart import resident
from usdslf.batch.records import read_note
from usdslf.cli.bench_batch import open_files

JOBS = """[[jobs]]
shots = ["shots/solve_*/stage.usda"]
strokes = ["{dir}/strokes.usda"]
[[jobs]]
shots = ["shots/show_*/stage.usda"]
look = "look.usda"
"""


def write_shots(folder: Path, solved: int, shown: int, workers: int) -> Path:
    """Writes the shots and their manifest; returns it."""
    first = folder / "shots/solve_000"
    text = write_shot(first).read_text()
    names = [f"solve_{i:03d}" for i in range(solved)] + [f"show_{i:03d}" for i in range(shown)]
    for number, name in enumerate(names):
        if name != first.name:
            shutil.copytree(first, folder / "shots" / name)
        blue = 0.2 + 0.3 * number / len(names)
        (folder / "shots" / name / "stage.usda").write_text(text.replace("(0.4, 0.3, 0.2)", f"(0.4, 0.3, {blue:.4f})"))
    write_look(folder / "look.usda")
    return write_manifest(folder, f"workers = {workers}", jobs=JOBS)


def main() -> None:
    """Prints the table."""
    given = [int(x) for x in sys.argv[1:]]
    solved, shown, workers = (*given, *(60, 140, 2)[len(given) :])
    with tempfile.TemporaryDirectory(prefix="usdslf_two_hundred_") as name:
        found = plan(write_shots(Path(name), solved, shown, workers))
        held: list[tuple[str, int, int, int]] = []

        def hear(event: Event) -> None:
            if event.state in ("done", "failed"):
                held.append((event.job, resident(os.getpid()), open_files(), threading.active_count()))

        began = time.monotonic()
        summary = run_batch(found, hear=hear)
        seconds = time.monotonic() - began
        print(f"{summary.count('done')} of {len(found.jobs)} done in {seconds:.0f} s, {found.workers} at a time")
        print("jobs      runner: MB, open files, threads    jobs: most MB, mean seconds")
        for part in np.array_split(np.arange(len(held)), 10):
            notes = [read_note(found.job(held[i][0])) for i in part]
            memory, files, threads = (max(held[i][k] for i in part) for k in (1, 2, 3))
            most, mean = max(n["memory"] for n in notes), np.mean([n["seconds"] for n in notes])
            rows = f"{part[0] + 1:3d}-{part[-1] + 1:3d} {memory / 1e6:14.1f} {files:8d} {threads:9d}"
            print(f"{rows} {most / 1e6:19.0f} {mean:9.1f}")


if __name__ == "__main__":
    main()
