"""UsdPreviewSurface materials of a stage as dictionaries of Mitsuba 3."""

from __future__ import annotations

import math
from typing import Any

import mitsuba as mi
import numpy as np
from numpy.typing import NDArray
from pxr import Usd, UsdShade
from reference.bordered_texture import register as register_texture
from reference.preview_surface_bsdf import register

register()
register_texture()

PRIMVAR_READERS = ("UsdPrimvarReader_float", "UsdPrimvarReader_float3", "UsdPrimvarReader_vector")
CHANNELS = {"rgb": [0, 1, 2], "r": [0], "g": [1], "b": [2], "a": [3]}
WRAPS = {"repeat": "repeat", "mirror": "mirror", "clamp": "clamp"}


def linear_from_srgb(x: NDArray) -> NDArray:
    """The sRGB curve, decoded."""
    return np.where(x <= 0.04045, x / 12.92, ((np.maximum(x, 0) + 0.055) / 1.055) ** 2.4)


def read_texels(path: str, color_space: str) -> NDArray | None:
    """Reads an image as (h, w, 4) float32, linear, top row first; None where it cannot be read."""
    import OpenImageIO as oiio

    image = oiio.ImageBuf(path)
    if image.has_error or not image.initialized:
        image.geterror()
        return None
    pixels = np.atleast_3d(image.get_pixels(oiio.FLOAT))
    count = pixels.shape[2]
    rgba = np.ones((*pixels.shape[:2], 4), np.float32)
    if count <= 2:
        rgba[..., :3] = pixels[..., :1]
        if count == 2:
            rgba[..., 3] = pixels[..., 1]
    else:
        rgba[..., : min(count, 4)] = pixels[..., :4]
    is_8_bit_color = str(image.spec().format) == "uint8" and count >= 3
    if color_space == "sRGB" or (color_space == "auto" and is_8_bit_color):
        rgba[..., :3] = linear_from_srgb(rgba[..., :3])
    return rgba


def input_source(
    shader: UsdShade.Shader, name: str, fallback: Any, warnings: list[str], primvars: dict[str, Any] | None = None
) -> tuple[Any, Any]:
    """Returns (constant, None), or (fallback, (texture shader, output name)); primvars are constants of a prim."""
    shade_input = shader.GetInput(name)
    if not shade_input:
        return fallback, None
    producers = UsdShade.Utils.GetValueProducingAttributes(shade_input)
    if not producers:
        value = shade_input.Get()
        return (fallback if value is None else value), None
    attribute = producers[0]
    if UsdShade.Utils.GetType(attribute.GetName()) == UsdShade.AttributeType.Output:
        source = UsdShade.Shader(attribute.GetPrim())
        kind = source.GetIdAttr().Get() if source else None
        if kind == "UsdUVTexture":
            return fallback, (source, UsdShade.Utils.GetBaseNameAndType(attribute.GetName())[0])
        if kind in PRIMVAR_READERS:
            value = (primvars or {}).get(input_source(source, "varname", "", warnings)[0])
            value = input_source(source, "fallback", None, warnings)[0] if value is None else value
            return (fallback if value is None else value), None
        warnings.append(f"{kind} feeding {shader.GetPath()}.{name}: fallback used")
        return fallback, None
    value = attribute.Get()
    return (fallback if value is None else value), None


