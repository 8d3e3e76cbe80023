"""What a look says of how it was solved, and what another solve takes from it."""

from __future__ import annotations

from pathlib import Path

from kit.varying_floor import write_floor

from usdslf.inference.weights import Options
from usdslf.provenance import said_of_solve, solved_with
from usdslf.shot import Shot
from usdslf.similarity.similarity import Weights
from usdslf.solution import Settings


def test_what_is_said_is_read_again(tmp_path: Path) -> None:
    shot = Shot.open(str(write_floor(tmp_path)), elements=300, bounces=2, missing_dome="white")
    for weights in (Options.of({"group": 8.25, "freedom": 0.1}), Options.of((1, 5, 25)), None):
        settings = Settings("l0", {"red": "diffuse+specular", "blue": "none"}, weights, Weights(0.25, 0.1, 2))
        found = solved_with(said_of_solve(shot, settings, "class"), ("red", "blue"))
        assert found.settings == settings and found.mode == "class" and found.warnings == ()
        assert Shot.open(shot.path, **found.quality).element_count == 300
        assert found.quality == {
            "elements": 300, "bounces": 2, "refine": 1, "model": "preview_surface", "missing_dome": "white",
            "make_preview": False,
        }  # fmt: skip
    assert solved_with(said_of_solve(shot, settings, ""), ("blue",)).settings.choose == {"blue": "none"}


def test_what_is_not_said_or_nonsense_is_told_and_taken_as_usual() -> None:
    (sentence,) = solved_with({}, ()).warnings
    assert "does not say how it was solved" in sentence
    odd = {"norm": "l7", "weights": "group", "similarity": "1,2", "mode": 3.5, "choose": "=", "elements": "many"}
    found = solved_with(odd, ())
    assert found.settings == Settings() and found.mode == "" and not found.quality
    assert len(found.warnings) == 6 and found.warnings[0] == (
        "the look says norm = l7, which is none: what is usual is taken"
    )
