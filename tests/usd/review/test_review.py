"""Review of a look layer: what it changes, from what, and what is wrong with it."""

from __future__ import annotations

import json
import shutil
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from kit.look_stages import author, change_of, new_shot
from kit.varying_floor import places, seen, stroke, write_floor
from pxr import Sdf, Usd, UsdShade

import usdslf
from usdslf.usd.review.review import review_look
from usdslf.usd.stroke_layer import write_strokes

Run = Callable[..., tuple[int, str, str]]


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    folder = tmp_path_factory.mktemp("made")
    shot, look, strokes = write_floor(folder), folder / "look.usda", folder / "strokes.usda"
    session = usdslf.open(str(shot), elements=400)
    session.add_stroke(stroke(seen(places(), (0.6, 0.2, 0.1))))
    write_strokes(strokes, session.strokes, session.stage)
    session.solve()
    session.author(look, strokes_path=strokes)
    return shot, look


@pytest.fixture
def shot_and_look(made: tuple[Path, Path], tmp_path: Path) -> tuple[Path, Path]:
    shutil.copytree(made[0].parent, tmp_path, dirs_exist_ok=True)
    return tmp_path / made[0].name, tmp_path / made[1].name


def test_a_look_is_said_with_what_it_changes(shot_and_look: tuple[Path, Path], run: Run) -> None:
    code, out, err = run("review", *shot_and_look)
    assert code == 0, err
    assert "/World/mtl/floor: diffuse, from /SlfStrokes/stroke_0001; residual" in out and "findings: 0" in out
    assert "/World/mtl/floor/surface.inputs:diffuseColor: (0.4, 0.4, 0.4) -> (0.6, 0.2, 0.1)" in out
    code, out, _ = run("review", *shot_and_look, "--json")
    found = json.loads(out)
    (edit,) = found["edits"]
    assert code == 0 and (edit["prim"], edit["attribute"]) == ("/World/mtl/floor/surface", "inputs:diffuseColor")
    np.testing.assert_allclose(edit["before"], 0.4, atol=1e-6)
    np.testing.assert_allclose(edit["after"], (0.6, 0.2, 0.1), atol=0.02)
    assert found["materials"][0]["residual_after"] < found["materials"][0]["residual_before"]


def test_what_is_wrong_is_found_and_told_by_the_exit_code(shot_and_look: tuple[Path, Path], run: Run) -> None:
    shot, look = shot_and_look
    layer = Sdf.Layer.FindOrOpen(str(look))
    layer.GetAttributeAtPath("/World/mtl/floor/surface.inputs:diffuseColor").default = (1.5, 0.2, 0.1)
    Sdf.CreatePrimInLayer(layer, "/World/gone")
    Sdf.AttributeSpec(layer.GetPrimAtPath("/World/gone"), "inputs:x", Sdf.ValueTypeNames.Float).default = 1.0
    layer.Save()
    code, out, _ = run("review", shot, look, "--json")
    names = {f["name"] for f in json.loads(out)["findings"]}
    assert code == 1 and {"OutOfRange", "DanglingOver"} <= names
    code, out, _ = run("review", shot, look)
    assert code == 1 and "  OutOfRange: " in out


def test_a_look_of_another_shot_is_said(shot_and_look: tuple[Path, Path], run: Run, tmp_path: Path) -> None:
    shot, look = shot_and_look
    other, copy, over = (tmp_path / f"{name}.usda" for name in ("other", "copy", "over"))
    other.write_text(shot.read_text() + "\n# another one\n")
    copy.write_bytes(shot.read_bytes())
    over.write_text(f"#usda 1.0\n(\n    subLayers = [@./{shot.name}@]\n    defaultPrim = \"World\"\n)\n")
    for same in (copy, over):  # also where the shot stands below another one
        assert run("review", same, look)[0] == 0
    code, out, _ = run("review", other, look)
    assert code == 1 and f"it was solved for ./{shot.name}, which is no part of this shot" in out


def test_what_an_earlier_look_of_the_shot_says_is_replaced_and_no_finding(
    shot_and_look: tuple[Path, Path], tmp_path: Path
) -> None:
    shot, earlier = shot_and_look
    later = tmp_path / "later"
    later.mkdir()
    (later / "shot.usda").write_text(f"#usda 1.0\n(\n    subLayers = [@../{earlier.name}@, @../{shot.name}@]\n)\n")
    stage = Usd.Stage.Open(str(later / "shot.usda"))
    (edit,) = author(stage, later, change_of(stage, "/World/floor", "diffuse", (0.1, 0.5, 0.2)))
    assert edit.attribute == "inputs:diffuseColor"
    found = review_look(later / "shot.usda", later / "look.usda", None)
    assert not found.findings and found.edits[0].wins
    (later / "hidden.usda").write_text(
        f"#usda 1.0\n(\n    subLayers = [@../{earlier.name}@, @./look.usda@, @../{shot.name}@]\n)\n"
    )
    found = review_look(later / "hidden.usda", later / "look.usda", None)
    (hidden,) = [f for f in found.findings if f.name == "HiddenEdit"]
    above, below = f"{earlier.parent.name}/look.usda", "later/look.usda"  # of one name: told apart
    assert f"of {below} is hidden by {above} at " in hidden.message and f"put {below} above {above}" in hidden.message
    (third := tmp_path / "third").mkdir()
    author(Usd.Stage.Open(str(later / "hidden.usda")), third, change_of(stage, "/World/floor", "glossiness"))
    found = review_look(later / "hidden.usda", third / "look.usda", None)
    assert "HiddenEdit" not in {f.name for f in found.findings}  # what those hide of each other is no fault of its own


