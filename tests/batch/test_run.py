"""A batch in which all goes wrong that can: the rest succeeds, each failure has its sentence, a second run mends it."""

from __future__ import annotations

import csv
import json
import os
import shutil
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest
from kit.batch_shots import GOOD, WRONG, break_shot, bytes_below, mend_hanging, write_manifest, write_shot, write_twelve

from usdslf.batch import Event, Limits, Summary, collect, plan, run_batch, run_job
from usdslf.batch.apart import Stopped, resident, run_apart
from usdslf.batch.job import Job
from usdslf.batch.records import write_failure
from usdslf.cli.bench_batch import open_files

LIMIT = 30  # seconds, of which a good job takes a tenth


@dataclass
class Ran:
    """A batch after its first run and after its second."""

    folder: Path
    first: Summary
    to_run: list[str]
    results: dict[str, bytes]
    second: Summary = field(default_factory=lambda: Summary("", "", ()))
    started: list[str] = field(default_factory=list)


@pytest.fixture(scope="module")
def ran(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Ran]:
    folder = tmp_path_factory.mktemp("batch")
    manifest = write_twelve(folder, f"seconds = {LIMIT}\nworkers = 3")
    signals = {"killed": signal.SIGKILL, "crashes": signal.SIGSEGV}

    def kill(event: Event) -> None:
        if event.state == "started" and event.job in signals:
            os.kill(event.pid, signals[event.job])

    found = plan(manifest)
    first = run_batch(found, hear=kill)
    made = Ran(folder, first, [j.name for j in plan(manifest).to_run], bytes_below(folder / "out"))
    mend_hanging(folder / "shots/a_hangs")
    del signals["killed"]

    def count(event: Event) -> None:
        made.started += [event.job] * (event.state == "started")
        kill(event)

    made.second = run_batch(plan(manifest), hear=count)
    yield made


def test_the_rest_succeeds_and_each_failure_has_its_sentence(ran: Ran) -> None:
    rows = {r.job: r for r in ran.first.rows}
    assert sorted(rows) == sorted((*GOOD, *WRONG))
    assert {name for name, r in rows.items() if r.state == "done"} == set(GOOD)
    assert all(rows[name].answers[0]["inferred"] == "diffuse" for name in GOOD[:2])
    wanted = {
        "missing": ("error", "there is no stroke layer"),
        "corrupt": ("error", "is not a readable USD file"),
        "empty": ("error", "no renderable geometry"),
        "killed": ("crash", "its process was ended by SIGKILL"),
        "crashes": ("crash", "its process was ended by SIGSEGV"),
        "a_hangs": ("time", f"it took longer than {LIMIT} s and was ended"),
    }
    for name, (cause, words) in wanted.items():
        assert rows[name].cause == cause and words in rows[name].why, rows[name]
        assert not any(path.startswith(f"{name}/") for path in ran.results)


def test_the_summary_is_read_by_other_programs(ran: Ran) -> None:
    text = {name: code.decode() for name, code in ran.results.items() if "/" not in name and not name.endswith("png")}
    assert json.loads(text["summary.json"])["counts"] == {"done": 6, "failed": 6, "new": 0}
    rows = list(csv.DictReader(text["summary.csv"].splitlines()))
    assert len(rows) == 12 and {r["state"] for r in rows} == {"done", "failed"}
    suite = ElementTree.fromstring(text["junit.xml"].split("?>", 1)[1])
    assert suite.attrib["tests"] == "12" and suite.attrib["errors"] == "6"
    assert {c.attrib["name"] for c in suite if c.find("error") is not None} == set(WRONG)
    assert "its process was ended by SIGKILL" in text["index.html"] and "good3" in text["index.html"]


def test_a_second_run_does_only_what_failed(ran: Ran) -> None:
    assert sorted(ran.to_run) == sorted(WRONG) == sorted(ran.started)
    done = {r.job for r in ran.second.rows if r.state == "done"}
    assert done == {*GOOD, "a_hangs", "killed"}
    now = bytes_below(ran.folder / "out")
    for name in GOOD:
        assert now[f"{name}/result.json"] == ran.results[f"{name}/result.json"]


def test_what_is_finished_is_known_by_content(ran: Ran) -> None:
    manifest = ran.folder / "batch.toml"
    stage = ran.folder / "shots/good0/stage.usda"
    os.utime(stage, (1e9, 1e9))  # another time, the same content
    assert plan(manifest).why["good0"] == ""
    text = stage.read_text()
    stage.write_text(text.replace("0.4, 0.3, 0.2", "0.4, 0.3, 0.3"))
    assert plan(manifest).why["good0"] == "../shots/good0/stage.usda changed"
    stage.write_text(text)
    layer = ran.folder / "shots/a_hangs/pipe.usda"  # a sublayer
    layer.write_text("#usda 1.0\n# another\n")
    assert plan(manifest).why["a_hangs"] == "../shots/a_hangs/pipe.usda changed"
    layer.write_text("#usda 1.0\n")
    assert plan(manifest).why["a_hangs"] == ""
    look = ran.folder / "out/good1/look.usda"
    whole = look.read_bytes()
    look.write_bytes(whole[:-1])
    assert plan(manifest).why["good1"] == "look.usda of its result changed"
    look.write_bytes(whole)
    manifest.write_text(manifest.read_text().replace("elements = 64", "elements = 65"))
    assert plan(manifest).why["good2"] == "its row changed"
    manifest.write_text(manifest.read_text().replace("elements = 65", "elements = 64"))
    assert plan(manifest).why["good2"] == ""


