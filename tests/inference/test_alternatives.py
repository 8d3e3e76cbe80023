"""What the report says of an alternative is what choosing it writes."""

from __future__ import annotations

import numpy as np
import pytest
from kit.varying_floor import places, seen, stroke, write_floor

import usdslf


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


@pytest.mark.parametrize("name", ["diffuse", "specular", "diffuse+specular", "none"])
def test_an_alternative_says_what_choosing_it_writes(shot: usdslf.Shot, name: str) -> None:
    (said,) = [a["after"] for a in solved(shot)["alternatives"] if a["id"] == name]
    written = solved(shot, name)["after"]
    for parameter in said:  # nothing sends its light round: a lone floor
        np.testing.assert_allclose(said[parameter], written[parameter], atol=1e-4)
