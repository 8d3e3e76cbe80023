"""Strokes painted from a path tracer's pictures give back the change that was made.

The truth lies in recovery/truth, made by recovery/make_truth.py.  Runs side by side divide the cases, see kit/share.py.
"""

from __future__ import annotations

import pytest
from kit.share import share_of
from truth.recovery.cases import CASES, UNDECIDABLE
from truth.recovery.run_recovery import (
    TRUTH,
    WANTED,
    Outcome,
    line,
    markdown_of_failures,
    read_truth,
    run,
    select,
    totals,
)

LEAST_CASES = 40
ELEMENTS = 2000  # the tables of README.md are of 4000
CLOSE = 0.9  # share of the right exact strokes whose value is within tolerance


@pytest.fixture(scope="module")
def outcomes() -> list[Outcome]:
    return list(run(share_of(select("tuning")), elements=ELEMENTS))


def test_every_case_has_a_truth_with_visible_change() -> None:
    assert len([c for c in CASES if c.set_name == "tuning"]) >= LEAST_CASES
    for case in CASES:
        assert (TRUTH / f"{case.name}.json").exists(), case.name
        truth = read_truth(case)
        if case.name not in UNDECIDABLE:
            assert truth["change"]["median"] > 5 * truth["noise"]["median"], case.name


def test_painted_changes_are_recovered(outcomes: list[Outcome], capsys: pytest.CaptureFixture[str]) -> None:
    found = totals(outcomes)
    with capsys.disabled():
        print()
        for outcome in outcomes:
            print(line(outcome))
        for total in found:
            print(total)
        for name, reason in UNDECIDABLE.items():
            print(f"not counted: {name}: {reason}")
    for total in found:
        assert total.share >= WANTED[total.way], f"{total}\n{markdown_of_failures(outcomes)}"
    exact = found[0]
    assert exact.close >= CLOSE * exact.right, str(exact)
