"""Whatever a file says, a command ends in a result or in one sentence: 500 damaged stages, strokes and looks.

Seeded.  Each of two processes runs its share of the cases of kit.fuzz_worker; a process that crashes or hangs counts as
a failure of the case that it was at, and another goes on behind it.  Runs side by side divide the cases, see
kit/share.py.
"""

from __future__ import annotations

import json
import os
import selectors
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import pytest
from kit.fuzz_worker import PAINT
from kit.fuzzed_shot import write_shot
from kit.share import rows_of_share

from usdslf.cli.main import main

CASES = 500
WORKERS = 2
HANGS = 60  # seconds that no case takes
ROOT = Path(__file__).resolve().parents[2]


@pytest.fixture(scope="module")
def found(tmp_path_factory: pytest.TempPathFactory) -> list[dict[str, Any]]:
    """What each command line ended in."""
    shares, own = [], rows_of_share(CASES)
    for share in range(WORKERS):
        folder = tmp_path_factory.mktemp("fuzz")
        shot, strokes, look = str(write_shot(folder)), str(folder / "strokes.usda"), str(folder / "look.usda")
        again = ("--camera", "/World/cam", "--path", "0.75,0.8 0.8,0.82", "--color", ".5,.1,.1", "--scope", "prim")
        assert main(["stroke", shot, strokes, *PAINT]) == 0
        assert main(["stroke", shot, strokes, *again]) == 0
        assert main(["solve", shot, strokes, "-o", look, "--elements", "150", "--bounces", "2"]) == 0
        first, end = (own[0] + n * len(own) // WORKERS for n in (share, share + 1))
        shares.append((folder, first, end))
    with ThreadPoolExecutor(WORKERS) as pool:
        return [case for part in pool.map(lambda share: _run(*share), shares) for case in part]


def _run(folder: Path, first: int, last: int) -> list[dict[str, Any]]:
    found: list[dict[str, Any]] = []
    while first < last:
        ended, at = _run_one(folder, first, last)
        found += ended
        if at is None:
            break
        found.append(at)
        first = at["case"] + 1
    return found


def _run_one(folder: Path, first: int, last: int) -> tuple[list[dict[str, Any]], dict[str, Any] | None]:
    """The cases that ended in one process, and the one that it crashed or hung at."""
    program = [sys.executable, str(ROOT / "tests/kit/fuzz_worker.py"), str(folder), str(first), str(last)]
    paths = os.pathsep.join([str(ROOT), str(ROOT / "tests"), os.environ.get("PYTHONPATH", "")])
    ended: list[dict[str, Any]] = []
    at: dict[str, Any] | None = {"case": first, "starts": "the process"}
    with subprocess.Popen(
        program, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, env=os.environ | {"PYTHONPATH": paths}
    ) as worker:
        assert worker.stdout and worker.stderr
        selector = selectors.DefaultSelector()
        selector.register(worker.stdout, selectors.EVENT_READ)
        why = "crashed"
        while True:
            if not selector.select(HANGS):
                worker.kill()
                why = f"took more than {HANGS} seconds"
                break
            line = worker.stdout.readline()
            if not line:
                break
            case = json.loads(line)
            if "starts" in case:
                at = case
            else:
                ended.append(case)
                at = None
        worker.wait()
        if at is not None:
            at |= {"run": at["starts"], "code": worker.returncode, "wrong": [why, worker.stderr.read()[-2000:]]}
    return ended, at


@pytest.mark.timeout(900)
def test_every_case_ends_in_a_result_or_in_one_sentence(found: list[dict[str, Any]]) -> None:
    wrong = [f"{c['case']} {c['run']}: " + "\n  ".join(c["wrong"]) for c in found if c["wrong"]]
    assert not wrong, "\n".join(wrong)


def test_cases_reach_what_they_are_for(found: list[dict[str, Any]]) -> None:
    """Not all files may be refused at their first line: many are read, and some are solved."""
    assert len({c["case"] for c in found}) == len(rows_of_share(CASES))
    for command, least in (("info", 40), ("stroke", 20), ("review", 20), ("solve", 5)):
        ended_well = [c for c in found if c["run"][0] == command and c["code"] in (0, 1)]
        assert len(ended_well) >= least * len(found) // CASES, command
        assert [c for c in found if c["run"][0] == command and c["code"] > 1], command
