"""usdslf cache: what is kept, how much of it, and nothing any more."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from usdslf.cache import Cache, cache_folder

Run = Callable[..., tuple[int, str, str]]


def test_size_and_clear(tmp_path: Path, run: Run, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    assert cache_folder() == tmp_path / "usdslf"
    assert run("cache", "--size") == (0, "0\n", "")
    for i in range(2):
        Cache(cache_folder()).arrays(f"e{i}", lambda: {"a": np.zeros(1000, np.uint8)})
    size = sum(file.stat().st_size for file in (tmp_path / "usdslf").iterdir())
    assert run("cache", "--size") == (0, f"{size}\n", "")
    code, out, _ = run("cache")
    assert code == 0 and "2 entries" in out and str(tmp_path / "usdslf") in out
    code, out, _ = run("cache", "--clear")
    assert code == 0 and "removed 2 entries" in out
    assert list((tmp_path / "usdslf").iterdir()) == []


def test_a_warning_of_the_log_is_a_line_that_quiet_hides(
    tmp_path: Path, run: Run, monkeypatch: pytest.MonkeyPatch
) -> None:
    import logging

    def speak(_: object) -> int:
        logging.getLogger("usdslf.cache").warning("an entry is %s", "damaged")
        return 0

    monkeypatch.setattr(Cache, "size", speak)
    assert run("cache", "--size") == (0, "0\n", "warning: an entry is damaged\n")
    assert run("cache", "--size", "--quiet") == (0, "0\n", "")
