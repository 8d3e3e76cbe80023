"""What the kinds of jobs find: answers elsewhere, why an answer is another one, an accepted look on other shots."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from kit.batch_shots import write_look, write_manifest, write_shot
from kit.joint_shots import AFTER, BEFORE, LAMPS, painted, ring, write_asset
from kit.joint_shots import write_shot as write_lit
from kit.stage_textures import write_image
from pxr import Gf, Sdf, Usd, UsdShade

import usdslf
from usdslf.batch import collect, plan, run_job
from usdslf.batch.changed import what_changed
from usdslf.batch.elsewhere import prefer_what_holds, score_elsewhere
from usdslf.batch.identity import identity_of
from usdslf.batch.sheet import FOUND, PLAIN
from usdslf.color import USD_DEFAULT_SPACE, color_of
from usdslf.errors import InputError
from usdslf.shot import Shot
from usdslf.textures.images import read_image
from usdslf.usd.stroke_layer import read_strokes, write_strokes

COLOR = color_of(None, USD_DEFAULT_SPACE)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    made = tmp_path_factory.mktemp("kinds")
    write_shot(made / "shots/one")
    return made


def test_an_answer_that_is_another_one_says_why(folder: Path) -> None:
    found = plan(write_manifest(folder))
    first = run_job(found.jobs[0])
    stage = folder / "shots/one/stage.usda"
    plain = stage.read_text()
    assert what_changed(first, first).why == () and what_changed(first, first).answers == ()

    stage.write_text(plain.replace("(4, 3.6, 3)", "(2, 1.8, 1.5)"))  # half the light: twice the colour
    dark = what_changed(first, run_job(plan(folder / "batch.toml").jobs[0]))
    assert dark.why == ("light: /World/lamp changed",)
    assert any("diffuse" in a and "became" in a for a in dark.answers), dark.answers

    strokes = read_strokes(folder / "shots/one/strokes.usda")
    for old, new, why in (
        ("roughness = 0.3", "roughness = 0.6", "surface: /World/mtl/floor changed"),
        ("double width = 4", "double width = 5", "asset: /World/floor changed"),
        ('def RectLight "lamp"', 'def RectLight "other"', "light: /World/other is new"),
        ("", "", "strokes: /SlfStrokes/stroke_0001 changed"),
    ):
        stage.write_text(plain.replace(old, new) if old else plain)
        painted_now = strokes if old else [replace(strokes[0], strength=0.5)]
        identity = identity_of(Shot.open(stage, elements=64), painted_now, found.jobs[0].options)
        assert why in what_changed(first, replace(first, values={**first.values, "identity": identity})).why


def test_an_explanation_that_holds_elsewhere_is_preferred_at_a_near_tie(tmp_path: Path) -> None:
    """A darker plane under one lamp may be less specular; a bright sky and a second lamp know that it is not."""
    asset = write_asset(tmp_path, BEFORE)
    home, other = (write_lit(tmp_path / name, asset, LAMPS[name]) for name in ("high", "side"))
    write_image(tmp_path / "sky.exr", np.full((8, 16, 3), 1.0, np.float32))
    stroke = painted(ring("ring4"), LAMPS["high"], AFTER["diffuse"])
    session = usdslf.open(home, elements=64)
    session.add_stroke(stroke)
    session.solve()
    assert session.answers[0].chosen.id == "specular" and "diffuse" in session.answers[0].ties
    scored = score_elsewhere(session.shot, session.solution, [str(tmp_path / "sky.exr"), str(other)])
    assert [s.place for s in scored] == ["sky.exr", "side/shot.usda"] and not any(s.why_not for s in scored)
    for each in scored:
        assert each.chosen == "specular" and each.shares["diffuse"] > each.shares["specular"] + 0.15, each
    assert prefer_what_holds(session.solution, scored, {}) == {"stroke_0001": "diffuse"}
    assert prefer_what_holds(session.solution, scored, {"stroke_0001": "specular"}) == {}
    with pytest.raises(InputError, match="there is no"):
        score_elsewhere(session.shot, session.solution, [str(tmp_path / "none.hdr")])

    write_strokes(tmp_path / "high/strokes.usda", [stroke], Usd.Stage.Open(str(home)))
    more = 'elsewhere = ["sky.exr", "side/shot.usda"]\nprefer_robust = true\n'
    jobs = '[[jobs]]\nshots = ["high/shot.usda"]\nstrokes = ["{dir}/strokes.usda"]\n'
    result = run_job(plan(write_manifest(tmp_path, more=more, jobs=jobs)).jobs[0])
    assert result.values["strokes"][0]["inferred"] == "diffuse"
    assert [e["chosen"] for e in result.values["elsewhere"]] == ["diffuse", "diffuse"]
    assert "../side/shot.usda" in result.inputs and "../sky.exr" in result.inputs


def test_an_accepted_look_goes_over_other_shots(folder: Path) -> None:
    write_shot(folder / "shots/renamed")
    renamed = folder / "shots/renamed/stage.usda"
    renamed.write_text(renamed.read_text().replace('"mtl"', '"materials"').replace("/World/mtl", "/World/materials"))
    write_shot(folder / "shots/hidden")
    hidden = Usd.Stage.Open(str(folder / "shots/hidden/stage.usda"))
    driven = UsdShade.Material(hidden.GetPrimAtPath("/World/mtl/floor")).CreateInput(
        "paint", Sdf.ValueTypeNames.Color3f
    )
    driven.Set(Gf.Vec3f(0.4, 0.3, 0.2))
    UsdShade.Shader(hidden.GetPrimAtPath("/World/mtl/floor/surface")).GetInput("diffuseColor").ConnectToSource(driven)
    hidden.GetRootLayer().Save()
    write_look(folder / "look.usda")
    jobs = '[[jobs]]\nshots = ["shots/*/stage.usda"]\nlook = "look.usda"\nname = "accepted/{folder}"\n'
    found = plan(write_manifest(folder, more="pictures = true\n", jobs=jobs))
    results = {job.name: run_job(job) for job in found.jobs}
    assert results["accepted/one"].findings == ()
    assert any("connection" in f for f in results["accepted/hidden"].findings), results["accepted/hidden"]
    said = " ".join(results["accepted/renamed"].findings)
    assert "the look changes nothing in stage.usda" in said and "It may be /World/materials/floor" in said, said
    review = Usd.Stage.Open(str(found.jobs[1].folder / "review.usda"))
    assert review.GetPrimAtPath("/World/mtl/floor/surface").GetAttribute("inputs:diffuseColor").Get()[0] == 0.5
    before, after = (
        read_image(found.job("accepted/one").folder / f"{n}.png", "raw", COLOR) for n in ("before", "after")
    )
    assert before.shape == (27, 48, 4) and np.abs(before - after).max() > 0.05
    summary = collect(found)
    sheet = read_image(folder / "out/sheet.png", "raw", COLOR)
    below = sheet[-16:].reshape(-1, 4)[:, :3]  # names, of those with findings in their colour
    assert (np.abs(below - FOUND).max(1) < 0.02).any() and (np.abs(below - PLAIN).max(1) < 0.02).any()
    assert sheet.shape[1] > 3 * 2 * 48 and summary.rows[1].pictures == (
        "accepted/one/before.png",
        "accepted/one/after.png",
    )
    assert "accepted/one/before.png" in (folder / "out/index.html").read_text()


def test_a_file_that_changes_while_it_is_read_ends_the_job(tmp_path: Path) -> None:
    """Its result would be named by what it did not read."""
    write_shot(tmp_path / "shots/one")
    found = plan(write_manifest(tmp_path))
    stage = tmp_path / "shots/one/stage.usda"

    def change(step: str, share: float) -> None:
        if step == "solve":
            stage.write_text(stage.read_text() + "# another\n")

    with pytest.raises(InputError, match=r"stage.usda changed while the job one read it; run it again"):
        run_job(found.jobs[0], change)
    assert not list((tmp_path / "out").iterdir())
