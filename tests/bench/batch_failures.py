"""Twelve shots in which all goes wrong that can, on each engine, and what a second run does.

    python tests/bench/batch_failures.py [here] [dask] [openjd]

One has no strokes, one a corrupt layer, one no geometry; one hangs, one job is killed while it reads, and of one the
worker that runs it is: on Dask the worker with kill -9, and the scheduler is restarted too; in `openjd run` the process
that the task's small one waits for.  What hung and was killed is mended once it was tried, and the same command is run
again.  Printed: what each run was to do, what came of it with each failure's sentence, whether results that stood
stayed untouched, and a hash of the bytes of all results, which is the same on each engine.
"""

from __future__ import annotations

import hashlib
import os
import shutil
import signal
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))
sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from kit.batch_shots import break_shot, bytes_below, mend_hanging, write_twelve
from kit.dask_cluster import Cluster

from usdslf.batch import plan
from usdslf.batch.records import as_known

LIMIT = 30  # seconds of a job
PATIENCE = 280  # seconds of a run
WORKERS_JOB = "crashes"  # of which the worker is killed
OPENING = {"257": 1, "2": 0}  # openat and open: which argument is the path
Run = Callable[[Path], None]


def command(*arguments: object) -> subprocess.Popen[str]:
    """The program with some arguments."""
    line = [sys.executable, "-m", "usdslf", "batch", *map(str, arguments)]
    return subprocess.Popen(line, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, text=True)


def reader_of(pipe: Path) -> int:
    """The process that waits in opening a pipe; 0 where there is none.  By what the kernel (Linux, x86-64) says."""
    for thread in _threads():
        with suppress(OSError, ValueError, IndexError):  # it may have ended meanwhile
            number, *arguments = (thread / "syscall").read_text().split()
            if number not in OPENING:
                continue
            with (thread / "mem").open("rb", 0) as memory:
                memory.seek(int(arguments[OPENING[number]], 16))
                if memory.read(len(bytes(pipe)) + 1) == bytes(pipe) + b"\0":
                    return int(thread.parts[2])
    return 0


def _threads() -> Iterator[Path]:
    """Of all processes, as /proc has them."""
    for process in os.listdir("/proc"):
        with suppress(OSError):
            yield from [Path("/proc", process, "task", name) for name in os.listdir(f"/proc/{process}/task")]


def parent_of(process: int) -> int:
    """The process that started another one."""
    return int(Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()[1])


@contextmanager
def killing(folder: Path, parent: bool) -> Iterator[list[str]]:
    """Kills the jobs `killed` and WORKERS_JOB once, each while it reads; of the latter its parent, where asked."""
    done, said = threading.Event(), list[str]()

    def watch(name: str, of_parent: bool) -> None:
        pipe = folder / "shots" / name / "pipe.usda"
        while not done.is_set() and pipe.is_fifo():
            if process := reader_of(pipe):
                victim = parent_of(process) if of_parent else process
                if name == WORKERS_JOB:
                    mend_hanging(pipe.parent)  # who takes the job over finds a layer
                os.kill(victim, signal.SIGKILL)
                said.append(f"killed {'the worker of ' if of_parent else ''}{name}")
                return
            time.sleep(0.05)

    threads = [threading.Thread(target=watch, args=x) for x in (("killed", False), (WORKERS_JOB, parent))]
    for thread in threads:
        thread.start()
    try:
        yield said
    finally:
        done.set()
        for thread in threads:
            thread.join()


def here(manifest: Path) -> None:
    """On this machine."""
    command(manifest, "--workers", 2).wait(PATIENCE)


def openjd(manifest: Path) -> None:
    """By `openjd run`."""
    template = manifest.parent / "farm.yaml"
    program = Path(sys.executable).with_name("openjd")
    subprocess.run([program, "run", template], capture_output=True, timeout=PATIENCE, check=False)


def write_farm(manifest: Path) -> None:
    """Writes the template, which lists what the shots read, while no shot hangs."""
    pipes = [p for p in manifest.parent.glob("shots/*/pipe.usda") if p.is_fifo()]
    for pipe in pipes:
        mend_hanging(pipe.parent)
    command(manifest, "--openjd", manifest.parent / "farm.yaml").wait(PATIENCE)
    for pipe in pipes:
        pipe.unlink()
        os.mkfifo(pipe)


