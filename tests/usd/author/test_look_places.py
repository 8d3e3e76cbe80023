"""Every kind of place that a material can be in: the right gprims change, no others, and the look says which.

| place | test |
| --- | --- |
| shader, interface input, node graph, reference, payload, class, scope of another layer | `test_one_material...` |
| shared material, by mode | `test_modes_on_a_shared_material` |
| variant | `test_a_variant_keeps_the_others_as_they_are`, `test_a_binding_of_a_variant...` |
| instance, nested instance | test_look_instances.py, test_author_scopes.py |
| PointInstancer | test_look_instances.py, test_author_scopes.py |
| GeomSubset | `test_a_subset_alone_changes` |
| binding for preview, full, all purposes | test_author_scopes.py, test_hidden_looks.py |
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from kit.look_stages import (
    F,
    add_material,
    add_quads,
    as_reflectance,
    author,
    bind,
    compose,
    new_stage,
    shown,
)
from kit.red_balls import GREEN, RED, assert_changes, ball, changed, green, red
from pxr import Gf, Sdf, Usd, UsdGeom, UsdShade, Vt

from usdslf.edits.edits import MaterialChange
from usdslf.surfaces.surface_points import evaluate_surface
from usdslf.usd.read.read import read_scene
from usdslf.usd.review.validate import validate as find_wrong


# ---- one material, wherever its value comes from --------------------------------------------------------
def in_the_shader(stage: Usd.Stage, folder: Path) -> str:
    bind(stage.GetPrimAtPath("/World/ball"), red(stage, "/World/mtl/red"))
    return "/World/mtl/red/pbr.inputs:diffuseColor"


def in_the_interface(stage: Usd.Stage, folder: Path) -> str:
    material = red(stage, "/World/mtl/red")
    tint = material.CreateInput("tint", F.Color3f)
    tint.Set(Gf.Vec3f(*RED))
    UsdShade.Shader(stage.GetPrimAtPath("/World/mtl/red/pbr")).GetInput("diffuseColor").ConnectToSource(tint)
    bind(stage.GetPrimAtPath("/World/ball"), material)
    return "/World/mtl/red.inputs:tint"


def in_a_node_graph(stage: Usd.Stage, folder: Path) -> str:
    material = UsdShade.Material.Define(stage, "/World/mtl/red")
    graph = UsdShade.NodeGraph.Define(stage, "/World/mtl/red/graph")
    shader = UsdShade.Shader.Define(stage, "/World/mtl/red/graph/pbr")
    shader.CreateIdAttr("UsdPreviewSurface")
    tint = graph.CreateInput("tint", F.Color3f)
    tint.Set(Gf.Vec3f(*RED))
    shader.CreateInput("diffuseColor", F.Color3f).ConnectToSource(tint)
    out = graph.CreateOutput("surface", F.Token)
    out.ConnectToSource(shader.CreateOutput("surface", F.Token))
    material.CreateSurfaceOutput().ConnectToSource(out)
    bind(stage.GetPrimAtPath("/World/ball"), material)
    return "/World/mtl/red/graph.inputs:tint"


def of_an_asset(stage: Usd.Stage, folder: Path, is_payload: bool) -> str:
    asset = new_stage(folder / "asset.usda")
    ball(asset, "/World/ball", red(asset, "/World/mtl/red"))
    asset.GetRootLayer().Save()
    stage.RemovePrim("/World/ball")
    prim = stage.DefinePrim("/World/asset")
    (prim.GetPayloads().AddPayload if is_payload else prim.GetReferences().AddReference)("./asset.usda")
    return "/World/asset/mtl/red/pbr.inputs:diffuseColor"


def in_a_reference(stage: Usd.Stage, folder: Path) -> str:
    return of_an_asset(stage, folder, False)


def in_a_payload(stage: Usd.Stage, folder: Path) -> str:
    return of_an_asset(stage, folder, True)


def in_a_class(stage: Usd.Stage, folder: Path) -> str:
    stage.CreateClassPrim("/_class_red")
    add_material(stage, "/_class_red", diffuseColor=Gf.Vec3f(*RED)).GetPrim().SetSpecifier(Sdf.SpecifierClass)
    for name in ("red", "other_red"):
        UsdShade.Material.Define(stage, f"/World/mtl/{name}").GetPrim().GetInherits().AddInherit("/_class_red")
        holder = "ball" if name == "red" else "stranger"
        bind(stage.GetPrimAtPath(f"/World/{holder}"), UsdShade.Material(stage.GetPrimAtPath(f"/World/mtl/{name}")))
    return "/World/mtl/red/pbr.inputs:diffuseColor"


def in_a_scope_of_another_layer(stage: Usd.Stage, folder: Path) -> str:
    """Materials in a scope beside the shot's root, in a sublayer; the shader lies outside of its material."""
    layer = Usd.Stage.CreateNew(str(folder / "materials.usda"))
    material = UsdShade.Material.Define(layer, "/Looks/red")
    shader = UsdShade.Shader.Define(layer, "/Looks/shaders/red_pbr")
    shader.CreateIdAttr("UsdPreviewSurface")
    shader.CreateInput("diffuseColor", F.Color3f).Set(Gf.Vec3f(*RED))
    material.CreateSurfaceOutput().ConnectToSource(shader.CreateOutput("surface", F.Token))
    UsdGeom.Scope.Define(layer, "/Looks")
    layer.GetRootLayer().Save()
    stage.GetRootLayer().subLayerPaths.append("./materials.usda")
    bind(stage.GetPrimAtPath("/World/ball"), UsdShade.Material(stage.GetPrimAtPath("/Looks/red")))
    return "/Looks/shaders/red_pbr.inputs:diffuseColor"


