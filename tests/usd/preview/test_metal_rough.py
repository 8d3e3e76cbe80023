"""Surfaces of glTF, RealityKit and OmniPBR as UsdPreviewSurface: twins written by hand, by the models' publications.

glTF 2.0, appendix B, and KHR_materials_specular; Apple, PBR Surface (RealityKit); NVIDIA, OmniPBR.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from kit.shader_nodes import Nodes
from numpy.testing import assert_allclose
from pxr import Sdf, UsdShade

from usdslf.textures.images import write_image
from usdslf.usd.preview.preview_material import make_preview
from usdslf.usd.read.read import open_stage

FIELDS = ("diffuse", "f0", "f90", "roughness", "clearcoat", "clearcoat_roughness", "emission", "opacity", "presence")
GLTF, REALITYKIT = "ND_gltf_pbr_surfaceshader", "ND_realitykit_pbr_surfaceshader"
CLOTH = (0.3, 0.2, 0.1)
NUMBERS: dict[str, tuple[str, dict[str, Any], dict[str, Any]]] = {
    "defaults of glTF": (GLTF, {}, {"diffuseColor": (1.0,) * 3, "metallic": 1.0, "roughness": 1.0}),
    "a dielectric of glTF": (
        GLTF, {"base_color": CLOTH, "metallic": 0.0, "roughness": 0.3, "ior": 1.8, "specular": 1.0},
        {"diffuseColor": CLOTH, "roughness": 0.3, "ior": 1.8},
    ),
    "half a specular of glTF": (
        GLTF,
        {"base_color": CLOTH, "metallic": 0.0, "roughness": 0.3, "specular": 0.5, "specular_color": (1, 0.5, 0.5)},
        {"useSpecularWorkflow": 1, "diffuseColor": CLOTH, "roughness": 0.3, "specularColor": (0.02, 0.01, 0.01)},
    ),
    "alpha of glTF where it is opaque": (
        GLTF, {"base_color": CLOTH, "alpha": 0.2}, {"diffuseColor": CLOTH, "metallic": 1.0, "roughness": 1.0}
    ),
    "alpha of glTF where it is blended": (
        GLTF, {"base_color": CLOTH, "metallic": 0.0, "alpha": 0.25, "alpha_mode": 2},
        {"diffuseColor": CLOTH, "roughness": 1.0, "opacity": 0.25, "opacityMode": "presence"},
    ),
    "coat and light of glTF": (
        GLTF,
        {
            "base_color": CLOTH, "metallic": 0.0, "clearcoat": 0.5, "clearcoat_roughness": 0.2,
            "emissive": (1.0, 0.5, 0.0), "emissive_strength": 3.0,
        },
        {
            "diffuseColor": CLOTH, "roughness": 1.0, "clearcoat": 0.5, "clearcoatRoughness": 0.2,
            "emissiveColor": (3.0, 1.5, 0.0),
        },
    ),
    "RealityKit": (
        REALITYKIT, {"baseColor": CLOTH, "roughness": 0.4}, {"diffuseColor": CLOTH, "roughness": 0.4}
    ),
    "a metal of RealityKit": (
        REALITYKIT + "_2_0", {"baseColor": CLOTH, "roughness": 0.25, "metallic": 1.0, "specular": 0.1},
        {"diffuseColor": CLOTH, "roughness": 0.25, "metallic": 1.0},
    ),
    "OmniPBR": (
        "mdl:OmniPBR", {"diffuse_color_constant": (0.6, 0.2, 0.2), "reflection_roughness_constant": 0.3},
        {"diffuseColor": (0.6, 0.2, 0.2), "roughness": 0.3},
    ),
    "defaults of OmniPBR": ("mdl:OmniPBR", {}, {"diffuseColor": (0.2,) * 3, "roughness": 0.5}),
    "brightened and tinted OmniPBR": (
        "mdl:OmniPBR",
        {
            "diffuse_color_constant": CLOTH, "albedo_brightness": 2.0, "albedo_add": 0.1,
            "diffuse_tint": (1.0, 0.5, 0.5), "metallic_constant": 1.0,
        },
        {"diffuseColor": (0.7, 0.25, 0.15), "metallic": 1.0, "roughness": 0.5},
    ),
}  # fmt: skip


def surface(nodes: Nodes, kind: str, inputs: dict[str, Any]) -> Nodes:
    if not kind.startswith("mdl:"):
        return nodes.surface(kind, **inputs)
    out = nodes.node("surface", kind, "out", 0, **inputs)
    shader = UsdShade.Shader(out.GetPrim())
    shader.SetSourceAsset(Sdf.AssetPath("OmniPBR.mdl"), "mdl")
    shader.SetSourceAssetSubIdentifier(kind.removeprefix("mdl:"), "mdl")
    nodes.material.CreateSurfaceOutput("mdl").ConnectToSource(out)
    nodes.stage.GetRootLayer().Save()
    return nodes


def check(folder: Path, kind: str, inputs: dict[str, Any], twin: Nodes) -> None:
    got, said = surface(Nodes(folder / "foreign.usda"), kind, inputs).made()
    assert not said, said
    wanted = twin.points()
    for name in FIELDS:
        assert_allclose(getattr(got, name), getattr(wanted, name), atol=1e-5, err_msg=name)


@pytest.mark.parametrize("case", NUMBERS)
def test_numbers_mean_what_the_model_says(case: str, tmp_path: Path) -> None:
    kind, inputs, preview = NUMBERS[case]
    check(tmp_path, kind, inputs, Nodes(tmp_path / "twin.usda").surface("UsdPreviewSurface", **preview))


def test_textures_of_omni_pbr_are_inputs_of_its_own(tmp_path: Path) -> None:
    """A base texture, and occlusion, roughness and metalness packed, half of which counts for the roughness."""
    rng = np.random.default_rng(1)
    for name in ("base", "orm"):
        write_image(tmp_path / f"{name}.png", rng.uniform(0.2, 0.8, (8, 8, 3)))
    base, orm = (Sdf.AssetPath(f"./{name}.png") for name in ("base", "orm"))
    twin = Nodes(tmp_path / "twin.usda")
    st = twin.node("st", "UsdPrimvarReader_float2", "result", 2, varname="st")
    common = {"st": st, "wrapS": "repeat", "wrapT": "repeat"}
    scale, bias = (0.5, 0.5, 1.0, 1.0), (0.0, 0.15, 0.0, 0.0)  # half of the texture, half of .3
    color = twin.node("base", "UsdUVTexture", "rgb", 3, file=base, sourceColorSpace="sRGB", **common)
    packed = twin.node(
        "orm", "UsdUVTexture", "g", 1, file=orm, sourceColorSpace="raw", scale=scale, bias=bias, **common
    )
    metal = UsdShade.Shader(packed.GetPrim()).CreateOutput("b", Sdf.ValueTypeNames.Float)
    twin.surface("UsdPreviewSurface", diffuseColor=color, roughness=packed, metallic=metal)
    inputs = {
        "diffuse_texture": base, "ORM_texture": orm, "enable_ORM_texture": 1, "reflection_roughness_constant": 0.3,
        "reflection_roughness_texture_influence": 0.5, "metallic_texture_influence": 1.0,
    }  # fmt: skip
    check(tmp_path, "mdl:OmniPBR", inputs, twin)


def test_images_of_gltf_in_materialx(tmp_path: Path) -> None:
    write_image(tmp_path / "base.png", np.random.default_rng(2).uniform(0.2, 0.8, (8, 8, 3)))
    file = Sdf.AssetPath("./base.png")
    foreign, twin = Nodes(tmp_path / "foreign.usda"), Nodes(tmp_path / "twin.usda")
    image = foreign.node("image", "ND_gltf_colorimage", "outcolor", 3, file=file)
    UsdShade.Shader(image.GetPrim()).GetInput("file").GetAttr().SetColorSpace("srgb_texture")
    foreign.surface(GLTF, base_color=image, metallic=0.0, roughness=0.6)
    st = twin.node("st", "UsdPrimvarReader_float2", "result", 2, varname="st")
    color = twin.node(
        "base", "UsdUVTexture", "rgb", 3, file=file, sourceColorSpace="sRGB", st=st, wrapS="repeat", wrapT="repeat"
    )
    twin.surface("UsdPreviewSurface", diffuseColor=color, roughness=0.6)
    got, said = foreign.made()
    assert not said, said
    for name in FIELDS:
        assert_allclose(getattr(got, name), getattr(twin.points(), name), atol=1e-5, err_msg=name)


def test_a_stage_of_both_is_read(inputs: Path) -> None:
    made = make_preview(open_stage(inputs / "weak/realitykit_mdl.usda"), None)
    shown = {str(m.prim): m.shows for m in made.made}
    assert shown["/World/A"]["diffuseColor"].number == pytest.approx((0.2, 0.6, 0.2))
    assert shown["/World/A"]["roughness"].number == pytest.approx((0.4,))
    assert shown["/World/B"]["diffuseColor"].number == pytest.approx((0.6, 0.2, 0.2))
    assert shown["/World/B"]["roughness"].number == pytest.approx((0.3,))
