"""Networks of other renderers as UsdPreviewSurface: images, primvars, what cannot be said; twins written by hand.

The expected values are those of MaterialX 1.39 (NG_place2d_vector2, NG_tiledimage_color3), Arnold and RenderMan.  The
twins say the same in a UsdPreviewSurface that was written by hand; both are read as scenes and compared at points of
the surface.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from kit.look_stages import validate as stock
from kit.preview_twins import CLOTH, OPEN_PBR, STANDARD, both, check
from kit.shader_nodes import N, Nodes
from numpy.testing import assert_allclose
from pxr import Gf, Sdf, Usd, UsdShade, Vt

from usdslf.surfaces.surface_points import evaluate_surface
from usdslf.textures.images import write_image
from usdslf.usd.layer.look_layer import LookLayer
from usdslf.usd.layer.wins import compose_over
from usdslf.usd.preview.preview_material import make_preview, write_made
from usdslf.usd.read.read import read_scene


# ---- images and primvars -----------------------------------------------------------------------------------
@pytest.fixture
def image(tmp_path: Path) -> Sdf.AssetPath:
    """Sixteen by sixteen texels of 8 bits, each another one."""
    rng = np.random.default_rng(5)
    write_image(tmp_path / "a.png", rng.uniform(0.1, 0.9, (16, 16, 3)).astype(np.float32))
    return Sdf.AssetPath("./a.png")


def uv_texture(twin: Nodes, name: str, file: Sdf.AssetPath, output: str = "rgb", **inputs: Any) -> UsdShade.Output:
    """A UsdUVTexture on st, or on `st` that is given."""
    st = inputs.pop("st", None) or twin.node(
        f"{name}_st", "UsdPrimvarReader_float2", "result", 2, varname=inputs.pop("uv_set", "st")
    )
    inputs = {"wrapS": "repeat", "wrapT": "repeat", "sourceColorSpace": "raw"} | inputs
    return twin.node(name, "UsdUVTexture", output, 3 if output == "rgb" else 1, file=file, st=st, **inputs)


def transformed(twin: Nodes, name: str, **inputs: Any) -> UsdShade.Output:
    reader = twin.node(f"{name}_reader", "UsdPrimvarReader_float2", "result", 2, varname="st")
    return twin.node(name, "UsdTransform2d", "result", 2, **{"in": reader}, **inputs)


def in_space(output: UsdShade.Output, space: str) -> UsdShade.Output:
    UsdShade.Shader(output.GetPrim()).GetInput("file").GetAttr().SetColorSpace(space)
    return output


def test_a_materialx_image_times_base_in_its_colour_space(tmp_path: Path, image: Sdf.AssetPath) -> None:
    foreign, twin = both(tmp_path)
    uv = foreign.node("uv", "ND_texcoord_vector2", size=2, index=1)
    color = in_space(foreign.node("color", "ND_image_color3", file=image, texcoord=uv), "srgb_texture")
    rough = foreign.node("rough", "ND_image_float", size=1, file=image, uaddressmode="mirror", vaddressmode="clamp")
    in_space(rough, "srgb_texture")  # which MaterialX converts colours from only
    plain = foreign.node("plain", "ND_image_color3", file=image)
    metal = foreign.node("metal", "ND_extract_color3", size=1, index=2, **{"in": plain})
    foreign.surface(STANDARD, base=0.5, base_color=color, specular_roughness=rough, metalness=metal)
    twin.surface(
        "UsdPreviewSurface",
        diffuseColor=uv_texture(twin, "c", image, sourceColorSpace="sRGB", scale=(0.5, 0.5, 0.5, 1), uv_set="st1"),
        roughness=uv_texture(twin, "r", image, "r", wrapS="mirror", wrapT="clamp"),
        metallic=uv_texture(twin, "m", image, "b"),
    )
    check(foreign, twin)
    # The look itself is valid, also where it stands alone.
    made = make_preview(foreign.stage, None)
    made.layer.Export(str(tmp_path / "made.usda"))
    assert stock(Usd.Stage.Open(str(tmp_path / "made.usda"))) == []


def test_channels_are_taken_and_changed_places(tmp_path: Path, image: Sdf.AssetPath) -> None:
    foreign, twin = both(tmp_path)
    color = foreign.node("color", "ND_image_color3", file=image)
    rough = foreign.node("rough", "ND_swizzle_color3_float", size=1, channels="g", **{"in": color})
    parts = foreign.node("parts", "ND_separate3_color3", "outb", 1, **{"in": color})
    metal = foreign.node("metal", "ND_remap_float", size=1, outlow=0.25, outhigh=0.75, **{"in": parts})
    foreign.surface(STANDARD, base_color=CLOTH, specular_roughness=rough, metalness=metal)
    twin.surface(
        "UsdPreviewSurface", diffuseColor=CLOTH, roughness=uv_texture(twin, "r", image, "g"),
        metallic=uv_texture(twin, "m", image, "b", scale=(1, 1, 0.5, 1), bias=(0, 0, 0.25, 0)),
    )  # fmt: skip
    check(foreign, twin)


def test_a_tiled_image_in_a_node_graph_with_an_interface(tmp_path: Path, image: Sdf.AssetPath) -> None:
    foreign, twin = both(tmp_path)
    graph = UsdShade.NodeGraph.Define(foreign.stage, "/World/mtl/a/graph")
    tiling = graph.CreateInput("tiling", N.Float2)
    tiling.Set(Gf.Vec2f(3, 2))
    tiled = foreign.node("graph/tiled", "ND_tiledimage_color3", file=image, uvoffset=(0.25, 0.5))
    UsdShade.Shader(tiled.GetPrim()).CreateInput("uvtiling", N.Float2).ConnectToSource(tiling)
    product = foreign.node("graph/product", "ND_multiply_color3FA", in1=tiled, in2=0.5)
    sum_ = foreign.node("graph/sum", "ND_add_color3", in1=product, in2=(0.1, 0.2, 0.3))
    graph.CreateOutput("out", N.Color3f).ConnectToSource(sum_)
    foreign.surface(OPEN_PBR, base_color=graph.GetOutput("out"))
    st = transformed(twin, "t", scale=(3, 2), translation=(-0.25, -0.5))
    twin.surface(
        "UsdPreviewSurface", roughness=0.3,
        diffuseColor=uv_texture(twin, "c", image, st=st, scale=(0.5, 0.5, 0.5, 1), bias=(0.1, 0.2, 0.3, 0)),
    )  # fmt: skip
    check(foreign, twin)


def test_place2d_turns_clockwise_about_its_pivot(tmp_path: Path, image: Sdf.AssetPath) -> None:
    foreign, twin = both(tmp_path)
    uv = foreign.node("uv", "ND_geompropvalue_vector2", size=2, geomprop="st")
    placed = foreign.node(
        "place", "ND_place2d_vector2", size=2, texcoord=uv, pivot=(0.5, 0.25), scale=(0.5, 0.25), rotate=90.0,
        offset=(0.125, 0.0),
    )  # fmt: skip
    foreign.surface(STANDARD, base_color=foreign.node("color", "ND_image_color3", file=image, texcoord=placed))
    # (s, t) - pivot, over scale: (2 s - 1, 4 t - 1); turned: (4 t - 1, 1 - 2 s); - offset + pivot
    st = transformed(twin, "t", scale=(2.0, 4.0), rotation=-90.0, translation=(-1 - 0.125 + 0.5, 1 + 0.25))
    twin.surface("UsdPreviewSurface", roughness=0.2, diffuseColor=uv_texture(twin, "c", image, st=st))
    check(foreign, twin)


def test_transmission_by_an_image_and_a_metal_with_a_tint(tmp_path: Path, image: Sdf.AssetPath) -> None:
    foreign, twin = both(tmp_path)
    through = foreign.node("t", "ND_image_float", size=1, file=image)
    foreign.surface(STANDARD, base_color=CLOTH, transmission=through)
    twin.surface(
        "UsdPreviewSurface", diffuseColor=CLOTH, roughness=0.2,
        opacity=uv_texture(twin, "o", image, "r", scale=(-1, 1, 1, 1), bias=(1, 0, 0, 0)),
    )  # fmt: skip
    check(foreign, twin)


@pytest.mark.parametrize(
    ("surface", "port", "node", "inside", "image_node", "file"),
    [
        (STANDARD, "normal", "ND_normalmap_float", "in", "ND_image_vector3", "file"),
        (OPEN_PBR, "geometry_normal", "ND_normalmap_float", "in", "ND_image_vector3", "file"),
        ("standard_surface", "normal", "normal_map", "input", "image", "filename"),
    ],
)
def test_normal_maps(
    surface: str, port: str, node: str, inside: str, image_node: str, file: str, tmp_path: Path, image: Sdf.AssetPath
) -> None:
    foreign, twin = both(tmp_path)
    space = {"color_space": "Raw"} if image_node == "image" else {}
    texel = foreign.node("texel", image_node, **{file: image}, **space)
    foreign.surface(surface, specular_roughness=0.3, **{port: foreign.node("map", node, **{inside: texel})})
    texture = uv_texture(twin, "n", image, scale=(2, 2, 2, 1), bias=(-1, -1, -1, 0))
    twin.surface("UsdPreviewSurface", diffuseColor=(0.8,) * 3, roughness=0.3, normal=texture)
    check(foreign, twin)
    assert np.abs(foreign.made()[0].normal - twin.points().normal).max() < 1e-6
    assert np.ptp(twin.points().normal, axis=0).min() > 0.1
    # At another strength it is no times and plus: it is named.
    scale = "strength" if node == "normal_map" else "scale"
    UsdShade.Shader(foreign.stage.GetPrimAtPath("/World/mtl/a/map")).CreateInput(scale, N.Float).Set(0.5)
    (said,) = foreign.made()[1]
    assert f"{port} of /World/mtl/a/surface is driven by /World/mtl/a/map with a strength of its own" in said


def test_half_a_metal_with_a_textured_base_and_a_tint(tmp_path: Path, image: Sdf.AssetPath) -> None:
    foreign, twin = both(tmp_path)
    color = foreign.node("color", "ND_image_color3", file=image)
    foreign.surface(STANDARD, base_color=color, metalness=0.25, specular_color=(1.0, 0.5, 0.5))
    quarter, rest = (0.25, 0.25, 0.25, 1), (0.75, 0.75, 0.75, 1)
    twin.surface(
        "UsdPreviewSurface", useSpecularWorkflow=1, roughness=0.2,
        diffuseColor=uv_texture(twin, "d", image, scale=rest),
        specularColor=uv_texture(twin, "s", image, scale=quarter, bias=(0.03, 0.015, 0.015, 0)),
    )  # fmt: skip
    check(foreign, twin)


def test_images_of_arnold(tmp_path: Path, image: Sdf.AssetPath) -> None:
    foreign, twin = both(tmp_path)
    color = foreign.node(
        "color", "image", "rgba", filename="./a.png", uvset="st1", sscale=2.0, tscale=3.0, soffset=0.25, tflip=1,
        multiply=(0.5, 0.25, 1.0), color_space="sRGB", swrap="mirror", twrap="periodic",
    )  # fmt: skip
    UsdShade.Shader(color.GetPrim()).GetPrim().RemoveProperty("inputs:filename")
    UsdShade.Shader(color.GetPrim()).CreateInput("filename", N.Asset).Set(image)
    rough = foreign.node("rough", "image", "g", 1, filename=image, color_space="Raw")
    foreign.surface("standard_surface", base_color=color, specular_roughness=rough)
    reader = twin.node("reader", "UsdPrimvarReader_float2", "result", 2, varname="st1")
    st = twin.node(
        "t", "UsdTransform2d", "result", 2, **{"in": reader}, scale=(2.0, -3.0), translation=(0.25, 1.0)
    )
    twin.surface(
        "UsdPreviewSurface", roughness=uv_texture(twin, "r", image, "g"),
        diffuseColor=uv_texture(
            twin, "c", image, st=st, sourceColorSpace="sRGB", wrapS="mirror", scale=(0.5, 0.25, 1, 1)
        ),
    )  # fmt: skip
    check(foreign, twin)


def test_textures_of_renderman(tmp_path: Path, image: Sdf.AssetPath) -> None:
    foreign, twin = both(tmp_path)
    manifold = foreign.node("m", "PxrManifold2D", "result", 3, scaleS=2.0, scaleT=4.0, offsetS=0.5, invertS=1)
    color = foreign.node("color", "PxrTexture", "resultRGB", filename=image, linearize=1, manifold=manifold)
    rough = foreign.node("rough", "PxrTexture", "resultG", 1, filename=image, invertT=0)
    foreign.surface("PxrDisneyBsdf", baseColor=color, roughness=rough)
    st = transformed(twin, "t", scale=(-2.0, 4.0), translation=(0.5, 0.0))  # 1 - (2 s + .5)
    upside_down = transformed(twin, "u", scale=(1.0, -1.0), translation=(0.0, 1.0))
    twin.surface(
        "UsdPreviewSurface", diffuseColor=uv_texture(twin, "c", image, st=st, sourceColorSpace="sRGB"),
        roughness=uv_texture(twin, "r", image, "g", st=upside_down),
    )  # fmt: skip
    check(foreign, twin)


@pytest.mark.parametrize(
    ("surface", "kind", "name", "output"),
    [
        (STANDARD, "ND_geompropvalue_color3", "geomprop", "out"),
        (STANDARD, "ND_UsdPrimvarReader_vector3", "varname", "out"),
        (STANDARD, "ND_geomcolor_color3", "", "out"),
        ("standard_surface", "user_data_rgb", "attribute", "out"),
    ],
)
def test_primvars(tmp_path: Path, surface: str, kind: str, name: str, output: str) -> None:
    foreign, twin = both(tmp_path)
    for each in (foreign, twin):
        primvar = each.mesh.CreateDisplayColorPrimvar("vertex")
        primvar.Set(Vt.Vec3fArray([(0.1, 0.2, 0.3), (0.5, 0.1, 0.1), (0.2, 0.6, 0.2), (0.3, 0.3, 0.7)]))
    color = foreign.node("color", kind, output, **({name: "displayColor"} if name else {}))
    foreign.surface(surface, base_color=color)
    reader = twin.node("reader", "UsdPrimvarReader_float3", "result", varname="displayColor")
    twin.surface("UsdPreviewSurface", roughness=0.2, diffuseColor=reader)
    check(foreign, twin)


# ---- what cannot be said ----------------------------------------------------------------------------------
def test_what_cannot_be_shown_is_named_and_has_its_default(tmp_path: Path, image: Sdf.AssetPath) -> None:
    foreign, twin = both(tmp_path)
    noise = foreign.node("noise", "ND_noise3d_color3")
    foreign.surface(STANDARD, base_color=noise, specular_roughness=0.4, sheen=0.5, thin_film_thickness=300.0)
    twin.surface("UsdPreviewSurface", diffuseColor=(0.8,) * 3, roughness=0.4)
    lost = "sheen, thin_film_thickness of /World/mtl/a/surface are not shown"
    driven = "base_color of /World/mtl/a/surface is driven by ND_noise3d_color3 at /World/mtl/a/noise"
    check(foreign, twin, [driven, lost])
    # With a displayColor that says what the noise is about.
    for each in (foreign, twin):
        each.mesh.CreateDisplayColorAttr([CLOTH])
    UsdShade.Shader(twin.stage.GetPrimAtPath("/World/mtl/a/surface")).GetInput("diffuseColor").Set(Gf.Vec3f(*CLOTH))
    check(foreign, twin, ["its displayColor (0.3, 0.2, 0.1) is used", lost])


def test_of_two_textures_that_meet_one_is_a_number(tmp_path: Path, image: Sdf.AssetPath) -> None:
    foreign, twin = both(tmp_path)
    color = foreign.node("color", "ND_image_color3", file=image)
    weight = foreign.node("weight", "ND_image_float", size=1, file=image, default=0.5)
    foreign.surface(STANDARD, base=weight, base_color=color)
    twin.surface(
        "UsdPreviewSurface", roughness=0.2, diffuseColor=uv_texture(twin, "c", image, scale=(0.5, 0.5, 0.5, 1))
    )
    check(foreign, twin, ["base colour of /World/mtl/a/surface is a product of two textures"])


def test_an_unknown_surface_keeps_the_displaycolor_and_says_so(tmp_path: Path) -> None:
    foreign, twin = both(tmp_path)
    for each in (foreign, twin):
        each.mesh.CreateDisplayColorAttr([CLOTH])
    foreign.surface("ND_mix_surfaceshader")
    twin.surface("UsdPreviewSurface", diffuseColor=CLOTH)
    check(foreign, twin, ["/World/mtl/a (mtlx) has no surface that can be shown: /World/quad keeps its displayColor"])


def test_an_image_without_a_file_is_its_default(tmp_path: Path) -> None:
    foreign, twin = both(tmp_path)
    foreign.surface(STANDARD, base_color=foreign.node("color", "ND_image_color3", default=CLOTH))
    twin.surface("UsdPreviewSurface", diffuseColor=CLOTH, roughness=0.2)
    check(foreign, twin, ["/World/mtl/a/color names no file: its default (0.3, 0.2, 0.1) is used"])


def test_a_network_that_goes_round_ends(tmp_path: Path) -> None:
    foreign, twin = both(tmp_path)
    first = foreign.node("first", "ND_multiply_color3")
    second = foreign.node("second", "ND_multiply_color3", in1=first)
    UsdShade.Shader(first.GetPrim()).CreateInput("in1", N.Color3f).ConnectToSource(second)
    foreign.surface(STANDARD, base_color=first)
    twin.surface("UsdPreviewSurface", diffuseColor=(0.8,) * 3, roughness=0.2)
    check(foreign, twin, ["a network that goes round"])


# ---- real stages ------------------------------------------------------------------------------------------
def opened(path: Path) -> Usd.Stage:
    """A real stage, to be edited in a session layer of its own."""
    stage = Usd.Stage.Open(Sdf.Layer.FindOrOpen(str(path)), Sdf.Layer.CreateAnonymous(".usda"))
    stage.SetEditTarget(stage.GetSessionLayer())
    return stage


def shaders(stage: Usd.Stage, kind: str) -> list[UsdShade.Shader]:
    found = [UsdShade.Shader(p) for p in stage.TraverseAll() if p.IsA(UsdShade.Shader)]
    return [s for s in found if s.GetIdAttr().Get() == kind]


@pytest.mark.parametrize(
    "name", ["shaderball_usdwg/standard_shader_ball_scene.usda", "shaderball_usdwg/layers/environment.usda"]
)
def test_walls_of_a_real_stage_look_as_their_authors_preview_materials(name: str, assets: Path) -> None:
    # The authors gave each wall both: OpenPBR with an image and no specular, and a UsdPreviewSurface.  Their
    # UsdUVTextures leave out that they repeat, without which coordinates from -1 to 0 show black.
    ours, theirs = opened(assets / name), opened(assets / name)
    for shader in shaders(ours, "UsdPreviewSurface"):
        shader.GetIdAttr().Set("gone")
    for shader in shaders(theirs, "UsdUVTexture"):
        for axis in "ST":
            shader.CreateInput(f"wrap{axis}", N.Token).Set("repeat")
    made = make_preview(ours, None)
    a, b = (read_scene(stage, refine=0) for stage in (compose_over(ours, made.layer), theirs))
    rng = np.random.default_rng(2)
    for gprim in ("back", "front", "left", "right", "top"):
        (number,) = (i for i, m in enumerate(a.meshes) if m.path.endswith(f"/box/{gprim}"))
        first, last = a.triangles.first_of_mesh[number : number + 2]
        triangle, at = rng.integers(first, last, 50), rng.uniform(0.01, 0.49, (50, 2))
        got, wanted = (evaluate_surface(s, triangle, at) for s in (a, b))
        assert np.ptp(wanted.diffuse) > 0.005
        assert_allclose(got.diffuse, wanted.diffuse, atol=1e-6)
        assert_allclose(got.roughness, wanted.roughness)
        assert_allclose(got.f0, 0, atol=1e-9)  # specular_weight 0, which the authors' own leave at .04


def test_a_teapot_of_materialx_has_the_defaults_of_its_definition(assets: Path) -> None:
    stage = opened(assets / "teapots_instanced_usdwg/assets/teapot/teapot.usd")
    for shader in shaders(stage, "UsdPreviewSurface"):
        shader.GetIdAttr().Set("gone")
    (material,) = read_scene(compose_over(stage, make_preview(stage, None).layer), refine=0).materials
    assert_allclose(material.diffuse_color, 0.8)
    assert_allclose((material.roughness, material.ior, material.metallic), ([0.2], [1.5], [0.0]))


def test_files_of_the_look_are_named_from_where_it_lies(tmp_path: Path, image: Sdf.AssetPath) -> None:
    foreign = Nodes(tmp_path / "foreign.usda")
    foreign.surface(STANDARD, base_color=foreign.node("color", "ND_image_color3", file=image))
    (tmp_path / "looks").mkdir()
    made = make_preview(foreign.stage, None)
    look = LookLayer(foreign.stage)
    write_made(look, made.made, {m.material for m in made.made}, folder=tmp_path / "looks")
    file = look.layer.GetAttributeAtPath("/World/SlfMaterials/preview_quad/diffuseColor_texture.inputs:file")
    assert file.default.path == "../a.png"
