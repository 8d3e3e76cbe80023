"""Verdict: what is unchecked is rejected, and the file is one that `usdslf accept --verdict` takes."""

from __future__ import annotations

import hashlib
from pathlib import Path

import pytest

from hydra_viewer.model.verdict import Verdict, in_words, rows_of
from usdslf import LookReview
from usdslf.review.verdict import read_verdict
from usdslf.usd.review.records import ReviewedEdit, ReviewedMaterial

BALL, FLOOR, SKIN = "/World/mtl/ball", "/World/mtl/floor", "/World/mtl/skin"


@pytest.fixture
def review(tmp_path: Path) -> LookReview:
    look = tmp_path / "look.usda"
    look.write_text("#usda 1.0\n")
    edit = lambda material, name, before, after, **more: ReviewedEdit(  # noqa: E731
        f"{material}/surface", f"inputs:{name}", f"{material}/surface", (f"{material}.inputs:{name}",), before, after,
        **more,
    )  # fmt: skip
    return LookReview(
        "shot.usda", str(look), hashlib.sha256(look.read_bytes()).hexdigest(),
        (
            ReviewedMaterial(BALL, BALL, "glossiness", ("/SlfStrokes/stroke_0001",)),
            ReviewedMaterial(SKIN, SKIN, "diffuse", (), {"diffuse": (0.5, 0.25, 0.125)}, {"diffuse": (0.25, 0.5, 1.0)}),
        ),
        (
            edit(FLOOR, "diffuseColor", None, (0.5, 0.25, 0.125), hidden_by="anim.usda"),
            edit(BALL, "roughness", 0.3, 0.12), edit(BALL, "roughness", 0.3, 0.12),
            edit(SKIN, "diffuseColor", (1.0,) * 4, (0.5, 2.0, 8.0, 1.0), representation="scale"),
        ),
        (), (), (), (), {}, False, (),
    )  # fmt: skip


def test_there_is_a_row_for_each_thing_that_can_be_decided(review: LookReview) -> None:
    ball, floor, skin = rows_of(review)
    assert (ball.target, ball.name, ball.before, ball.after) == (f"{BALL}.inputs:roughness", "roughness", "0.3", "0.12")
    assert (ball.state, ball.strokes) == ("", ("stroke_0001",))
    assert (floor.before, floor.after, floor.state) == ("—", "0.50 0.25 0.12", "hidden by anim.usda")
    assert in_words("auto") == "auto"
    assert (skin.before, skin.after) == ("0.50 0.25 0.12", "0.25 0.50 1.00")  # not the scale of its texture
    assert skin.colors == ((0.5, 0.25, 0.125), (0.25, 0.5, 1.0)) and not ball.colors and not floor.colors


def test_a_verdict_is_read_by_accept(review: LookReview, tmp_path: Path) -> None:
    verdict = Verdict(review)
    verdict.decide(f"{BALL}.inputs:roughness", False)
    verdict.decide(f"{FLOOR}.inputs:diffuseColor", False)
    verdict.decide(f"{FLOOR}.inputs:diffuseColor", True)
    verdict.notes[f"{BALL}.inputs:roughness"] = "too wet «»"
    verdict.write(str(tmp_path / "verdict.json"))
    read = read_verdict(tmp_path / "verdict.json", review.look)
    assert {d.target: (d.is_accepted, d.note) for d in read.decided} == {
        f"{BALL}.inputs:roughness": (False, "too wet «»"),
        f"{FLOOR}.inputs:diffuseColor": (True, ""),
        f"{SKIN}.inputs:diffuseColor": (True, ""),
    }
