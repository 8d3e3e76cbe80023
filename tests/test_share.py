"""What runs side by side divide is asked once, and what all of them ask by each; see kit/share.py."""

from __future__ import annotations

from itertools import zip_longest
from pathlib import Path

import pytest
from kit.share import ALIKE, COUNTED, TESTS, is_alike, not_taken, share_of

ITEMS = ("a1", "-1", "a2", "b1", "-2", "c1", "c2", "d1")


def piece(item: str) -> str | None:
    return None if item[0] == "-" else item[0]


def test_pieces_are_asked_once_and_whole_and_the_rest_by_all(tmp_path: Path) -> None:
    runs = [not_taken(ITEMS, piece, tmp_path), not_taken(ITEMS[::-1], piece, tmp_path)]
    found = list(zip_longest(*runs))  # in turn
    one, other = ([item for item in asked if item] for asked in zip(*found))
    assert one and other and sorted(one + other) == sorted((*ITEMS, "-1", "-2"))
    assert not {p for p in map(piece, one) if p} & set(map(piece, other))
    assert list(not_taken(ITEMS, piece, tmp_path)) == ["-1", "-2"]  # a third that comes late


def test_shares_of_runs_are_all_there_is(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("USDSLF_SHARE", raising=False)
    assert share_of(ITEMS) == list(ITEMS)
    found = []
    for number in range(3):
        monkeypatch.setenv("USDSLF_SHARE", f"{number}/3")
        found += share_of(ITEMS)
    assert sorted(found) == sorted(ITEMS)
    monkeypatch.setenv("USDSLF_SHARE", "3/3")
    with pytest.raises(ValueError, match="0 to 2"):
        share_of(ITEMS)


def test_what_is_alike_is_there_and_what_depends_on_a_python_is_not_among_it() -> None:
    assert all((TESTS / name).exists() for name in (*ALIKE, *COUNTED))
    assert is_alike(TESTS / "render/live/test_live_picture.py") and not is_alike(TESTS / COUNTED[0])
    for name in ("journeys/test_cli.py", "usd/read/test_read.py", "batch/test_run.py", "test_shot.py", "test_share.py"):
        assert not is_alike(TESTS / name)