PLACES = [in_the_shader, in_the_interface, in_a_node_graph, in_a_reference, in_a_payload, in_a_class,
          in_a_scope_of_another_layer]  # fmt: skip


@pytest.mark.parametrize("place", PLACES, ids=lambda f: f.__name__)
def test_one_material_changes_where_its_value_comes_from(tmp_path: Path, place: Any) -> None:
    stage = new_stage(tmp_path / "shot.usda")
    ball(stage, "/World/ball")
    ball(stage, "/World/stranger", red(stage, "/World/mtl/stranger"))
    at = place(stage, tmp_path)
    painted = "/World/asset/ball" if stage.GetPrimAtPath("/World/asset") else "/World/ball"
    assert_changes(stage, tmp_path, {painted}, green(stage, painted))
    layer = Sdf.Layer.FindOrOpen(str(tmp_path / "look.usda"))
    paths: list[Sdf.Path] = []
    layer.Traverse("/", paths.append)
    assert [str(p) for p in paths if p.IsPropertyPath()] == [at]


# ---- shared materials -----------------------------------------------------------------------------------
@pytest.mark.parametrize("scope", ["material", "prim"])
@pytest.mark.parametrize("mode", ["", "override", "new"])
def test_modes_on_a_shared_material(tmp_path: Path, mode: str, scope: str) -> None:
    stage = new_stage(tmp_path / "shot.usda")
    shared = red(stage, "/World/mtl/red")
    for name in "abc":
        ball(stage, f"/World/{name}", shared)
    is_all = mode == "override" or (mode == "" and scope == "material")
    expected = {f"/World/{n}" for n in ("abc" if is_all else "a")}
    assert_changes(stage, tmp_path, expected, green(stage, "/World/a", scope=scope), mode=mode)
    assert bool(compose(tmp_path).GetPrimAtPath("/World/mtl/SlfMaterials/red_a")) != is_all


def test_a_new_material_is_made_even_where_all_of_its_users_are_painted(tmp_path: Path) -> None:
    stage = new_stage(tmp_path / "shot.usda")
    ball(stage, "/World/a", red(stage, "/World/mtl/red"))
    assert_changes(stage, tmp_path, {"/World/a"}, green(stage, "/World/a"), mode="new")
    review = compose(tmp_path)
    assert review.GetAttributeAtPath("/World/mtl/red/pbr.inputs:diffuseColor").Get() == Gf.Vec3f(*RED)


def test_a_subset_alone_changes(tmp_path: Path) -> None:
    stage = new_stage(tmp_path / "shot.usda")
    row = add_quads(stage, "/World/row")
    bind(row.GetPrim(), red(stage, "/World/mtl/red"))
    part = UsdShade.MaterialBindingAPI(row).CreateMaterialBindSubset("part", Vt.IntArray([2, 3]))
    UsdShade.MaterialBindingAPI(row).SetMaterialBindSubsetsFamilyType(UsdGeom.Tokens.nonOverlapping)
    bind(part.GetPrim(), red(stage, "/World/mtl/part"))
    assert_changes(stage, tmp_path, {"/World/row/part"}, green(stage, "/World/row/part", targets=("/World/row",)))


# ---- variants -------------------------------------------------------------------------------------------
def variants(folder: Path) -> Usd.Stage:
    """A referenced asset whose variants give one shader other values, and bind other materials."""
    asset = new_stage(folder / "asset.usda")
    root = asset.GetPrimAtPath("/World")
    ball(asset, "/World/ball", red(asset, "/World/mtl/red"))
    for name in ("one", "two"):
        red(asset, f"/World/mtl/{name}")
    ball(asset, "/World/box")
    colors, bindings = (root.GetVariantSets().AddVariantSet(n) for n in ("colour", "binding"))
    for i, name in enumerate(("one", "two")):
        for group in (colors, bindings):
            group.AddVariant(name)
            group.SetVariantSelection(name)
        with colors.GetVariantEditContext():
            color = asset.GetAttributeAtPath("/World/mtl/red/pbr.inputs:diffuseColor")
            color.Set(Gf.Vec3f(0.5, 0.1 * i, 0.3))
        with bindings.GetVariantEditContext():
            bind(asset.GetPrimAtPath("/World/box"), UsdShade.Material(asset.GetPrimAtPath(f"/World/mtl/{name}")))
    # A value in the shader itself would be stronger than those in its variants.
    asset.GetRootLayer().GetAttributeAtPath("/World/mtl/red/pbr.inputs:diffuseColor").ClearDefaultValue()
    asset.GetRootLayer().Save()
    stage = new_stage(folder / "shot.usda")
    prim = stage.DefinePrim("/World/asset")
    prim.GetReferences().AddReference("./asset.usda")
    ball(stage, "/World/stranger", red(stage, "/World/mtl/red"))
    choose(stage, "one")
    stage.GetRootLayer().Save()
    return stage


