"""Surfaces and nodes of other renderers, as tables: which input says what, and its default.

    MODELS: id of a surface shader -> Model      laws in preview_look.py say how what it holds is put together
    NODES: name of a node -> Node                what stands between a surface and its values, for driven.py
    CONTEXTS                                     the render contexts, in the order in which they are asked

A node of MaterialX is named by its category ("ND_multiply_color3FA" is "mtlx:multiply"), others by their id.

Sources: MaterialX 1.39, libraries bxdf/standard_surface.mtlx (1.0.0 and 1.0.1), open_pbr_surface.mtlx,
disney_principled.mtlx, gltf_pbr.mtlx, usd_preview_surface.mtlx, stdlib_defs.mtlx and stdlib_ng.mtlx; Georgiev et al.
2019, Autodesk Standard Surface; OpenPBR Surface 1.1; Burley 2012, Physically-Based Shading at Disney; RenderMan's
PxrSurface, PxrDisneyBsdf, PxrTexture and PxrManifold2D, Arnold's standard_surface and image, RealityKit's PBR surface
and OmniPBR of MDL, as their documentation has them.
"""

from __future__ import annotations

from dataclasses import dataclass, field

Default = tuple[float, ...]
Role = tuple[str, Default]  # name of the input, its default

CONTEXTS = ("mtlx", "arnold", "ri", "mdl", "")


@dataclass(frozen=True)
class Model:
    """A surface shader: what its inputs mean, and those that UsdPreviewSurface has nothing for."""

    law: str  # standard | open_pbr | disney | pxr | metal_rough | omni_pbr | preview
    roles: dict[str, Role]
    lost: dict[str, Default] = field(default_factory=dict)  # input -> the value at which it does nothing
    normal: str = "normal"  # the input for a normal map


_STANDARD: dict[str, Role] = {
    "base_weight": ("base", (1.0,)),
    "base_color": ("base_color", (0.8, 0.8, 0.8)),
    "metalness": ("metalness", (0.0,)),
    "specular_weight": ("specular", (1.0,)),
    "specular_color": ("specular_color", (1.0, 1.0, 1.0)),
    "ior": ("specular_IOR", (1.5,)),
    "roughness": ("specular_roughness", (0.2,)),
    "coat_weight": ("coat", (0.0,)),
    "coat_color": ("coat_color", (1.0, 1.0, 1.0)),
    "coat_roughness": ("coat_roughness", (0.1,)),
    "coat_ior": ("coat_IOR", (1.5,)),
    "transmission": ("transmission", (0.0,)),
    "subsurface_weight": ("subsurface", (0.0,)),
    "subsurface_color": ("subsurface_color", (1.0, 1.0, 1.0)),
    "emission_weight": ("emission", (0.0,)),
    "emission_color": ("emission_color", (1.0, 1.0, 1.0)),
    "opacity": ("opacity", (1.0, 1.0, 1.0)),
}
_STANDARD_LOST: dict[str, Default] = {
    "diffuse_roughness": (0.0,),
    "specular_anisotropy": (0.0,),
    "transmission_color": (1.0, 1.0, 1.0),
    "transmission_extra_roughness": (0.0,),
    "sheen": (0.0,),
    "coat_affect_color": (0.0,),
    "coat_affect_roughness": (0.0,),
    "thin_film_thickness": (0.0,),
}
_OPEN_PBR: dict[str, Role] = {
    "base_weight": ("base_weight", (1.0,)),
    "base_color": ("base_color", (0.8, 0.8, 0.8)),
    "metalness": ("base_metalness", (0.0,)),
    "specular_weight": ("specular_weight", (1.0,)),
    "specular_color": ("specular_color", (1.0, 1.0, 1.0)),
    "ior": ("specular_ior", (1.5,)),
    "roughness": ("specular_roughness", (0.3,)),
    "coat_weight": ("coat_weight", (0.0,)),
    "coat_color": ("coat_color", (1.0, 1.0, 1.0)),
    "coat_roughness": ("coat_roughness", (0.0,)),
    "coat_ior": ("coat_ior", (1.6,)),
    "coat_darkening": ("coat_darkening", (1.0,)),
    "transmission": ("transmission_weight", (0.0,)),
    "subsurface_weight": ("subsurface_weight", (0.0,)),
    "subsurface_color": ("subsurface_color", (0.8, 0.8, 0.8)),
    "emission_weight": ("emission_luminance", (0.0,)),
    "emission_color": ("emission_color", (1.0, 1.0, 1.0)),
    "opacity": ("geometry_opacity", (1.0,)),
}
_DISNEY: dict[str, Role] = {
    "base_color": ("baseColor", (0.2, 0.5, 0.8)),
    "metalness": ("metallic", (0.0,)),
    "specular_weight": ("specular", (0.5,)),
    "specular_tint": ("specularTint", (0.0,)),
    "roughness": ("roughness", (0.25,)),
    "coat_weight": ("clearcoat", (0.0,)),
    "coat_gloss": ("clearcoatGloss", (1.0,)),
    "emission_color": ("emitColor", (0.0, 0.0, 0.0)),
    "opacity": ("presence", (1.0,)),
}
_DISNEY_LOST: dict[str, Default] = {"anisotropic": (0.0,), "sheen": (0.0,), "subsurface": (0.0,)}