def test_results_stand_where_the_project_is_moved(ran: Ran, tmp_path: Path) -> None:
    shutil.copytree(ran.folder, tmp_path / "moved")
    why = plan(tmp_path / "moved/batch.toml").why
    assert {name for name, w in why.items() if not w} == {*GOOD, "a_hangs", "killed"}


def test_a_job_in_this_process_writes_the_same_bytes(ran: Ran, tmp_path: Path) -> None:
    """The studio's own scheduler: run_job and collect, no process of ours."""
    found = plan(ran.folder / "batch.toml", ran.folder / "own")
    write_failure(found.job("good1"), "an earlier run failed", "error")
    run_job(found.job("good1"))
    mine, theirs = (bytes_below(ran.folder / name / "good1") for name in ("own", "out"))
    assert mine == theirs and set(mine) == {"look.usda", "report.json", "result.json"}
    summary = collect(found)
    assert {r.job: r.state for r in summary.rows if r.state != "new"} == {"good1": "done"}
    assert not summary.failed  # what was not run did not fail


def test_two_hundred_jobs_leave_nothing_open(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """In the runner; each process here ends at once, without a word."""
    variants = ", ".join(f'{{name = "{k}"}}' for k in range(200))
    jobs = f'[[jobs]]\nname = "{{variant}}"\nshots = ["a.usda"]\nstrokes = ["s.usda"]\nvariants = [{variants}]\n'
    found = plan(write_manifest(tmp_path, "workers = 2", jobs=jobs))
    monkeypatch.setattr(sys, "executable", shutil.which("false"))
    at: list[tuple[int, int, int]] = []

    def hear(event: Event) -> None:
        if event.state == "failed":
            at.append((resident(os.getpid()), open_files(), threading.active_count()))

    summary = run_batch(found, hear=hear)
    assert len(summary.failed) == 200 and summary.failed[0].why == "its process ended with exit code 1"
    early, late = np.array(at[20:60]).max(0), np.array(at[-40:]).max(0)
    of_others = 12  # files and threads of jobs that begin or end just then; one left by each would be 140 more
    assert late[0] - early[0] < 8 << 20 and (late[1:] < early[1:] + of_others).all(), (early, late)


def job_of(folder: Path) -> Job:
    return Job("x", "solve", str(folder / "none.usda"), str(folder / "s.usda"), output=str(folder / "out"))


def test_memory_beyond_its_limit_ends_a_job(tmp_path: Path) -> None:
    found = run_apart(job_of(tmp_path), Limits(60, 8 << 20))
    assert found.cause == "memory" and "GiB where it may have" in found.why and found.memory > 8 << 20


def test_a_run_that_is_stopped_ends_its_processes(tmp_path: Path) -> None:
    stop, pids = threading.Event(), list[int]()

    def hear(event: Event) -> None:
        pids.append(event.pid)
        stop.set()

    with pytest.raises(Stopped):
        run_apart(job_of(tmp_path), Limits(60), hear, stop)
    with pytest.raises(ProcessLookupError):
        os.kill(pids[0], 0)


@pytest.mark.parametrize("how", [signal.SIGINT, signal.SIGTERM])
def test_a_stop_leaves_what_is_finished_and_says_how_to_go_on(tmp_path: Path, how: signal.Signals) -> None:
    write_shot(tmp_path / "shots/one")
    break_shot(tmp_path / "shots/one", "hangs")
    manifest = write_manifest(tmp_path, "seconds = 60")
    process = subprocess.Popen(
        [sys.executable, "-m", "usdslf", "batch", str(manifest)],
        stderr=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
    )
    while process.poll() is None and "run" not in process.stderr.readline():
        pass
    until = time.monotonic() + 60
    while time.monotonic() < until and not _children(process.pid):
        time.sleep(0.02)
    child = _children(process.pid)[0]
    process.send_signal(how)
    _, err = process.communicate(timeout=60)
    assert process.returncode == 130, err
    assert "stopped: 0 of 1 jobs are done; the same command goes on with the rest" in err
    assert json.loads((tmp_path / "out/summary.json").read_text())["counts"]["new"] == 1
    assert not Path(f"/proc/{child}").exists()
    assert sorted(p.name for p in (tmp_path / "out").iterdir() if p.is_dir()) == [".batch"]


def _children(pid: int) -> list[int]:
    return [int(p) for t in Path(f"/proc/{pid}/task").iterdir() for p in (t / "children").read_text().split()]
