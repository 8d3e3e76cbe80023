"""Each entry of the gallery shows what its figure claims, with few elements and without pictures.

Of some a path tracer, given the shot with the look layer, is asked too: it shows the painted places nearer to what was
painted.
"""

from __future__ import annotations

from pathlib import Path

import pytest
from pxr import Usd
from reference.mitsuba_setup import why_no_pathtracer

from usdslf.gallery import ENTRIES
from usdslf.gallery.play import Play
from usdslf.gallery.records import Entry

ELEMENTS, TRACED_ELEMENTS = 1500, 2500
DIRECT, INDIRECT = 5.0, 2.0  # times nearer
TRACED = (
    "still_life", "toys", "white_dab", "shadow_diffuse", "white_room", "sketch_specular", "across_the_mirror",
    "indirect_diffuse", "indirect_specular",
)  # fmt: skip


@pytest.mark.divided
@pytest.mark.parametrize("entry", ENTRIES, ids=lambda e: e.name)
def test_the_claim_comes_true(entry: Entry, tmp_path: Path) -> None:
    is_traced = entry.name in TRACED
    play = Play(entry, tmp_path, elements=TRACED_ELEMENTS if is_traced else ELEMENTS, pictures=False)
    entry.run(play)
    assert play.shown, "nothing was checked"
    wrong = [f"{s.sentence}: {s.measured}" for s in play.shown if not s.is_true]
    assert not wrong, (wrong, [step.lines for step in play.steps])
    for step in play.steps:
        for name in ("look.usda", "review.usda"):
            stage = Usd.Stage.Open(str(step.folder / name))
            assert stage and not stage.GetCompositionErrors(), (step.title, name)
        assert all(e["wins"] for e in step.report["edits"]), step.report["edits"]
    if is_traced:
        if why_no_pathtracer():
            pytest.skip(why_no_pathtracer())
        check_that_what_was_painted_is_nearer(play)


def check_that_what_was_painted_is_nearer(play: Play) -> None:
    from gallery.path_traced import nearness

    # the mirror's first stroke is direct, for contrast with the second: 4.7 times, not looked at here
    looked_at = 0
    for step in play.steps[1:] if play.entry.name == "across_the_mirror" else play.steps:
        modes = {s.path: s.mode for s in step.strokes if s.tool != "fixate"}
        for near in nearness(step):
            if near.stroke in modes:
                wanted = DIRECT if modes[near.stroke] == "direct" else INDIRECT
                assert near.factor >= wanted, (step.title, near)
                looked_at += 1
    assert looked_at >= len(play.steps) - 1, play.steps


def test_names_are_unique_and_figures_are_named() -> None:
    names = {e.name for e in ENTRIES}
    assert len(names) == len(ENTRIES) and names >= set(TRACED)
    assert all(e.figures and e.title and e.claim.endswith(".") for e in ENTRIES)