_GLTF: dict[str, Role] = {
    "base_color": ("base_color", (1.0, 1.0, 1.0)),
    "metalness": ("metallic", (1.0,)),
    "roughness": ("roughness", (1.0,)),
    "specular_weight": ("specular", (1.0,)),
    "specular_color": ("specular_color", (1.0, 1.0, 1.0)),
    "ior": ("ior", (1.5,)),
    "transmission": ("transmission", (0.0,)),
    "emission_color": ("emissive", (0.0, 0.0, 0.0)),
    "emission_weight": ("emissive_strength", (1.0,)),
    "alpha_mode": ("alpha_mode", (0.0,)),
    "opacity": ("alpha", (1.0,)),
    "coat_weight": ("clearcoat", (0.0,)),
    "coat_roughness": ("clearcoat_roughness", (0.0,)),
}
_GLTF_LOST: dict[str, Default] = {
    "iridescence": (0.0,),
    "sheen_color": (0.0, 0.0, 0.0),
    "anisotropy_strength": (0.0,),
    "dispersion": (0.0,),
}
_REALITYKIT: dict[str, Role] = {
    "base_color": ("baseColor", (1.0, 1.0, 1.0)),
    "metalness": ("metallic", (0.0,)),
    "roughness": ("roughness", (0.5,)),
    "specular_weight": ("specular", (0.5,)),
    "emission_color": ("emissiveColor", (0.0, 0.0, 0.0)),
    "opacity": ("opacity", (1.0,)),
    "coat_weight": ("clearcoat", (0.0,)),
    "coat_roughness": ("clearcoatRoughness", (0.0,)),
}
_OMNI_PBR: dict[str, Role] = {
    "base_color": ("diffuse_color_constant", (0.2, 0.2, 0.2)),
    "brightness": ("albedo_brightness", (1.0,)),
    "added": ("albedo_add", (0.0,)),
    "tint": ("diffuse_tint", (1.0, 1.0, 1.0)),
    "roughness": ("reflection_roughness_constant", (0.5,)),
    "roughness_influence": ("reflection_roughness_texture_influence", (0.0,)),
    "metalness": ("metallic_constant", (0.0,)),
    "metalness_influence": ("metallic_texture_influence", (0.0,)),
    "is_packed": ("enable_ORM_texture", (0.0,)),
    "specular_weight": ("specular_level", (0.5,)),
    "emits": ("enable_emission", (0.0,)),
    "emission_color": ("emissive_color", (1.0, 0.1, 0.1)),
    "emission_weight": ("emissive_intensity", (40.0,)),
    "is_cut": ("enable_opacity", (0.0,)),
    "opacity": ("opacity_constant", (1.0,)),
}