class MaterialReader:
    """Turns materials into BSDF dictionaries and collects what it could not honour in `warnings`."""

    def __init__(self, model: str, warnings: list[str]) -> None:
        self.model = model
        self.warnings = warnings
        self._primvars: dict[str, Any] = {}

    def read(
        self,
        material: UsdShade.Material | None,
        display: tuple[float, ...],
        primvars: dict[str, Any] | None = None,
    ) -> tuple[dict, Any, str]:
        """Returns (BSDF dictionary, emitter dictionary or None, name of the texture coordinates).

        Args:
          material: what is bound, or None.
          display: colour of a prim without a material.
          primvars: constant primvars of the prim, for readers of the material; see `names_of_primvars`.
        """
        self._primvars = primvars or {}
        bsdf: dict[str, Any] = {"type": "usdpreviewsurface", "model": self.model}
        shader = material.ComputeSurfaceSource()[0] if material else None
        if not shader or shader.GetIdAttr().Get() != "UsdPreviewSurface":
            if shader:
                self.warnings.append(f"{shader.GetIdAttr().Get()} on {material.GetPath()}: fallback material")
            bsdf.update(diffuse=mi.ScalarColor3f(*display), use_specular_workflow=False)
            return bsdf, None, "st"
        uv_names = ["st"]

        def color(name: str, fallback: tuple[float, float, float]) -> Any:
            value, texture = self._source(shader, name, fallback)
            if texture:
                return self._texture(*texture, 3, uv_names)
            return mi.ScalarColor3f(*[float(x) for x in value])

        def scalar(name: str, fallback: float) -> Any:
            value, texture = self._source(shader, name, fallback)
            return self._texture(*texture, 1, uv_names) if texture else float(value)

        bsdf["use_specular_workflow"] = bool(self._source(shader, "useSpecularWorkflow", 0)[0])
        bsdf["diffuse"] = color("diffuseColor", (0.18, 0.18, 0.18))
        bsdf["specular"] = color("specularColor", (0, 0, 0))
        bsdf["roughness"] = scalar("roughness", 0.5)
        bsdf["metallic"] = scalar("metallic", 0.0)
        bsdf["ior"] = float(self._source(shader, "ior", 1.5)[0])
        coat = scalar("clearcoat", 0.0)
        if coat != 0.0:
            coat_roughness = scalar("clearcoatRoughness", 0.01)
            bsdf.update(clearcoat=coat, has_clearcoat=True, clearcoat_roughness=coat_roughness)
        self._add_opacity(bsdf, shader, scalar("opacity", 1.0))
        self._add_normal(bsdf, shader, uv_names)
        shade_input = shader.GetInput("displacement")
        if shade_input and (shade_input.HasConnectedSource() or shade_input.Get()):
            self.warnings.append(f"displacement on {material.GetPath()}: ignored")
        emission, texture = self._source(shader, "emissiveColor", (0, 0, 0))
        emitter = None
        if texture:
            bitmap = self._texture(*texture, 3, uv_names)
            if np.array(bitmap.get("inner", bitmap)["data"]).max() > 0:
                emitter = {"type": "area", "radiance": bitmap}
        elif any(x > 0 for x in emission):
            emitter = {"type": "area", "radiance": {"type": "rgb", "value": [float(x) for x in emission]}}
        if len(set(uv_names[1:])) > 1:
            self.warnings.append(f"several texture coordinates on {material.GetPath()}: {uv_names[-1]} for all")
        return bsdf, emitter, uv_names[-1]

    def _source(self, shader: UsdShade.Shader, name: str, fallback: Any) -> tuple[Any, Any]:
        return input_source(shader, name, fallback, self.warnings, self._primvars)

    def _add_normal(self, bsdf: dict, shader: UsdShade.Shader, uv_names: list[str]) -> None:
        """Adds the normal map: texels that are vectors in -1..1, and st as a map of the mesh's coordinates."""
        texture = self._source(shader, "normal", (0, 0, 1))[1]
        if not texture:
            return
        reader, output = texture
        bitmap = self._texture(reader, output, 3, uv_names, as_vectors=True)
        inner = bitmap.get("inner", bitmap)
        st_from_uv = np.array(inner["to_uv"].matrix)[:2, :2] if "to_uv" in inner else np.eye(2)
        # Mitsuba's v runs down: the derivatives of the position change with it, in the BSDF.
        uv_from_st = np.linalg.inv(np.array([[1, -1], [-1, 1]]) * st_from_uv)
        bsdf["normal_map"] = bitmap
        for i, value in enumerate(uv_from_st.ravel()):
            bsdf[f"uv_from_st{i}"] = float(value)

    def _add_opacity(self, bsdf: dict, shader: UsdShade.Shader, opacity: Any) -> None:
        if opacity == 1.0:
            return
        threshold = float(self._source(shader, "opacityThreshold", 0.0)[0])
        mode = self._source(shader, "opacityMode", "transparent")[0]
        if threshold > 0:
            mode = "presence"
        bsdf.update(
            opacity=opacity, has_null=True, presence=mode == "presence", opacity_threshold=threshold
        )

    def _texture(
        self, texture: UsdShade.Shader, output: str, size: int, uv_names: list[str], as_vectors: bool = False
    ) -> dict:
        """Returns a bitmap dictionary with scale and bias applied to its texels.

        Integer normal maps (`as_vectors`) without scale and bias are read as if they had 2 and -1.
        """

        def value(name: str, fallback: Any) -> Any:
            return self._source(texture, name, fallback)[0]

        asset = value("file", None)
        path = (asset.resolvedPath or asset.path) if asset else ""
        if "<UDIM>" in path:
            self.warnings.append(f"UDIM texture {path}")
        texels = read_texels(path, "raw" if as_vectors else value("sourceColorSpace", "auto"))
        scale, bias = value("scale", (1, 1, 1, 1)), value("bias", (0, 0, 0, 0))
        is_plain = (*scale, *bias) == (1, 1, 1, 1, 0, 0, 0, 0)
        if as_vectors and is_plain and not path.endswith((".exr", ".hdr")):
            scale, bias = (2, 2, 2, 2), (-1, -1, -1, -1)
            self.warnings.append(f"normal map {texture.GetPath()} without scale and bias: taken as 2 and -1")
        if texels is None:
            self.warnings.append(f"unreadable texture {path}")
            texels = np.broadcast_to(np.array(value("fallback", (0, 0, 0, 1)), np.float32), (2, 2, 4))
        else:
            texels = texels * np.array(scale, np.float32) + np.array(bias, np.float32)
        reader = texture.GetInput("st")
        if not (reader and reader.HasConnectedSource()):  # one place of the texture, (0, 0) unless written
            s, t = (reader.Get() if reader else None) or (0.0, 0.0)
            row, column = int((1 - t % 1) * len(texels)) % len(texels), int(s % 1 * texels.shape[1])
            row = len(texels) - 1 if t == 0 else row
            texels = np.broadcast_to(texels[row, column], (2, 2, 4))
        channels = CHANNELS[output]
        if size == 3 and len(channels) == 1:
            channels = channels * 3
        wrap_s, wrap_t = value("wrapS", "useMetadata"), value("wrapT", "useMetadata")
        if wrap_s != wrap_t:
            self.warnings.append(f"wrapS {wrap_s} with wrapT {wrap_t} on {texture.GetPath()}")
        texels = np.ascontiguousarray(texels[..., channels[:size]], np.float32)
        bitmap: dict[str, Any] = {
            "type": "bitmap",
            "data": mi.TensorXf(texels),
            "raw": True,
            "wrap_mode": WRAPS.get(wrap_s, "clamp"),
            "filter_type": "bilinear",
        }
        uv_names.append(self._coordinates(texture, bitmap))
        if wrap_s in WRAPS:
            return bitmap
        return _bordered(bitmap, np.broadcast_to(np.array(bias, float), 4)[channels[:size]])

    def _coordinates(self, texture: UsdShade.Shader, bitmap: dict) -> str:
        """Adds a UsdTransform2d to the bitmap; returns the name of the primvar that is read."""
        reader = _connected(texture, "st")
        if reader and reader.GetIdAttr().Get() == "UsdTransform2d":
            rotation = math.radians(self._source(reader, "rotation", 0.0)[0])
            scale = self._source(reader, "scale", (1, 1))[0]
            move = self._source(reader, "translation", (0, 0))[0]
            c, s = math.cos(rotation), math.sin(rotation)
            st_from_uv = np.array(
                [[c * scale[0], -s * scale[1], move[0]], [s * scale[0], c * scale[1], move[1]], [0, 0, 1]]
            )
            flip = np.array([[1, 0, 0], [0, -1, 1], [0, 0, 1.0]])  # Mitsuba's v = 1 - t
            flipped = flip @ st_from_uv @ flip
            to_uv = np.eye(4)
            to_uv[:2, :2], to_uv[:2, 3] = flipped[:2, :2], flipped[:2, 2]
            bitmap["to_uv"] = mi.ScalarTransform4f(to_uv)
            reader = _connected(reader, "in")
        return str(self._source(reader, "varname", "st")[0] or "st") if reader else "st"


