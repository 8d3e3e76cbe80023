"""The next dab, on a plane under a lamp whose light is known in closed form."""

from __future__ import annotations

import numpy as np
import pytest
from kit.lit_plane import FLOOR, dabs, seen, write_plane

import usdslf
from usdslf.errors import SolveError

TRUE = FLOOR | {"specular": (0.25, 0.25, 0.25)}


@pytest.fixture(scope="module")
def shot(tmp_path_factory: pytest.TempPathFactory) -> usdslf.Shot:
    return usdslf.open(str(write_plane(tmp_path_factory.mktemp("plane"))), elements=150).shot


def test_one_dab_at_the_place_that_is_named_decides(shot: usdslf.Shot) -> None:
    """Three dabs of one colour leave diffuse and specular close; what each expects elsewhere is what it would show."""
    few = np.array([[0.1, 0.05, 0.0], [0.14, 0.05, 0.0], [0.1, 0.09, 0.0]])
    mean = seen(few, TRUE["diffuse"], TRUE["specular"], TRUE["roughness"]).mean(0)
    session = usdslf.Session(shot)
    session.add_stroke(dabs(few, np.tile(mean, (3, 1))))
    session.solve()
    (answer,) = session.answers
    named = session.next_dab()
    assert named.is_decisive
    assert 0 < named.xy[0] < 1 and 0 < named.xy[1] < 1
    at = np.array([named.position])
    assert abs(at[0, 2]) < 1e-4
    assert answer.chosen.id in named.expected and len(named.expected) == 2
    for c in answer.candidates:
        if c.id in named.expected and "glossiness" not in c.freed:
            t = answer.tables
            shown = seen(at, tuple(c.diffuse_of(t.diffuse)), tuple(c.f0_of(t.f0)), TRUE["roughness"])[0]
            np.testing.assert_allclose(named.expected[c.id], shown, rtol=0.12)

    more = np.concatenate([few, at])
    colors = np.concatenate([np.tile(mean, (3, 1)), seen(at, TRUE["diffuse"], TRUE["specular"], TRUE["roughness"])])
    session.add_stroke(dabs(more, colors))
    session.solve()
    assert session.report()["strokes"][0]["inferred"] == "specular"


def test_there_is_no_next_dab_without_an_answer(shot: usdslf.Shot) -> None:
    with pytest.raises(SolveError, match="no direct answer to any stroke"):
        usdslf.Session(shot).next_dab()


def test_the_report_says_what_the_paint_allows_and_how_likely_each_explanation_is(shot: usdslf.Shot) -> None:
    u, v = np.meshgrid(np.linspace(-0.35, 0.55, 4), np.linspace(-0.3, 0.4, 4))
    points = np.stack([u.ravel(), v.ravel(), 0 * u.ravel()], 1)
    session = usdslf.Session(shot)
    session.add_stroke(dabs(points, seen(points, TRUE["diffuse"], TRUE["specular"], TRUE["roughness"])))
    session.solve()
    (stroke,) = session.report()["strokes"]
    low, high = stroke["range"]["specular"]
    assert (np.array(low) <= 0.25).all() and (np.array(high) >= 0.25).all() and list(stroke["range"]) == ["specular"]
    chances = [a["probability"] for a in stroke["alternatives"]]
    assert sum(chances) == pytest.approx(1) and chances[0] == max(chances)
