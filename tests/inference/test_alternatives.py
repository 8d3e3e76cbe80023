"""What the report says of an alternative is what choosing it writes."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest
from kit.varying_floor import places, seen, stroke, write_floor

import usdslf
from usdslf.inference import if_chosen
from usdslf.inference.alternatives import alternatives_of
from usdslf.inference.answers import Alternative, Answer, Pool
from usdslf.inference.candidate import Candidate
from usdslf.inference.fit import Problem
from usdslf.solution import find_solution


@pytest.fixture(scope="module")
def shot(tmp_path_factory: pytest.TempPathFactory) -> usdslf.Shot:
    return usdslf.open(str(write_floor(tmp_path_factory.mktemp("floor"))), elements=400).shot


def solved(shot: usdslf.Shot, choose: str = "") -> dict:
    """The report's stroke for a floor that is painted unevenly, three dabs far off."""
    colors = np.array(seen(places(), (0.6, 0.2, 0.1)))
    colors[:3] *= (0.4, 1.6, 2.0)
    session = usdslf.Session(shot)
    session.add_stroke(stroke(colors))
    session.solve(choose={session.strokes[0].name: choose} if choose else None)
    return session.report()["strokes"][0]


def test_what_alternatives_would_be_is_found_once_and_when_it_is_asked(
    shot: usdslf.Shot, monkeypatch: pytest.MonkeyPatch
) -> None:
    found: list[str] = []
    refit = if_chosen.refit

    def noted(problem: Problem, chosen: Candidate) -> Candidate:
        found.append(chosen.id)
        return refit(problem, chosen)

    monkeypatch.setattr(if_chosen, "refit", noted)
    solution = find_solution(shot, [stroke(np.array(seen(places(), (0.5, 0.2, 0.1))))])
    (answer,) = solution.answers
    assert len(solution.left_out) == 1 < len(answer.rounds)  # no light comes back: none is sent for the second fit
    assert found == [] and set(answer.if_chosen) == {c.id for c in answer.candidates}
    with ThreadPoolExecutor(4) as pool:
        means = list(pool.map(lambda _: answer.if_chosen["diffuse"], range(8)))
    assert found == ["diffuse"] and all(m is means[0] for m in means)
    np.testing.assert_allclose(means[0]["diffuse"], (0.5, 0.2, 0.1), rtol=0.05)
    assert answer.if_chosen.get("no such") is None


@pytest.mark.parametrize("name", ["diffuse", "specular", "diffuse+specular", "none"])
def test_an_alternative_says_what_choosing_it_writes(shot: usdslf.Shot, name: str) -> None:
    (said,) = [a["after"] for a in solved(shot)["alternatives"] if a["id"] == name]
    written = solved(shot, name)["after"]
    for parameter in said:  # nothing sends its light round: a lone floor
        np.testing.assert_allclose(said[parameter], written[parameter], atol=1e-4)


def test_those_of_an_indirect_answer_are_changes_of_all_in_sight() -> None:
    """The chosen one first, though it may cost more, then by cost; where nothing changes it is as it was."""
    before = {"diffuse": np.full(3, 0.2), "specular": np.full(3, 0.04), "roughness": np.array([0.5])}
    after = before | {"roughness": np.array([0.1])}
    others = [
        Alternative("none", 8.0, (), {}, False, False),
        Alternative("glossiness of /mtl/ring", 3.0, ("/mtl/ring",), after, False, True),
        Alternative("diffuse of /mtl/wall", None, ("/mtl/wall",), after, False, False),
        Alternative("specular of /mtl/ring", 5.0, ("/mtl/ring",), after, True, False),
    ]
    pool, chosen = Pool(0, "material", (), (0,)), Candidate(("specular",))
    answer = Answer(pool, chosen, (chosen,), None, before, after, 1.0, 0.1, (0.1,), others=tuple(others))
    found = alternatives_of(answer)
    assert [a.id.split(" ")[0] for a in found] == ["specular", "glossiness", "none", "diffuse"]
    assert [a.after["roughness"] for a in found] == [0.1, 0.1, 0.5, 0.1]
    assert found[1].probability > found[0].probability > found[2].probability > found[3].probability == 0
