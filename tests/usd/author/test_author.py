"""The look layer: sparse, clean, always winning, in the right place, on made-up and on real stages."""

from __future__ import annotations

import hashlib
import os
import subprocess
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from kit.look_stages import (
    TYPES,
    F,
    add_material,
    add_quads,
    as_reflectance,
    author,
    bind,
    change_of,
    compose,
    image_file,
    new_shot,
    new_stage,
    read_inputs,
    record,
    shown,
    validate,
)
from numpy.testing import assert_allclose
from pxr import Gf, Kind, Sdf, Usd, UsdGeom, UsdShade, Vt

from usdslf.color import USD_DEFAULT_SPACE, Color
from usdslf.edits.edits import MaterialChange, Reflectance
from usdslf.errors import AuthorError
from usdslf.scene.records import PrimvarInput, Texture
from usdslf.strokes.stroke import Stroke
from usdslf.usd.author.author import author_look, author_review_root, why_not_editable
from usdslf.usd.binding import bound_relationship, preview_surface, users_of
from usdslf.usd.notes import Notes
from usdslf.usd.read.materials import MaterialTable
from usdslf.usd.stroke_layer import write_strokes


@pytest.fixture
def shot(tmp_path: Path) -> Usd.Stage:
    return new_shot(tmp_path)


# ---- the material in place -----------------------------------------------------------------------
@pytest.mark.parametrize(
    ("freed", "d", "f0", "roughness"),
    [
        ("diffuse", (0.1, 0.4, 0.2), None, None),
        ("specular", None, (0.2,) * 3, None),
        ("specular", None, (0.3, 0.1, 0.1), None),
        ("glossiness", None, None, 0.15),
        ("diffuse+specular+glossiness", (0.0,) * 3, (0.9, 0.7, 0.3), 0.3),
    ],
)
def test_what_shows_is_what_was_solved(
    shot: Usd.Stage, tmp_path: Path, freed: str, d: Any, f0: Any, roughness: float | None
) -> None:
    change = change_of(shot, "/World/ball", freed, d, f0, roughness)
    edits = author(shot, tmp_path, change)
    assert edits and all(e.wins and not e.hidden_by for e in edits)
    review = compose(tmp_path)
    for prim in ("/World/ball", "/World/other"):
        got = shown(review, prim)
        assert_allclose(got["d"], change.after.diffuse, rtol=0.01, atol=1e-5)
        assert_allclose(got["f0"], change.after.f0, rtol=0.01, atol=1e-5)
        assert_allclose(got["roughness"], change.after.roughness, rtol=0.01)
    assert shown(review, "/World/row") == shown(shot, "/World/row")
    for edit in edits:
        value = review.GetAttributeAtPath(f"{edit.prim}.{edit.attribute}").Get()
        assert_allclose(np.ravel(value), np.ravel(edit.after), rtol=1e-6)


def test_the_layer_is_sparse(shot: Usd.Stage, tmp_path: Path) -> None:
    change = change_of(shot, "/World/ball", "diffuse+glossiness", (0.1, 0.4, 0.2), roughness=0.2)
    author(shot, tmp_path, change)
    layer = Sdf.Layer.FindOrOpen(str(tmp_path / "look.usda"))
    paths: list[Sdf.Path] = []
    layer.Traverse("/", paths.append)
    assert sorted(str(p) for p in paths if p.IsPropertyPath()) == [
        "/World/mtl/red/pbr.inputs:diffuseColor",
        "/World/mtl/red/pbr.inputs:roughness",
    ]
    specs = [layer.GetPrimAtPath(p) for p in paths if p.IsPrimPath()]
    assert all(s.specifier == Sdf.SpecifierOver and not s.typeName for s in specs)
    # Every opinion matters: without it the picture is another one.
    full = read_inputs(compose(tmp_path), "/World/ball")
    for path in [p for p in paths if p.IsPropertyPath()]:
        less = Sdf.Layer.CreateAnonymous(".usda")
        less.TransferContent(layer)
        prim = less.GetPrimAtPath(path.GetPrimPath())
        prim.RemoveProperty(prim.attributes[path.name])
        root = Sdf.Layer.CreateAnonymous(".usda")
        root.subLayerPaths = [less.identifier, shot.GetRootLayer().identifier]
        assert read_inputs(Usd.Stage.Open(root), "/World/ball") != full


