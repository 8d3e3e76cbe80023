"""A look that is written again: what usdslf wrote goes, what a person wrote stays and is said."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from kit.look_stages import author, change_of, compose, new_shot, read_inputs, shown
from numpy.testing import assert_allclose
from pxr import Gf, Sdf, Usd

GREEN, BLUE = (0.1, 0.4, 0.2), (0.1, 0.1, 0.5)
RED = "/World/mtl/red/pbr"


@pytest.fixture
def shot(tmp_path: Path) -> Usd.Stage:
    return new_shot(tmp_path)


def look_of(folder: Path) -> Sdf.Layer:
    return Sdf.Layer.FindOrOpen(str(folder / "look.usda"))


def everything(shot: Usd.Stage, **more: Any) -> list:
    """Changes of each kind: an override, a new bound material, and faces of a mesh."""
    return [
        change_of(shot, "/World/ball", "diffuse", GREEN, scope="prim"),
        change_of(
            shot, "/World/row", "glossiness", roughness=0.2, scope="stroke", faces={"/World/row": (1,)}
        ),
        change_of(shot, "/World/other", "specular", f0=(0.2,) * 3),
    ]


@pytest.mark.parametrize("suffix", [".usda", ".usdc"])
def test_no_strokes_leave_nothing_of_ours(shot: Usd.Stage, tmp_path: Path, suffix: str) -> None:
    from usdslf.usd.author.author import author_look

    out = tmp_path / f"look{suffix}"
    author_look(shot, [], out)
    empty = out.read_bytes()
    assert author_look(shot, everything(shot), out)
    assert out.read_bytes() != empty
    warnings: list[str] = []
    author_look(shot, [], out, warnings=warnings)
    assert out.read_bytes() == empty and warnings == []


def test_an_earlier_change_goes_when_another_one_is_solved(shot: Usd.Stage, tmp_path: Path) -> None:
    author(shot, tmp_path, *everything(shot))
    author(shot, tmp_path, change_of(shot, "/World/row", "diffuse", BLUE))
    again = (tmp_path / "look.usda").read_bytes()
    (tmp_path / "look.usda").unlink()
    author(shot, tmp_path, change_of(shot, "/World/row", "diffuse", BLUE))
    assert (tmp_path / "look.usda").read_bytes() == again


def test_all_kinds_of_changes_give_the_same_bytes_each_time(shot: Usd.Stage, tmp_path: Path) -> None:
    written = []
    for again in range(3):
        if again == 2:
            (tmp_path / "look.usda").unlink()
        author(shot, tmp_path, *everything(shot))
        written.append((tmp_path / "look.usda").read_bytes())
    assert written[0] == written[1] == written[2]


def test_a_binding_that_a_person_changed_stays(shot: Usd.Stage, tmp_path: Path) -> None:
    author(shot, tmp_path, *everything(shot))
    layer = look_of(tmp_path)
    binding = layer.GetRelationshipAtPath("/World/ball.material:binding")
    binding.targetPathList.explicitItems = ["/World/mtl/grey"]
    layer.Save()
    warnings: list[str] = []
    author(shot, tmp_path, warnings=warnings)
    assert len(warnings) == 1 and "/World/ball.material:binding" in warnings[0]
    assert "MaterialBindingAPI" in compose(tmp_path).GetPrimAtPath("/World/ball").GetAppliedSchemas()
    api = look_of(tmp_path).GetPrimAtPath("/World/ball").GetInfo("apiSchemas")
    assert "MaterialBindingAPI" in api.GetAddedOrExplicitItems()
    assert shown(compose(tmp_path), "/World/ball") == shown(shot, "/World/row")


def by_hand_on_our_prim(layer: Sdf.Layer) -> str:
    Sdf.AttributeSpec(layer.GetPrimAtPath(RED), "inputs:clearcoat", Sdf.ValueTypeNames.Float).default = 0.7
    return f"{RED}.inputs:clearcoat"


def by_hand_elsewhere(layer: Sdf.Layer) -> str:
    prim = Sdf.CreatePrimInLayer(layer, "/World/mtl/grey/pbr")
    Sdf.AttributeSpec(prim, "inputs:metallic", Sdf.ValueTypeNames.Float).default = 1.0
    return "/World/mtl/grey/pbr.inputs:metallic"


def by_hand_metadata(layer: Sdf.Layer) -> str:
    data = dict(layer.GetPrimAtPath("/World/mtl/red").customData)
    layer.GetPrimAtPath("/World/mtl/red").SetInfo("customData", data | {"mine": "yes"})
    return "/World/mtl/red"


def by_hand_variant(layer: Sdf.Layer) -> str:
    Sdf.CreateVariantInLayer(layer, "/World", "season", "summer")
    return "/World"


@pytest.mark.parametrize(
    "add",
    [by_hand_on_our_prim, by_hand_elsewhere, by_hand_metadata, by_hand_variant],
    ids=lambda f: f.__name__,
)
def test_what_a_person_added_stays_and_is_said(shot: Usd.Stage, tmp_path: Path, add: Any) -> None:
    change = change_of(shot, "/World/ball", "diffuse", GREEN)
    author(shot, tmp_path, change)
    layer = look_of(tmp_path)
    path = add(layer)
    layer.Save()
    with_hand = compose(tmp_path)
    values = [with_hand.GetAttributeAtPath(f"{p}.inputs:{n}").Get() for p, n in
              ((RED, "clearcoat"), ("/World/mtl/grey/pbr", "metallic")) if
              with_hand.GetAttributeAtPath(f"{p}.inputs:{n}")]  # fmt: skip
    for changes, colour in (([change_of(shot, "/World/ball", "diffuse", BLUE)], BLUE), ([], (0.6, 0.2, 0.1))):
        warnings: list[str] = []
        edits = author(shot, tmp_path, *changes, warnings=warnings)
        assert all(e.wins for e in edits)
        assert [path in w and "by hand" in w for w in warnings] == [True]
        review = compose(tmp_path)
        assert_allclose(shown(review, "/World/ball")["d"], colour, rtol=1e-6)
        now = [review.GetAttributeAtPath(f"{p}.inputs:{n}").Get() for p, n in
               ((RED, "clearcoat"), ("/World/mtl/grey/pbr", "metallic")) if
               review.GetAttributeAtPath(f"{p}.inputs:{n}")]  # fmt: skip
        assert now == values
        layer = look_of(tmp_path)
        if add is by_hand_metadata:
            assert set(layer.GetPrimAtPath("/World/mtl/red").customData) == {"mine"} | (
                {"usdslf"} if changes else set()
            )
        if add is by_hand_variant:
            assert layer.GetObjectAtPath("/World{season=summer}")
        first = (tmp_path / "look.usda").read_bytes()
        author(shot, tmp_path, *changes)
        assert (tmp_path / "look.usda").read_bytes() == first


def test_a_value_that_a_person_changed_stays_and_hides_ours(shot: Usd.Stage, tmp_path: Path) -> None:
    author(shot, tmp_path, change_of(shot, "/World/ball", "diffuse+glossiness", GREEN, roughness=0.2))
    layer = look_of(tmp_path)
    layer.GetAttributeAtPath(f"{RED}.inputs:diffuseColor").default = Gf.Vec3f(1, 1, 0)
    layer.Save()
    warnings: list[str] = []
    change = change_of(shot, "/World/ball", "diffuse+glossiness", BLUE, roughness=0.3)
    edits = {e.attribute: e for e in author(shot, tmp_path, change, warnings=warnings)}
    assert not edits["inputs:diffuseColor"].wins and "by hand" in edits["inputs:diffuseColor"].hidden_by
    assert edits["inputs:roughness"].wins
    assert len(warnings) == 1 and f"{RED}.inputs:diffuseColor was changed by hand" in warnings[0]
    inputs = read_inputs(compose(tmp_path), "/World/ball")
    assert_allclose(inputs["diffuseColor"], (1, 1, 0))
    assert inputs["roughness"] == pytest.approx(0.3)


def test_opinions_below_a_new_material_outlive_it(shot: Usd.Stage, tmp_path: Path) -> None:
    """A person tuned the material that usdslf made: it is said even when the material is no more."""
    author(shot, tmp_path, change_of(shot, "/World/ball", "diffuse", GREEN, scope="prim"))
    layer = look_of(tmp_path)
    made = layer.GetPrimAtPath("/World/mtl/SlfMaterials/red_ball/pbr")
    Sdf.AttributeSpec(made, "inputs:ior", Sdf.ValueTypeNames.Float).default = 2.0
    layer.Save()
    author(shot, tmp_path, change_of(shot, "/World/ball", "diffuse", BLUE, scope="prim"))
    inputs = read_inputs(compose(tmp_path), "/World/ball")
    assert inputs["ior"] == 2.0
    assert_allclose(inputs["diffuseColor"], BLUE, rtol=1e-6)
    warnings: list[str] = []
    author(shot, tmp_path, warnings=warnings)
    assert len(warnings) == 1 and "red_ball/pbr.inputs:ior" in warnings[0]
    specs = look_of(tmp_path).GetPrimAtPath("/World/mtl/SlfMaterials/red_ball")
    assert specs.specifier == Sdf.SpecifierOver and not specs.typeName and not specs.hasInheritPaths


def test_a_look_without_a_record_is_a_persons(shot: Usd.Stage, tmp_path: Path) -> None:
    author(shot, tmp_path, change_of(shot, "/World/ball", "diffuse", GREEN))
    layer = look_of(tmp_path)
    layer.customLayerData = {"usdslf": {"version": "0"}}
    layer.Save()
    warnings: list[str] = []
    author(shot, tmp_path, warnings=warnings)
    assert warnings and "by hand" in warnings[0]
    assert_allclose(shown(compose(tmp_path), "/World/ball")["d"], GREEN, rtol=1e-6)


def test_what_another_program_saved_meanwhile_stays(shot: Usd.Stage, tmp_path: Path) -> None:
    author(shot, tmp_path, change_of(shot, "/World/ball", "diffuse", GREEN))
    held = look_of(tmp_path)  # open in this process, as in a viewer
    text = (tmp_path / "look.usda").read_text()
    line = "color3f inputs:diffuseColor"
    assert text.count(line) == 1
    (tmp_path / "look.usda").write_text(text.replace(line, f"float inputs:clearcoat = 0.25\n{line}"))
    warnings: list[str] = []
    author(shot, tmp_path, change_of(shot, "/World/ball", "diffuse", BLUE), warnings=warnings)
    assert len(warnings) == 1 and "inputs:clearcoat" in warnings[0]
    assert held.GetAttributeAtPath(f"{RED}.inputs:clearcoat").default == 0.25
    assert_allclose(held.GetAttributeAtPath(f"{RED}.inputs:diffuseColor").default, BLUE, rtol=1e-6)
