"""The textured cases' truth: small, clear of its noise, over many assets, and of the change that the case names."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from truth.recovery.make_truth import TRUTH
from truth.recovery.textured_cases import TEXTURED, TexturedCase

LARGEST_FILE, LARGEST_SUM = 15 * 1024, 1024 * 1024  # bytes
PARAMETERS = {"diffuse": "diffuse", "specular": "specular", "glossiness": "roughness"}


def test_cases_are_many_and_varied() -> None:
    assert len(TEXTURED) >= 30
    assert len({c.name for c in TEXTURED}) == len(TEXTURED)
    assert len({c.shot.asset for c in TEXTURED}) >= 4
    for parameter in PARAMETERS:
        assert sum(c.parameter == parameter for c in TEXTURED) >= 6
    assert sum(bool(c.shot.copies) for c in TEXTURED) >= 3


def test_all_truth_is_small() -> None:
    sizes = [(TRUTH / f"{c.name}.json").stat().st_size for c in TEXTURED]
    assert max(sizes) < LARGEST_FILE
    assert sum(sizes) < LARGEST_SUM


@pytest.mark.parametrize("case", TEXTURED, ids=lambda c: c.name)
def test_the_change_is_seen_and_is_of_one_parameter(case: TexturedCase) -> None:
    truth = json.loads((TRUTH / f"{case.name}.json").read_text())
    assert truth["change"]["median"] >= max(0.05, 5 * truth["noise"]["median"])
    exact, before = np.array(truth["colors"]["exact"]), np.array(truth["colors_before"])
    assert 16 <= len(exact) == len(before) == len(truth["xy"])
    moved = {
        p
        for p, key in PARAMETERS.items()
        if np.abs(np.subtract(truth["after"][key], truth["before"][key])).max() > 0.02
    }
    # A base colour is the F0 of the metal in a packed map too, a little.
    assert case.parameter in moved
    assert moved <= {case.parameter, "specular"}, moved


@pytest.mark.assets
@pytest.mark.parametrize("case", TEXTURED, ids=lambda c: c.name)
def test_what_was_changed_is_what_the_case_names(assets: Path, case: TexturedCase) -> None:
    truth = json.loads((TRUTH / f"{case.name}.json").read_text())
    named = json.loads(json.dumps(case.changed_values()))
    assert len(named) == len(truth["changed"]) == 1
    assert named[0]["attribute"] == truth["changed"][0]["attribute"]
    np.testing.assert_allclose(named[0]["is"], truth["changed"][0]["is"])
    assert named[0]["is"] != named[0]["was"]