def choose(stage: Usd.Stage, name: str) -> None:
    for group in ("colour", "binding"):
        stage.GetPrimAtPath("/World/asset").GetVariantSet(group).SetVariantSelection(name)


@pytest.mark.parametrize("is_instance", [False, True])
def test_a_variant_keeps_the_others_as_they_are(tmp_path: Path, is_instance: bool) -> None:
    stage = variants(tmp_path)
    stage.GetPrimAtPath("/World/asset").SetInstanceable(is_instance)
    said: list[str] = []
    assert_changes(stage, tmp_path, {"/World/asset/ball"}, green(stage, "/World/asset/ball"), warnings=said)
    assert ["colour=one of /World/asset only" in w for w in said] == [True]
    review = compose(tmp_path)
    for each in (stage, review):
        each.SetEditTarget(each.GetSessionLayer())
        choose(each, "two")
    assert changed(stage, review) == set()
    assert shown(review, "/World/asset/ball")["d"] == pytest.approx((0.5, 0.1, 0.3))


def test_a_binding_of_a_variant_is_replaced_in_this_variant_only(tmp_path: Path) -> None:
    stage = variants(tmp_path)
    change = green(stage, "/World/asset/box")
    assert_changes(stage, tmp_path, {"/World/asset/box"}, change, mode="new")
    review = compose(tmp_path)
    for each in (stage, review):
        each.SetEditTarget(each.GetSessionLayer())
        choose(each, "two")
    assert changed(stage, review) == set()
    assert find_wrong(review, None) == []


def test_an_edit_in_a_variant_goes_when_it_is_solved_again(tmp_path: Path) -> None:
    stage = variants(tmp_path)
    author(stage, tmp_path, green(stage, "/World/asset/ball"))
    author(stage, tmp_path)
    layer = Sdf.Layer.FindOrOpen(str(tmp_path / "look.usda"))
    assert not layer.GetPrimAtPath("/World/asset") and changed(stage, compose(tmp_path)) == set()


def test_a_material_that_references_another_changes_along_and_is_named(tmp_path: Path) -> None:
    stage = new_stage(tmp_path / "shot.usda")
    ball(stage, "/World/a", red(stage, "/World/mtl/red"))
    copied = UsdShade.Material.Define(stage, "/World/mtl/copied")
    copied.GetPrim().GetReferences().AddInternalReference("/World/mtl/red")
    ball(stage, "/World/b", copied)
    said: list[str] = []
    assert_changes(stage, tmp_path, {"/World/a", "/World/b"}, green(stage, "/World/a"), warnings=said)
    assert said == ["/World/mtl/copied take their values from /World/mtl/red by reference, and change with it"]
    said.clear()
    assert_changes(stage, tmp_path, {"/World/a"}, green(stage, "/World/a"), mode="new", warnings=said)
    assert said == []


@pytest.mark.parametrize("is_shared", [False, True])
def test_a_texture_that_cannot_be_read_takes_the_change_as_its_fallback(tmp_path: Path, is_shared: bool) -> None:
    """Scale and bias do not act on a fallback."""
    stage = new_stage(tmp_path / "shot.usda")
    material = red(stage, "/World/mtl/red")
    texture = UsdShade.Shader.Define(stage, "/World/mtl/red/tex")
    texture.CreateIdAttr("UsdUVTexture")
    texture.CreateInput("file", F.Asset).Set("./gone.exr")
    texture.CreateInput("fallback", F.Float4).Set(Gf.Vec4f(0.5, 0.4, 0.3, 0.7))
    shader = UsdShade.Shader(stage.GetPrimAtPath("/World/mtl/red/pbr"))
    shader.GetInput("diffuseColor").ConnectToSource(texture.CreateOutput("rgb", F.Float3))
    if is_shared:
        shader.CreateInput("emissiveColor", F.Color3f).ConnectToSource(texture.GetOutput("rgb"))
    ball(stage, "/World/ball", material)
    stage.GetRootLayer().Save()
    scene = read_scene(stage)
    (found,) = scene.materials
    before, after = as_reflectance(diffuseColor=(0.5, 0.4, 0.3)), as_reflectance(diffuseColor=GREEN)
    said: list[str] = []
    change = MaterialChange(found, "material", ("/World/ball",), ("diffuse",), before, after)
    (edit,) = author(stage, tmp_path, change, warnings=said)
    assert edit.wins and edit.attribute == "inputs:fallback" and any("shows its fallback" in w for w in said)
    points = [evaluate_surface(s, [0], [(0.3, 0.3)]) for s in (scene, read_scene(compose(tmp_path)))]
    assert points[1].diffuse[0] == pytest.approx(GREEN, rel=1e-5)
    assert points[1].emission[0] == pytest.approx(points[0].emission[0])
    assert points[1].opacity[0] == points[0].opacity[0]