MODELS: dict[str, Model] = {
    "ND_gltf_pbr_surfaceshader": Model("metal_rough", _GLTF, _GLTF_LOST),
    "ND_realitykit_pbr_surfaceshader": Model("metal_rough", _REALITYKIT, {"opacityThreshold": (0.0,)}),
    "ND_realitykit_pbr_surfaceshader_2_0": Model("metal_rough", _REALITYKIT, {"opacityThreshold": (0.0,)}),
    "mdl:OmniPBR": Model("omni_pbr", _OMNI_PBR, {"albedo_desaturation": (0.0,)}, "normalmap_texture"),
    "ND_standard_surface_surfaceshader": Model("standard", _STANDARD, _STANDARD_LOST),
    "ND_standard_surface_surfaceshader_100": Model(
        "standard",
        _STANDARD | {"base_weight": ("base", (0.8,)), "base_color": ("base_color", (1.0, 1.0, 1.0))},
        _STANDARD_LOST,
    ),
    "standard_surface": Model("standard", _STANDARD, _STANDARD_LOST),
    "ND_open_pbr_surface_surfaceshader": Model(
        "open_pbr",
        _OPEN_PBR,
        {
            "base_diffuse_roughness": (0.0,),
            "specular_roughness_anisotropy": (0.0,),
            "transmission_color": (1.0, 1.0, 1.0),
            "fuzz_weight": (0.0,),
            "thin_film_weight": (0.0,),
        },
        "geometry_normal",
    ),
    "PxrDisneyBsdf": Model(
        "disney",
        _DISNEY
        | {"specular_weight": ("specReflectScale", (1.0,)), "ior": ("ior", (1.5,))}
        | {"transmission": ("specTrans", (0.0,))},
        _DISNEY_LOST | {"diffTrans": (0.0,), "flatness": (0.0,)},
        "bumpNormal",
    ),
    "PxrDisney": Model("disney", _DISNEY, _DISNEY_LOST, "bumpNormal"),
    "ND_disney_principled": Model(
        "disney",
        {k: v for k, v in _DISNEY.items() if k not in ("emission_color", "opacity")}
        | {"base_color": ("baseColor", (0.16, 0.16, 0.16)), "transmission": ("specTrans", (0.0,))}
        | {"roughness": ("roughness", (0.5,))},
        _DISNEY_LOST,
    ),
    "PxrSurface": Model(
        "pxr",
        {
            "base_weight": ("diffuseGain", (1.0,)),
            "base_color": ("diffuseColor", (0.18, 0.18, 0.18)),
            "fresnel_mode": ("specularFresnelMode", (0.0,)),
            "face_color": ("specularFaceColor", (0.0, 0.0, 0.0)),
            "edge_color": ("specularEdgeColor", (0.0, 0.0, 0.0)),
            "ior": ("specularIor", (1.5, 1.5, 1.5)),
            "extinction": ("specularExtinctionCoeff", (0.0, 0.0, 0.0)),
            "roughness": ("specularRoughness", (0.2,)),
            "coat_mode": ("clearcoatFresnelMode", (0.0,)),
            "coat_face": ("clearcoatFaceColor", (0.0, 0.0, 0.0)),
            "coat_edge": ("clearcoatEdgeColor", (0.0, 0.0, 0.0)),
            "coat_ior": ("clearcoatIor", (1.5, 1.5, 1.5)),
            "coat_extinction": ("clearcoatExtinctionCoeff", (0.0, 0.0, 0.0)),
            "coat_roughness": ("clearcoatRoughness", (0.0,)),
            "transmission": ("refractionGain", (0.0,)),
            "emission_weight": ("glowGain", (0.0,)),
            "emission_color": ("glowColor", (1.0, 1.0, 1.0)),
            "opacity": ("presence", (1.0,)),
        },
        {
            "diffuseRoughness": (0.0,),
            "specularAnisotropy": (0.0,),
            "roughSpecularFaceColor": (0.0, 0.0, 0.0),
            "roughSpecularEdgeColor": (0.0, 0.0, 0.0),
            "iridescenceFaceGain": (0.0,),
            "iridescenceEdgeGain": (0.0,),
            "fuzzGain": (0.0,),
            "subsurfaceGain": (0.0,),
            "singlescatterGain": (0.0,),
        },
        "bumpNormal",
    ),
    "ND_UsdPreviewSurface_surfaceshader": Model(
        "preview",
        {
            "diffuseColor": ("diffuseColor", (0.18, 0.18, 0.18)),
            "emissiveColor": ("emissiveColor", (0.0, 0.0, 0.0)),
            "useSpecularWorkflow": ("useSpecularWorkflow", (0.0,)),
            "specularColor": ("specularColor", (0.0, 0.0, 0.0)),
            "metallic": ("metallic", (0.0,)),
            "roughness": ("roughness", (0.5,)),
            "clearcoat": ("clearcoat", (0.0,)),
            "clearcoatRoughness": ("clearcoatRoughness", (0.01,)),
            "opacity": ("opacity", (1.0,)),
            "opacityThreshold": ("opacityThreshold", (0.0,)),
            "opacityMode": ("opacityMode", (0.0,)),
            "ior": ("ior", (1.5,)),
        },
    ),
}


