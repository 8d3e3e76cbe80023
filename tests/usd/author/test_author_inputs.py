"""Authoring where the input comes from: interface inputs, textures and their channels, primvars."""

from __future__ import annotations

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
    add_two_instances,
    as_reflectance,
    author,
    bind,
    change_of,
    compose,
    image_file,
    new_stage,
    record,
    shown,
)
from numpy.testing import assert_allclose
from pxr import Gf, Usd, UsdGeom, UsdShade, Vt

from usdslf.edits.edits import MaterialChange
from usdslf.scene.records import PrimvarInput, Texture
from usdslf.usd.binding import bound_relationship, preview_surface


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
    add_two_instances(stage)
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
