"""Results know nothing of the number of threads; those of linear algebra rest as long as somebody solves."""

from __future__ import annotations

import os
import subprocess
import sys
import textwrap
from pathlib import Path

import pytest
from kit.painted_table import CAMERA, ON_RED, write_table

from usdslf.threads import BLAS_THREADS, THREADS, thread_count

CODE = """
from concurrent.futures import ThreadPoolExecutor
import numpy, scipy.linalg
from threadpoolctl import threadpool_info, threadpool_limits
from usdslf.threads import one_blas_thread

def now():
    return {i["num_threads"] for i in threadpool_info() if i["user_api"] == "blas"}

with threadpool_limits(3, "blas"):
    found = [now()]
    first, second = one_blas_thread(), one_blas_thread()
    first.__enter__(); second.__enter__()
    found.append(now())
    with ThreadPoolExecutor(1) as other:
        other.submit(first.__exit__, None, None, None).result()
    found.append(now())
    second.__exit__(None, None, None)
    found.append(now())
print(found)
"""


@pytest.mark.parametrize(("asked", "within"), [(None, {1}), ("OMP_NUM_THREADS", {3})])
def test_linear_algebra_stays_on_its_thread_until_the_last_one_leaves(asked: str | None, within: set[int]) -> None:
    environment = {k: v for k, v in os.environ.items() if k not in BLAS_THREADS}
    environment |= {asked: "2"} if asked else {}
    run = subprocess.run([sys.executable, "-c", CODE], capture_output=True, text=True, check=True, env=environment)
    assert run.stdout.strip() == str([{3}, within, within, {3}])


ALL_STEPS = textwrap.dedent(
    """
    import hashlib
    import os
    import sys

    stage, camera, places, count = sys.argv[1], sys.argv[2], eval(sys.argv[3]), int(sys.argv[4])
    os.sched_getaffinity = lambda _: set(range(count))  # as on a machine of so many processors, whatever there are

    import usdslf
    from usdslf.threads import thread_count

    assert thread_count() == count
    shot = usdslf.open(stage, elements=2500, bounces=2).shot
    stroke = usdslf.paint_stroke(shot.scene, shot.tracer, shot.camera(camera), [places], 0.03, (0.05, 0.1, 0.5))
    solution = usdslf.run(usdslf.solve(shot, [stroke]), lambda *_: None)
    *_, live = usdslf.live_picture(shot, camera, size=(320, 240)).frames(2)
    found = {
        "elements": shot.elements.position, "visibility": shot.visibility.hit, "fixed light": shot.fixed_light,
        "light field": shot.light_field.radiance(), "live picture": live.picture,
        "picture": usdslf.render_shot(shot, camera, size=(160, 120), samples=4)["color"],
        "answer": repr([(a.after, a.residual_after, a.pool.strokes) for a in solution.answers]).encode(),
    }
    for name, value in found.items():
        print(name, hashlib.sha256(bytes(value)).hexdigest()[:16])
    """
)


def test_results_do_not_depend_on_the_number_of_threads(tmp_path: Path) -> None:
    """Those of rays and trees, and those of the device: all is the same to the last bit."""
    stage, found = write_table(tmp_path), list[str]()
    for count in (1, 3):
        environment = {k: v for k, v in os.environ.items() if k not in (THREADS, *BLAS_THREADS)}
        environment["POCL_MAX_PTHREAD_COUNT"] = str(count)
        command = [sys.executable, "-c", ALL_STEPS, str(stage), CAMERA, repr(ON_RED), str(count)]
        done = subprocess.run(
            command, env=environment, capture_output=True, text=True, check=False, cwd=Path(__file__).parents[1]
        )
        assert done.returncode == 0, done.stderr
        found.append(done.stdout)
    assert found[0].count("\n") == 7
    assert found[0] == found[1]


@pytest.mark.parametrize(("said", "count"), [("", 4), ("1", 1), ("3", 3), ("9", 4), ("0", 1), ("many", 4)])
def test_a_process_takes_no_more_than_it_has_and_than_is_said(
    said: str, count: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(os, "sched_getaffinity", lambda _: {0, 2, 5, 7}, raising=False)
    monkeypatch.setenv(THREADS, said)
    assert thread_count() == count