@dataclass(frozen=True)
class Node:
    """A node between a surface and its values: what kind it is and what its inputs are called."""

    kind: str  # image | primvar | value | math | channel | normal
    inputs: dict[str, str] = field(default_factory=dict)  # what driven.py asks for -> name of the input
    defaults: dict[str, float] = field(default_factory=dict)  # of inputs of `math`, in their order
    text: dict[str, str] = field(default_factory=dict)  # words that stand where there is no input


_WRAPS = {"wrap_s": "wrapS", "wrap_t": "wrapT"}
_UV_TEXTURE = {"file": "file", "st": "st", "fallback": "fallback", "scale": "scale", "bias": "bias", **_WRAPS}
_UV_TEXTURE |= {"space": "sourceColorSpace"}

NODES: dict[str, Node] = {
    "mtlx:image": Node(
        "image",
        {
            "file": "file", "st": "texcoord", "fallback": "default",
            "wrap_s": "uaddressmode", "wrap_t": "vaddressmode",
        },
        text={"wrap": "periodic", "space": "raw"},
    ),
    "mtlx:tiledimage": Node(
        "image",
        {
            "file": "file", "st": "texcoord", "fallback": "default", "tiling": "uvtiling", "shift": "uvoffset",
            "image_size": "realworldimagesize", "tile_size": "realworldtilesize",
        },
        text={"wrap": "periodic", "space": "raw"},
    ),
    "mtlx:gltf": Node(  # gltf_image, gltf_colorimage
        "image",
        {
            "file": "file", "st": "texcoord", "fallback": "default",
            "wrap_s": "uaddressmode", "wrap_t": "vaddressmode",
        },
        text={"wrap": "periodic", "space": "raw"},
    ),
    "mtlx:UsdUVTexture": Node("image", _UV_TEXTURE, text={"wrap": "periodic", "space": "raw"}),
    "UsdUVTexture": Node("image", _UV_TEXTURE, text={"wrap": "useMetadata", "space": "auto"}),
    "image": Node(
        "image",
        {
            "file": "filename", "uv_set": "uvset", "st": "uvcoords", "fallback": "missing_texture_color",
            "wrap_s": "swrap", "wrap_t": "twrap", "scale": "multiply", "bias": "offset", "space": "color_space",
            "scale_s": "sscale", "scale_t": "tscale", "shift_s": "soffset", "shift_t": "toffset",
            "flip_s": "sflip", "flip_t": "tflip",
        },
        text={"wrap": "periodic", "space": "auto"},
    ),
    "PxrTexture": Node(
        "image",
        {
            "file": "filename", "st": "manifold", "fallback": "missingColor", "invert_t": "invertT",
            "scale": "colorScale", "bias": "colorOffset", "linearize": "linearize",
        },
        text={"wrap": "periodic", "space": "raw"},
    ),
    "mtlx:geompropvalue": Node("primvar", {"name": "geomprop", "fallback": "default"}),
    "mtlx:UsdPrimvarReader": Node("primvar", {"name": "varname", "fallback": "fallback"}),
    "mtlx:geomcolor": Node("primvar", {"fallback": "default"}, text={"name": "displayColor"}),
    "UsdPrimvarReader": Node("primvar", {"name": "varname", "fallback": "fallback"}),
    "user_data_rgb": Node("primvar", {"name": "attribute", "fallback": "default"}),
    "user_data_float": Node("primvar", {"name": "attribute", "fallback": "default"}),
    "PxrPrimvar": Node("primvar", {"name": "varname", "fallback": "defaultColor"}),
    "mtlx:constant": Node("value", {"value": "value"}),
    "mtlx:dot": Node("value", {"value": "in"}),
    "mtlx:multiply": Node("math", {"op": "multiply"}, {"in1": 0.0, "in2": 1.0}),
    "mtlx:divide": Node("math", {"op": "divide"}, {"in1": 0.0, "in2": 1.0}),
    "mtlx:add": Node("math", {"op": "add"}, {"in1": 0.0, "in2": 0.0}),
    "mtlx:subtract": Node("math", {"op": "subtract"}, {"in1": 0.0, "in2": 0.0}),
    "mtlx:invert": Node("math", {"op": "subtract"}, {"amount": 1.0, "in": 0.0}),
    "mtlx:mix": Node("math", {"op": "mix"}, {"bg": 0.0, "fg": 0.0, "mix": 0.0}),
    "mtlx:remap": Node(
        "math", {"op": "remap"}, {"in": 0.0, "inlow": 0.0, "inhigh": 1.0, "outlow": 0.0, "outhigh": 1.0}
    ),
    "multiply": Node("math", {"op": "multiply"}, {"input1": 1.0, "input2": 1.0}),
    "add": Node("math", {"op": "add"}, {"input1": 0.0, "input2": 0.0}),
    "subtract": Node("math", {"op": "subtract"}, {"input1": 0.0, "input2": 0.0}),
    "mtlx:extract": Node("channel", {"value": "in", "index": "index"}),
    "mtlx:separate2": Node("channel", {"value": "in"}),
    "mtlx:separate3": Node("channel", {"value": "in"}),
    "mtlx:separate4": Node("channel", {"value": "in"}),
    "mtlx:swizzle": Node("channel", {"value": "in", "channels": "channels"}),
    "mtlx:convert": Node("value", {"value": "in"}),
    "mtlx:normalmap": Node("normal", {"value": "in", "strength": "scale"}),
    "normal_map": Node("normal", {"value": "input", "strength": "strength"}),
    "PxrToFloat": Node("channel", {"value": "input"}, text={"channels": "r"}),
    "PxrToFloat3": Node("value", {"value": "input"}),
}