class Dask:
    """On a cluster, whose scheduler is restarted in the first run once three jobs have come back."""

    def __init__(self, folder: Path) -> None:
        (folder / "cluster").mkdir()
        self.cluster, self.is_first = Cluster(folder / "cluster"), True
        self.started = 0
        self.cluster.start_scheduler()

    def worker(self) -> None:
        self.started += 1
        self.cluster.start_worker(f"worker{self.started}")

    def __call__(self, manifest: Path) -> None:
        run = command(manifest, "--scheduler", self.cluster.address)
        until = time.monotonic() + PATIENCE
        while run.poll() is None and time.monotonic() < until:
            alive = [n for n, p in self.cluster.processes.items() if n != "scheduler" and p.poll() is None]
            for _ in range(2 - len(alive)):  # as a farm does
                self.worker()
            if self.is_first and sum(known == "done" for known, _ in states(manifest).values()) >= 3:
                self.is_first = False
                self.cluster.kill("scheduler")
                self.cluster.start_scheduler()
                print("\nthe scheduler is restarted", flush=True)
            time.sleep(0.5)
        run.kill()


def states(manifest: Path) -> dict[str, tuple[str, str]]:
    """What is known of each job: done, or failed with its sentence."""
    found = {job.name: as_known(job) for job in plan(manifest).jobs}
    return {n: ("done" if r.is_done else r.cause, r.why.replace(str(manifest.parent), "")) for n, r in found.items()}


def tried(engine: str, run: Run, folder: Path) -> dict[str, bytes]:
    """Runs the twelve on an engine until nothing but what cannot be mended is left; returns the results' bytes."""
    manifest = write_twelve(folder, f"seconds = {LIMIT}")
    for name in ("killed", WORKERS_JOB):
        break_shot(folder / "shots" / name, "hangs")
    if engine == "openjd":
        write_farm(manifest)
    for number in range(1, 4):
        todo = [j.name for j in plan(manifest).to_run]
        stood = {n: _stamp(folder, n) for n, (state, _) in states(manifest).items() if state == "done"}
        began = time.monotonic()
        with killing(folder, engine != "here") as killed:
            run(manifest)
        seconds, known = time.monotonic() - began, states(manifest)
        print(f"\n{engine}, run {number}, {seconds:.0f} s; to run: {', '.join(todo)}; {', '.join(killed)}")
        done = [n for n, (state, _) in known.items() if state == "done"]
        print(f"  done {len(done)} of {len(known)}: {', '.join(done)}")
        for name, (cause, why) in known.items():
            if cause != "done":
                print(f"  {name}: {cause}: {why[:150]}")
        touched = [n for n, stamp in stood.items() if _stamp(folder, n) != stamp]
        print(f"  results that stood: {len(stood)}, touched: {touched or 'none'}", flush=True)
        for name in ("a_hangs", "killed", WORKERS_JOB):
            if known[name][0] != "lost" and (folder / "shots" / name / "pipe.usda").is_fifo():  # it was tried
                mend_hanging(folder / "shots" / name)
        if len(done) == 9:
            break
    return {k: v for k, v in bytes_below(folder / "out").items() if "/" in k and not k.startswith(".batch")}


def _stamp(folder: Path, name: str) -> int:
    return (folder / "out" / name / "result.json").stat().st_mtime_ns


def main() -> None:
    """Prints what came of each engine."""
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(1))  # which ends what was started
    results: dict[str, dict[str, bytes]] = {}
    for engine in sys.argv[1:] or ["here", "dask", "openjd"]:
        # Reports name files, so it is one place for all.
        folder = Path(tempfile.gettempdir()).resolve() / "usdslf_failures/project"
        shutil.rmtree(folder.parent, ignore_errors=True)
        folder.mkdir(parents=True)
        dask = Dask(folder.parent) if engine == "dask" else None
        try:
            results[engine] = tried(engine, dask or {"here": here, "openjd": openjd}[engine], folder)
        finally:
            if dask:
                dask.cluster.end_all()
        files = results[engine]
        digest = hashlib.sha256(repr(sorted(files.items())).encode()).hexdigest()
        print(f"  {len(files)} files of results, together {digest[:16]}", flush=True)
    (first, *others) = results.values()
    print(f"\nthe same bytes on {', '.join(results)}: {all(other == first for other in others)}")


if __name__ == "__main__":
    main()
