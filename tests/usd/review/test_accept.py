"""Accept and toggle: seen by plain USD, over referenced, instanced and locally authored materials."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from kit.look_stages import author, change_of, shown
from kit.reviewed_looks import ORM, PACKED, RED, composed, write_look, write_shot
from pxr import Sdf, Usd

from usdslf.edits.baked_texture import Baked
from usdslf.errors import InputError
from usdslf.textures.images import write_image
from usdslf.usd.review.accept import Wish, accept_look, shared_strokes
from usdslf.usd.review.review import review_look
from usdslf.usd.review.toggle import toggle

Run = Callable[..., tuple[int, str, str]]


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    write_look(tmp_path)
    return tmp_path


def accept(folder: Path, **wish: tuple[str, ...]) -> dict[str, str]:
    accept_look(folder / "shot.usda", folder / "look.usda", folder / "accepted.usda", Wish(**wish))
    return composed(folder, "accepted.usda")


def names(folder: Path) -> set[str]:
    return {t for e in review_look(folder / "shot.usda", folder / "look.usda", None).edits for t in e.targets}


def test_a_look_says_of_each_opinion_what_it_is_for(folder: Path) -> None:
    inputs = {f"{RED}.inputs:diffuseColor", f"{RED}.inputs:roughness", f"{PACKED}.inputs:roughness"}
    assert names(folder) == inputs | {"/World/one/mtl/paint.inputs:diffuseColor"}


def test_all_is_the_look_and_none_is_the_shot(folder: Path) -> None:
    before = (folder / "look.usda").read_bytes()
    look, shot = composed(folder), composed(folder, "")
    assert look != shot
    assert accept(folder) == look
    assert accept(folder, but=tuple(names(folder))) == shot
    assert accept(folder, only=tuple(names(folder))) == look
    assert (folder / "look.usda").read_bytes() == before


@pytest.mark.parametrize("name", ["stroke_0004", "/World/one/mtl/paint", "/World/one/mtl/paint.inputs:diffuseColor"])
def test_halves_by_stroke_material_and_input_are_what_they_say(folder: Path, name: str) -> None:
    look, shot = composed(folder), composed(folder, "")
    without, alone = accept(folder, but=(name,)), accept(folder, only=(name,))
    of = {p for p in look if p.startswith("/World/one") and look[p] != shot.get(p)}
    assert of
    assert {p: without.get(p) for p in of} == {p: shot.get(p) for p in of}
    assert {p: without[p] for p in look.keys() & without.keys() - of} == {
        p: look[p] for p in look.keys() & without.keys() - of
    }
    assert {p: alone[p] for p in of} == {p: look[p] for p in of}
    rest = {p for p in shot if not p.startswith("/World/one")}
    assert {p: alone[p] for p in rest} == {p: shot[p] for p in rest}


def test_one_input_of_a_material(folder: Path) -> None:
    found = accept(folder, but=(f"{RED}.inputs:roughness",))
    look, shot = composed(folder), composed(folder, "")
    path = f"{RED}/pbr.inputs:"
    assert found[f"{path}roughness"] == shot[f"{path}roughness"]
    assert found[f"{path}diffuseColor"] == look[f"{path}diffuseColor"]
    layer = Sdf.Layer.FindOrOpen(str(folder / "accepted.usda"))
    assert layer.GetPrimAtPath(RED).customData["usdslf"]["inferred"] == "diffuse"
    assert list(layer.customLayerData["usdslf"]["accepted"]["leftOut"]) == [f"{RED}.inputs:roughness"]


def test_a_narrow_name_overrules_a_wide_one(folder: Path) -> None:
    done = accept_look(
        folder / "shot.usda", folder / "look.usda", folder / "accepted.usda",
        Wish(said={RED: False, f"{RED}.inputs:roughness": True}),
    )  # fmt: skip
    assert f"{RED}.inputs:diffuseColor" in done.left_out and f"{RED}.inputs:roughness" in done.kept


def test_a_stroke_that_asks_with_another_stays_and_that_is_said(folder: Path) -> None:
    done = accept_look(
        folder / "shot.usda", folder / "look.usda", folder / "accepted.usda", Wish(but=("stroke_0001",))
    )
    assert not done.left_out and any("stroke_0001, which asked together with" in w for w in done.warnings)
    done = accept_look(
        folder / "shot.usda", folder / "look.usda", folder / "accepted.usda", Wish(but=("stroke_0001", "stroke_0002"))
    )
    assert set(done.left_out) == {f"{RED}.inputs:diffuseColor", f"{RED}.inputs:roughness"}


def test_strokes_that_only_another_solve_can_leave_out_are_named(folder: Path) -> None:
    def left(**wish: tuple[str, ...]) -> list[tuple[str, tuple[str, ...]]]:
        found = shared_strokes(folder / "shot.usda", folder / "look.usda", Wish(**wish))
        return [(x.stroke, x.others) for x in found]

    one, two = "/SlfStrokes/stroke_0001", "/SlfStrokes/stroke_0002"
    assert left(but=("stroke_0001",)) == left(only=("stroke_0002",)) == [(one, (two,))]
    assert left(but=("stroke_0001", "/World/other")) == [(one, (two,))]  # one gprim of two
    for wish in ({}, {"only": (RED,)}, {"but": ("stroke_0001", RED)}, {"but": ("stroke_0001", "stroke_0002")}):
        assert left(**wish) == []
    assert left(but=("stroke_0003",)) == []
    with pytest.raises(InputError, match="nothing for stroke_0009"):
        left(but=("stroke_0009",))


def test_one_gprim_of_two_that_share_a_material(folder: Path) -> None:
    accept(folder, but=("/World/other",))
    stage = Usd.Stage.CreateInMemory()
    stage.GetRootLayer().subLayerPaths = [str(folder / "accepted.usda"), str(folder / "shot.usda")]
    plain = Usd.Stage.Open(str(folder / "shot.usda"))
    full = Usd.Stage.CreateInMemory()
    full.GetRootLayer().subLayerPaths = [str(folder / "look.usda"), str(folder / "shot.usda")]
    assert shown(stage, "/World/other") == shown(plain, "/World/other")
    assert shown(stage, "/World/ball") == shown(full, "/World/ball") != shown(plain, "/World/ball")
    assert not [f for f in review_look(folder / "shot.usda", folder / "accepted.usda", None).findings]


def test_what_nothing_is_for_is_refused(folder: Path) -> None:
    with pytest.raises(InputError, match=r"nothing for /World/gone; name one of: "):
        accept(folder, but=("/World/gone",))
    with pytest.raises(InputError, match="the look itself"):
        accept_look(folder / "shot.usda", folder / "look.usda", folder / "look.usda")


def test_paths_hold_in_another_folder(folder: Path) -> None:
    (folder / "elsewhere").mkdir()
    accept_look(folder / "shot.usda", folder / "look.usda", folder / "elsewhere" / "accepted.usda")
    data = Sdf.Layer.FindOrOpen(str(folder / "elsewhere" / "accepted.usda")).customLayerData["usdslf"]
    assert data["shot"] == "../shot.usda"
    assert not review_look(folder / "shot.usda", folder / "elsewhere" / "accepted.usda", None).findings


def baked_look(folder: Path) -> list[Path]:
    """A look with a baked texture on each of two materials."""
    stage = write_shot(folder)
    files, changes = [], []
    for prim, digit in (("/World/ball", "a"), ("/World/crate", "b")):
        file = folder / "look.textures" / f"map_{digit * 12}.exr"
        file.parent.mkdir(exist_ok=True)
        files.append(write_image(file, np.full((2, 2, 1), 0.3)))
        baked = Baked(str(file), "raw", "r", (0.5,), (0.3,), (0.3,) * 4, "repeat", "repeat", "st", 4)
        name = "ior" if prim == "/World/crate" else "roughness"
        changes.append(replace(change_of(stage, prim, "glossiness"), freed=(), baked={name: baked}))
    author(stage, folder, *changes)
    return files


def test_only_textures_that_are_needed_are_carried(tmp_path: Path) -> None:
    files = baked_look(tmp_path)
    shot, look, out = (tmp_path / n for n in ("shot.usda", "look.usda", "accepted.usda"))
    done = accept_look(shot, look, out)
    assert [Path(t).name for t in done.textures] == [f.name for f in files]
    assert not review_look(shot, out, None).findings and all(f.is_file() for f in files)
    done = accept_look(shot, look, out, Wish(but=(PACKED,)))
    assert [p.name for p in (tmp_path / "accepted.textures").iterdir()] == [files[0].name]
    assert len(done.textures) == 1 and all(f.is_file() for f in files)
    accept_look(shot, look, out, Wish(but=(PACKED, RED)))
    assert not (tmp_path / "accepted.textures").exists()
    assert composed(tmp_path, "accepted.usda") == composed(tmp_path, "")


# ---- verdict files --------------------------------------------------------------------------------
def test_a_verdict_is_executed_and_one_of_another_look_is_refused(folder: Path, run: Run) -> None:
    look, verdict, out = (folder / n for n in ("look.usda", "look.verdict.json", "accepted.usda"))
    said = [{"target": f"{RED}.inputs:roughness", "verdict": "reject", "note": "too sharp"}]
    digest = hashlib.sha256(look.read_bytes()).hexdigest()
    values = {"look": "look.usda", "lookHash": digest, "by": "Ada", "verdicts": said}
    verdict.write_text(json.dumps(values))
    code, done, err = run("accept", folder / "shot.usda", look, "-o", out, "--verdict", verdict)
    assert code == 0, err
    assert f"left out: {RED}.inputs:roughness" in done
    accepted = Sdf.Layer.FindOrOpen(str(out)).customLayerData["usdslf"]["accepted"]
    assert (accepted["by"], accepted["verdict"]) == ("Ada", "look.verdict.json")
    verdict.write_text(json.dumps(values | {"lookHash": "0" * 64}))
    code, _, err = run("accept", folder / "shot.usda", look, "-o", out, "--verdict", verdict)
    assert code == 2 and "a verdict of another state" in err
    for broken in ("{", "[]", '{"verdicts": [{"target": 3, "verdict": "accept"}]}', '{"verdicts": 1}'):
        verdict.write_text(broken)
        code, _, err = run("accept", folder / "shot.usda", look, "-o", out, "--verdict", verdict)
        assert code == 2 and "is no verdict" in err, broken


# ---- toggle ----------------------------------------------------------------------------------------
@pytest.mark.parametrize(
    "name", [RED, f"{RED}.inputs:roughness", "/World/one/mtl/paint", f"{PACKED}.inputs:roughness", "stroke_0004", ORM]
)
def test_off_is_accept_without_it_and_on_brings_the_same_bytes_back(folder: Path, name: str) -> None:
    look = folder / "look.usda"
    before, full = look.read_bytes(), composed(folder)
    without = accept(folder, but=(name,))
    toggle(look, [name], on=False)
    assert composed(folder) == without != full
    review = review_look(folder / "shot.usda", look, None)
    assert not review.findings and any(e.is_off for e in review.edits)
    toggle(look, [name], on=True)
    assert look.read_bytes() == before


def test_all_off_is_the_shot_and_they_come_back_one_by_one(folder: Path, run: Run) -> None:
    look, every = folder / "look.usda", sorted(names(folder))
    before = look.read_bytes()
    assert run("toggle", look, "--off", *every)[0] == 0
    assert composed(folder) == composed(folder, "")
    for name in reversed(every):
        code, out, err = run("toggle", look, "--on", name)
        assert code == 0 and "on: " in out, err
    assert look.read_bytes() == before
