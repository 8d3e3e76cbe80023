"""UsdPreviewSurface as a BSDF of Mitsuba 3, reflecting on both sides.

    F = F0 + (F90 - F0) (1 - V.H)^5,   f_r = d (1 - F) / pi + F D G / (4 NL NE) + coat

The specification leaves the balance of diffuse and specular and the masking G open.  The balance is that
of the shader that ships with OpenUSD.  `model` chooses D and G:

    ggx       exact GGX D, height-correlated Smith G (the default, as in Cycles and MaterialX)
    smith     exact GGX D, separable Smith G
    schlick   exact GGX D, Schlick's G with k = alpha / 2 (OpenUSD's shader without its epsilons)
    storm     as OpenUSD's shader evaluates it, with its epsilons of 1e-3

`f90` (default 1) exists for tests only: f90 = 0 with specular = 0 is a pure Lambertian surface, which
UsdPreviewSurface cannot express.

Normal map: n = x T + y B + z N, T and B the derivatives of the position by s and t, orthogonal to N.  Where n
faces away from the eye it is turned about N by half a turn; light from below the surface is none.
Source: UsdPreviewSurface specification 2.5; Heitz 2014 (G); Schuessler et al. 2017 (both choices of n).
"""

from __future__ import annotations

from typing import Any

import drjit as dr
import mitsuba as mi
from reference.mitsuba_setup import set_variant

set_variant()

STORM_EPSILON = 1e-3
SMALLEST_ROUGHNESS = 0.02  # below it float32 has no lobes; they are narrower than a pixel anyway


