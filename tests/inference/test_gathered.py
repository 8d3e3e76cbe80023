"""Samples of a stroke are traced once on a shot, whatever is asked beside it; what comes of them is the same."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from kit.lit_plane import FLOOR, dabs, places, seen, write_plane

import usdslf
from usdslf import solution
from usdslf.inference import first_answers, whitening
from usdslf.inference.answers import Painted
from usdslf.inference.bilinear import Tables
from usdslf.inference.evidence import Evidence
from usdslf.inference.gathered import Gathered
from usdslf.inference.weights import Options
from usdslf.light_field.light_field import LightField
from usdslf.scene.difference import look_alike
from usdslf.session import Session


@pytest.fixture(scope="module")
def path(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_plane(tmp_path_factory.mktemp("plane"))


def painted(name: str, change: float, **other: Any) -> usdslf.Stroke:
    at = places()
    stroke = dabs(at, seen(at, [c * change for c in FLOOR["diffuse"]], FLOOR["specular"], FLOOR["roughness"]))
    return replace(stroke, name=name, **other)


def test_a_stroke_is_traced_once_and_the_answer_is_that_of_a_fresh_shot(
    path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    traced: list[str] = []
    gather = solution.gather_stroke

    def noted(stroke: usdslf.Stroke, *args: Any) -> Painted:
        traced.append(stroke.name)
        return gather(stroke, *args)

    monkeypatch.setattr(solution, "gather_stroke", noted)
    session = usdslf.open(str(path), elements=100)
    first, second = painted("stroke_0001", 1.3), painted("stroke_0002", 1.31)
    session.add_stroke(first)
    session.solve()
    session.add_stroke(second)
    session.solve()
    assert traced == ["stroke_0001", "stroke_0002"]
    session.remove_stroke("stroke_0002")
    session.add_stroke(replace(second, active=False))
    session.solve(choose={"stroke_0001": "specular"})
    again = session.solve()
    assert traced == ["stroke_0001", "stroke_0002"]
    session.add_stroke(replace(first, colors=first.colors * np.float32(1.1)))
    session.solve()
    assert traced == ["stroke_0001", "stroke_0002", "stroke_0001"]
    fresh = usdslf.open(str(path), elements=100)
    fresh.add_stroke(first)
    for a, b in zip(again, fresh.solve(), strict=True):
        assert look_alike(a.chosen, b.chosen) and a.residual_after == b.residual_after


def test_a_first_answer_is_weighed_once_and_evidence_taken_once_in_the_light_as_it_is(
    path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    weighed: list[int] = []
    weigh, take = first_answers.enumerate_candidates, Painted.evidence
    taken: list[str] = []

    def noted(tables: Tables, options: Options) -> Any:
        weighed.append(len(tables.target))
        return weigh(tables, options)

    def noted_too(painted: Painted, field: LightField, is_weighed: bool = True) -> Evidence:
        taken.extend([painted.stroke.name] * is_weighed)
        return take(painted, field, is_weighed)

    monkeypatch.setattr(first_answers, "enumerate_candidates", noted)
    monkeypatch.setattr(Painted, "evidence", noted_too)
    shot = usdslf.open(str(path), elements=100).shot
    first, second = painted("a", 1.3), painted("b", 0.6, scope="stroke")
    alone = solution.find_solution(shot, [first])
    both = solution.find_solution(shot, [second, first])
    again = solution.find_solution(shot, [first])
    assert weighed == [len(first.counts), len(second.counts)] and taken == ["a", "b"]
    assert [a.pool.strokes for a in both.answers] == [(0,), (1,)]
    assert again.answers[0] is alone.answers[0] and again.left_out == alone.left_out  # an undo finds nothing anew
    solution.find_solution(shot, [first], solution.Settings(choose={"a": "specular"}))
    solution.find_solution(shot, [first], solution.Settings(weights=Options(group=9.0)))
    assert len(weighed) == 4 and taken == ["a", "b"]


def test_the_errors_of_a_pool_are_factored_once(path: Path) -> None:
    """For its fits, and for the fit again; whatever the light is, and for another choice."""
    shot = usdslf.open(str(path), elements=100).shot
    whitening._white_of.cache_clear()
    solution.find_solution(shot, [painted("a", 1.3)])
    solution.find_solution(shot, [painted("a", 1.3)], solution.Settings(choose={"a": "specular"}))
    assert whitening._white_of.cache_info().misses == 2


def test_what_is_said_of_a_stroke_is_said_each_time(path: Path) -> None:
    shot = usdslf.open(str(path), elements=100).shot
    moved = painted("stroke_0001", 1.2)
    moved = replace(moved, points=moved.points + np.float32([0, 0.4, 0]))
    found = []
    for session in (Session(shot), Session(shot)):
        session.add_stroke(moved)
        session.solve()
        found.append(session.warnings)
    assert found[0] and found[0] == found[1]


def test_no_more_is_kept_than_the_limit(path: Path) -> None:
    session = usdslf.open(str(path), elements=100)
    session.add_stroke(painted("stroke_0001", 1.3))
    session.solve()
    (kept,) = session.solution.painted
    size = kept.samples.light.fixed_d.nbytes
    traced: list[str] = []

    def ask(store: Gathered, name: str) -> None:
        store.of(painted(name, 1.0), lambda said: (traced.append(name), kept)[1], [])

    for limit, wanted in ((1 << 40, ["a", "b"]), (size, ["a", "b", "a"])):
        traced.clear()
        store = Gathered(limit)
        for name in ("a", "b", "a"):
            ask(store, name)
        assert traced == wanted
