"""Paint that is what the picture shows asks for nothing, whatever the evidence says at an edge."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from kit.dull_tables import N, dull_tables
from kit.varying_floor import places, seen, stroke, write_floor

import usdslf
from usdslf.inference.bilinear import Tables
from usdslf.inference.solve import enumerate_candidates
from usdslf.inference.unchanged import by_own_errors, may_be_unchanged
from usdslf.inference.weights import Options

O = Options()


def shiny_tables(seed: int = 5) -> Tables:
    """Tables of dabs that were painted as they look, every eighth in a highlight."""
    t = dull_tables(np.random.default_rng(seed))
    light = np.full((N, 1, 3), 0.05)
    light[::8] = 6.0
    t = replace(t, dabs=replace(t.dabs, p=t.dabs.p + 0.04 * light, v=light))
    return replace(t, target=t.before, scale=t.before + 0.05)


def answer(t: Tables) -> str:
    """The cheapest candidate by the errors of the evidence."""
    return by_own_errors(t, O, enumerate_candidates(t, O, ("diffuse", "specular")))[0].id


@pytest.mark.parametrize("factor", [0.5, 1.8])
def test_an_edge_that_the_evidence_misses_is_no_wish(factor: float) -> None:
    t = shiny_tables()
    target = t.target * np.random.default_rng(1).normal(1, 0.01, (N, 3))
    target[8] *= factor
    t = replace(t, target=target)
    assert may_be_unchanged(t)
    assert answer(t) == "none"


def test_a_change_that_is_seen_at_three_dabs_of_many_stays_one() -> None:
    """Only the highlight of the paint differs from the picture."""
    t = shiny_tables()
    t = replace(t, target=t.target + 0.03 * t.dabs.v[:, 0])
    assert may_be_unchanged(t)
    assert answer(t) == "specular"


@pytest.mark.parametrize("change", [[0.05, 0.0, 0.0], [0.03, 0.04, 0.02]])
def test_a_small_change_everywhere_is_not_taken_for_the_picture(change: list[float]) -> None:
    t = shiny_tables()
    assert not may_be_unchanged(replace(t, target=t.target + np.array(change) * t.dabs.u[:, 0]))


def test_who_paints_unevenly_does_not_copy() -> None:
    t = shiny_tables()
    wave = 1 + 0.1 * np.sin(6 * t.place[:, :1])
    assert not may_be_unchanged(replace(t, target=t.target * wave))


def test_dabs_whose_points_differ_may_be_further_off() -> None:
    t = shiny_tables()
    t = replace(t, target=t.target * np.where(np.arange(N) % 2, 1.1, 0.9)[:, None])
    assert not may_be_unchanged(t)
    assert may_be_unchanged(replace(t, noise=0.1 * t.before))


def test_swatches_of_the_picture_ask_for_nothing() -> None:
    t = shiny_tables()
    swatch = np.arange(N) // 8
    colors = np.stack([t.target[swatch == k].mean(0) for k in range(3)])[swatch]
    assert may_be_unchanged(replace(t, target=colors, scale=colors + 0.05, swatch=swatch))


@pytest.fixture(scope="module")
def shot(tmp_path_factory: pytest.TempPathFactory) -> usdslf.Shot:
    return usdslf.open(str(write_floor(tmp_path_factory.mktemp("floor"))), elements=400).shot


@pytest.mark.parametrize(("diffuse", "inferred"), [(0.4, "none"), (0.46, "diffuse")])
def test_a_picture_painted_back_over_itself_is_answered_none(
    shot: usdslf.Shot, diffuse: float, inferred: str
) -> None:
    """One dab of three times the light decides nothing, a floor that is lighter all over does."""
    colors = np.array(seen(places(), (diffuse,) * 3))
    colors[0] *= 3
    session = usdslf.Session(shot)
    session.add_stroke(stroke(colors))
    session.solve()
    found = session.report()["strokes"][0]
    assert found["inferred"] == inferred
    assert max(a["probability"] for a in found["alternatives"] if a["id"] == inferred) > 0.9
