"""Threads of linear algebra that wait by turning: none, as long as somebody solves."""

from __future__ import annotations

import os
import subprocess
import sys

import pytest

from usdslf.threads import BLAS_THREADS

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
