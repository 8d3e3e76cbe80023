"""The UsdPreviewSurface that shows what a surface of another renderer shows, as near as it can.

    look_of(stage, color, material, notes, shown) -> Look or None      None where no surface of it is known

A surface is first read as layers that all models share: a diffuse colour, metalness, what is reflected head-on
by the dielectric and by the metal, roughness, a coat, what it lets through and what it emits.  Then it is written in
the workflow that says it:

    metal     diffuseColor, metallic, ior     where the dielectric reflects grey head-on and the metal the base colour
    specular  diffuseColor, specularColor     where the metalness is a number:  d (1 - m),  F_d (1 - m) + F_m m

F0 of a dielectric is ((n - 1) / (n + 1))^2, with the weight and the tint of its specular reflection.  At grazing
angles UsdPreviewSurface reflects all, whatever the weight: what has no specular reflection at all is made rough.
Roughness is the square root of alpha in all models.  Laws:

    standard   base colour = base * base_color, mixed with subsurface_color; all below a coat is tinted by its
               colour; F_m = base colour.  Autodesk Standard Surface (Georgiev et al. 2019), Sections 4.1 to 4.6
    open_pbr   the same with specular_weight on the metal too; a coat darkens: (1 - K) / (1 - E K) with
               K = 1 - (1 - F0) / n^2, and roughens: (r^4 + 2 r_c^4)^(1/4).  OpenPBR 1.1
    metal_rough, omni_pbr    metal_rough.py
    disney     F_d = .08 specular mix(1, tint, specularTint), tint the base colour over its luminance; coat of
               .25 clearcoat, F0 .04, alpha mix(.1, .001, gloss).  Burley 2012, Section 5 and Appendix B.  Its
               successor (PxrDisneyBsdf, Burley 2015) has the F0 of its ior in place of .08
    pxr        F_d the face colour, or in mode physical that of ior and extinction times the edge colour; no metal
    preview    a UsdPreviewSurface in MaterialX: input by input

A surface that lets light through (transmission) is transparent, one that is not there (opacity) present in part.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from pxr import Sdf, Usd, UsdShade

from usdslf.color import LUMINANCE, Color
from usdslf.usd.notes import Notes
from usdslf.usd.preview.coordinates import as_transform_2d, producer
from usdslf.usd.preview.driven import (
    Driven,
    DrivenReader,
    Image,
    NotAffine,
    as_size,
    constant,
    mix,
    node_of,
    plus,
    times,
)
from usdslf.usd.preview.metal_rough import metal_rough, omni_pbr
from usdslf.usd.preview.surface_layers import NOTHING, ONE, Layers, f0_of, is_number
from usdslf.usd.preview.surface_models import CONTEXTS, MODELS, Model

Look = dict[str, Driven]  # input of a UsdPreviewSurface -> what drives it; words and switches as numbers
MODES = ("transparent", "presence")  # opacityMode, by its number
_MOST_F0 = 0.98
_COLORS = {"diffuseColor": (0.18,) * 3, "specularColor": (0.0,) * 3, "emissiveColor": (0.0,) * 3}
# What UsdPreviewSurface has where nothing is said.
FALLBACKS: dict[str, tuple[float, ...]] = {
    **_COLORS, "useSpecularWorkflow": (0.0,), "metallic": (0.0,), "roughness": (0.5,), "clearcoat": (0.0,),
    "clearcoatRoughness": (0.01,), "ior": (1.5,), "opacity": (1.0,), "opacityThreshold": (0.0,), "opacityMode": (0.0,),
    "normal": (0.0, 0.0, 1.0),
}  # fmt: skip


def look_of(
    stage: Usd.Stage, color: Color, material: Sdf.Path, notes: Notes, shown: tuple[float, ...] = ()
) -> Look | None:
    """Returns the look of a material of another renderer; None where it has no surface that the table knows.

    Args:
        stage: the shot.
        color: its working space is that of what layers say, USD's default.
        material: path of a Material.
        notes: gets a sentence for each thing that is not shown as it is.
        shown: displayColor of the gprim, for a base colour that nothing simple drives.
    """
    prim = stage.GetPrimAtPath(material)
    if not prim or not prim.IsA(UsdShade.Material):
        return None
    found = surface_of(UsdShade.Material(prim))
    if found is None:
        return None
    return _Translation(found, DrivenReader(Usd.TimeCode.EarliestTime(), color, notes), notes, shown).look()


def surface_of(material: UsdShade.Material) -> UsdShade.Shader | None:
    """Returns the surface shader of the first render context that the table knows."""
    outputs = [o.GetBaseName().rpartition(":")[0] for o in material.GetSurfaceOutputs()]
    for context in dict.fromkeys((*CONTEXTS, *outputs)):
        if context not in outputs:
            continue
        shader = material.ComputeSurfaceSource(context)[0]
        if shader and name_of(shader) in MODELS:
            return shader
    return None


def name_of(shader: UsdShade.Shader) -> str:
    """Returns the name of a shader in the table: its id, or "mdl:" and that of its material in an MDL file."""
    if shader.GetImplementationSource() == UsdShade.Tokens.sourceAsset:
        return f"mdl:{shader.GetSourceAssetSubIdentifier('mdl')}"
    return str(shader.GetIdAttr().Get())


class _Translation:
    """One surface on its way to a UsdPreviewSurface."""

    def __init__(
        self, shader: UsdShade.Shader, reader: DrivenReader, notes: Notes, shown: tuple[float, ...]
    ) -> None:
        self.shader, self.reader, self.notes, self.shown = shader, reader, notes, shown
        self.model: Model = MODELS[name_of(shader)]

    def look(self) -> Look:
        if self.model.law == "preview":
            look = {name: self.role(name) for name in self.model.roles}
        else:
            laws: dict[str, Callable[[], Layers]] = {
                "standard": self._standard, "open_pbr": self._standard, "disney": self._disney, "pxr": self._pxr,
                "metal_rough": lambda: metal_rough(self), "omni_pbr": lambda: omni_pbr(self),
            }  # fmt: skip
            look = self._written(laws[self.model.law]())
        look |= self._normal()
        self._name_what_is_lost()
        settled = {name: self._settled(name, value) for name, value in look.items()}
        return {
            n: v
            for n, v in settled.items()
            if v.number is None or n == "diffuseColor" or not _near(v.number, FALLBACKS[n])
        }

    # ---- reading ---------------------------------------------------------------------------
    def role(self, name: str, otherwise: Driven = NOTHING) -> Driven:
        """What drives the input of a role; its default where that is no image, primvar or number."""
        if name not in self.model.roles:
            return otherwise
        port, default = self.model.roles[name]
        try:
            return self.reader.value(self.shader, port, default)
        except NotAffine as why:
            best = self.shown if name in ("base_color", "diffuseColor") and len(self.shown) == 3 else default
            what = "displayColor" if best is self.shown else "default"
            self.say(port, str(why), f"its {what} {_words(best)} is used")
            return constant(*best)

    def number(self, name: str, otherwise: float = 0.0) -> float:
        """A role that only a number can be for, as one."""
        value = self.role(name, constant(otherwise))
        best = value.best_number
        if value.source is not None:
            self.say(self.model.roles[name][0], "a texture", f"{best[0]:.3g} is used")
        return float(np.mean(best))

    def say(self, port: str, why: str, instead: str) -> None:
        where = self.shader.GetPath()
        text = f"{port} of {{}} is driven by {why}, which UsdPreviewSurface cannot show: {instead}"
        self.notes.add(text, where)

    def attempt(self, what: str, law: Callable[..., Driven], *values: Driven) -> Driven:
        """A law; where two textures meet in it, the later ones are numbers."""
        try:
            return law(*values)
        except NotAffine as why:
            self.notes.add(f"{what} of {{}} is {why}: the second is taken as a number", self.shader.GetPath())
            kept = [i for i, v in enumerate(values) if v.source is not None][:1]
            return law(*(v if i in kept else constant(*v.best_number) for i, v in enumerate(values)))

    # ---- laws ------------------------------------------------------------------------------
    def _standard(self) -> Layers:
        is_open = self.model.law == "open_pbr"
        base = self.attempt("base colour", times, self.role("base_color"), self.role("base_weight"))
        diffuse = base
        if not is_number(weight := self.role("subsurface_weight"), 0):
            diffuse = self.attempt("subsurface", mix, base, self.role("subsurface_color"), weight)
        specular = self.attempt("specular", times, self.role("specular_color"), self.role("specular_weight"))
        f0 = times(specular, constant(f0_of(self.number("ior"))))
        metal = self.attempt("specular", times, base, self.role("specular_weight")) if is_open else base
        roughness, coat = self.role("roughness"), self.role("coat_weight")
        layers = Layers(diffuse, self.role("metalness"), f0, metal, roughness, opacity=self.role("opacity"))
        layers.transmission = self.role("transmission")
        layers.emission = self.attempt("emission", times, self.role("emission_color"), self.role("emission_weight"))
        if not is_number(coat, 0):
            layers.coat, layers.coat_roughness = coat, self.role("coat_roughness")
            layers.coat_f0 = f0_of(self.number("coat_ior"))
            self._below_coat(layers, is_open)
        return layers

    def _below_coat(self, layers: Layers, is_open: bool) -> None:
        tint = self.attempt("coat", mix, constant(1.0, 1.0, 1.0), self.role("coat_color"), layers.coat)
        darker = self._darkened(layers, tint) if is_open else tint
        for name, by in (("diffuse", darker), ("metal_f0", darker), ("dielectric_f0", tint), ("emission", tint)):
            setattr(layers, name, self.attempt("coat", times, getattr(layers, name), by))

    def _darkened(self, layers: Layers, tint: Driven) -> Driven:
        """Tint times the darkening of OpenPBR, and the base roughened; where all of it is numbers."""
        values = (layers.diffuse, layers.coat, layers.roughness, layers.coat_roughness, layers.metalness)
        if any(v.source is not None for v in values):
            self.notes.add("the coat of {} does not darken and roughen what is below it", self.shader.GetPath())
            return tint
        coat, rough, rough_coat = (float(v.bias[0]) for v in values[1:4])
        n = (1 + layers.coat_f0**0.5) / (1 - layers.coat_f0**0.5)
        k = 1 - (1 - layers.coat_f0) / n**2
        m = layers.metalness.bias[0]
        albedo = np.array(layers.diffuse.bias) * (1 - m) + np.array(as_size(layers.metal_f0, 3).best_number) * m
        darkening = (1 - k) / (1 - albedo * k)
        roughened = min(1.0, rough**4 + 2 * rough_coat**4) ** 0.25
        layers.roughness = constant(rough + (roughened - rough) * coat)
        amount = constant(coat * self.number("coat_darkening"))
        return times(tint, mix(constant(1.0, 1.0, 1.0), constant(*darkening), amount))

    def _disney(self) -> Layers:
        base = self.role("base_color")
        most = f0_of(self.number("ior")) if "ior" in self.model.roles else 0.08
        f0 = times(constant(most, most, most), self.role("specular_weight"))
        if not is_number(amount := self.role("specular_tint"), 0):
            tint = np.array(base.best_number)
            tint = tint / max(float(tint @ LUMINANCE), 1e-6)
            tinted = self.attempt("specularTint", mix, constant(1.0, 1.0, 1.0), constant(*tint), amount)
            f0 = self.attempt("specularTint", times, f0, tinted)
        layers = Layers(base, self.role("metalness"), f0, base, self.role("roughness"))
        layers.opacity, layers.transmission = self.role("opacity", ONE), self.role("transmission")
        layers.emission = self.role("emission_color")
        layers.coat = times(self.role("coat_weight"), constant(0.25))
        if not is_number(layers.coat, 0):
            gloss = self.number("coat_gloss")
            layers.coat_roughness = constant((0.1 + (0.001 - 0.1) * gloss) ** 0.5)
        return layers

    def _pxr(self) -> Layers:
        base = self.attempt("diffuse", times, self.role("base_color"), self.role("base_weight"))
        f0 = self._pxr_f0("face_color", "edge_color", "fresnel_mode", "ior", "extinction")
        layers = Layers(base, NOTHING, f0, f0, self.role("roughness"))
        layers.opacity, layers.transmission = self.role("opacity"), self.role("transmission")
        layers.emission = self.attempt("glow", times, self.role("emission_color"), self.role("emission_weight"))
        coat = self._pxr_f0("coat_face", "coat_edge", "coat_mode", "coat_ior", "coat_extinction")
        head_on = float(np.mean(coat.best_number))
        if head_on > 0:  # a weight of the coat that reflects head-on what this one does
            layers.coat_f0 = max(head_on, 0.04)
            layers.coat = constant(head_on / layers.coat_f0)
            layers.coat_roughness = self.role("coat_roughness")
        return layers

    def _pxr_f0(self, face: str, edge: str, mode: str, ior: str, extinction: str) -> Driven:
        if not self.number(mode):
            return self.role(face)
        n, k = (np.array(self.role(name).best_number) for name in (ior, extinction))
        f0 = ((n - 1) ** 2 + k**2) / ((n + 1) ** 2 + k**2)
        return times(self.role(edge), constant(*f0))

    # ---- writing ---------------------------------------------------------------------------
    def _written(self, layers: Layers) -> Look:
        m = layers.metalness.number
        head_on = layers.dielectric_f0.number
        is_grey = head_on is not None and np.ptp(head_on) <= 1e-6
        has_coat = not is_number(layers.coat, 0)
        fits = m == (1.0,) or (is_grey and (m == (0.0,) or layers.metal_f0 == layers.diffuse))
        if has_coat and fits and m != (1.0,):
            assert head_on is not None
            fits = abs(head_on[0] - layers.coat_f0) < 1e-6
        look = self._by_metal(layers) if fits or m is None else self._by_specular(layers, m[0])
        if has_coat:
            look |= {"clearcoat": layers.coat, "clearcoatRoughness": layers.coat_roughness}
            if m == (1.0,) or not fits:
                look["ior"] = constant(_ior(layers.coat_f0))
        if m is None and not fits:
            self.notes.add(
                "specular of {} has a tint or a coat of its own beside a textured metalness: its mean is used",
                self.shader.GetPath(),
            )
            look["ior"] = constant(_ior(float(np.mean(layers.dielectric_f0.best_number))))
        no_specular = m == (0.0,) and is_number(layers.dielectric_f0, 0)
        look["roughness"] = ONE if no_specular else layers.roughness
        look["emissiveColor"] = as_size(layers.emission, 3)
        return look | self._coverage(layers)

    def _by_metal(self, layers: Layers) -> Look:
        m = layers.metalness.number
        color = layers.metal_f0 if m == (1.0,) else layers.diffuse
        look = {"diffuseColor": as_size(color, 3), "metallic": layers.metalness}
        if m != (1.0,):
            look["ior"] = constant(_ior(float(np.mean(layers.dielectric_f0.best_number))))
        return look

    def _by_specular(self, layers: Layers, m: float) -> Look:
        diffuse = times(layers.diffuse, constant(1 - m))
        specular = self.attempt("specular", mix, layers.dielectric_f0, layers.metal_f0, constant(m))
        return {
            "useSpecularWorkflow": ONE,
            "diffuseColor": as_size(diffuse, 3),
            "specularColor": as_size(specular, 3),
        }

    def _coverage(self, layers: Layers) -> Look:
        """Opacity and its mode."""
        opacity = layers.opacity
        if opacity.size == 3:
            value = opacity.number
            opacity = as_size(opacity, 1) if value is None else constant(float(np.mean(value)))
        if is_number(layers.transmission, 0):
            is_solid = is_number(opacity, 1)
            return {} if is_solid else {"opacity": opacity, "opacityMode": constant(float(MODES.index("presence")))}
        solid = plus(ONE, times(layers.metalness, constant(-1.0)))
        through = self.attempt("transmission", times, layers.transmission, solid)
        left = plus(ONE, times(through, constant(-1.0)))
        return {"opacity": self.attempt("opacity", times, opacity, left)}

    def _normal(self) -> Look:
        """A normal map: texels 0..1 that stand for -1..1, but those of a preview surface, which are as they are."""
        port = self.model.normal
        output = producer(self.shader, port)
        if output is None or not UsdShade.Output.IsOutput(output):
            return {}
        try:
            if self.model.law == "preview":
                return {"normal": self.reader.value(self.shader, port, FALLBACKS["normal"])}
            shader = UsdShade.Shader(output.GetPrim())
            node = node_of(shader)
            if node is None or node.kind != "normal":
                raise NotAffine(f"{shader.GetIdAttr().Get() or 'a node without id'} at {shader.GetPath()}")
            if self.reader.number(shader, node.inputs["strength"], (1.0,)) != (1.0,):
                raise NotAffine(f"{shader.GetPath()} with a strength of its own")
            texel = self.reader.value(shader, node.inputs["value"], (0.5, 0.5, 1.0))
            return {"normal": plus(times(texel, constant(2.0)), constant(-1.0, -1.0, -1.0))}
        except NotAffine as why:
            self.say(port, str(why), "the normals of the gprim are used")
            return {}

    # ---- what cannot be said ---------------------------------------------------------------
    def _settled(self, name: str, value: Driven) -> Driven:
        """A value that a UsdUVTexture or a UsdPrimvarReader can give, else the best number."""
        wanted = "rgb" if len(FALLBACKS[name]) == 3 else ""
        why = ""
        if isinstance(value.source, str):
            if set(value.scale) != {1.0} or set(value.bias) != {0.0}:
                why = f"the primvar {value.source} times or plus a number"
            elif value.channels != (wanted or value.channels[:1]) or value.channels[:1] != "r":
                why = f"single channels of the primvar {value.source}"
        elif isinstance(value.source, Image):
            if wanted and value.channels != wanted:
                why = "an image of other channels"
            elif as_transform_2d(value.source.st_from_uv) is None:
                why = "an image at sheared coordinates"
        if name in ("useSpecularWorkflow", "opacityThreshold", "opacityMode") and value.source is not None:
            why = "a texture"
        if not why:
            return value
        best = value.best_number
        self.say(name, why, f"{_words(best)} is used")
        return constant(*best)

    def _name_what_is_lost(self) -> None:
        """A sentence for the inputs that do something, which UsdPreviewSurface has nothing for."""
        lost = []
        for port, nothing in self.model.lost.items():
            try:
                value = self.reader.value(self.shader, port, nothing)
            except NotAffine:
                value = replace(ONE, source="?")
            if value.number is None or not _near(value.number, nothing):
                lost.append(port)
        if lost:
            text = f"{', '.join(lost)} of {{}} {'are' if len(lost) > 1 else 'is'} not shown: UsdPreviewSurface has none"
            self.notes.add(text, self.shader.GetPath())


def _ior(f0: float) -> float:
    root = min(max(f0, 0.0), _MOST_F0) ** 0.5
    return (1 + root) / (1 - root)


def _near(a: tuple[float, ...], b: tuple[float, ...]) -> bool:
    return len(a) == len(b) and bool(np.allclose(a, b, rtol=0, atol=1e-6))


def _words(values: tuple[float, ...]) -> str:
    return "(" + ", ".join(f"{v:.3g}" for v in values) + ")"
