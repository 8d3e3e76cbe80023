"""The accelerated hour in a minute's version: nothing is lost, and the window goes on."""

from __future__ import annotations

from pathlib import Path

from bench.viewer_hour import growth, work

PER_SHOT = 5  # with an undo, a look round and a wait for the answer among them


def test_no_stroke_is_lost_over_switches_of_shots(tmp_path: Path) -> None:
    hour = work(PER_SHOT + 2, tmp_path, per_shot=PER_SHOT)
    assert hour.strokes == PER_SHOT + 2 and hour.lost == 0 and len(hour.memory) == 2


def test_growth_is_measured_behind_the_warm_up() -> None:
    assert abs(growth([100.0, 200.0, 300.0, 310.0, 310.0, 310.0, 310.0, 310.0, 310.0])) < 1e-6
    assert abs(growth([100.0, 200.0, 300.0, 310.0, 315.0, 320.0, 325.0, 330.0, 335.0]) - 5.0) < 1e-6
