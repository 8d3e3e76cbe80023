"""The bench of a stage: all rows of the demo's table, on strokes that it paints itself."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from kit.painted_table import write_table
from kit.stage_parts import StageBuilder

from usdslf.cli import bench, bench_strokes, bench_subject, bench_timing

Run = Callable[..., tuple[int, str, str]]


@pytest.fixture(autouse=True)
def quick(monkeypatch: pytest.MonkeyPatch) -> None:
    for module in (bench_timing, bench_strokes):
        monkeypatch.setattr(module, "REPEATS", 1)
    monkeypatch.setattr(bench, "SIZE", (32, 16))
    monkeypatch.setattr(bench_strokes, "MANY_DABS", 18)
    monkeypatch.setattr(bench, "start_steps", lambda *_: ())


def test_a_stage_has_the_rows_of_the_demo(tmp_path: Path, run: Run) -> None:
    stage = write_table(tmp_path)
    code, out, err = run("bench", "--json", "--stage", stage, "--elements", 200)
    assert code == 0, err
    found = json.loads(out)
    rows = {row["step"]: row for row in found["rows"]}
    assert 150 < found["elements"] < 300 and min(row["seconds"] for row in rows.values()) > 0
    assert set(rows) == {
        "read", "elements", "visibility", "visibility, one object moved", "static light", "light field, all bounces",
        "one bounce", "evidence of the strokes", "solve, all bounces", next(r for r in rows if "stylize" in r),
        "its look, read back", "picture 32 x 16", "new stroke to answer, first one", "new stroke to answer, third one",
        "three known strokes, all rounds", "undo of the third", "another choice", "18 dabs on one material",
        "live, first frame at half size", "live, first frame", "live, half size, camera turning",
        "live, one more frame", "answer to live picture", "live, after a change of diffuse",
        "live, after one of roughness",
    }  # fmt: skip
    assert sorted(p.name for p in tmp_path.iterdir()) == [stage.name]  # nothing is written beside it


def test_strokes_go_on_what_is_seen_most(tmp_path: Path) -> None:
    subject = bench_subject.staged(str(write_table(tmp_path)), 2.0, elements=100)
    strokes, chosen, scene = subject.paint(), subject.choose(), subject.session.scene
    assert [s.name for s in strokes] == ["stroke_0001", "stroke_0002", "stroke_0003"]
    assert strokes[0].surfaces == ("/World/table",) and all(len(s.counts) == bench_subject.DABS for s in strokes)
    assert len({s.surfaces for s in strokes}) == 3
    assert scene.meshes[chosen.mover].path == "/World/other_red_ball"
    assert scene.materials[chosen.recolored].path.endswith("table") and chosen.lift[1] == pytest.approx(
        0.2 * np.linalg.norm(np.ptp(scene.meshes[chosen.mover].positions, 0))
    )


def test_a_stage_that_shows_nothing_is_a_sentence(tmp_path: Path, run: Run) -> None:
    b = StageBuilder(tmp_path)
    b.plane("floor", 1, 1, b.material("m", diffuseColor=(0.5, 0.5, 0.5)), y=-5)
    b.camera((0, 1, 0), (0, 9, 0))
    code, _, err = run("bench", "--stage", b.save(), "--elements", 50)
    assert code == 2 and "sees no surface" in err
