"""Laws of surfaces with a base colour, metalness and roughness: glTF's, RealityKit's, and OmniPBR of MDL.

    metal_rough(surface) -> Layers      gltf_pbr, RealityKit's PBR
    omni_pbr(surface) -> Layers         OmniPBR, whose textures are inputs of its own and not nodes

    glTF        F_d = specular specular_color ((n - 1) / (n + 1))^2; alpha counts in the modes MASK and BLEND only
    RealityKit  F_d = .08 specular
    OmniPBR     base = (texture or constant, brightened, plus what is added) * tint; F_d = .08 specular_level;
                roughness and metalness lie between the constant and the texture, by its influence
    all         F_m = base colour

Source: glTF 2.0, appendix B, and KHR_materials_specular; gltf_pbr.mtlx of MaterialX 1.39; Apple, ShaderGraph, PBR
Surface (RealityKit), and PhysicallyBasedMaterial; NVIDIA, OmniPBR.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Protocol

import numpy as np
from pxr import UsdShade

from usdslf.usd.preview.driven import Driven, DrivenReader, NotAffine, constant, mix, plus, times
from usdslf.usd.preview.surface_layers import ONE, Layers, f0_of, is_number
from usdslf.usd.preview.surface_models import Model

MOST_SPECULAR = 0.08  # F0 at a level of 1


class Surface(Protocol):
    """A surface of another renderer, as preview_look.py reads it."""

    shader: UsdShade.Shader
    reader: DrivenReader
    model: Model

    def role(self, name: str, otherwise: Driven = ...) -> Driven: ...
    def number(self, name: str, otherwise: float = ...) -> float: ...
    def attempt(self, what: str, law: Callable[..., Driven], *values: Driven) -> Driven: ...
    def say(self, port: str, why: str, instead: str) -> None: ...


def metal_rough(s: Surface) -> Layers:
    """Returns the layers of a surface of glTF or RealityKit."""
    base = s.role("base_color")
    if "ior" in s.model.roles:
        weight = s.attempt("specular", times, s.role("specular_color"), s.role("specular_weight"))
        f0 = times(weight, constant(f0_of(s.number("ior", 1.5))))
    else:
        f0 = times(s.role("specular_weight"), constant(MOST_SPECULAR))
    layers = Layers(base, s.role("metalness"), f0, base, s.role("roughness"))
    layers.transmission = s.role("transmission")
    layers.emission = s.attempt("emission", times, s.role("emission_color"), s.role("emission_weight", ONE))
    if s.number("alpha_mode", 1.0):
        layers.opacity = s.role("opacity", ONE)
    layers.coat = s.role("coat_weight")
    if not is_number(layers.coat, 0):
        layers.coat_roughness = s.role("coat_roughness")
    return layers


def omni_pbr(s: Surface) -> Layers:
    """Returns the layers of OmniPBR."""
    base = _texture(s, "diffuse_texture", "rgb", "auto") or s.role("base_color")
    base = plus(times(base, constant(s.number("brightness", 1.0))), constant(*(s.number("added"),) * 3))
    base = s.attempt("diffuse_tint", times, base, s.role("tint"))
    roughness, metalness = _packed(s)
    f0 = times(s.role("specular_weight"), constant(MOST_SPECULAR))
    layers = Layers(base, metalness, f0, base, roughness)
    if s.number("emits"):
        layers.emission = s.attempt("emission", times, s.role("emission_color"), s.role("emission_weight"))
    if s.number("is_cut"):
        layers.opacity = s.role("opacity", ONE)
    return layers


def _packed(s: Surface) -> tuple[Driven, Driven]:
    """Roughness and metalness: of one texture with occlusion, of one each, or the constants."""
    found = []
    files = {"roughness": ("reflectionroughness_texture", "g"), "metalness": ("metallic_texture", "b")}
    for name, (file, channel) in files.items():
        one = _texture(s, "ORM_texture", channel, "raw") if s.number("is_packed") else None
        image = one or _texture(s, file, "r", "raw")
        value = s.role(name)
        if image is not None:
            value = s.attempt(name, mix, value, image, constant(s.number(f"{name}_influence")))
        found.append(value)
    return found[0], found[1]


def _texture(s: Surface, port: str, channels: str, space: str) -> Driven | None:
    """What a texture says that is an input of the surface itself; None where it names no file."""
    reader = s.reader
    numbers = lambda name, default: reader.number(s.shader, name, default)  # noqa: E731
    if numbers("project_uvw", (0.0,))[0]:
        try:
            there = reader.file(s.shader, port, channels, space, (1.0, 1.0), (0.0, 0.0))
        except NotAffine:
            there = None
        if there is not None:
            s.say(port, "an image that is projected", "its constant is used")
        return None
    if np.any(numbers("texture_rotate", (0.0,))):
        s.say(port, "an image that is turned", "it is shown as it is")
    try:
        scale, shift = numbers("texture_scale", (1.0, 1.0)), numbers("texture_translate", (0.0, 0.0))
        return reader.file(s.shader, port, channels, space, scale, shift)
    except NotAffine as why:
        s.say(port, str(why), "its constant is used")
        return None