def test_nothing_is_written_for_a_change_that_is_none(shot: Usd.Stage, tmp_path: Path) -> None:
    assert author(shot, tmp_path, change_of(shot, "/World/ball", "diffuse+specular+glossiness")) == []
    layer = Sdf.Layer.FindOrOpen(str(tmp_path / "look.usda"))
    assert list(layer.rootPrims.keys()) == ["World"] and not layer.rootPrims["World"].nameChildren


def test_same_edit_twice_gives_the_same_bytes(shot: Usd.Stage, tmp_path: Path) -> None:
    change = change_of(shot, "/World/ball", "diffuse", (0.1, 0.4, 0.2))
    author(shot, tmp_path, change, provenance={"version": "0.1.0", "solve": {"norm": "mixed"}})
    first = (tmp_path / "look.usda").read_bytes()
    author(shot, tmp_path, change, provenance={"solve": {"norm": "mixed"}, "version": "0.1.0"})
    assert (tmp_path / "look.usda").read_bytes() == first


def test_an_interrupted_write_leaves_the_earlier_file(
    shot: Usd.Stage, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    author(shot, tmp_path, change_of(shot, "/World/ball", "diffuse", (0.1, 0.4, 0.2)))
    first = (tmp_path / "look.usda").read_bytes()

    def killed(*_: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(Path, "replace", killed)
    with pytest.raises(KeyboardInterrupt):
        author(shot, tmp_path, change_of(shot, "/World/ball", "glossiness", roughness=0.1))
    assert (tmp_path / "look.usda").read_bytes() == first
    assert sorted(p.name for p in tmp_path.iterdir()) == ["look.usda", "shot.usda"]


def test_provenance_says_strokes_values_and_hashes(shot: Usd.Stage, tmp_path: Path) -> None:
    stroke = Stroke("stroke_0001", np.zeros((2, 3), np.float32), np.ones(2), np.ones((2, 3)), np.ones((2, 3)))
    write_strokes(tmp_path / "strokes.usda", [stroke], shot)
    change = change_of(
        shot, "/World/ball", "diffuse", (0.1, 0.4, 0.2), residual_before=0.5, residual_after=0.01
    )
    given = {"version": "0.1.0", "device": "cpu", "workingSpace": "lin_rec709_scene"}
    author(shot, tmp_path, change, provenance=given, strokes_path=tmp_path / "strokes.usda")
    layer = Sdf.Layer.FindOrOpen(str(tmp_path / "look.usda"))
    data = layer.customLayerData["usdslf"]
    assert (data["shot"], data["strokes"], data["device"]) == ("./shot.usda", "./strokes.usda", "cpu")
    assert data["shotHash"] == hashlib.sha256((tmp_path / "shot.usda").read_bytes()).hexdigest()
    assert data["strokesHash"] == hashlib.sha256((tmp_path / "strokes.usda").read_bytes()).hexdigest()
    review = compose(tmp_path)
    on_material = review.GetPrimAtPath("/World/mtl/red").GetCustomDataByKey("usdslf")
    assert list(on_material["strokes"]) == ["/SlfStrokes/stroke_0001"]
    assert on_material["inferred"] == "diffuse"
    assert_allclose(on_material["before"]["diffuse"], (0.6, 0.2, 0.1), rtol=1e-6)
    assert_allclose(on_material["after"]["diffuse"], (0.1, 0.4, 0.2), rtol=1e-6)
    assert_allclose(on_material["after"]["specular"], (0.04,) * 3, rtol=1e-6)
    assert (on_material["residualBefore"], on_material["residualAfter"]) == (0.5, 0.01)


def test_what_lies_outside_the_folder_is_found_by_relative_paths(shot: Usd.Stage, tmp_path: Path) -> None:
    (tmp_path / "out").mkdir()
    change = change_of(shot, "/World/ball", "diffuse", (0.1, 0.4, 0.2))
    author_look(shot, [change], tmp_path / "out/look.usda")
    author_review_root(tmp_path / "out/review.usda", tmp_path / "out/look.usda", None, tmp_path / "shot.usda")
    layer = Sdf.Layer.FindOrOpen(str(tmp_path / "out/review.usda"))
    assert list(layer.subLayerPaths) == ["./look.usda", "../shot.usda"]
    assert_allclose(shown(Usd.Stage.Open(layer), "/World/ball")["d"], (0.1, 0.4, 0.2), rtol=1e-6)
    tmp = tmp_path / "out"
    tmp.rename(tmp_path / "moved")
    moved = Usd.Stage.Open(str(tmp_path / "moved/review.usda"))
    assert_allclose(shown(moved, "/World/ball")["d"], (0.1, 0.4, 0.2), rtol=1e-6)


# ---- where the input comes from -------------------------------------------------------------------
@pytest.mark.parametrize("levels", [1, 2])
@pytest.mark.parametrize("has_value", [True, False])
def test_interface_inputs_are_where_values_go(tmp_path: Path, levels: int, has_value: bool) -> None:
    stage = new_stage(tmp_path / "shot.usda")
    material = add_material(stage, "/World/mtl/red")
    shader = UsdShade.Shader(stage.GetPrimAtPath("/World/mtl/red/pbr"))
    top = material.CreateInput("tint", F.Color3f)
    port = shader.CreateInput("diffuseColor", F.Color3f)
    if levels == 2:
        graph = UsdShade.NodeGraph.Define(stage, "/World/mtl/red/graph")
        inner = UsdShade.Shader.Define(stage, "/World/mtl/red/graph/pbr")
        inner.CreateIdAttr("UsdPreviewSurface")
        middle = graph.CreateInput("c", F.Color3f)
        middle.ConnectToSource(top)
        inner.CreateInput("diffuseColor", F.Color3f).ConnectToSource(middle)
        graph.CreateOutput("surface", F.Token).ConnectToSource(inner.ConnectableAPI(), "surface")
        material.CreateSurfaceOutput().ConnectToSource(graph.ConnectableAPI(), "surface")
    else:
        port.ConnectToSource(top)
    if has_value:
        top.Set(Gf.Vec3f(0.6, 0.2, 0.1))
    ball = UsdGeom.Sphere.Define(stage, "/World/ball")
    bind(ball.GetPrim(), material)
    stage.GetRootLayer().Save()
    (edit,) = author(stage, tmp_path, change_of(stage, "/World/ball", "diffuse", (0.1, 0.4, 0.2)))
    assert (edit.prim, edit.attribute, edit.wins) == ("/World/mtl/red", "inputs:tint", True)
    assert_allclose(shown(compose(tmp_path), "/World/ball")["d"], (0.1, 0.4, 0.2), rtol=1e-6)


def test_an_interface_input_that_drives_more_is_said(tmp_path: Path) -> None:
    stage = new_stage(tmp_path / "shot.usda")
    material = add_material(stage, "/World/mtl/red")
    rough = material.CreateInput("rough", F.Float)
    rough.Set(0.5)
    shader = UsdShade.Shader(stage.GetPrimAtPath("/World/mtl/red/pbr"))
    shader.CreateInput("roughness", F.Float).ConnectToSource(rough)
    shader.CreateInput("clearcoatRoughness", F.Float).ConnectToSource(rough)
    bind(UsdGeom.Sphere.Define(stage, "/World/ball").GetPrim(), material)
    stage.GetRootLayer().Save()
    warnings: list[str] = []
    change = change_of(stage, "/World/ball", "glossiness", roughness=0.1)
    author(stage, tmp_path, change, warnings=warnings)
    assert len(warnings) == 1 and "inputs:clearcoatRoughness" in warnings[0]


def textured(stage: Usd.Stage, channels: dict[str, str], **values: Any) -> UsdShade.Material:
    """A material whose inputs read channels of one UsdUVTexture."""
    material = add_material(stage, "/World/mtl/tex")
    shader = UsdShade.Shader(stage.GetPrimAtPath("/World/mtl/tex/pbr"))
    node = UsdShade.Shader.Define(stage, "/World/mtl/tex/map")
    node.CreateIdAttr("UsdUVTexture")
    node.CreateInput("file", F.Asset).Set("./missing.png")
    for name, value in values.items():
        node.CreateInput(name, F.Float4).Set(Gf.Vec4f(*value))
    for name, channel in channels.items():
        output = node.CreateOutput(channel, F.Float3 if channel == "rgb" else F.Float)
        shader.CreateInput(name, TYPES[name]).ConnectToSource(output)
    bind(UsdGeom.Sphere.Define(stage, "/World/ball").GetPrim(), material)
    stage.GetRootLayer().Save()
    return material


def texture_change(mean: Any, target: Any, channels: str, name: str = "diffuseColor") -> MaterialChange:
    values: dict[str, Any] = {name: mean}
    before, after = as_reflectance(**values), as_reflectance(**{name: target})
    texture = Texture("/World/mtl/tex/map", image_file(), channels=channels)
    material = record("/World/mtl/tex", **{name: texture})
    freed = "diffuse" if name == "diffuseColor" else "glossiness"
    return MaterialChange(material, "material", ("/World/ball",), (freed,), before, after)


def test_a_textured_colour_is_changed_by_scale_over_what_was_there(tmp_path: Path) -> None:
    """The texel whose value was the mean takes the solved one, with the scale and bias that were there."""
    stage = new_stage(tmp_path / "shot.usda")
    textured(stage, {"diffuseColor": "rgb"}, scale=(0.5, 0.5, 0.5, 1), bias=(0.1, 0.1, 0.1, 0))
    mean, target = np.array((0.35, 0.3, 0.2)), np.array((0.1, 0.3, 0.6))
    edits = author(stage, tmp_path, texture_change(mean, target, "rgb"))
    assert {e.attribute for e in edits} == {"inputs:scale", "inputs:bias"}
    assert all(e.representation == "scale" and e.wins and e.prim == "/World/mtl/tex/map" for e in edits)
    review = compose(tmp_path)
    node = UsdShade.Shader(review.GetPrimAtPath("/World/mtl/tex/map"))
    scale, bias = (np.array(node.GetInput(n).Get()) for n in ("scale", "bias"))
    texel = (mean - 0.1) / 0.5
    assert_allclose(texel * scale[:3] + bias[:3], target, atol=1e-6)
    assert scale[3] == 1 and bias[3] == 0  # alpha means something else


def test_a_packed_map_changes_in_its_channel_only(tmp_path: Path) -> None:
    stage = new_stage(tmp_path / "shot.usda")
    textured(stage, {"roughness": "g", "metallic": "b"})
    (edit,) = author(stage, tmp_path, texture_change(0.6, 0.3, "g", "roughness"))
    assert edit.attribute == "inputs:scale"
    assert_allclose(edit.after, (1, 0.5, 1, 1), rtol=1e-6)


@pytest.mark.parametrize("scope", ["material", "prim"])
def test_a_channel_that_feeds_two_inputs_is_split(tmp_path: Path, scope: str) -> None:
    stage = new_stage(tmp_path / "shot.usda")
    material = textured(stage, {"roughness": "r", "metallic": "r"}, scale=(0.5, 1, 1, 1))
    bind(UsdGeom.Sphere.Define(stage, "/World/other").GetPrim(), material)
    stage.GetRootLayer().Save()
    change = replace(texture_change(0.5, 0.25, "r", "roughness"), scope=scope)
    (edit,) = author(stage, tmp_path, change)
    assert edit.wins, edit.hidden_by
    review = compose(tmp_path)
    bound = review.GetPrimAtPath(bound_relationship(review.GetPrimAtPath("/World/ball"))[0])
    shader = preview_surface(UsdShade.Material(bound))
    assert shader is not None
    values = {}
    for name in ("roughness", "metallic"):
        (output,) = shader.GetInput(name).GetValueProducingAttributes()
        node = UsdShade.Shader(output.GetPrim())
        assert node.GetIdAttr().Get() == "UsdUVTexture" and output.GetBaseName() == "r"
        assert node.GetInput("file").Get().path == "./missing.png"
        values[name] = node.GetInput("scale").Get()[0]
    assert values == {"roughness": 0.25, "metallic": 0.5}


def test_a_channel_is_split_inside_an_instance_too(tmp_path: Path) -> None:
    asset = new_stage(tmp_path / "asset.usda")
    textured(asset, {"roughness": "r", "metallic": "r"}, scale=(0.5, 1, 1, 1))
    stage = new_stage(tmp_path / "shot.usda")
    for name in "ab":
        prim = stage.DefinePrim(f"/World/{name}", "Xform")
        prim.GetReferences().AddReference("./asset.usda")
        prim.SetInstanceable(True)
    stage.GetRootLayer().Save()
    change = texture_change(0.5, 0.25, "r", "roughness")
    material = replace(change.material, path="/World/a/mtl/tex")
    (edit,) = author(stage, tmp_path, replace(change, material=material, targets=("/World/a/ball",)))
    assert edit.wins, edit.hidden_by
    review = compose(tmp_path)
    for name, scale in (("a", 0.25), ("b", 0.5)):
        shader = UsdShade.Shader(review.GetPrimAtPath(f"/World/{name}/mtl/tex/pbr"))
        (output,) = shader.GetInput("roughness").GetValueProducingAttributes()
        node = UsdShade.Shader(output.GetPrim())
        assert node.GetIdAttr().Get() == "UsdUVTexture"
        assert node.GetInput("scale").Get()[0] == scale
        assert output.GetPrim().GetPath().HasPrefix(f"/World/{name}")


@pytest.mark.parametrize("interpolation", ["constant", "vertex", "faceVarying"])
@pytest.mark.parametrize("another_lacks_it", [False, True])
def test_a_primvar_is_mapped_on_the_gprim(tmp_path: Path, interpolation: str, another_lacks_it: bool) -> None:
    stage = new_stage(tmp_path / "shot.usda")
    material = add_material(stage, "/World/mtl/tex")
    shader = UsdShade.Shader(stage.GetPrimAtPath("/World/mtl/tex/pbr"))
    reader = UsdShade.Shader.Define(stage, "/World/mtl/tex/reader")
    reader.CreateIdAttr("UsdPrimvarReader_float3")
    reader.CreateInput("varname", F.String).Set("displayColor")
    reader.CreateInput("fallback", F.Float3).Set((0.4, 0.4, 0.4))
    output = reader.CreateOutput("result", F.Float3)
    shader.CreateInput("diffuseColor", F.Color3f).ConnectToSource(output)
    mesh = add_quads(stage, "/World/row")
    bind(mesh.GetPrim(), material)
    if another_lacks_it:
        bind(UsdGeom.Sphere.Define(stage, "/World/ball").GetPrim(), material)
    count = {"constant": 1, "vertex": 10, "faceVarying": 16}[interpolation]
    colors = np.linspace(0.1, 0.5, count * 3, dtype=np.float32).reshape(-1, 3)
    primvar = mesh.CreateDisplayColorPrimvar(interpolation)
    primvar.Set(Vt.Vec3fArray.FromNumpy(colors))
    if interpolation == "faceVarying":
        primvar.SetIndices(Vt.IntArray(list(range(16))))
    stage.GetRootLayer().Save()
    mean = colors.mean(0)
    change = replace(
        texture_change(mean, mean * [0.5, 1, 0.25], "rgb"),
        material=record("/World/mtl/tex", diffuseColor=PrimvarInput("displayColor", (0.18,) * 3)),
    )
    edits = author(stage, tmp_path, change)
    assert all(e.wins and e.representation == "primvar" for e in edits)
    review = compose(tmp_path)
    assert review.GetAttributeAtPath("/World/mtl/tex/reader.inputs:varname").Get() == "slf:diffuseColor"
    got = UsdGeom.PrimvarsAPI(review.GetPrimAtPath("/World/row")).GetPrimvar("slf:diffuseColor")
    assert got.GetInterpolation() == interpolation and len(got.ComputeFlattened()) == count
    assert_allclose(np.array(got.ComputeFlattened()).mean(0), mean * [0.5, 1, 0.25], atol=1e-6)
    # The reader's fallback is an opinion only where it shows.
    assert any(e.attribute == "inputs:fallback" for e in edits) == another_lacks_it
    fallback = review.GetAttributeAtPath("/World/mtl/tex/reader.inputs:fallback").Get()
    assert_allclose(fallback, (0.2, 0.4, 0.1) if another_lacks_it else (0.4,) * 3, atol=1e-6)


def test_a_node_that_cannot_be_changed_is_said_and_left(tmp_path: Path) -> None:
    stage = new_stage(tmp_path / "shot.usda")
    material = add_material(stage, "/World/mtl/red")
    noise = UsdShade.Shader.Define(stage, "/World/mtl/red/noise")
    noise.CreateIdAttr("ND_noise3d_color3")
    shader = UsdShade.Shader(stage.GetPrimAtPath("/World/mtl/red/pbr"))
    shader.CreateInput("diffuseColor", F.Color3f).ConnectToSource(noise.CreateOutput("out", F.Color3f))
    bind(UsdGeom.Sphere.Define(stage, "/World/ball").GetPrim(), material)
    stage.GetRootLayer().Save()
    warnings: list[str] = []
    change = change_of(stage, "/World/ball", "diffuse", (0.9,) * 3)
    (edit,) = author(stage, tmp_path, change, warnings=warnings)
    assert not edit.wins and "/World/mtl/red/noise" in edit.hidden_by and len(warnings) == 1


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
    """/World/a and /World/b are instances of an asset of two gprims, in which /inner is an instance too."""
    asset = Usd.Stage.CreateNew(str(tmp_path / "asset.usda"))
    red = None
    for root in ("/inner", "/asset"):
        prim = UsdGeom.Xform.Define(asset, root).GetPrim()
        UsdGeom.Scope.Define(asset, f"{root}/mtl")
        red = add_material(asset, f"{root}/mtl/red", diffuseColor=Gf.Vec3f(0.6, 0.2, 0.1))
        bind(UsdGeom.Sphere.Define(asset, f"{root}/ball").GetPrim(), red)
        bind(UsdGeom.Sphere.Define(asset, f"{root}/ball2").GetPrim(), red)
        Usd.ModelAPI(prim).SetKind(Kind.Tokens.component)
    nested = asset.DefinePrim("/asset/nested", "Xform")
    nested.GetReferences().AddInternalReference("/inner")
    nested.SetInstanceable(True)
    asset.GetRootLayer().Save()
    stage = new_stage(tmp_path / "shot.usda")
    for name in ("a", "b"):
        prim = stage.DefinePrim(f"/World/{name}", "Xform")
        prim.GetReferences().AddReference("./asset.usda", "/asset")
        prim.SetInstanceable(True)
    stage.GetRootLayer().Save()
    return stage


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


# ---- does it win -----------------------------------------------------------------------------------
def test_an_edit_that_a_stronger_layer_hides_says_by_what(shot: Usd.Stage, tmp_path: Path) -> None:
    shot.SetEditTarget(shot.GetSessionLayer())
    shader = UsdShade.Shader(shot.GetPrimAtPath("/World/mtl/red/pbr"))
    shader.GetInput("diffuseColor").Set(Gf.Vec3f(1, 1, 1))
    change = change_of(shot, "/World/ball", "diffuse", (0.1, 0.4, 0.2))
    edits = author_look(shot, [change], tmp_path / "look.usda")
    assert not edits[0].wins and "session" in edits[0].hidden_by


def test_time_samples_below_are_overridden_and_said(shot: Usd.Stage, tmp_path: Path) -> None:
    shader = UsdShade.Shader(shot.GetPrimAtPath("/World/mtl/grey/pbr"))
    for t in (1, 24):
        shader.GetInput("roughness").GetAttr().Set(0.1 * t, t)
    shot.GetRootLayer().Save()
    warnings: list[str] = []
    change = change_of(shot, "/World/row", "glossiness", roughness=0.7)
    (edit,) = author(shot, tmp_path, change, warnings=warnings)
    assert edit.wins and len(warnings) == 1 and "animated" in warnings[0]
    review = compose(tmp_path)
    assert review.GetAttributeAtPath("/World/mtl/grey/pbr.inputs:roughness").Get(24) == pytest.approx(0.7)


def test_a_stronger_binding_above_is_found(shot: Usd.Stage, tmp_path: Path) -> None:
    red = UsdShade.Material(shot.GetPrimAtPath("/World/mtl/red"))
    api = UsdShade.MaterialBindingAPI.Apply(shot.GetPrimAtPath("/World"))
    api.Bind(red, UsdShade.Tokens.strongerThanDescendants)
    shot.GetRootLayer().Save()
    (edit,) = author(shot, tmp_path, change_of(shot, "/World/ball", "diffuse", (0.9,) * 3, scope="prim"))
    assert not edit.wins and "stronger binding" in edit.hidden_by


# ---- refusals ----------------------------------------------------------------------------------------
def test_why_not_editable_names_the_reason(shot: Usd.Stage) -> None:
    assert why_not_editable(shot.GetPrimAtPath("/World/ball")) == ""
    assert why_not_editable(shot.GetPrimAtPath("/World/mtl/red")) == ""
    bare = UsdGeom.Sphere.Define(shot, "/World/bare").GetPrim()
    assert "no material" in why_not_editable(bare)
    lost = UsdShade.MaterialBindingAPI.Apply(bare).GetDirectBindingRel()
    lost.SetTargets(["/World/mtl/lost"])
    assert "/World/mtl/lost, which is not there" in why_not_editable(bare)
    other = UsdShade.Material.Define(shot, "/World/mtl/ri")
    node = UsdShade.Shader.Define(shot, "/World/mtl/ri/node")
    node.CreateIdAttr("PxrSurface")
    other.CreateSurfaceOutput("ri").ConnectToSource(node.ConnectableAPI(), "surface")
    bind(bare, other)
    assert "(it has ri)" in why_not_editable(bare)


def test_neither_shot_nor_a_strangers_file_is_overwritten(shot: Usd.Stage, tmp_path: Path) -> None:
    change = change_of(shot, "/World/ball", "diffuse", (0.1, 0.4, 0.2))
    before = (tmp_path / "shot.usda").read_bytes()
    for write in (
        lambda: author_look(shot, [change], tmp_path / "shot.usda"),
        lambda: author_review_root(tmp_path / "shot.usda", "look.usda", None, tmp_path / "shot.usda"),
    ):
        with pytest.raises(AuthorError, match="shot"):
            write()
    assert (tmp_path / "shot.usda").read_bytes() == before
    stranger = tmp_path / "mine.usda"
    stranger.write_text("#usda 1.0\n")
    with pytest.raises(AuthorError, match="not a look layer"):
        author_look(shot, [change], stranger)
    with pytest.raises(AuthorError, match="cannot be written"):
        author_look(shot, [change], tmp_path / "missing/look.usda")


# ---- validators, and programs without the plugin -------------------------------------------------------
PLAIN = """
import sys
from pxr import Usd, UsdValidation
validators = UsdValidation.ValidationRegistry().GetOrLoadAllValidators()
for path in sys.argv[1:]:
    stage = Usd.Stage.Open(path)
    assert "usdslf" not in sys.modules
    assert not Usd.SchemaRegistry().FindAppliedAPIPrimDefinition("SlfStrokeAPI")
    assert not stage.GetCompositionErrors()
    for error in UsdValidation.ValidationContext(validators).Validate(stage):
        print(path, error.GetErrorAsString())
"""


def test_all_layers_validate_in_plain_usd_without_the_plugin(instances: Usd.Stage, tmp_path: Path) -> None:
    stage = instances
    row = add_quads(stage, "/World/row")
    bind(row.GetPrim(), add_material(stage, "/World/mtl/grey"))
    stage.GetRootLayer().Save()
    stroke = Stroke("stroke_0001", np.zeros((2, 3), np.float32), np.ones(2), np.ones((2, 3)), np.ones((2, 3)))
    write_strokes(tmp_path / "strokes.usda", [stroke], stage)
    changes = [
        change_of(stage, "/World/a/ball", "diffuse", (0.1, 0.4, 0.2), scope="prim"),
        change_of(stage, "/World/b/nested/ball", "specular", f0=(0.3, 0.1, 0.1)),
        change_of(
            stage, "/World/row", "glossiness", roughness=0.1, scope="stroke", faces={"/World/row": (1,)}
        ),
    ]
    assert all(e.wins for e in author(stage, tmp_path, *changes, strokes_path=tmp_path / "strokes.usda"))
    compose(tmp_path, strokes="strokes.usda")
    environment = {k: v for k, v in os.environ.items() if k not in ("PXR_PLUGINPATH_NAME", "PYTHONPATH")}
    files = [str(tmp_path / name) for name in ("look.usda", "strokes.usda", "review.usda")]
    done = subprocess.run(
        [sys.executable, "-P", "-c", PLAIN, *files], env=environment, capture_output=True, text=True
    )
    # What the shot itself is blamed for (new_stage leaves out extents) may show in the review root.
    said = [line for line in done.stdout.splitlines() if "review.usda" not in line]
    assert (done.returncode, said, done.stderr) == (0, [], "")
    assert len(done.stdout.splitlines()) == len(validate(stage))


# ---- real stages -----------------------------------------------------------------------------------------
REAL = [
    ("living_room_godot/living_room.usda", "/root/Cylinder/Cylinder"),
    ("cornell_box/cornell-box.usda", "/cornell_box/left_wall/left_wall"),
    ("avocado/avocado.usda", "/Avocado/Avocado"),
    ("dutch_ship_polyhaven/dutch_ship_medium.usdc", "/root/dutch_ship_medium_hull"),
    ("teapot_usdwg/Teapot.usd", "/Teapot/Geometry"),
    ("teapots_instanced_usdwg/scenes/teapotScene.usd", "/Scene/ring000/teapot002/geo/default/Body"),
    (
        "vehicles_usdwg/USD_Mini_Car_Kit/assets/vehicles/vehicleVariants.usda",
        "/vehicleVariant/tractorFullAsset/tractor/geo/tractor/_2_redMax",
    ),
    ("preview_surface_mayausd/UsdPreviewSurface/UseSpecularWorkflowTest.usda", "/pSphere1"),
]


def find_gprim(stage: Usd.Stage, path: str) -> str:
    """The prim, or the first one below it that has a material."""
    for prim in Usd.PrimRange(stage.GetPrimAtPath(path), Usd.TraverseInstanceProxies()):
        if not bound_relationship(prim)[0].isEmpty and (prim.IsA(UsdGeom.Gprim) or prim.IsA(UsdGeom.Subset)):
            return str(prim.GetPath())
    raise AssertionError(path)


@pytest.mark.parametrize(("name", "prim"), REAL)
def test_real_stages_take_three_kinds_of_change(assets: Path, tmp_path: Path, name: str, prim: str) -> None:
    # A part of the thousands of instances is enough.
    mask = Usd.StagePopulationMask(["/Scene/ring000"] if "instanced" in name else ["/"])
    stage = Usd.Stage.OpenMasked(str(assets / name), mask)
    blamed = set(validate(stage))
    painted = find_gprim(stage, prim)
    table = MaterialTable(Usd.TimeCode.Default(), Color(None, USD_DEFAULT_SPACE), Notes())
    material = table.materials[table(stage.GetPrimAtPath(painted))]
    others = {str(p.GetPath()) for p in users_of(stage, Sdf.Path(material.path))}
    others = sorted(o for o in others if not o.startswith(painted))[:3]
    for scope, freed in (("material", "diffuse"), ("material", "specular"), ("prim", "glossiness")):
        before = as_reflectance(diffuseColor=(0.4, 0.35, 0.3))
        after = Reflectance(before.diffuse * 0.5, before.f0 * 2, 0.21)
        change = MaterialChange(material, scope, (painted,), (freed,), before, after, means={"metallic": 0.0})
        edits = author_look(stage, [change], tmp_path / "look.usda")
        assert edits and all(e.wins for e in edits), edits
        author_review_root(tmp_path / "review.usda", tmp_path / "look.usda", None, assets / name)
        review = Usd.Stage.OpenMasked(str(tmp_path / "review.usda"), mask)
        assert validate(Usd.Stage.Open(str(tmp_path / "look.usda"))) == []
        assert set(validate(review)) <= blamed, freed
        for other in others if scope == "prim" else ():
            assert read_inputs(review, other) == read_inputs(stage, other)