def _bordered(bitmap: dict, border: NDArray) -> dict:
    """A bitmap that is black (its bias) outside 0..1: wrap modes `black` and, without metadata, `useMetadata`."""
    m = np.array(bitmap["to_uv"].matrix) if "to_uv" in bitmap else np.eye(4)
    places = {f"m{i}": float(x) for i, x in enumerate([*m[0, :2], m[0, 3], *m[1, :2], m[1, 3]])}
    border = np.repeat(border, 3)[:3] if len(border) == 1 else border
    return {"type": "bordered", "inner": bitmap, "border": mi.ScalarColor3f(*border.tolist()), **places}


def names_of_primvars(material: UsdShade.Material) -> list[str]:
    """Returns the primvars that colours and numbers of a material are read from."""
    names = []
    for prim in Usd.PrimRange(material.GetPrim(), Usd.TraverseInstanceProxies(Usd.PrimDefaultPredicate)):
        shader = UsdShade.Shader(prim)
        if shader and shader.GetIdAttr().Get() in PRIMVAR_READERS:
            names.append(str(input_source(shader, "varname", "", [])[0]))
    return sorted(set(names))


def _connected(shader: UsdShade.Shader, name: str) -> UsdShade.Shader | None:
    shade_input = shader.GetInput(name)
    if not shade_input or not shade_input.HasConnectedSource():
        return None
    return UsdShade.Shader(shade_input.GetConnectedSources()[0][0].source.GetPrim())
