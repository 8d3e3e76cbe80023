"""Authoring for a material, a prim or a stroke, and in instances: who changes and who does not."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from kit.look_stages import (
    F,
    add_material,
    author,
    bind,
    change_of,
    compose,
    new_instances,
    new_shot,
    new_stage,
    shown,
    validate,
)
from numpy.testing import assert_allclose
from pxr import Gf, Sdf, Usd, UsdGeom, UsdShade, Vt

from usdslf.usd.binding import users_of


@pytest.fixture
def shot(tmp_path: Path) -> Usd.Stage:
    return new_shot(tmp_path)


# ---- scopes ---------------------------------------------------------------------------------------
def test_scope_prim_makes_a_material_that_inherits_the_original(shot: Usd.Stage, tmp_path: Path) -> None:
    change = change_of(shot, "/World/ball", "diffuse", (0.1, 0.4, 0.2), scope="prim")
    edits = author(shot, tmp_path, change)
    assert [e.prim for e in edits] == ["/World/mtl/SlfMaterials/red_ball/pbr"] and edits[0].wins
    review = compose(tmp_path)
    assert_allclose(shown(review, "/World/ball")["d"], (0.1, 0.4, 0.2), rtol=1e-6)
    assert shown(review, "/World/other") == shown(shot, "/World/other")
    # What changes in the original later still reaches the new material.
    review.SetEditTarget(review.GetSessionLayer())
    shader = UsdShade.Shader(review.GetPrimAtPath("/World/mtl/red/pbr"))
    shader.CreateInput("roughness", F.Float).Set(0.9)
    assert shown(review, "/World/ball")["roughness"] == pytest.approx(0.9)


def test_scope_prim_of_all_users_is_an_override_in_place(shot: Usd.Stage, tmp_path: Path) -> None:
    targets = ("/World/ball", "/World/other")
    change = change_of(shot, "/World/ball", "diffuse", (0.1, 0.4, 0.2), scope="prim", targets=targets)
    (edit,) = author(shot, tmp_path, change)
    assert edit.prim == "/World/mtl/red/pbr"
    assert len(users_of(shot, Sdf.Path("/World/mtl/red"))) == 2


def test_scope_stroke_binds_the_painted_faces_only(shot: Usd.Stage, tmp_path: Path) -> None:
    faces = {"/World/row": (1, 2)}
    change = change_of(shot, "/World/row", "diffuse", (0.1, 0.4, 0.2), scope="stroke", faces=faces)
    edits = author(shot, tmp_path, change)
    assert all(e.wins for e in edits)
    review = compose(tmp_path)
    (subset,) = UsdShade.MaterialBindingAPI(review.GetPrimAtPath("/World/row")).GetMaterialBindSubsets()
    assert list(subset.GetIndicesAttr().Get()) == [1, 2]
    assert_allclose(shown(review, str(subset.GetPath()))["d"], (0.1, 0.4, 0.2), rtol=1e-6)
    assert shown(review, "/World/row") == shown(shot, "/World/row")
    assert validate(review) == []


def test_scope_stroke_splits_the_subset_that_is_there(shot: Usd.Stage, tmp_path: Path) -> None:
    mesh = UsdGeom.Mesh(shot.GetPrimAtPath("/World/row"))
    api = UsdShade.MaterialBindingAPI(mesh)
    subset = api.CreateMaterialBindSubset("half", Vt.IntArray([0, 1, 2]))
    bind(subset.GetPrim(), UsdShade.Material(shot.GetPrimAtPath("/World/mtl/red")))
    shot.GetRootLayer().Save()
    change = change_of(
        shot, "/World/row/half", "diffuse", (0.1, 0.4, 0.2),
        scope="stroke", targets=("/World/row",), faces={"/World/row": (2, 3)},
    )  # fmt: skip
    assert all(e.wins for e in author(shot, tmp_path, change))
    review = compose(tmp_path)
    subsets = UsdShade.MaterialBindingAPI(review.GetPrimAtPath("/World/row")).GetMaterialBindSubsets()
    faces = {s.GetPrim().GetName(): list(s.GetIndicesAttr().Get()) for s in subsets}
    assert faces == {"half": [0, 1], "slf_painted_half": [2]}  # face 3 shows another material
    assert_allclose(shown(review, "/World/row/slf_painted_half")["d"], (0.1, 0.4, 0.2), rtol=1e-6)
    assert_allclose(shown(review, "/World/row/half")["d"], (0.6, 0.2, 0.1), rtol=1e-6)
    assert validate(review) == []


@pytest.mark.parametrize("subset", [False, True])
def test_two_strokes_on_faces_of_one_mesh_share_them_out(shot: Usd.Stage, tmp_path: Path, subset: bool) -> None:
    """The later one gets the face that both painted."""
    mesh, material = UsdGeom.Mesh(shot.GetPrimAtPath("/World/row")), "/World/row"
    if subset:
        half = UsdShade.MaterialBindingAPI(mesh).CreateMaterialBindSubset("half", Vt.IntArray([0, 1, 2, 3]))
        bind(half.GetPrim(), UsdShade.Material(shot.GetPrimAtPath("/World/mtl/red")))
        shot.GetRootLayer().Save()
        material = "/World/row/half"
    colors, faces = [(0.1, 0.4, 0.2), (0.3, 0.1, 0.5)], [(1, 2), (2, 3)]
    changes = [
        change_of(shot, material, "diffuse", c, scope="stroke", targets=("/World/row",), faces={"/World/row": f})
        for c, f in zip(colors, faces)
    ]
    assert all(e.wins for e in author(shot, tmp_path, *changes))
    review = compose(tmp_path)
    found = UsdShade.MaterialBindingAPI(review.GetPrimAtPath("/World/row")).GetMaterialBindSubsets()
    of = {tuple(s.GetIndicesAttr().Get()): shown(review, str(s.GetPath()))["d"] for s in found}
    assert set(of) == {(1,), (2, 3)} | ({(0,)} if subset else set())
    assert_allclose(of[1,], colors[0], rtol=1e-6)
    assert_allclose(of[2, 3], colors[1], rtol=1e-6)
    assert validate(review) == []


def test_scope_stroke_of_every_face_is_the_whole_prim(shot: Usd.Stage, tmp_path: Path) -> None:
    faces = {"/World/row": (0, 1, 2, 3)}
    change = change_of(shot, "/World/row", "diffuse", (0.1, 0.4, 0.2), scope="stroke", faces=faces)
    author(shot, tmp_path, change)
    review = compose(tmp_path)
    assert not UsdShade.MaterialBindingAPI(review.GetPrimAtPath("/World/row")).GetMaterialBindSubsets()
    assert_allclose(shown(review, "/World/row")["d"], (0.1, 0.4, 0.2), rtol=1e-6)


@pytest.mark.parametrize("purpose", ["", "preview", "full"])
def test_a_new_binding_replaces_the_one_that_shows(shot: Usd.Stage, tmp_path: Path, purpose: str) -> None:
    prim = shot.GetPrimAtPath("/World/ball")
    api = UsdShade.MaterialBindingAPI(prim)
    api.UnbindDirectBinding()
    grey = UsdShade.Material(shot.GetPrimAtPath("/World/mtl/grey"))
    api.Bind(grey, UsdShade.Tokens.fallbackStrength, purpose or UsdShade.Tokens.allPurpose)
    shot.GetRootLayer().Save()
    change = change_of(shot, "/World/ball", "diffuse", (0.1, 0.4, 0.2), scope="prim")
    (edit,) = author(shot, tmp_path, change)
    assert edit.wins
    assert_allclose(shown(compose(tmp_path), "/World/ball")["d"], (0.1, 0.4, 0.2), rtol=1e-6)


# ---- instances -------------------------------------------------------------------------------------
@pytest.fixture
def instances(tmp_path: Path) -> Usd.Stage:
    return new_instances(tmp_path)


BALLS = [f"/World/{i}/{n}{b}" for i in "ab" for n in ("", "nested/") for b in ("ball", "ball2")]


@pytest.mark.parametrize("scope", ["material", "prim"])
@pytest.mark.parametrize("painted", ["/World/a/ball", "/World/a/nested/ball2"])
def test_an_edit_in_an_instance_changes_this_one_and_no_other(
    instances: Usd.Stage, tmp_path: Path, painted: str, scope: str
) -> None:
    change = change_of(instances, painted, "diffuse", (0.1, 0.4, 0.2), scope=scope)
    edits = author(instances, tmp_path, change)
    assert edits and all(e.wins for e in edits), edits
    review = compose(tmp_path)
    beside = painted.replace("ball2", "ball")
    expected = {painted} if scope == "prim" else {beside, beside.replace("ball", "ball2")}
    changed = {b for b in BALLS if not np.allclose(shown(review, b)["d"], (0.6, 0.2, 0.1))}
    assert changed == expected
    for ball in expected:
        assert_allclose(shown(review, ball)["d"], (0.1, 0.4, 0.2), rtol=1e-6)
    assert review.GetPrimAtPath("/World/a").IsInstance() and review.GetPrimAtPath("/World/b").IsInstance()
    assert validate(review) == validate(instances)


def test_two_materials_of_one_instance_share_its_class(instances: Usd.Stage, tmp_path: Path) -> None:
    one = change_of(instances, "/World/a/ball", "diffuse", (0.1, 0.4, 0.2))
    two = change_of(instances, "/World/a/nested/ball", "glossiness", roughness=0.1)
    three = change_of(instances, "/World/b/ball", "glossiness", roughness=0.2)
    edits = author(instances, tmp_path, one, two, three)
    assert all(e.wins for e in edits) and len(edits) == 3
    review = compose(tmp_path)
    assert_allclose(shown(review, "/World/a/ball")["d"], (0.1, 0.4, 0.2), rtol=1e-6)
    assert shown(review, "/World/a/nested/ball")["roughness"] == pytest.approx(0.1)
    assert shown(review, "/World/b/ball")["roughness"] == pytest.approx(0.2)
    assert shown(review, "/World/b/nested/ball")["roughness"] == 0.5


def test_copies_of_a_point_instancer_change_by_their_prototype(tmp_path: Path) -> None:
    stage = new_stage(tmp_path / "shot.usda")
    red = add_material(stage, "/World/mtl/red", diffuseColor=Gf.Vec3f(0.6, 0.2, 0.1))
    instancer = UsdGeom.PointInstancer.Define(stage, "/World/many")
    ball = UsdGeom.Sphere.Define(stage, "/World/many/protos/ball")
    bind(ball.GetPrim(), red)
    bind(UsdGeom.Sphere.Define(stage, "/World/other").GetPrim(), red)
    instancer.CreatePrototypesRel().AddTarget(ball.GetPath())
    stage.GetRootLayer().Save()
    change = change_of(
        stage, "/World/many/protos/ball", "diffuse", (0.1, 0.4, 0.2),
        scope="prim", targets=("/World/many/protos/ball[3]",),
    )  # fmt: skip
    author(stage, tmp_path, change)
    review = compose(tmp_path)
    assert_allclose(shown(review, "/World/many/protos/ball")["d"], (0.1, 0.4, 0.2), rtol=1e-6)
    assert_allclose(shown(review, "/World/other")["d"], (0.6, 0.2, 0.1), rtol=1e-6)
