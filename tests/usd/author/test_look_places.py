"""Every kind of place that a material can be in: the right gprims change, no others, and the look says which.

| place | test |
| --- | --- |
| shader, interface input, node graph, reference, payload, class, scope of another layer | `test_one_material...` |
| shared material, by mode | `test_modes_on_a_shared_material` |
| variant | `test_a_variant_keeps_the_others_as_they_are`, `test_a_binding_of_a_variant...` |
| instance, nested instance | `test_rows_of_the_table_of_instances`, test_author.py |
| PointInstancer | `test_prototypes_below_an_over_change_and_are_named`, test_author.py |
| GeomSubset | `test_a_subset_alone_changes` |
| binding for preview, full, all purposes | test_author.py, `test_final_renders_that_do_not_see_it_are_named` |
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
    change_of,
    compose,
    new_stage,
    shown,
    validate,
)
from pxr import Gf, Sdf, Usd, UsdGeom, UsdShade, Vt

from usdslf.edits.edits import MaterialChange
from usdslf.errors import AuthorError
from usdslf.surfaces.surface_points import evaluate_surface
from usdslf.usd.binding import gprims_of, parts_of
from usdslf.usd.layer.wins import why_hidden
from usdslf.usd.read.read import read_scene
from usdslf.usd.review.validate import validate as find_wrong

RED, GREEN = (0.6, 0.2, 0.1), (0.1, 0.4, 0.2)


def ball(stage: Usd.Stage, path: str, material: UsdShade.Material | None = None) -> Usd.Prim:
    made = UsdGeom.Sphere.Define(stage, path)
    made.CreateExtentAttr(Vt.Vec3fArray([Gf.Vec3f(-1, -1, -1), Gf.Vec3f(1, 1, 1)]))
    if material:
        bind(made.GetPrim(), material)
    return made.GetPrim()


def red(stage: Usd.Stage, path: str) -> UsdShade.Material:
    return add_material(stage, path, diffuseColor=Gf.Vec3f(*RED))


def changed(before: Usd.Stage, after: Usd.Stage) -> set[str]:
    """The gprims and GeomSubsets that show another material or other values than before."""
    parts = [p for g in gprims_of(before) for p in parts_of(g)]
    return {str(p.GetPath()) for p in parts if shown(before, str(p.GetPath())) != shown(after, str(p.GetPath()))}


def green(stage: Usd.Stage, prim: str, **more: Any) -> MaterialChange:
    return change_of(stage, prim, "diffuse", GREEN, **more)


def assert_changes(stage: Usd.Stage, folder: Path, expected: set[str], change: MaterialChange, **options: Any) -> None:
    """Exactly these gprims change, each edit wins and lists them, and validators have nothing new to say."""
    stage.GetRootLayer().Save()
    edits = author(stage, folder, change, **options)
    assert edits and all(e.wins and not e.hidden_by and not e.mend for e in edits), edits
    review = compose(folder)
    assert changed(stage, review) == expected
    for prim in expected:
        assert shown(review, prim)["d"] == pytest.approx(GREEN, rel=1e-5)
    for edit in edits:
        assert set(edit.affects) == expected
    assert set(validate(review)) <= set(validate(stage))
    assert find_wrong(review, None) == []
    assert validate(Usd.Stage.Open(str(folder / "look.usda"))) == []


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


# ---- instances: the table of what works ---------------------------------------------------------------------
def instances(folder: Path, with_class: bool = True, several: bool = True) -> Usd.Stage:
    """/World/a and /World/b are instances of an asset of two balls, which inherits a class; /World/c is no instance."""
    asset = Usd.Stage.CreateNew(str(folder / "asset.usda"))
    root = UsdGeom.Xform.Define(asset, "/asset").GetPrim()
    UsdGeom.Scope.Define(asset, "/asset/mtl")
    ball(asset, "/asset/ball", red(asset, "/asset/mtl/red"))
    if several:
        ball(asset, "/asset/other", red(asset, "/asset/mtl/other"))
    if with_class:
        asset.CreateClassPrim("/_class_asset")
        root.GetInherits().AddInherit("/_class_asset")
    asset.GetRootLayer().Save()
    stage = new_stage(folder / "shot.usda")
    for name in "abc":
        prim = stage.DefinePrim(f"/World/{name}", "Xform")
        prim.GetReferences().AddReference("./asset.usda", "/asset")
        prim.SetInstanceable(name != "c")
    stage.GetRootLayer().Save()
    return stage


PBR = "mtl/red/pbr"


def put(layer: Sdf.Layer, prim: str) -> None:
    spec = Sdf.AttributeSpec(Sdf.CreatePrimInLayer(layer, prim), "inputs:diffuseColor", F.Color3f)
    spec.default = Gf.Vec3f(*GREEN)


def over_below_an_instance(look: Sdf.Layer) -> str:
    put(look, f"/World/a/{PBR}")
    return ""


def over_on_the_class(look: Sdf.Layer) -> str:
    put(look, f"/_class_asset/{PBR}")
    return "abc"


def new_class(look: Sdf.Layer) -> str:
    put(look, f"/_class_new/{PBR}")
    look.GetPrimAtPath("/_class_new").specifier = Sdf.SpecifierClass
    Sdf.CreatePrimInLayer(look, "/World/a").inheritPathList.Prepend("/_class_new")
    return "a"


def binding_on_the_instance(look: Sdf.Layer) -> str:
    material = Sdf.CreatePrimInLayer(look, "/World/new_red")
    material.specifier, material.typeName = Sdf.SpecifierDef, "Material"
    material.inheritPathList.Prepend("/World/a/mtl/red")
    put(look, "/World/new_red/pbr")
    prim = Sdf.CreatePrimInLayer(look, "/World/a")
    prim.SetInfo("apiSchemas", Sdf.TokenListOp.Create(prependedItems=["MaterialBindingAPI"]))
    rel = Sdf.RelationshipSpec(prim, "material:binding", custom=False)
    rel.targetPathList.explicitItems = ["/World/new_red"]
    rel.SetInfo("bindMaterialAs", "strongerThanDescendants")
    return "a+"  # all of the instance


def no_instance_any_more(look: Sdf.Layer) -> str:
    put(look, f"/World/a/{PBR}")
    look.GetPrimAtPath("/World/a").instanceable = False
    return "a"


def specializes(look: Sdf.Layer) -> str:
    put(look, f"/_class_new/{PBR}")
    Sdf.CreatePrimInLayer(look, "/World/a").specializesList.Prepend("/_class_new")
    return ""


ROWS = [over_below_an_instance, over_on_the_class, new_class, binding_on_the_instance, no_instance_any_more,
        specializes]  # fmt: skip


@pytest.mark.parametrize("row", ROWS, ids=lambda f: f.__name__)
def test_rows_of_the_table_of_instances(tmp_path: Path, row: Any) -> None:
    """What USD does with each way of changing an instance: the modes below rest on it."""
    stage = instances(tmp_path)
    look = Sdf.Layer.CreateNew(str(tmp_path / "look.usda"))
    who = row(look)
    look.Save()
    expected = {f"/World/{n}/ball" for n in who if n != "+"}
    assert changed(stage, compose(tmp_path)) == expected | ({"/World/a/other"} if "+" in who else set())


@pytest.mark.parametrize(
    ("mode", "scope", "several", "expected"),
    [
        ("", "material", True, {"/World/a/ball"}),
        ("override", "prim", True, {"/World/a/ball"}),
        ("class", "material", True, {"/World/a/ball", "/World/b/ball", "/World/c/ball"}),
        ("new", "prim", True, {"/World/a/ball"}),
        ("new", "prim", False, {"/World/a/ball"}),
    ],
)
def test_modes_in_an_instance(tmp_path: Path, mode: str, scope: str, several: bool, expected: set[str]) -> None:
    stage = instances(tmp_path, several=several)
    assert_changes(stage, tmp_path, expected, green(stage, "/World/a/ball", scope=scope), mode=mode)
    look = Sdf.Layer.FindOrOpen(str(tmp_path / "look.usda"))
    roots = set(look.rootPrims.keys())
    review = compose(tmp_path)
    assert review.GetPrimAtPath("/World/a").IsInstance() and review.GetPrimAtPath("/World/b").IsInstance()
    # A whole instance takes one binding; parameters take a class of their own, or that of the asset.
    whole = mode == "new" and not several
    assert roots == {"World"} | ({"_class_asset"} if mode == "class" else set() if whole else {"_slf_World_a"})
    assert bool(look.GetRelationshipAtPath("/World/a.material:binding")) == whole


def test_an_asset_without_class_says_what_else_to_do(tmp_path: Path) -> None:
    stage = instances(tmp_path, with_class=False)
    with pytest.raises(AuthorError, match="inherit no class: solve with --mode override or --mode new"):
        author(stage, tmp_path, green(stage, "/World/a/ball"), mode="class")


def test_an_opinion_of_the_shot_hides_a_class_and_the_mend_works(tmp_path: Path) -> None:
    stage = instances(tmp_path)
    shader = UsdShade.Shader(stage.GetPrimAtPath(f"/World/c/{PBR}"))
    shader.GetInput("diffuseColor").Set(Gf.Vec3f(0.3, 0.3, 0.3))
    stage.GetRootLayer().Save()
    (edit,) = author(stage, tmp_path, green(stage, "/World/c/ball"), mode="class")
    assert not edit.wins and edit.affects == ()
    assert edit.hidden_by == f"shot.usda at /World/c/{PBR}.inputs:diffuseColor"
    assert "--mode override" in edit.mend
    assert_changes(stage, tmp_path, {"/World/c/ball"}, green(stage, "/World/c/ball"), mode="override")


def test_prototypes_below_an_over_change_and_are_named(tmp_path: Path) -> None:
    stage = new_stage(tmp_path / "shot.usda")
    instancer = UsdGeom.PointInstancer.Define(stage, "/World/many")
    stage.OverridePrim("/World/many/protos")
    inside = ball(stage, "/World/many/protos/ball", red(stage, "/World/mtl/red"))
    instancer.CreatePrototypesRel().AddTarget(inside.GetPath())
    instancer.CreateProtoIndicesAttr(Vt.IntArray([0, 0]))
    instancer.CreatePositionsAttr(Vt.Vec3fArray([(0, 0, 0), (3, 0, 0)]))
    instancer.CreateExtentAttr(Vt.Vec3fArray([(-1, -1, -1), (4, 1, 1)]))
    ball(stage, "/World/stranger", red(stage, "/World/mtl/stranger"))
    change = green(stage, str(inside.GetPath()), targets=("/World/many/protos/ball[1]",))
    stage.GetRootLayer().Save()
    (edit,) = author(stage, tmp_path, change)
    assert edit.wins and edit.affects == ("/World/many/protos/ball",)
    assert changed(stage, compose(tmp_path)) == {"/World/many/protos/ball"}


# ---- what hides an edit, and what mends it --------------------------------------------------------------------
ATTRIBUTE = "/World/mtl/red/pbr.inputs:diffuseColor"


def stronger_layer(stage: Usd.Stage, top: Sdf.Layer, look: Sdf.Layer) -> None:
    put(top, "/World/mtl/red/pbr")
    top.GetAttributeAtPath(ATTRIBUTE).default = Gf.Vec3f(1, 1, 1)


def stronger_samples(stage: Usd.Stage, top: Sdf.Layer, look: Sdf.Layer) -> None:
    stronger_layer(stage, top, look)
    top.SetTimeSample(ATTRIBUTE, 1.0, Gf.Vec3f(1, 1, 1))


def stronger_samples_that_start_alike(stage: Usd.Stage, top: Sdf.Layer, look: Sdf.Layer) -> None:
    stronger_layer(stage, top, look)
    top.GetAttributeAtPath(ATTRIBUTE).default = look.GetAttributeAtPath(ATTRIBUTE).default
    for time, value in ((1.0, look.GetAttributeAtPath(ATTRIBUTE).default), (9.0, Gf.Vec3f(1, 1, 1))):
        top.SetTimeSample(ATTRIBUTE, time, value)


def own_samples(stage: Usd.Stage, top: Sdf.Layer, look: Sdf.Layer) -> None:
    look.SetTimeSample(ATTRIBUTE, 1.0, Gf.Vec3f(1, 1, 1))


def stronger_connection(stage: Usd.Stage, top: Sdf.Layer, look: Sdf.Layer) -> None:
    spec = Sdf.AttributeSpec(Sdf.CreatePrimInLayer(top, "/World/mtl/red/pbr"), "inputs:diffuseColor", F.Color3f)
    spec.connectionPathList.explicitItems = ["/World/mtl/red/tex.outputs:rgb"]


def inactive(stage: Usd.Stage, top: Sdf.Layer, look: Sdf.Layer) -> None:
    Sdf.CreatePrimInLayer(top, "/World/mtl/red").active = False


def in_the_session(stage: Usd.Stage, top: Sdf.Layer, look: Sdf.Layer) -> None:
    stronger_layer(stage, stage.GetSessionLayer(), look)


HIDING = {
    stronger_layer: (f"top.usda at {ATTRIBUTE}", "put look.usda above top.usda"),
    stronger_samples: ("time samples in top.usda", "above top.usda"),
    stronger_samples_that_start_alike: ("time samples in top.usda", "above top.usda"),
    own_samples: ("time samples in look.usda itself", f"remove the time samples of {ATTRIBUTE}"),
    stronger_connection: ("a connection to /World/mtl/red/tex.outputs:rgb", "edit /World/mtl/red/tex"),
    inactive: ("/World/mtl/red, which is inactive", "activate /World/mtl/red"),
    in_the_session: ("session", "from the session layer"),
}


@pytest.mark.parametrize("how", HIDING, ids=lambda f: f.__name__)
def test_what_hides_an_edit_is_named_with_what_mends_it(tmp_path: Path, how: Any) -> None:
    shot = new_stage(tmp_path / "shot.usda")
    ball(shot, "/World/ball", red(shot, "/World/mtl/red"))
    shot.GetRootLayer().Save()
    author(shot, tmp_path, green(shot, "/World/ball"))
    look = Sdf.Layer.FindOrOpen(str(tmp_path / "look.usda"))
    root = Sdf.Layer.CreateNew(str(tmp_path / "root.usda"))
    top = Sdf.Layer.CreateNew(str(tmp_path / "top.usda"))
    root.subLayerPaths = ["./top.usda", "./look.usda", "./shot.usda"]
    stage = Usd.Stage.Open(root)
    assert why_hidden(stage, look, Sdf.Path(ATTRIBUTE), Sdf.Path(ATTRIBUTE)) == ("", "")
    how(stage, top, look)
    what, mend = why_hidden(stage, look, Sdf.Path(ATTRIBUTE), Sdf.Path(ATTRIBUTE))
    assert HIDING[how][0] in what and HIDING[how][1] in mend
    assert next(f.name for f in find_wrong(stage, None) if f.name != "StaleLook") in ("HiddenEdit", "DanglingOver")


def test_another_variant_hides_what_only_one_has(tmp_path: Path) -> None:
    stage = new_stage(tmp_path / "shot.usda")
    group = stage.GetPrimAtPath("/World").GetVariantSets().AddVariantSet("kind")
    for name in ("full", "empty"):
        group.AddVariant(name)
    group.SetVariantSelection("full")
    with group.GetVariantEditContext():
        ball(stage, "/World/ball", red(stage, "/World/own/red"))
    stage.GetRootLayer().Save()
    author(stage, tmp_path, green(stage, "/World/ball"))
    review = compose(tmp_path)
    path = Sdf.Path("/World/own/red/pbr.inputs:diffuseColor")
    look = Sdf.Layer.FindOrOpen(str(tmp_path / "look.usda"))
    review.SetEditTarget(review.GetSessionLayer())
    review.GetPrimAtPath("/World").GetVariantSet("kind").SetVariantSelection("empty")
    what, mend = why_hidden(review, look, path, path)
    assert "with the variant kind=empty of /World" in what and "choose the variant that has /World/own" in mend


def test_a_stronger_binding_is_mended_where_it_is(tmp_path: Path) -> None:
    stage = new_stage(tmp_path / "shot.usda")
    shared = red(stage, "/World/mtl/red")
    for name in "ab":
        ball(stage, f"/World/{name}", shared)
    api = UsdShade.MaterialBindingAPI.Apply(stage.GetPrimAtPath("/World"))
    api.Bind(shared, UsdShade.Tokens.strongerThanDescendants)
    stage.GetRootLayer().Save()
    (edit,) = author(stage, tmp_path, green(stage, "/World/a", scope="prim"))
    assert not edit.wins and edit.mend.startswith("make /World.material:binding weakerThanDescendants")


# ---- final renders ---------------------------------------------------------------------------------------------
def test_final_renders_that_do_not_see_it_are_named(tmp_path: Path) -> None:
    stage = new_stage(tmp_path / "shot.usda")
    both = red(stage, "/World/mtl/both")
    node = UsdShade.Shader.Define(stage, "/World/mtl/both/ri")
    node.CreateIdAttr("PxrSurface")
    both.CreateSurfaceOutput("ri").ConnectToSource(node.CreateOutput("surface", F.Token))
    ball(stage, "/World/a", both)
    shown_only = ball(stage, "/World/b", red(stage, "/World/mtl/preview"))
    final = UsdShade.Material.Define(stage, "/World/mtl/final")
    final.CreateSurfaceOutput("mtlx").ConnectToSource(node.CreateOutput("surface", F.Token))
    UsdShade.MaterialBindingAPI(shown_only).Bind(final, materialPurpose=UsdShade.Tokens.full)
    ball(stage, "/World/c", red(stage, "/World/mtl/plain"))
    stage.GetRootLayer().Save()
    said: list[str] = []
    author(stage, tmp_path, *(green(stage, f"/World/{n}") for n in "abc"), warnings=said)
    assert said == [
        "final renders of /World/a by ri use another surface of /World/mtl/both and do not see the edit",
        "final renders of /World/b by mtlx show /World/mtl/final, bound for purpose full, and do not see the edit",
    ]


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
