"""The cache: entries by origin, whole or absent, no more than fits, and damaged ones made anew and said once."""

from __future__ import annotations

import logging
import multiprocessing
import os
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from usdslf.cache import ABANDONED, SUFFIX, TRIMMED, Cache, address

KIB = 1024


def block(seed: int, size: int = 16 * KIB) -> dict[str, NDArray]:
    return {"bytes": np.random.default_rng(seed).integers(0, 256, size, np.uint8)}


def unexpected() -> dict[str, NDArray]:
    raise AssertionError("computed again")


def test_an_entry_is_computed_once_and_read_as_it_was(tmp_path: Path) -> None:
    made = {"a": np.arange(7, dtype=np.uint16), "b": np.linspace(0, 1, 6, dtype=np.float32).reshape(2, 3)}
    cache = Cache(tmp_path / "new" / "folder")
    for found in (cache.arrays("x", lambda: made), cache.arrays("x", unexpected)):
        assert set(found) == {"a", "b"}
        for name, value in made.items():
            assert found[name].dtype == value.dtype
            np.testing.assert_array_equal(found[name], value)


def test_names_differ_by_each_thing_that_an_entry_comes_from() -> None:
    names = [
        address("level", 1, "text", 2), address("fresnel", 1, "text", 2), address("level", 2, "text", 2),
        address("level", 1, "texts", 2), address("level", 1, "text", 3), address("level", 1, "text", "2"),
        address("level", 1, "tex", "t2"), address("level", 1, b"text", 2, ""),
    ]  # fmt: skip
    assert len(set(names)) == len(names)
    assert address("level", 1, "text", 2) == names[0]


@pytest.mark.parametrize("damage", ["empty", "cut", "other", "flipped"])
def test_a_damaged_entry_is_made_anew_and_said_once(
    damage: str, tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    cache, made = Cache(tmp_path), block(1)
    cache.arrays("x", lambda: made)
    (file,) = (e.path for e in cache.entries())
    whole = bytearray(file.read_bytes())
    flipped = whole.copy()
    flipped[len(whole) // 2] ^= 1
    broken = {"empty": b"", "cut": whole[:500], "other": b"no archive", "flipped": flipped}[damage]
    with caplog.at_level(logging.WARNING):
        for _ in range(2):
            file.write_bytes(broken)
            np.testing.assert_array_equal(cache.arrays("x", lambda: made)["bytes"], made["bytes"])
    np.testing.assert_array_equal(cache.arrays("x", unexpected)["bytes"], made["bytes"])
    assert [r.getMessage().count(str(file)) for r in caplog.records] == [1]


def test_the_least_recently_used_go_when_all_is_too_large(tmp_path: Path) -> None:
    each = 16 * KIB + 300
    cache = Cache(tmp_path, limit=5 * each)
    for i in range(5):
        cache.arrays(f"e{i}", lambda i=i: block(i))  # type: ignore[misc]
        os.utime(tmp_path / f"e{i}{SUFFIX}", (1000 + i, 1000 + i))
    cache.arrays("e0", unexpected)  # used now
    cache.arrays("e5", lambda: block(5))
    left = {e.path.stem for e in cache.entries()}
    assert {"e0", "e5"} <= left and "e1" not in left and "e2" not in left
    assert cache.size() <= TRIMMED * cache.limit
    assert cache.clear() == len(left) and cache.size() == 0


def test_what_a_killed_run_left_goes_after_a_while(tmp_path: Path) -> None:
    old, new = tmp_path / f".old{SUFFIX}", tmp_path / f".new{SUFFIX}"
    for file in (old, new):
        file.write_bytes(b"half")
    os.utime(old, (0, os.path.getmtime(new) - ABANDONED - 60))
    Cache(tmp_path).arrays("x", lambda: block(0))
    assert not old.exists() and new.exists()


def test_a_folder_that_cannot_be_written_is_no_error() -> None:
    made = block(3)
    np.testing.assert_array_equal(Cache(Path("/dev/null/nowhere")).arrays("x", lambda: made)["bytes"], made["bytes"])


def _work(folder: Path, seed: int) -> int:
    cache, rng = Cache(folder, limit=200 * KIB), np.random.default_rng(seed)
    wrong = 0
    for i in rng.integers(0, 30, 150).tolist():
        found = cache.arrays(f"e{i}", lambda i=i: block(i))["bytes"]  # type: ignore[misc]
        wrong += not np.array_equal(found, block(i)["bytes"])
    return wrong


def test_processes_share_a_folder_that_is_trimmed_all_the_time(tmp_path: Path) -> None:
    with multiprocessing.get_context("spawn").Pool(3) as pool:
        assert pool.starmap(_work, [(tmp_path, seed) for seed in range(3)]) == [0, 0, 0]
    cache = Cache(tmp_path, limit=200 * KIB)
    assert cache.size() <= cache.limit + 3 * 17 * KIB
    assert not [e for e in cache.entries() if e.path.name.startswith(".")]
