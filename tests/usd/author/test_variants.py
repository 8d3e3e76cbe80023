"""Alternatives that travel: each selection shows, by plain USD, wherever the material comes from."""

from __future__ import annotations

from pathlib import Path

import pytest
from kit.look_stages import author, change_of, shown
from kit.reviewed_looks import RED, composed, write_shot
from pxr import Sdf, Usd

from usdslf.edits.edits import MaterialChange
from usdslf.errors import InputError
from usdslf.usd.author.variants import AS_IT_WAS, variants_in
from usdslf.usd.layer.shown_paths import ALTERNATIVES
from usdslf.usd.review.accept import Wish, accept_look
from usdslf.usd.review.review import review_look

COLOR, F0, ROUGH = (0.1, 0.4, 0.3), (0.3, 0.25, 0.2), 0.15
PLACES = {"local": "/World/ball", "instance": "/World/one/body", "reference": "/World/three/body"}


def explanations(stage: Usd.Stage, prim: str, **more: object) -> list[MaterialChange]:
    return [
        change_of(stage, prim, "diffuse", COLOR, **more),
        change_of(stage, prim, "specular", f0=F0, **more),
        change_of(stage, prim, "glossiness", roughness=ROUGH, **more),
    ]


def write(folder: Path, prim: str) -> tuple[Usd.Stage, list]:
    stage = write_shot(folder)
    best, *rivals = explanations(stage, prim, targets=_users(prim))
    return stage, author(stage, folder, best, rivals={0: rivals})


def _users(prim: str) -> tuple[str, ...]:
    return ("/World/ball", "/World/other") if prim == "/World/ball" else (prim,)


def select(folder: Path, name: str) -> Usd.Stage:
    """What any program does: another selection, in a layer over look and shot."""
    root = Sdf.Layer.CreateAnonymous(".usda")
    root.subLayerPaths = [str(folder / "look.usda"), str(folder / "shot.usda")]
    stage = Usd.Stage.Open(root)
    (material,) = variants_in(Sdf.Layer.FindOrOpen(str(folder / "look.usda")))
    assert stage.GetPrimAtPath(material).GetVariantSet(ALTERNATIVES).SetVariantSelection(name)
    return stage


@pytest.mark.parametrize("place", list(PLACES))
def test_each_selection_shows_on_what_is_local_instanced_and_referenced(tmp_path: Path, place: str) -> None:
    prim = PLACES[place]
    stage, edits = write(tmp_path, prim)
    plain = shown(stage, prim)
    assert all(e.wins for e in edits) and edits
    names = next(iter(variants_in(Sdf.Layer.FindOrOpen(str(tmp_path / "look.usda"))).values()))
    assert names[0] == "diffuse" and sorted(names) == sorted(["diffuse", "specular", "glossiness", AS_IT_WAS])
    for user in _users(prim):
        seen = {name: shown(select(tmp_path, name), user) for name in names}
        assert seen[AS_IT_WAS] == plain
        assert seen["diffuse"]["d"] == pytest.approx(COLOR, abs=1e-4)
        assert seen["diffuse"]["f0"] == pytest.approx(plain["f0"], abs=1e-4)
        assert seen["specular"]["f0"] == pytest.approx(F0, abs=1e-3)
        assert seen["glossiness"]["roughness"] == pytest.approx(ROUGH, abs=1e-5)
        assert seen["glossiness"]["d"] == pytest.approx(plain["d"], abs=1e-5)
    # Nothing else shows anything else.
    everything = {"/World/ball", "/World/crate", *(f"/World/{n}/body" for n in ("one", "two", "three"))}
    others = everything - {*_users(prim)}
    for other in others:
        assert shown(select(tmp_path, "specular"), other) == shown(stage, other)


def test_a_material_that_follows_the_shot_still_does(tmp_path: Path) -> None:
    """What no alternative says is the shot's, also when the shot changes."""
    write(tmp_path, "/World/ball")
    shot = Sdf.Layer.FindOrOpen(str(tmp_path / "shot.usda"))
    shot.GetAttributeAtPath(f"{RED}/pbr.inputs:roughness").default = 0.77
    assert shown(select(tmp_path, "diffuse"), "/World/ball")["roughness"] == pytest.approx(0.77)


def test_one_of_them_is_left_by_choose(tmp_path: Path) -> None:
    write(tmp_path, "/World/ball")
    shot, look, out = (tmp_path / n for n in ("shot.usda", "look.usda", "accepted.usda"))
    accept_look(shot, look, out, Wish(choose={"stroke_0001": "specular"}))
    layer = Sdf.Layer.FindOrOpen(str(out))
    assert ALTERNATIVES not in out.read_text() and not variants_in(layer)
    seen, wanted = composed(tmp_path, "accepted.usda"), select(tmp_path, "specular")
    (path,) = [p for p in seen if p.endswith("inputs:specularColor")]
    assert seen[path].split(" <")[0].strip() == str(wanted.GetAttributeAtPath(path).Get())
    assert not review_look(shot, out, None).findings
    with pytest.raises(InputError, match="no alternative sheen; choose from diffuse"):
        accept_look(shot, look, out, Wish(choose={RED: "sheen"}))
    with pytest.raises(InputError, match="no alternatives for /World/mtl/packed"):
        accept_look(shot, look, out, Wish(choose={"/World/mtl/packed": "diffuse"}))


def test_a_review_shows_the_selected_one(tmp_path: Path) -> None:
    write(tmp_path, "/World/ball")
    found = review_look(tmp_path / "shot.usda", tmp_path / "look.usda", None)
    assert [m.inferred for m in found.materials] == ["diffuse"] and not found.findings
    assert {g.path for g in found.gprims} == {"/World/ball", "/World/other"}
