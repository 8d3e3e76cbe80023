"""Run: the jobs of a plan that are not finished, each in a process of its own, on this machine or by an engine.

    run_batch(plan, engine, hear) -> Summary
    run_one(plan, name, hear) -> Result           one of them, as a task of a farm does

An engine is a function that takes jobs that do not need each other and yields each with its result, in any order.
"""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ThreadPoolExecutor, wait

from usdslf.batch.apart import Hear, Stopped, run_apart
from usdslf.batch.changed import what_changed
from usdslf.batch.collecting import collect
from usdslf.batch.inputs import Hashes
from usdslf.batch.job import Event, Job, Result
from usdslf.batch.places import remove_abandoned
from usdslf.batch.planning import Plan, why_to_run
from usdslf.batch.records import forget_failure, read_failure, read_result, write_failure, write_note
from usdslf.batch.summary import Summary
from usdslf.errors import UsdslfError
from usdslf.progress import forget_interrupt

LISTENED = 0.1  # seconds between two looks whether the run is to stop

Engine = Callable[[Sequence[Job], Plan, Hear], Iterator[tuple[Job, Result]]]


def run_batch(found: Plan, engine: Engine | None = None, hear: Hear | None = None) -> Summary:
    """Runs what has to be run, and writes the summary of all jobs.

    Args:
        found: of `plan`.
        engine: None: processes of this machine.
        hear: told what each job does.

    Returns: the summary.  Jobs that failed are in it, and do not end the run.

    Raises: KeyboardInterrupt where the run was stopped, UsdslfError where its engine cannot go on; results that are
        whole stay, and the summary is written.
    """
    work, tell = engine or on_this_machine, hear or (lambda event: None)
    remove_abandoned(found.output)
    hashes = Hashes.of(found.output)
    try:
        for jobs in phases(found.jobs):
            ready = []
            for job in jobs:
                if (reason := _why_not(job, found)) is not None:
                    _deliver(job, Result(job.name, job.kind, False, reason, "error"), None, tell)
                elif found.why[job.name] and why_to_run(job, hashes):
                    ready.append(job)
            before = {job.name: read_result(job) for job in ready}
            for job, result in work(ready, found, tell) if ready else ():
                _deliver(job, result, before[job.name], tell)
    except (KeyboardInterrupt, UsdslfError):
        forget_interrupt()
        collect(found)
        raise
    return collect(found)


def run_one(found: Plan, name: str, hear: Hear | None = None) -> Result:
    """Runs one job of a plan in a process of its own, unless its result stands.

    Raises: InputError for a name that there is not.
    """
    job = found.job(name)
    if not why_to_run(job, Hashes.of(found.output)):
        standing = read_result(job)
        assert standing is not None
        return standing
    if (reason := _why_not(job, found)) is not None:
        return _deliver(job, Result(job.name, job.kind, False, reason, "error"), None, hear or (lambda event: None))
    before = read_result(job)
    return _deliver(job, run_apart(job, found.limits, hear), before, hear or (lambda event: None))


def on_this_machine(jobs: Sequence[Job], found: Plan, tell: Hear) -> Iterator[tuple[Job, Result]]:
    """Runs jobs in processes of this machine, some at a time; yields each with its result."""
    stop = threading.Event()
    with ThreadPoolExecutor(found.workers, "usdslf-batch") as pool:
        left = iter(jobs)
        running: dict[Future[Result], Job] = {}
        try:
            while True:
                while len(running) < found.workers and (job := next(left, None)) is not None:
                    running[pool.submit(run_apart, job, found.limits, tell, stop)] = job
                if not running:
                    return
                for future in wait(running, LISTENED, FIRST_COMPLETED).done:
                    yield running.pop(future), future.result()
        finally:
            stop.set()
            for future, job in running.items():
                try:
                    future.result()
                except Stopped:
                    tell(Event(job.name, "stopped"))


def phases(jobs: Sequence[Job]) -> list[list[Job]]:
    """Returns jobs by layers: those that need none, then those that need these, and so on."""
    level: dict[str, int] = {}
    for job in jobs:
        level[job.name] = 1 + max((level[n] for n in job.needs), default=-1)
    return [[j for j in jobs if level[j.name] == k] for k in range(max(level.values(), default=-1) + 1)]


def _why_not(job: Job, found: Plan) -> str | None:
    """Why a job cannot be run, where something that it needs failed; None where it can."""
    for name in job.needs:
        if failure := read_failure(found.job(name)):
            return f"{name}, which it needs, failed: {failure.why}"
        if read_result(found.job(name)) is None:
            return f"{name}, which it needs, was not run"
    return None


def _deliver(job: Job, result: Result, before: Result | None, tell: Hear) -> Result:
    """Keeps what came of a job, and tells it."""
    if not result.is_done:
        write_failure(job, result.why, result.cause)
        tell(Event(job.name, "failed", why=result.why))
        return result
    forget_failure(job)
    changed = what_changed(before, result).as_values() if before is not None and job.kind == "solve" else None
    write_note(job, seconds=result.seconds, memory=result.memory, changed=changed)
    tell(Event(job.name, "done"))
    return result
