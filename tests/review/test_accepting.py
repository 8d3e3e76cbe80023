"""One of several strokes that were answered together is rejected: the others are solved again without it."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from kit.stage_parts import StageBuilder, rectangle
from kit.varying_floor import GREY, add_lamp, part, places
from pxr import Sdf, Usd

import usdslf
from usdslf.contents import file_hash
from usdslf.errors import InputError
from usdslf.review.accepting import accept
from usdslf.usd.review.accept import Wish
from usdslf.usd.review.review import review_look
from usdslf.usd.review.toggle import toggle

Run = Callable[..., tuple[int, str, str]]
RED, BLUE, GREEN = (0.6, 0.2, 0.1), (0.1, 0.2, 0.6), (0.15, 0.5, 0.15)
FLOOR, PATCH = "/World/mtl/floor", "/World/mtl/patch"
QUALITY = {"elements": 300}


@pytest.fixture(scope="module")
def looked(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A floor painted red and blue, one input of it by hand; a patch painted green, taken for specular, and silent."""
    folder = tmp_path_factory.mktemp("together")
    b = StageBuilder(folder)
    for name, left in (("floor", -1.0), ("patch", 0.0)):
        b.mesh(name, rectangle((left, 0, 1), (1, 0, 0), (0, 0, -2)), b.material(name, **GREY))
    add_lamp(b)
    shot = b.save()
    x, near = places()[:, 0], places()[:, 2] > 0.1
    strokes = [part("red", (x < 0) & ~near, RED), part("blue", (x < 0) & near, BLUE), part("green", x > 0, GREEN)]
    session = usdslf.open(str(shot), **QUALITY)
    for each in strokes:
        session.add_stroke(each)
    session.solve(choose={"green": "specular"})
    usdslf.write_strokes(folder / "strokes.usda", strokes, session.stage)
    session.author(folder / "look.usda", strokes_path=folder / "strokes.usda")
    toggle(folder / "look.usda", [PATCH], on=False)
    layer = Sdf.Layer.FindOrOpen(str(folder / "look.usda"))
    by_hand = Sdf.AttributeSpec(layer.GetPrimAtPath(f"{FLOOR}/surface"), "inputs:clearcoat", Sdf.ValueTypeNames.Float)
    by_hand.default = 0.25
    layer.Save()
    return folder


def diffuse(folder: Path, look: str, material: str = FLOOR) -> np.ndarray:
    root = Sdf.Layer.CreateAnonymous(".usda")
    root.subLayerPaths = [str(folder / look), str(folder / "stage.usda")] if look else [str(folder / "stage.usda")]
    stage = Usd.Stage.Open(root)
    return np.array(stage.GetPrimAtPath(f"{material}/surface").GetAttribute("inputs:diffuseColor").Get())


def test_the_others_say_what_they_would_have_said_alone(looked: Path, run: Run) -> None:
    files = {name: (looked / name).read_bytes() for name in ("stage.usda", "look.usda", "strokes.usda")}
    mixed = diffuse(looked, "look.usda")
    assert np.abs(mixed - RED).max() > 0.05 and np.abs(mixed - BLUE).max() > 0.05
    verdict = {"look": "look.usda", "lookHash": file_hash(looked / "look.usda"), "by": "Ada",
               "verdicts": [{"target": "blue", "verdict": "reject", "note": "no"},
                            {"target": FLOOR, "verdict": "accept", "note": ""}]}  # fmt: skip
    (looked / "look.verdict.json").write_text(json.dumps(verdict))
    code, said, err = run(
        "accept", looked / "stage.usda", looked / "look.usda", "-o", looked / "red.usda", "--verdict",
        looked / "look.verdict.json", "--elements", 300,
    )  # fmt: skip
    assert code == 0 and f"accepted: {FLOOR}.inputs:diffuseColor" in said, err
    assert "solved again without /SlfStrokes/blue, which asked together with /SlfStrokes/red" in err
    np.testing.assert_allclose(diffuse(looked, "red.usda"), RED, atol=0.03)
    layer = Sdf.Layer.FindOrOpen(str(looked / "red.usda"))
    assert layer.GetAttributeAtPath(f"{FLOOR}/surface.inputs:clearcoat").default == 0.25  # by hand
    said_of = layer.customLayerData["usdslf"]["accepted"]
    assert list(said_of["solvedWithout"]) == ["/SlfStrokes/blue"] and said_of["by"] == "Ada"
    assert said_of["look"] == "look.usda" and said_of["lookHash"] == file_hash(looked / "look.usda")
    found = review_look(looked / "stage.usda", looked / "red.usda", None)
    assert not found.findings and {s for m in found.materials for s in m.strokes} >= {"/SlfStrokes/red"}
    assert "/SlfStrokes/blue" not in {s for m in found.materials for s in m.strokes}
    assert f"{PATCH}/surface.inputs:specularColor" in toggle(looked / "red.usda", [PATCH], on=True).changed  # was off
    found = review_look(looked / "stage.usda", looked / "red.usda", None)
    assert {m.shown_at: m.inferred for m in found.materials} == {FLOOR: "diffuse", PATCH: "specular"}
    assert {name: (looked / name).read_bytes() for name in files} == files


