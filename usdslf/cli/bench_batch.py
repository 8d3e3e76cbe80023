"""Bench of batches: throughput with one and two workers, memory of a worker, what a job costs beside its work.

The same small shot is solved again and again, each time by a job of its own, in a process of its own.
"""

from __future__ import annotations

import os
import tempfile
import time
from collections.abc import Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from usdslf.batch.apart import resident
from usdslf.batch.job import Event
from usdslf.batch.planning import Plan, plan
from usdslf.batch.records import read_note
from usdslf.batch.run import run_batch
from usdslf.batch.work import run_job
from usdslf.errors import UsdslfError
from usdslf.gallery import still_life
from usdslf.gallery.play import Play
from usdslf.usd.stroke_layer import write_strokes

if TYPE_CHECKING:
    from usdslf.progress import Say

ELEMENTS = 200
PLANNED = 10000


def measure_batch(jobs: int, device: str | None, ocio: str | None, say: Say) -> dict[str, Any]:
    """Runs batches of small shots in a folder that goes again.

    Args:
        jobs: of the longest run, the one that shows whether memory or files grow; the timed ones have 8 at most.

    Returns: seconds of a job's work and of its process, jobs a minute by workers, bytes of a worker, resident bytes
        and open files of the runner at the first and at the last job, seconds to plan PLANNED jobs.

    Raises: UsdslfError where a job fails.
    """
    with tempfile.TemporaryDirectory(prefix="usdslf_bench_") as name:
        folder = Path(name)
        play = Play(still_life.ENTRY, folder, device=device, ocio=ocio, pictures=False, elements=ELEMENTS)
        shot, strokes = play.session.shot.path, folder / "strokes.usda"
        write_strokes(strokes, still_life.paint(play), play.session.stage)
        job = _plan(folder, "alone", shot, strokes, 1, 1).jobs[0]
        run_job(job)  # what is kept between runs is there now
        began = time.perf_counter()
        run_job(job)
        work = time.perf_counter() - began
        timed = {w: _run(_plan(folder, f"workers_{w}", shot, strokes, min(jobs, 8), w), say) for w in (1, 2)}
        long = _run(_plan(folder, "long", shot, strokes, jobs, 2), say)
        began = time.perf_counter()
        many = _plan(folder, "many", shot, strokes, PLANNED, 1)
        planned = time.perf_counter() - began
    assert len(many.jobs) == PLANNED
    return {
        "elements": ELEMENTS,
        "work_seconds": work,
        "job_seconds": timed[1]["seconds"] / timed[1]["jobs"],
        "runs": [timed[1], timed[2], long],
        "plan": {"jobs": PLANNED, "seconds": planned},
    }


def _plan(folder: Path, name: str, shot: str, strokes: Path, jobs: int, workers: int) -> Plan:
    variants = ", ".join(f'{{name = "{k:05d}"}}' for k in range(jobs))
    manifest = folder / f"{name}.toml"
    manifest.write_text(
        f'output = "{name}"\nname = "{{variant}}"\npictures = false\n[options]\nelements = {ELEMENTS}\n'
        f'[[jobs]]\nshots = ["{Path(shot).name}"]\nstrokes = ["{strokes.name}"]\nvariants = [{variants}]\n',
        encoding="utf-8",
    )
    found = plan(manifest, workers=workers)
    return replace(found, workers=workers)


def _run(found: Plan, say: Say) -> dict[str, Any]:
    """Runs a plan; returns jobs, workers, seconds, bytes of a worker, and the runner's bytes and open files."""
    held: list[tuple[int, int]] = []

    def hear(event: Event) -> None:
        if event.state in ("done", "failed"):
            held.append((resident(os.getpid()), open_files()))
            say("batch", len(held) / len(found.jobs))

    began = time.perf_counter()
    summary = run_batch(found, hear=hear)
    seconds = time.perf_counter() - began
    if summary.failed:
        raise UsdslfError(f"the job {summary.failed[0].job} of the bench failed: {summary.failed[0].why}")
    memory = max(int(read_note(job).get("memory", 0)) for job in found.jobs)
    return {
        "jobs": len(found.jobs), "workers": found.workers, "seconds": seconds, "worker_bytes": memory,
        "first": held[0], "last": held[-1],
    }  # fmt: skip


def open_files() -> int:
    """Returns how many files this process has open; 0 where the system does not say."""
    place = Path("/proc/self/fd")
    return len(list(place.iterdir())) if place.is_dir() else 0


def lines_of_batch(found: Mapping[str, Any]) -> Iterator[str]:
    """Yields the table that people read."""
    work, job = found["work_seconds"], found["job_seconds"]
    yield f"{found['elements']} elements: {work:.2f} s of work, {job:.2f} s a job: {job - work:.2f} s its process costs"
    yield f"{'jobs':>6}{'workers':>9}{'seconds':>9}{'jobs/min':>10}{'MB a worker':>13}  runner: MB, open files"
    for run in found["runs"]:
        (first, files), (last, files_last) = run["first"], run["last"]
        yield (
            f"{run['jobs']:>6}{run['workers']:>9}{run['seconds']:>9.1f}{60 * run['jobs'] / run['seconds']:>10.1f}"
            f"{run['worker_bytes'] / 1e6:>13.0f}  {first / 1e6:.0f} -> {last / 1e6:.0f}, {files} -> {files_last}"
        )
    yield f"{found['plan']['jobs']} jobs planned in {found['plan']['seconds']:.1f} s"
