"""Numbers of other renderers' surfaces as UsdPreviewSurface: values of the published models.

They are the models' own: MaterialX 1.39 (standard_surface.mtlx, open_pbr_surface.mtlx and their defaults), Autodesk
Standard Surface (Georgiev et al. 2019), OpenPBR 1.1, Burley 2012 and RenderMan's documentation of PxrSurface.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from kit.preview_twins import CLOTH, OPEN_PBR, STANDARD, both, check, f0


def gold(v: float) -> tuple[float, float, float]:
    return (0.9 * v, 0.7 * v, 0.3 * v)
COATED = {"coat": 0.5, "coat_color": (0.8, 0.6, 0.4), "coat_roughness": 0.25}
# model and its inputs, and the UsdPreviewSurface that its publication makes of them
NUMBERS: dict[str, tuple[str, dict[str, Any], dict[str, Any]]] = {
    "defaults of MaterialX": (STANDARD, {}, {"diffuseColor": (0.8,) * 3, "roughness": 0.2}),
    "defaults of its first version": (STANDARD + "_100", {}, {"diffuseColor": (0.8,) * 3, "roughness": 0.2}),
    "defaults of Arnold": ("standard_surface", {}, {"diffuseColor": (0.8,) * 3, "roughness": 0.2}),
    "defaults of OpenPBR": (OPEN_PBR, {}, {"diffuseColor": (0.8,) * 3, "roughness": 0.3}),
    "defaults of PxrSurface": (
        "PxrSurface", {}, {"useSpecularWorkflow": 1, "specularColor": (0.0,) * 3, "roughness": 1.0}
    ),
    "no specular": (
        STANDARD, {"base_color": CLOTH, "specular": 0.0, "specular_roughness": 0.1},
        {"diffuseColor": CLOTH, "ior": 1.0, "roughness": 1.0},
    ),
    "base": (
        STANDARD, {"base": 0.5, "base_color": CLOTH, "specular_roughness": 0.7, "specular_IOR": 1.8},
        {"diffuseColor": (0.15, 0.1, 0.05), "roughness": 0.7, "ior": 1.8},
    ),
    "half a specular weight": (
        STANDARD, {"base_color": CLOTH, "specular": 0.5, "specular_IOR": 2.0},
        {"useSpecularWorkflow": 1, "diffuseColor": CLOTH, "specularColor": (0.5 / 9,) * 3, "roughness": 0.2},
    ),
    "tinted specular": (
        "standard_surface", {"base_color": CLOTH, "specular": 0.9, "specular_color": (1.0, 0.5, 0.2)},
        {"useSpecularWorkflow": 1, "diffuseColor": CLOTH, "specularColor": (0.036, 0.018, 0.0072), "roughness": 0.2},
    ),
    "metal": (
        STANDARD, {"base": 0.8, "base_color": gold(1), "metalness": 1.0, "specular_color": (0.9, 0.8, 0.7)},
        {"diffuseColor": gold(0.8), "metallic": 1.0, "roughness": 0.2},
    ),
    "half metal": (
        STANDARD, {"base_color": gold(1), "metalness": 0.5},
        {"diffuseColor": gold(1), "metallic": 0.5, "roughness": 0.2},
    ),
    "half metal with a tint": (
        STANDARD, {"base_color": gold(1), "metalness": 0.25, "specular_color": (1.0, 0.5, 0.5)},
        {
            "useSpecularWorkflow": 1, "diffuseColor": gold(0.75), "roughness": 0.2,
            "specularColor": tuple(0.25 * c + 0.75 * 0.04 * t for c, t in zip(gold(1), (1, 0.5, 0.5))),
        },
    ),
    "metal of OpenPBR with half a specular weight": (
        OPEN_PBR, {"base_color": gold(1), "base_metalness": 1.0, "specular_weight": 0.5, "base_weight": 0.9},
        {"diffuseColor": gold(0.45), "metallic": 1.0, "roughness": 0.3},
    ),
    "coat": (
        STANDARD, {"base_color": CLOTH, **COATED},
        {
            "useSpecularWorkflow": 1, "specularColor": (0.036, 0.032, 0.028), "clearcoat": 0.5,
            "diffuseColor": (0.27, 0.16, 0.07), "roughness": 0.2, "clearcoatRoughness": 0.25,
        },
    ),
    "coat of another ior": (
        STANDARD, {"base_color": CLOTH, "coat": 1.0, "coat_IOR": 2.0},
        {
            "useSpecularWorkflow": 1, "diffuseColor": CLOTH, "specularColor": (0.04,) * 3, "ior": 2.0,
            "clearcoat": 1.0, "clearcoatRoughness": 0.1, "roughness": 0.2,
        },
    ),
    "glass": (
        STANDARD, {"base_color": CLOTH, "transmission": 0.75},
        {"diffuseColor": CLOTH, "opacity": 0.25, "roughness": 0.2},
    ),
    "a metal lets nothing through": (
        STANDARD, {"base_color": gold(1), "metalness": 1.0, "transmission": 1.0},
        {"diffuseColor": gold(1), "metallic": 1.0, "roughness": 0.2},
    ),
    "cut out": (
        STANDARD, {"base_color": CLOTH, "opacity": (0.25, 0.5, 0.75)},
        {"diffuseColor": CLOTH, "opacity": 0.5, "opacityMode": "presence", "roughness": 0.2},
    ),
    "subsurface": (
        STANDARD, {"base_color": CLOTH, "subsurface": 0.5, "subsurface_color": (0.7, 0.4, 0.3)},
        {"diffuseColor": (0.5, 0.3, 0.2), "roughness": 0.2},
    ),
    "emission": (
        OPEN_PBR, {"emission_luminance": 3.0, "emission_color": (1.0, 0.5, 0.25)},
        {"diffuseColor": (0.8,) * 3, "emissiveColor": (3.0, 1.5, 0.75), "roughness": 0.3},
    ),
    "defaults of PxrDisney": ("PxrDisney", {}, {"diffuseColor": (0.2, 0.5, 0.8), "roughness": 0.25}),
    "Disney's glass": (
        "PxrDisneyBsdf", {"baseColor": CLOTH, "ior": 2.0, "specReflectScale": 0.5, "specTrans": 0.25},
        {
            "useSpecularWorkflow": 1, "diffuseColor": CLOTH, "specularColor": (0.5 / 9,) * 3, "roughness": 0.25,
            "opacity": 0.75,
        },
    ),
    "Disney's plastic": (
        "PxrDisney",
        {"baseColor": CLOTH, "specular": 0.75, "roughness": 0.35, "clearcoat": 0.8, "clearcoatGloss": 0.0},
        {
            "useSpecularWorkflow": 1, "diffuseColor": CLOTH, "specularColor": (0.06,) * 3, "roughness": 0.35,
            "clearcoat": 0.2, "clearcoatRoughness": 0.1**0.5,
        },
    ),
    "Disney's tint": (
        "PxrDisneyBsdf", {"baseColor": CLOTH, "specularTint": 1.0},
        {
            "useSpecularWorkflow": 1, "diffuseColor": CLOTH, "roughness": 0.25,
            "specularColor": tuple(0.04 * c / (0.2126 * 0.3 + 0.7152 * 0.2 + 0.0722 * 0.1) for c in CLOTH),
        },
    ),
    "Disney's metal": (
        "PxrDisneyBsdf", {"baseColor": gold(1), "metallic": 1.0, "roughness": 0.1},
        {"diffuseColor": gold(1), "metallic": 1.0, "roughness": 0.1},
    ),
    "Pixar's artistic": (
        "PxrSurface", {"diffuseGain": 0.5, "diffuseColor": CLOTH, "specularFaceColor": (0.3, 0.2, 0.1)},
        {
            "useSpecularWorkflow": 1, "diffuseColor": (0.15, 0.1, 0.05), "specularColor": (0.3, 0.2, 0.1),
            "roughness": 0.2,
        },
    ),
    "Pixar's physical": (
        "PxrSurface",
        {
            "diffuseGain": 0.0, "specularFresnelMode": 1, "specularEdgeColor": (1.0,) * 3, "specularRoughness": 0.4,
            "specularIor": (0.2, 0.9, 1.5), "specularExtinctionCoeff": (3.9, 2.5, 0.0),
        },
        {
            "useSpecularWorkflow": 1, "diffuseColor": (0.0,) * 3, "roughness": 0.4,
            "specularColor": ((0.64 + 15.21) / (1.44 + 15.21), (0.01 + 6.25) / (3.61 + 6.25), 0.04),
        },
    ),
    "a preview surface in MaterialX": (
        "ND_UsdPreviewSurface_surfaceshader",
        {"diffuseColor": CLOTH, "metallic": 0.3, "roughness": 0.6, "clearcoat": 0.4, "ior": 1.7, "opacity": 0.5},
        {"diffuseColor": CLOTH, "metallic": 0.3, "roughness": 0.6, "clearcoat": 0.4, "ior": 1.7, "opacity": 0.5},
    ),
}  # fmt: skip


@pytest.mark.parametrize("case", NUMBERS)
def test_numbers_mean_what_the_model_says(case: str, tmp_path: Path) -> None:
    kind, inputs, preview = NUMBERS[case]
    foreign, twin = both(tmp_path)
    check(foreign.surface(kind, **inputs), twin.surface("UsdPreviewSurface", **preview))


def test_a_coat_of_openpbr_darkens_and_roughens(tmp_path: Path) -> None:
    foreign, twin = both(tmp_path)
    foreign.surface(OPEN_PBR, base_color=CLOTH, coat_weight=1.0, coat_roughness=0.3)
    k = 1 - (1 - f0(1.6)) / 1.6**2
    dark = tuple(c * (1 - k) / (1 - c * k) for c in CLOTH)
    twin.surface(
        "UsdPreviewSurface", useSpecularWorkflow=1, diffuseColor=dark, specularColor=(0.04,) * 3, ior=1.6,
        clearcoat=1.0, clearcoatRoughness=0.3, roughness=(0.3**4 + 2 * 0.3**4) ** 0.25,
    )  # fmt: skip
    check(foreign, twin)