def test_it_is_solved_as_the_look_was(looked: Path) -> None:
    """Norm, mode and the light's quality are those of then, also without being told; what is chosen stays chosen."""
    session = usdslf.open(str(looked / "stage.usda"), **QUALITY)
    for each in usdslf.read_strokes(looked / "strokes.usda"):
        session.add_stroke(each)
    session.solve("l2", {"red": "diffuse"})
    session.author(looked / "new.usda", strokes_path=looked / "strokes.usda", mode="new")
    was = {m.inferred for m in review_look(looked / "stage.usda", looked / "new.usda", None).materials}
    assert was == {"diffuse", "diffuse+specular+glossiness"}  # of the floor, of the patch
    done = accept(looked / "stage.usda", looked / "new.usda", looked / "again.usda", Wish(but=("blue",)))
    assert not any("how it was solved" in w for w in done.warnings)
    found = review_look(looked / "stage.usda", looked / "again.usda", None)
    assert {m.inferred for m in found.materials} == was
    assert {e.representation for e in found.edits} >= {"binding"}  # materials of their own
    data = Sdf.Layer.FindOrOpen(str(looked / "again.usda")).customLayerData["usdslf"]
    assert {k: data["settings"][k] for k in ("norm", "mode", "elements")} == {
        "norm": "l2", "mode": "new", "elements": QUALITY["elements"],
    }  # fmt: skip


def test_only_one_of_them_is_accepted(looked: Path) -> None:
    done = accept(looked / "stage.usda", looked / "look.usda", looked / "blue.usda", Wish(only=("blue",)), QUALITY)
    assert f"{FLOOR}.inputs:diffuseColor" in done.kept and any("without /SlfStrokes/red" in w for w in done.warnings)
    np.testing.assert_allclose(diffuse(looked, "blue.usda"), BLUE, atol=0.03)
    assert not [e for e in review_look(looked / "stage.usda", looked / "blue.usda", None).edits if PATCH in e.prim]


def test_what_a_layer_can_say_is_not_solved_again(looked: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("usdslf.review.accepting.find_solution", lambda *args: pytest.fail("it was solved"))
    shot, look, out = looked / "stage.usda", looked / "look.usda", looked / "some.usda"
    for wish in (None, Wish(but=("red", "blue")), Wish(only=(FLOOR,)), Wish(but=(FLOOR, "red"))):
        accept(shot, look, out, wish, QUALITY)
        is_kept = wish is None or bool(wish.only)
        np.testing.assert_array_equal(diffuse(looked, "some.usda"), diffuse(looked, "look.usda" if is_kept else ""))


def test_strokes_that_are_gone_cannot_be_solved_without(looked: Path) -> None:
    strokes = (looked / "strokes.usda").read_bytes()
    (looked / "strokes.usda").unlink()
    try:
        with pytest.raises(InputError, match=r"blue is not in the stroke layer of .*look.usda any more"):
            accept(looked / "stage.usda", looked / "look.usda", looked / "none.usda", Wish(but=("blue",)), QUALITY)
    finally:
        (looked / "strokes.usda").write_bytes(strokes)
    assert not (looked / "none.usda").exists()