def test_what_is_no_look_is_refused(shot_and_look: tuple[Path, Path], run: Run, tmp_path: Path) -> None:
    shot, _ = shot_and_look
    code, _, err = run("review", shot, tmp_path / "strokes.usda")
    assert code == 2 and "is not a look layer of usdslf" in err
    code, _, err = run("review", shot, tmp_path / "nowhere.usda")
    assert code == 2 and "there is no look layer" in err and "usdslf solve" in err


def test_a_look_that_the_shot_has_is_reviewed_where_it_is(inputs: Path, run: Run) -> None:
    """Two artists' looks in one shot: Carl's is the stronger one and hides Anna's, also in her review."""
    shot, anna, carl = (inputs / "two_looks" / name for name in ("clash.usda", "look_anna.usda", "look_carl.usda"))
    code, out, _ = run("review", shot, anna, "--json")
    found = json.loads(out)
    hidden = [f for f in found["findings"] if f["name"] == "HiddenEdit"]
    assert code == 1 and [(f["layer"], "look_carl.usda" in f["message"]) for f in hidden] == [("look_anna.usda", True)]
    np.testing.assert_allclose(found["edits"][0]["before"], (0.5, 0.5, 0.5), atol=1e-6)  # the shot's, not Carl's
    found = json.loads(run("review", shot, carl, "--json")[1])
    assert [f["layer"] for f in found["findings"] if f["name"] == "HiddenEdit"] == ["look_anna.usda"]
    np.testing.assert_allclose(found["edits"][0]["before"], (0.3784995, 0.01392, 0.01392), atol=1e-5)  # Anna's
    assert json.loads(run("info", shot, "--json")[1])["findings"] == found["findings"]


def test_what_usdslf_said_and_a_person_rewrote_is_no_reason_to_fail(shot_and_look: tuple[Path, Path], run: Run) -> None:
    shot, look = shot_and_look
    text = look.read_text()
    for of, into in (
        ("double residualAfter = ", "string residualAfter = \"\" # "),
        ("string shot = ", "double shot = 3 # "),
        ("string[] written = ", "string written = \"x\" # "),
        ("dictionary after", "string after = \"\"\ndictionary more"),
        ("color3f inputs:diffuseColor = ", "mystery inputs:diffuseColor = "),
    ):
        assert of in text
        look.write_text(text.replace(of, into))
        code, out, err = run("review", shot, look)
        assert (code in (0, 1) and "findings:" in out) or (code == 2 and err.count("\n") == 1), (into, err)
        assert "internal error" not in err


def test_what_is_wrong_with_the_shot_is_no_error_of_what_the_look_makes_of_it(tmp_path: Path) -> None:
    """A varname as a token: so in the shot's Material, and so in the one that a look makes of it."""
    stage = new_shot(tmp_path)
    reader = UsdShade.Shader.Define(stage, "/World/mtl/red/uv")
    reader.CreateIdAttr("UsdPrimvarReader_float2")
    reader.CreateInput("varname", Sdf.ValueTypeNames.Token).Set("st")
    stage.GetRootLayer().Save()
    author(stage, tmp_path, change_of(stage, "/World/ball", "diffuse", (0.1, 0.4, 0.2)), mode="new")
    look = tmp_path / "look.usda"
    assert review_look(tmp_path / "shot.usda", look, None).validator_errors == ()
    layer = Sdf.Layer.FindOrOpen(str(look))
    spec = Sdf.CreatePrimInLayer(layer, "/World/mtl/grey/uv")
    spec.specifier, spec.typeName = Sdf.SpecifierDef, "Shader"
    id_ = Sdf.AttributeSpec(spec, "info:id", Sdf.ValueTypeNames.Token, Sdf.VariabilityUniform)
    id_.default = "UsdPrimvarReader_float2"
    Sdf.AttributeSpec(spec, "inputs:varname", Sdf.ValueTypeNames.Token).default = "st"
    layer.Save()
    errors = review_look(tmp_path / "shot.usda", look, None).validator_errors
    assert errors and all("/World/mtl/grey/uv" in e for e in errors)
