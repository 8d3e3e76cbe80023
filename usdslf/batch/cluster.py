"""Cluster: the jobs of a batch on a Dask distributed cluster.

    on_cluster(address, ship) -> Engine

A worker runs a job as this machine does, in a process of its own, so that limits hold and a crash ends the job alone.
A worker that dies gives its jobs to others; where the scheduler is gone, it is asked again for a while, and what it
forgot is sent anew: results are whole or not there, so nothing is lost by doing one twice.

Files are read and results written by shared paths; shipped, they lie in a folder of the worker under their own names,
and results come back as bytes.  Both ways the results are the same, byte for byte.
"""

from __future__ import annotations

import contextlib
import hashlib
import os
import shutil
import tempfile
import time
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

from usdslf.batch.apart import Hear, run_apart
from usdslf.batch.job import Event, Job, Limits, Result
from usdslf.batch.places import staged
from usdslf.batch.planning import Plan
from usdslf.batch.run import Engine
from usdslf.errors import InputError, UsdslfError

RETRIED = 60.0  # seconds in which a scheduler that is gone may come back
ASKED = 10.0  # seconds that it is waited for at a time
MOST_DEATHS = 3  # workers that may die of a job before it counts as failed


def on_cluster(address: str, ship: bool = False, retried: float = RETRIED) -> Engine:
    """Returns an engine that runs jobs on a cluster.

    Args:
        address: of the scheduler, tcp://host:port.
        ship: files are sent to the workers and results back; else all machines share their paths.
        retried: seconds in which a scheduler that is gone may come back.

    Raises: InputError where Dask is not installed, or nobody answers at the address.
    """
    try:
        import distributed  # noqa: F401
    except ImportError:
        raise InputError("--scheduler needs Dask distributed; install it with: pip install 'usdslf[cluster]'") from None

    def run(jobs: Sequence[Job], found: Plan, tell: Hear) -> Iterator[tuple[Job, Result]]:
        left = {job.name: job for job in jobs}
        until = time.monotonic() + min(retried, ASKED)  # nobody may be there at all
        while left:
            try:
                with _client(address, min(retried, ASKED)) as client:
                    until = time.monotonic() + retried
                    for job, result in _sent(client, ship, list(left.values()), found, tell):
                        until = time.monotonic() + retried
                        del left[job.name]
                        yield job, result
            except (OSError, _Gone) as gone:
                if time.monotonic() > until:
                    reason = " ".join(str(gone).split()) or type(gone).__name__
                    raise InputError(
                        f"the scheduler {address} does not answer ({reason}); start it and run again"
                    ) from None
                time.sleep(0.2)

    return run


class _Gone(Exception):
    """The scheduler forgot a job."""


@contextlib.contextmanager
def _client(address: str, seconds: float) -> Iterator[Any]:
    """A connection to a scheduler.  Raises: OSError where nobody answers."""
    from distributed import Client

    client = Client(address, timeout=seconds, set_as_default=False, heartbeat_interval=500)
    try:
        yield client
    finally:
        with contextlib.suppress(OSError):
            client.close(timeout=seconds)


def _sent(
    client: Any, ship: bool, jobs: Sequence[Job], found: Plan, tell: Hear
) -> Iterator[tuple[Job, Result]]:  # fmt: skip
    """Runs jobs while one scheduler lives.  Raises: OSError or _Gone where it does not."""
    from distributed import as_completed
    from distributed.scheduler import KilledWorker

    sent: dict[Any, Job] = {}
    files = _Shipped(client, found) if ship else None
    for job in jobs:
        try:
            given = files.of(job) if files else None
        except UsdslfError as error:
            yield job, Result(job.name, job.kind, False, str(error), "error")
            continue
        sent[client.submit(work_on_worker, job.as_json(), asdict(found.limits), given, pure=False, retries=0)] = job
        tell(Event(job.name, "started"))
    for future in as_completed(list(sent), loop=client.loop):
        job = sent.pop(future)
        if future.status in ("cancelled", "lost"):
            raise _Gone(f"it forgot {job.name}")
        if future.status == "error":
            failed = future.exception()
            if not isinstance(failed, KilledWorker):
                raise _Gone(str(failed))
            yield job, Result(job.name, job.kind, False, f"{MOST_DEATHS} workers died of it", "crash")
            continue
        values, back = future.result()
        result = Result.of_values(values)
        if back is not None and result.is_done:
            _put(job, back)
        yield job, result
        future.release()


class _Shipped:
    """Files on their way to workers: each is sent once, by content."""

    def __init__(self, client: Any, found: Plan) -> None:
        self.client, self.found = client, found
        self.known: dict[str, Any] = {}

    def of(self, job: Job) -> dict[str, Any]:
        """Returns the contents of the files that a job reads, by their absolute paths, as they travel."""
        from usdslf.batch.reads import reads_of

        names = [*reads_of(job).files]
        for need in (self.found.job(name) for name in job.needs):
            names += [str(p) for p in need.folder.rglob("*") if p.is_file()]
            names += reads_of(need).files if not job.shot else ()  # of the asset that these shots show
        found = {}
        for name in names:
            if os.path.isfile(name):
                data = Path(name).read_bytes()
                code = hashlib.sha256(data).hexdigest()
                if code not in self.known:
                    self.known[code] = self.client.scatter(data, hash=True)
                found[os.path.abspath(name)] = self.known[code]
        return found


def _put(job: Job, files: Mapping[str, bytes]) -> None:
    """Writes a result that came back, whole or not at all."""
    with staged(job.output, job.name) as folder:
        for name, data in files.items():
            (folder / name).parent.mkdir(parents=True, exist_ok=True)
            (folder / name).write_bytes(data)


def work_on_worker(
    row: str, limits: Mapping[str, Any], files: Mapping[str, bytes] | None
) -> tuple[dict[str, Any], dict[str, bytes] | None]:
    """Runs a job on a worker; returns its result, and its files where they have to be sent back.

    Args:
        row: the job, as JSON.
        limits: of `Limits`.
        files: contents of shipped files, by absolute path; None: they lie where the row says.
    """
    job, bounds = Job.of_json(row), Limits(**limits)
    if files is None:
        return run_apart(job, bounds).as_values(), None
    root = os.path.realpath(tempfile.mkdtemp(prefix="usdslf_shipped_"))
    try:
        for name, data in files.items():
            place = Path(root + name)
            place.parent.mkdir(parents=True, exist_ok=True)
            place.write_bytes(data)
        Path(root + job.output).mkdir(parents=True, exist_ok=True)
        shipped = replace(job, root=root)
        result = run_apart(shipped, bounds)
        back = {}
        if result.is_done:
            back = {p.relative_to(shipped.folder).as_posix(): p.read_bytes() for p in _files_in(shipped.folder)}
        why = result.why.replace(root, "")
        return replace(result, why=why).as_values(), back
    finally:
        shutil.rmtree(root, ignore_errors=True)


def _files_in(folder: Path) -> list[Path]:
    return sorted(p for p in folder.rglob("*") if p.is_file())
