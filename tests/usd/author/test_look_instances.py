"""Looks in instances: the table of what works, modes, prototypes."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from kit.look_stages import (
    author,
    compose,
    new_stage,
)
from kit.red_balls import assert_changes, ball, changed, green, put, red
from pxr import Gf, Sdf, Usd, UsdGeom, UsdShade, Vt

from usdslf.errors import AuthorError


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
