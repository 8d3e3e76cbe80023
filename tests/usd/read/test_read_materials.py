"""Materials read from small stages whose records can be told by hand."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
from pxr import Usd

from usdslf.color import USD_DEFAULT_SPACE, color_of
from usdslf.scene.records import Material, PrimvarInput, Texture
from usdslf.textures.images import write_image
from usdslf.usd.notes import Notes
from usdslf.usd.read.materials import MaterialTable

SHADER = 'def Shader "s" { uniform token info:id = "UsdPreviewSurface"\n token outputs:surface\n %s }'
READER = 'def Shader "uv" { uniform token info:id = "UsdPrimvarReader_float2"\n%s\n float2 outputs:result }'


def material(name: str, shader: str = "", more: str = "", head: str = "") -> str:
    """A material with a UsdPreviewSurface `s`."""
    connect = f"token outputs:surface.connect = </{name}/s.outputs:surface>"
    return f'def Material "{name}" {{ {connect}\n {head}\n{SHADER % shader}\n{more} }}\n'


def texture(inputs: str, node: str = "t") -> str:
    return (
        f'def Shader "{node}" {{ uniform token info:id = "UsdUVTexture"\n{inputs}\n'
        "float outputs:r\n float outputs:a\n float3 outputs:rgb }\n"
    )


def stage_of(text: str, folder: Path | None = None) -> Usd.Stage:
    text = text.replace("}", "\n}\n")  # the parser wants one property a line
    if folder is None:
        stage = Usd.Stage.CreateInMemory()
        assert stage.GetRootLayer().ImportFromString("#usda 1.0\n" + text)
        return stage
    path = folder / "stage.usda"
    path.write_text("#usda 1.0\n" + text)
    return Usd.Stage.Open(str(path))


def read(
    stage: Usd.Stage, prim: str = "/ball", time: float | None = None, notes: Notes | None = None
) -> Material:
    code = Usd.TimeCode.EarliestTime() if time is None else Usd.TimeCode(time)
    table = MaterialTable(code, color_of(None, USD_DEFAULT_SPACE), notes or Notes())
    return table.materials[table(stage.GetPrimAtPath(prim))]


def ball(binding: str = "rel material:binding = </m>", more: str = "") -> str:
    return f'def Sphere "ball" ( prepend apiSchemas = ["MaterialBindingAPI"] ) {{ {binding}\n{more} }}\n'


# ---- constants -----------------------------------------------------------------------------------
def test_constants_and_fallbacks() -> None:
    inputs = "color3f inputs:diffuseColor = (0.1, 0.2, 0.3)\n float inputs:ior = 1.7\n"
    inputs += "int inputs:useSpecularWorkflow = 1\n color3f inputs:specularColor = (0.5, 0.5, 0.5)\n"
    inputs += 'float inputs:opacityThreshold = 0.3\n token inputs:opacityMode = "presence"'
    found = read(stage_of(ball() + material("m", inputs)))
    assert found.diffuse_color == pytest.approx([0.1, 0.2, 0.3])
    assert found.ior == pytest.approx([1.7])
    assert found.use_specular_workflow
    assert found.specular_color == pytest.approx([0.5] * 3)
    assert (found.opacity_threshold, found.opacity_mode) == (pytest.approx(0.3), "presence")
    assert found.roughness == pytest.approx([0.5])
    assert found.clearcoat_roughness == pytest.approx([0.01])
    assert (found.path, found.shader, found.why_not_editable) == ("/m", "/m/s", "")


def test_values_are_read_at_the_time() -> None:
    inputs = "float inputs:roughness.timeSamples = { 1: 0.2, 11: 0.4 }"
    stage = stage_of(ball() + material("m", inputs))
    assert read(stage, time=6).roughness == pytest.approx([0.3])
    assert read(stage).roughness == pytest.approx([0.2])


def test_interface_inputs_and_node_graphs_are_followed() -> None:
    graph = """def NodeGraph "g" {
        float inputs:deep.connect = </m.inputs:rough>
        float outputs:out.connect = </m/g/t.outputs:r>
        def Shader "t" { uniform token info:id = "UsdUVTexture"
            float4 inputs:scale.connect = </m/g.inputs:deep4>\n float outputs:r }
        float4 inputs:deep4 = (3, 3, 3, 3)
    }"""
    inputs = "float inputs:roughness.connect = </m/g.inputs:deep>\n"
    inputs += "float inputs:metallic.connect = </m/g.outputs:out>"
    found = read(stage_of(ball() + material("m", inputs, graph, "float inputs:rough = 0.25")))
    assert found.roughness == pytest.approx([0.25])
    assert isinstance(found.metallic, Texture)
    assert found.metallic.scale == (3, 3, 3, 3)
    assert (found.metallic.prim, found.metallic.channels) == ("/m/g/t", "r")


def test_a_dangling_connection_leaves_the_value_beside_it() -> None:
    inputs = "float inputs:roughness = 0.3\n float inputs:roughness.connect = </m/none.outputs:r>"
    assert read(stage_of(ball() + material("m", inputs))).roughness == pytest.approx([0.3])


def test_what_cannot_be_read_is_noted_with_its_prim() -> None:
    notes = Notes()
    odd = 'def Shader "x" { uniform token info:id = "Voronoi"\n float outputs:out }'
    inputs = "float inputs:roughness.connect = </m/x.outputs:out>"
    assert read(stage_of(ball() + material("m", inputs, odd)), notes=notes).roughness == pytest.approx([0.5])
    assert any("/m/x" in s and "Voronoi" in s for s in notes.sentences())


def test_colours_of_another_space_come_into_the_working_space() -> None:
    inputs = 'color3f inputs:diffuseColor = (1, 0, 0) ( colorSpace = "lin_ap1_scene" )'
    found = read(stage_of(ball() + material("m", inputs)))
    assert found.diffuse_color == pytest.approx([1.7051, -0.1303, -0.0240], abs=2e-3)  # AP1 red in Rec.709


# ---- textures ------------------------------------------------------------------------------------
def textured(tmp_path: Path, inputs: str, more: str = "", channel: str = "rgb") -> tuple[Texture, Notes]:
    write_image(tmp_path / "a.exr", np.ones((2, 2, 3)))
    notes = Notes()
    shader = f"color3f inputs:diffuseColor.connect = </m/t.outputs:{channel}>"
    stage = stage_of(ball() + material("m", shader, texture(inputs) + more), tmp_path)
    found = read(stage, notes=notes).diffuse_color
    assert isinstance(found, Texture)
    return found, notes


def test_textures_with_all_their_inputs(tmp_path: Path) -> None:
    inputs = (
        'asset inputs:file = @./a.exr@\n token inputs:wrapS = "mirror"\n token inputs:wrapT = "clamp"\n'
        "float4 inputs:scale = (2, 2, 2, 1)\n float4 inputs:bias = (-1, -1, -1, 0)\n"
        'float4 inputs:fallback = (0.5, 0.5, 1, 1)\n token inputs:sourceColorSpace = "raw"\n'
        "float2 inputs:st.connect = </m/uv.outputs:result>"
    )
    found, notes = textured(tmp_path, inputs, READER % 'string inputs:varname = "map1"', "a")
    assert found.path == str(tmp_path / "a.exr")
    assert (found.wrap_s, found.wrap_t, found.channels, found.uv_set) == ("mirror", "clamp", "a", "map1")
    assert (found.scale, found.bias) == ((2, 2, 2, 1), (-1, -1, -1, 0))
    assert (found.fallback, found.color_space) == ((0.5, 0.5, 1, 1), "raw")
    assert notes.sentences() == []


def test_wrap_falls_back_to_black_and_st_to_st(tmp_path: Path) -> None:
    found, _ = textured(tmp_path, "asset inputs:file = @./a.exr@")
    assert (found.wrap_s, found.wrap_t, found.uv_set) == ("black", "black", "st")
    assert (found.color_space, found.fallback) == ("auto", (0, 0, 0, 1))


@pytest.mark.parametrize(
    ("file", "source", "expected"),
    [("sRGB", "auto", "sRGB"), ("sRGB", "raw", "raw"), ("", "sRGB", "sRGB"), ("nonsense", "auto", "auto")],
)
def test_source_color_space_wins_over_metadata(tmp_path: Path, file: str, source: str, expected: str) -> None:
    metadata = f'( colorSpace = "{file}" )' if file else ""
    inputs = f'asset inputs:file = @./a.exr@ {metadata}\n token inputs:sourceColorSpace = "{source}"'
    found, notes = textured(tmp_path, inputs)
    assert found.color_space == expected
    assert bool(notes.sentences()) == (file == "nonsense")


def test_transforms_chain_scale_rotate_translate(tmp_path: Path) -> None:
    def transform(node: str, source: str, inputs: str) -> str:
        return (
            f'def Shader "{node}" {{ uniform token info:id = "UsdTransform2d"\n{inputs}\n'
            f"float2 inputs:in.connect = </m/{source}.outputs:result>\n float2 outputs:result }}\n"
        )

    more = transform("x1", "x2", "float inputs:rotation = 90\n float2 inputs:translation = (1, 2)")
    more += transform("x2", "uv", "float2 inputs:scale = (3, 5)") + READER % 'string inputs:varname = "st"'
    inputs = "asset inputs:file = @./a.exr@\n float2 inputs:st.connect = </m/x1.outputs:result>"
    found, _ = textured(tmp_path, inputs, more)
    moved = np.array(found.st_from_uv) @ [0.2, 0.1, 1]
    assert moved == pytest.approx([1 - 0.5, 2 + 0.6, 1])  # (.6, .5) turned by 90 degrees, then moved
    assert math.isclose(np.linalg.det(np.array(found.st_from_uv)[:2, :2]), 15)


def test_constant_coordinates_and_reader_fallback(tmp_path: Path) -> None:
    found, _ = textured(tmp_path, "asset inputs:file = @./a.exr@\n float2 inputs:st = (0.25, 0.75)")
    assert np.array(found.st_from_uv) @ [9, 9, 1] == pytest.approx([0.25, 0.75, 1])
    reader = READER % 'string inputs:varname = "st"\n float2 inputs:fallback = (0.3, 0.4)'
    inputs = "asset inputs:file = @./a.exr@\n float2 inputs:st.connect = </m/uv.outputs:result>"
    found, _ = textured(tmp_path, inputs, reader)
    assert found.st_fallback == pytest.approx((0.3, 0.4))


def test_varname_through_the_interface_as_a_token(tmp_path: Path) -> None:
    reader = READER % "token inputs:varname.connect = </m.inputs:frame:stPrimvarName>"
    write_image(tmp_path / "a.exr", np.ones((2, 2, 3)))
    inputs = "asset inputs:file = @./a.exr@\n float2 inputs:st.connect = </m/uv.outputs:result>"
    body = material(
        "m",
        "color3f inputs:diffuseColor.connect = </m/t.outputs:rgb>",
        texture(inputs) + reader,
        'token inputs:frame:stPrimvarName = "UVMap"',
    )
    found = read(stage_of(ball() + body, tmp_path)).diffuse_color
    assert isinstance(found, Texture)
    assert found.uv_set == "UVMap"


def test_udim_tiles_are_listed(tmp_path: Path) -> None:
    for tile in (1001, 1012):
        write_image(tmp_path / f"a.{tile}.exr", np.ones((2, 2, 3)))
    found, notes = textured(tmp_path, "asset inputs:file = @./a.<UDIM>.exr@")
    assert [t for t, _ in found.tiles] == [1001, 1012]
    assert [Path(f).name for _, f in found.tiles] == ["a.1001.exr", "a.1012.exr"]
    assert notes.sentences() == []
    found, notes = textured(tmp_path, "asset inputs:file = @./b.<UDIM>.exr@")
    assert found.tiles == ()
    assert any("/m/t" in s for s in notes.sentences())


def test_missing_textures_are_noted_with_the_shader(tmp_path: Path) -> None:
    for inputs in ("asset inputs:file = @./none.png@", "asset inputs:file = @@", ""):
        found, notes = textured(tmp_path, inputs)
        assert found.path == ""
        assert any("/m/t" in s for s in notes.sentences())


def test_primvar_readers_feed_inputs() -> None:
    reader = 'def Shader "p" { uniform token info:id = "UsdPrimvarReader_float3"\n'
    reader += 'string inputs:varname = "displayColor"\n float3 inputs:fallback = (1, 0, 0)\n'
    reader += "float3 outputs:result }"
    inputs = "color3f inputs:diffuseColor.connect = </m/p.outputs:result>"
    assert read(stage_of(ball() + material("m", inputs, reader))).diffuse_color == PrimvarInput(
        "displayColor", (1.0, 0.0, 0.0)
    )


@pytest.mark.parametrize("authored", [False, True])
def test_normal_maps_of_integers_are_vectors(tmp_path: Path, authored: bool) -> None:
    write_image(tmp_path / "n.png", np.full((2, 2, 3), 0.5))
    inputs = "asset inputs:file = @./n.png@\n"
    if authored:
        inputs += "float4 inputs:scale = (2, 2, 2, 1)\n float4 inputs:bias = (-1, -1, -1, 0)\n"
        inputs += 'token inputs:sourceColorSpace = "raw"'
    notes = Notes()
    shader = "normal3f inputs:normal.connect = </m/t.outputs:rgb>"
    found = read(stage_of(ball() + material("m", shader, texture(inputs)), tmp_path), notes=notes).normal
    assert found is not None
    assert (found.scale, found.bias, found.color_space) == ((2, 2, 2, 1), (-1, -1, -1, 0), "raw")
    assert len(notes.sentences()) == (0 if authored else 2)


# ---- bindings ------------------------------------------------------------------------------------
def test_preview_wins_over_all_purpose_and_full() -> None:
    binding = (
        "rel material:binding = </a>\n rel material:binding:preview = </p>\n rel material:binding:full = </f>"
    )
    stage = stage_of(ball(binding) + material("a") + material("p") + material("f"))
    assert read(stage).path == "/p"


def test_full_is_used_where_nothing_else_is_bound() -> None:
    assert read(stage_of(ball("rel material:binding:full = </f>") + material("f"))).path == "/f"


def test_full_is_used_where_only_it_has_a_preview_surface() -> None:
    plain = 'def Material "a" { token outputs:ri:surface }\n'
    binding = "rel material:binding = </a>\n rel material:binding:full = </f>"
    assert read(stage_of(ball(binding) + plain + material("f"))).path == "/f"


@pytest.mark.parametrize(("strength", "expected"), [("strongerThanDescendants", "/a"), ("", "/b")])
def test_inherited_bindings_and_their_strength(strength: str, expected: str) -> None:
    bind = f'( bindMaterialAs = "{strength}" )' if strength else ""
    text = (
        'def Xform "x" ( prepend apiSchemas = ["MaterialBindingAPI"] )'
        f"{{ rel material:binding = </a> {bind}\n" + ball("rel material:binding = </b>") + "}\n"
    )
    assert read(stage_of(text + material("a") + material("b")), "/x/ball").path == expected


def test_collection_bindings() -> None:
    text = """def Xform "x" ( prepend apiSchemas = ["MaterialBindingAPI", "CollectionAPI:red"] ) {
        rel collection:red:includes = </x/ball>
        rel material:binding:collection:red = [</x.collection:red>, </a>]
        rel material:binding = </b>
        def Sphere "ball" {}
        def Sphere "other" {}
    }"""
    stage = stage_of(text + material("a") + material("b"))
    assert read(stage, "/x/ball").path == "/a"
    assert read(stage, "/x/other").path == "/b"


def test_subsets_have_their_own_material() -> None:
    subset = (
        'def GeomSubset "part" ( prepend apiSchemas = ["MaterialBindingAPI"] ) {'
        'uniform token elementType = "face"\n uniform token familyName = "materialBind"\n'
        "int[] indices = [0]\n rel material:binding = </b> }"
    )
    stage = stage_of(ball(more=subset) + material("m") + material("b"))
    assert read(stage, "/ball/part").path == "/b"
    assert read(stage).path == "/m"


def test_one_material_has_one_index_and_instances_have_their_own() -> None:
    text = (
        'class "proto" { '
        + ball("rel material:binding = </proto/m>")
        + material("m", "").replace("</m", "</proto/m")
    )
    text += '}\ndef "i" ( instanceable = true\n inherits = </proto> ) {}\n'
    text += 'def "j" ( instanceable = true\n inherits = </proto> ) {}\n'
    stage = stage_of(text)
    table = MaterialTable(Usd.TimeCode.Default(), color_of(None, USD_DEFAULT_SPACE), Notes())
    first = [table(stage.GetPrimAtPath(p)) for p in ("/i/ball", "/j/ball", "/i/ball")]
    assert first == [0, 1, 0]
    assert [m.path for m in table.materials] == ["/i/m", "/j/m"]
    assert [m.shader for m in table.materials] == ["/i/m/s", "/j/m/s"]


# ---- stand-ins -----------------------------------------------------------------------------------
def test_display_color_stands_in_and_says_why() -> None:
    found = read(stage_of(ball("color3f[] primvars:displayColor = [(0.1, 0.2, 0.3)]")))
    assert found.diffuse_color == pytest.approx([0.1, 0.2, 0.3])
    assert (found.path, found.shader) == ("", "")
    assert "no material" in found.why_not_editable


def test_varying_display_color_is_a_primvar_and_opacity_goes_along() -> None:
    colors = 'color3f[] primvars:displayColor = [(1, 0, 0), (0, 1, 0)] ( interpolation = "vertex" )\n'
    found = read(stage_of(ball(colors + "float[] primvars:displayOpacity = [0.25]")))
    assert found.diffuse_color == PrimvarInput("displayColor", (0.18, 0.18, 0.18))
    assert found.opacity == pytest.approx([0.25])


def test_equal_stand_ins_are_one() -> None:
    text = "".join(
        f'def Sphere "{n}" {{ color3f[] primvars:displayColor = [({v}, 0, 0)] }}\n'
        for n, v in (("a", 1), ("b", 1), ("c", 0.5), ("d", 1))
    )
    stage = stage_of(text)
    table = MaterialTable(Usd.TimeCode.Default(), color_of(None, USD_DEFAULT_SPACE), Notes())
    assert [table(stage.GetPrimAtPath(f"/{n}")) for n in "abcd"] == [0, 0, 1, 0]


def test_other_shaders_are_named_with_their_contexts() -> None:
    other = """def Material "m" { token outputs:mtlx:surface.connect = </m/x.outputs:out>
        def Shader "x" { uniform token info:id = "ND_standard_surface_surfaceshader"
            token outputs:out } }"""
    found = read(
        stage_of(ball("rel material:binding = </m>\ncolor3f[] primvars:displayColor = [(1, 0, 0)]") + other)
    )
    assert found.path == "/m"
    assert "mtlx" in found.why_not_editable
    assert "/m" in found.why_not_editable
    assert found.diffuse_color == pytest.approx([1, 0, 0])