# The channel that the name of an output stands for.
OUTPUTS = {
    "r": "r", "g": "g", "b": "b", "a": "a", "outr": "r", "outg": "g", "outb": "b", "outa": "a",
    "outx": "r", "outy": "g", "outz": "b", "outw": "a",
    "resultR": "r", "resultG": "g", "resultB": "b", "resultA": "a",
}  # fmt: skip
# Components of a MaterialX type.
SIZES = {"float": 1, "vector2": 2, "color3": 3, "vector3": 3, "color4": 4, "vector4": 4}
WRAPS = {"periodic": "repeat", "constant": "black", "black": "black", "clamp": "clamp", "mirror": "mirror",
         "repeat": "repeat", "useMetadata": "useMetadata", "file": "useMetadata"}  # fmt: skip
# Colour spaces of other programs by the names of UsdUVTexture; any other name is OpenColorIO's.
SPACES = {"auto": "auto", "srgb": "sRGB", "srgb_texture": "sRGB", "raw": "raw", "none": "raw", "linear": "raw",
          "lin_rec709": "raw", "utility - raw": "raw", "utility - srgb - texture": "sRGB",
          "lin_rec709_scene": "raw", "srgb_rec709_scene": "sRGB", "utility - linear - srgb": "raw"}  # fmt: skip
