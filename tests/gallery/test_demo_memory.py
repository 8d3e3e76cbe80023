"""The demo keeps one figure at a time in memory; its index keeps only what it shows."""

from __future__ import annotations

import weakref
from pathlib import Path
from typing import Any

import pytest

from usdslf.gallery import demo, play
from usdslf.session import Session


def test_no_session_of_an_entry_lives_when_the_next_begins(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    made: list[weakref.ref[Session]] = []
    alive: list[int] = []  # sessions, as each entry begins
    opened, begun = Session.__init__, play.Play.__init__

    def opens(session: Session, *args: Any, **options: Any) -> None:
        opened(session, *args, **options)
        made.append(weakref.ref(session))

    def begins(self: play.Play, *args: Any, **options: Any) -> None:
        alive.append(sum(r() is not None for r in made))
        begun(self, *args, **options)

    monkeypatch.setattr(Session, "__init__", opens)
    monkeypatch.setattr(play.Play, "__init__", begins)
    names = ("white_dab", "similarity")
    lines = list(
        demo.run_demos(names, False, tmp_path, None, None, None, lambda step, share: None, elements=300, pictures=False)
    )
    assert alive == [0, 0] and len(made) >= 4  # white_dab alone opens one, and one after each of its steps
    assert not any(r() for r in made)
    index = (tmp_path / "index.html").read_text()
    assert all(name in index for name in names)
    assert any("At the glint it is a highlight" in line for line in lines) and "At the glint" in index
    assert "a rough first stroke" in index