class UsdPreviewSurface(mi.BSDF):
    """The BSDF; parameters are constants or Mitsuba textures."""

    def __init__(self, props: Any) -> None:
        mi.BSDF.__init__(self, props)
        self.model = props.get("model", "ggx")
        self.use_specular_workflow = bool(props.get("use_specular_workflow", True))
        self.diffuse = _color(props, "diffuse", 0.18)
        self.specular = _color(props, "specular", 0.0)
        self.roughness = _scalar(props, "roughness", 0.5)
        self.metallic = _scalar(props, "metallic", 0.0)
        self.clearcoat = _scalar(props, "clearcoat", 0.0)
        self.clearcoat_roughness = _scalar(props, "clearcoat_roughness", 0.01)
        self.opacity = _scalar(props, "opacity", 1.0)
        self.ior = float(props.get("ior", 1.5))
        self.f90 = float(props.get("f90", 1.0))
        self.has_clearcoat = bool(props.get("has_clearcoat", False))
        self.has_null = bool(props.get("has_null", False))
        self.presence = bool(props.get("presence", False))
        self.opacity_threshold = float(props.get("opacity_threshold", 0.0))
        self.normal_map = props.get("normal_map", None)
        self.uv_from_st = [float(props.get(f"uv_from_st{i}", (1.0, 0.0, 0.0, 1.0)[i])) for i in range(4)]
        sides = mi.BSDFFlags.FrontSide | mi.BSDFFlags.BackSide
        self.m_components = [mi.BSDFFlags.GlossyReflection | mi.BSDFFlags.DiffuseReflection | sides]
        if self.has_null:
            self.m_components.append(mi.BSDFFlags.Null | sides)
        flags = self.m_components[0]
        for component in self.m_components[1:]:
            flags = flags | component
        self.m_flags = flags

    def traverse(self, callback: Any) -> None:
        """Names the parameters."""
        for name in (
            "diffuse",
            "specular",
            "roughness",
            "metallic",
            "clearcoat",
            "clearcoat_roughness",
            "opacity",
        ):
            callback.put(name, getattr(self, name), mi.ParamFlags.Differentiable)

    def parameters_changed(self, keys: Any) -> None:
        """Nothing is cached."""

    def surface(self, si: Any, active: Any) -> tuple[Any, Any, Any, Any, Any]:
        """Returns d, F0, F90, roughness and opacity at a hit, by either workflow."""
        d = _color_at(self.diffuse, si, active)
        r0 = self._r0()
        if self.use_specular_workflow:
            f0 = _color_at(self.specular, si, active)
            f90 = mi.Color3f(self.f90)
        else:
            m = _scalar_at(self.metallic, si, active)
            s = dr.lerp(mi.Color3f(1), d, m)
            f0 = dr.lerp(s * r0, s, m)
            f90 = s * self.f90
            d = d * (1 - m)
        roughness = dr.maximum(_scalar_at(self.roughness, si, active), SMALLEST_ROUGHNESS)
        opacity = _scalar_at(self.opacity, si, active) if self.has_null else mi.Float(1)
        if self.opacity_threshold > 0:
            opacity = dr.select(opacity >= self.opacity_threshold, mi.Float(1), mi.Float(0))
        if self.has_null and not self.presence:
            d = d * opacity
        return d, f0, f90, roughness, opacity

    def _r0(self) -> float:
        return ((1 - self.ior) / (1 + self.ior)) ** 2

    def mapped_frame(self, si: Any, wi: Any, active: Any) -> Any:
        """Returns the frame about the mapped normal, in the frame of the surface; wi is above the surface."""
        if self.normal_map is None:
            return mi.Frame3f(mi.Vector3f(1, 0, 0), mi.Vector3f(0, 1, 0), mi.Vector3f(0, 0, 1))
        n = self.normal_map.eval_3(si, active)
        m = self.uv_from_st
        dp_du, dp_dv = si.to_local(si.dp_du), si.to_local(-si.dp_dv)  # by USD's v, which runs up
        dp_ds, dp_dt = dp_du * m[0] + dp_dv * m[2], dp_du * m[1] + dp_dv * m[3]
        length = dr.sqrt(dp_ds.x * dp_ds.x + dp_ds.y * dp_ds.y)
        t = mi.Vector3f(dp_ds.x, dp_ds.y, 0) / dr.maximum(length, 1e-20)
        b = mi.Vector3f(-t.y, t.x, 0) * dr.sign(-dp_dt.x * t.y + dp_dt.y * t.x)
        mapped = dr.normalize(n[0] * t + n[1] * b + mi.Vector3f(0, 0, n[2]))
        mapped = dr.select((length > 1e-18) & (dr.squared_norm(mi.Vector3f(n)) > 0), mapped, mi.Vector3f(0, 0, 1))
        turned = dr.normalize(mi.Vector3f(-mapped.x, -mapped.y, dr.abs(mapped.z)))
        mapped = dr.select(dr.dot(mapped, wi) > 0, mapped, turned)
        return mi.Frame3f(mapped)

    # Microfacet terms.

    def _D(self, alpha: Any, h: Any) -> Any:
        a2 = alpha * alpha
        t = h.x * h.x + h.y * h.y + a2 * h.z * h.z  # NH^2 (a2 - 1) + 1 without its cancellation
        if self.model == "storm":
            return (a2 + STORM_EPSILON) / (dr.pi * t * t)
        return a2 / (dr.pi * t * t)

    def _V(self, alpha: Any, nl: Any, ne: Any) -> Any:
        """G / (4 NL NE)."""
        if self.model in ("storm", "schlick"):
            k = alpha * 0.5
            g = ne / (ne * (1 - k) + k) * nl / (nl * (1 - k) + k)
            return g / (4 * nl * ne + (STORM_EPSILON if self.model == "storm" else 0.0))
        a2 = alpha * alpha
        le = dr.sqrt(a2 + (1 - a2) * ne * ne)
        ll = dr.sqrt(a2 + (1 - a2) * nl * nl)
        if self.model == "smith":
            return 1 / ((ne + le) * (nl + ll))
        return 0.5 / (nl * le + ne * ll)

    def _brdf_cos(self, surface: Any, si: Any, wo: Any, active: Any) -> Any:
        d, f0, f90, roughness, opacity = surface
        wi = dr.mulsign(mi.Vector3f(si.wi), si.wi.z)
        wo = dr.mulsign(mi.Vector3f(wo), si.wi.z)
        active = active & (wo.z > 0) & (wi.z > 0)
        frame = self.mapped_frame(si, wi, active)
        wi, wo = frame.to_local(wi), frame.to_local(wo)
        nl, ne = wo.z, wi.z
        active = active & (nl > 0) & (ne > 0)
        nl, ne = dr.maximum(nl, 1e-6), dr.maximum(ne, 1e-6)
        h = dr.normalize(wi + wo)
        s5 = (1 - dr.clip(dr.dot(wi, h), 0, 1)) ** 5
        F = dr.lerp(f0, f90, s5)
        alpha = roughness * roughness
        specular = F * (self._D(alpha, h) * self._V(alpha, nl, ne))
        if self.has_clearcoat:
            r0 = self._r0()
            rough_c = dr.maximum(_scalar_at(self.clearcoat_roughness, si, active), SMALLEST_ROUGHNESS)
            alpha_c = rough_c * rough_c
            coat = (r0 + (1 - r0) * s5) * self._D(alpha_c, h) * self._V(alpha_c, nl, ne)
            specular += _scalar_at(self.clearcoat, si, active) * coat
        value = (d * dr.inv_pi * (1 - F) + specular) * nl
        if self.presence:
            value = value * opacity
        return dr.select(active, value, 0)

    # Sampling: one of the specular lobe, the coat, the cosine, and passing straight through.

    def _weights(self, surface: Any, si: Any, active: Any) -> tuple[Any, Any, Any, Any]:
        d, f0, f90, _, opacity = surface
        c = dr.clip(dr.abs(si.wi.z), 0, 1)
        s = mi.luminance(dr.lerp(f0, f90, (1 - c) ** 5))
        specular = dr.clip(s / dr.maximum(s + mi.luminance(d), 1e-4), 0.15, 0.9)
        coat = mi.Float(0)
        if self.has_clearcoat:
            coat = dr.clip(0.25 * _scalar_at(self.clearcoat, si, active), 0, 0.25)
        through = (1 - opacity) * 0.999 if self.has_null else mi.Float(0)
        return specular * (1 - coat), coat, (1 - specular) * (1 - coat), through

    def _lobe(self, roughness: Any) -> tuple[Any, Any]:
        alpha = roughness * roughness
        return alpha, mi.MicrofacetDistribution(mi.MicrofacetType.GGX, alpha, alpha, True)

    def _pdf(self, surface: Any, si: Any, wo: Any, active: Any) -> Any:
        specular, coat, cosine, through = self._weights(surface, si, active)
        wi = dr.mulsign(mi.Vector3f(si.wi), si.wi.z)
        wo = dr.mulsign(mi.Vector3f(wo), si.wi.z)
        frame = self.mapped_frame(si, wi, active)
        ok = active & (wi.z > 0) & (wo.z > 0)
        wi, wo = frame.to_local(wi), frame.to_local(wo)
        ok = ok & (wi.z > 0) & (wo.z > 0)
        h = dr.normalize(wi + wo)
        jacobian = 4 * dr.maximum(dr.dot(wi, h), 1e-6)
        pdf = specular * self._lobe(surface[3])[1].pdf(wi, h) / jacobian
        if self.has_clearcoat:
            rough_c = dr.maximum(_scalar_at(self.clearcoat_roughness, si, active), SMALLEST_ROUGHNESS)
            pdf += coat * self._lobe(rough_c)[1].pdf(wi, h) / jacobian
        pdf += cosine * wo.z * dr.inv_pi
        return dr.select(ok, pdf * (1 - through), 0)

    def sample(self, ctx: Any, si: Any, sample1: Any, sample2: Any, active: Any = True) -> Any:
        """Draws a direction; returns the sample and value * cos / pdf."""
        surface = self.surface(si, active)
        specular, coat, _, through = self._weights(surface, si, active)
        wi = dr.mulsign(mi.Vector3f(si.wi), si.wi.z)
        frame = self.mapped_frame(si, wi, active)
        wi = frame.to_local(wi)
        bs = dr.zeros(mi.BSDFSample3f)
        is_through = sample1 < through
        u = dr.clip((sample1 - through) / dr.maximum(1 - through, 1e-4), 0, 0.9999999)
        is_specular, is_coat = u < specular, (u >= specular) & (u < specular + coat)
        roughness = surface[3]
        if self.has_clearcoat:
            rough_c = dr.maximum(_scalar_at(self.clearcoat_roughness, si, active), SMALLEST_ROUGHNESS)
            roughness = dr.select(is_coat, rough_c, roughness)
        h, _ = self._lobe(roughness)[1].sample(wi, sample2)
        wo_cosine = mi.warp.square_to_cosine_hemisphere(sample2)
        wo = frame.to_world(dr.select(is_specular | is_coat, mi.reflect(wi, h), wo_cosine))
        bs.wo = dr.mulsign(mi.Vector3f(wo), si.wi.z)
        bs.pdf = self._pdf(surface, si, bs.wo, active)
        bs.eta = 1
        bs.sampled_type = mi.UInt32(+mi.BSDFFlags.GlossyReflection)
        bs.sampled_component = mi.UInt32(0)
        value = self._brdf_cos(surface, si, bs.wo, active)
        weight = dr.select(bs.pdf > 0, value / bs.pdf, 0)
        if self.has_null:
            bs.wo = dr.select(is_through, -si.wi, bs.wo)
            bs.pdf = dr.select(is_through, through, bs.pdf)
            passed = mi.Color3f((1 - surface[4]) / dr.maximum(through, 1e-6))
            weight = dr.select(is_through, passed, weight)
            bs.sampled_type = dr.select(is_through, mi.UInt32(+mi.BSDFFlags.Null), bs.sampled_type)
            bs.sampled_component = dr.select(is_through, mi.UInt32(1), bs.sampled_component)
        ok = active & (is_through | (bs.pdf > 0))
        return bs, dr.select(ok, weight, 0)

    def eval(self, ctx: Any, si: Any, wo: Any, active: Any = True) -> Any:
        """Value times cosine."""
        return self._brdf_cos(self.surface(si, active), si, wo, active)

    def pdf(self, ctx: Any, si: Any, wo: Any, active: Any = True) -> Any:
        """Solid-angle density of `sample`."""
        return self._pdf(self.surface(si, active), si, wo, active)

    def eval_pdf(self, ctx: Any, si: Any, wo: Any, active: Any = True) -> Any:
        """Both at once."""
        surface = self.surface(si, active)
        return self._brdf_cos(surface, si, wo, active), self._pdf(surface, si, wo, active)

    def eval_diffuse_reflectance(self, si: Any, active: Any = True) -> Any:
        """d: the diffuse albedo before the Fresnel balance."""
        return self.surface(si, active)[0]

    def to_string(self) -> str:
        """A short name."""
        return f"UsdPreviewSurface[model={self.model}, specular_workflow={self.use_specular_workflow}]"


def _color(props: Any, name: str, default: float) -> Any:
    value = props.get(name, default)
    return value if hasattr(value, "eval") else mi.Color3f(value)


def _scalar(props: Any, name: str, default: float) -> Any:
    value = props.get(name, default)
    return value if hasattr(value, "eval_1") else mi.Float(value)


def _color_at(value: Any, si: Any, active: Any) -> Any:
    return value.eval(si, active) if hasattr(value, "eval") else mi.Color3f(value)


def _scalar_at(value: Any, si: Any, active: Any) -> Any:
    return value.eval_1(si, active) if hasattr(value, "eval_1") else mi.Float(value)


def register() -> None:
    """Makes the plug-in known to Mitsuba as `usdpreviewsurface`."""
    mi.register_bsdf("usdpreviewsurface", lambda props: UsdPreviewSurface(props))
