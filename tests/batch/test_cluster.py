"""Batches on a real Dask scheduler with real workers, which die meanwhile; the results are the same bytes."""

from __future__ import annotations

import shutil
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import pytest
from kit.batch_shots import break_shot, bytes_below, write_manifest, write_shot
from kit.dask_cluster import Cluster

from usdslf.batch import plan, run_job
from usdslf.batch.cluster import on_cluster
from usdslf.batch.job import Limits
from usdslf.errors import InputError

WAITED = 120  # seconds for anything
AT_ONCE = 3.0  # seconds, less than a job takes


@pytest.fixture
def cluster(tmp_path: Path) -> Iterator[Cluster]:
    made = Cluster(tmp_path)
    yield made
    made.end_all()


def batch(folder: Path, *options: str) -> subprocess.Popen[str]:
    command = [sys.executable, "-m", "usdslf", "batch", str(folder / "batch.toml"), *options]
    return subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)


def wait_for_job(cluster: Cluster, name: str) -> int:
    until = time.monotonic() + WAITED
    while time.monotonic() < until:
        if jobs := cluster.jobs_of(name):
            return jobs[0]
        time.sleep(0.02)
    raise AssertionError(f"{name} got no job; see {cluster.folder}")


def wait_for_end(process: int) -> None:
    until = time.monotonic() + AT_ONCE
    while not Cluster.has_ended(process):
        assert time.monotonic() < until, f"process {process} goes on without its worker"
        time.sleep(0.02)


def test_a_worker_is_killed_and_the_scheduler_restarted(cluster: Cluster, tmp_path: Path) -> None:
    for name in ("one", "corrupt"):
        write_shot(tmp_path / "shots" / name)
    break_shot(tmp_path / "shots/corrupt", "corrupt")
    write_manifest(tmp_path, f"seconds = {WAITED}")
    cluster.start_scheduler()
    cluster.start_worker("first")
    run = batch(tmp_path, "--scheduler", cluster.address)
    job = wait_for_job(cluster, "first")
    cluster.kill("first")
    cluster.start_worker("second")
    wait_for_job(cluster, "second")
    wait_for_end(job)  # the job of the dead worker ends with it
    cluster.kill("scheduler")
    cluster.end("second")
    cluster.start_scheduler()
    cluster.start_worker("third")
    out, err = run.communicate(timeout=WAITED)
    assert run.returncode == 1 and "1 done, 1 failed" in out, out + err
    assert "corrupt: failed: " in out and "is not a readable USD file" in out
    shared = bytes_below(tmp_path / "out/one")

    shutil.rmtree(tmp_path / "shots/corrupt")
    sent = batch(tmp_path, "--scheduler", cluster.address, "--ship", "-o", str(tmp_path / "sent"))
    out, err = sent.communicate(timeout=WAITED)
    assert sent.returncode == 0 and "1 done, 0 failed" in out, out + err
    assert bytes_below(tmp_path / "sent/one") == shared
    run_job(plan(tmp_path / "batch.toml", tmp_path / "here").job("one"))
    assert bytes_below(tmp_path / "here/one") == shared
    assert set(shared) == {"look.usda", "report.json", "result.json"}


def test_a_scheduler_that_does_not_answer_is_an_error(cluster: Cluster, tmp_path: Path) -> None:
    write_shot(tmp_path / "shots/one")
    found = plan(write_manifest(tmp_path))
    engine = on_cluster(cluster.address, retried=0.5)
    with pytest.raises(InputError, match="does not answer"):
        list(engine(found.jobs, found, lambda event: None))
    assert found.limits != Limits()
