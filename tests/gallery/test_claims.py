"""Each entry of the gallery shows what its figure claims, with few elements and without pictures."""

from __future__ import annotations

from pathlib import Path

import pytest
from pxr import Usd

from usdslf.gallery import ENTRIES
from usdslf.gallery.play import Play
from usdslf.gallery.records import Entry

ELEMENTS = 1500


@pytest.mark.divided
@pytest.mark.parametrize("entry", ENTRIES, ids=lambda e: e.name)
def test_the_claim_comes_true(entry: Entry, tmp_path: Path) -> None:
    play = Play(entry, tmp_path, elements=ELEMENTS, pictures=False)
    entry.run(play)
    assert play.shown, "nothing was checked"
    wrong = [f"{s.sentence}: {s.measured}" for s in play.shown if not s.is_true]
    assert not wrong, (wrong, [step.lines for step in play.steps])
    for step in play.steps:
        for name in ("look.usda", "review.usda"):
            stage = Usd.Stage.Open(str(step.folder / name))
            assert stage and not stage.GetCompositionErrors(), (step.title, name)
        assert all(e["wins"] for e in step.report["edits"]), step.report["edits"]


def test_names_are_unique_and_figures_are_named() -> None:
    assert len({e.name for e in ENTRIES}) == len(ENTRIES)
    assert all(e.figures and e.title and e.claim.endswith(".") for e in ENTRIES)
