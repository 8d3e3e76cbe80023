"""Materials: what is bound to gprims -> Material records.

What is bound, and by which UsdPreviewSurface it shows, is usd/binding's.  Anything else becomes a stand-in
(displayColor, else grey) that says why it cannot be edited.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from types import MappingProxyType
from typing import Any

import numpy as np
from pxr import Sdf, Usd, UsdGeom, UsdShade

from usdslf.color import USD_DEFAULT_SPACE, Color
from usdslf.progress import tell_during, told
from usdslf.scene.records import F64, Input, Material, Mesh, PrimvarInput, Texture, constant
from usdslf.textures import images
from usdslf.textures.texels import WRAPS
from usdslf.threads import map_ahead
from usdslf.usd.binding import bound_material, named_material, preview_surface, render_contexts
from usdslf.usd.notes import Notes
from usdslf.usd.read.input_values import floats
from usdslf.usd.read.primvars import is_from_instancer

# field of Material: (input of the shader, fallback)
_COLORS: dict[str, tuple[str, tuple[float, float, float]]] = {
    "diffuse_color": ("diffuseColor", (0.18, 0.18, 0.18)),
    "emissive_color": ("emissiveColor", (0.0, 0.0, 0.0)),
    "specular_color": ("specularColor", (0.0, 0.0, 0.0)),
}
_SCALARS: dict[str, tuple[str, float]] = {
    "metallic": ("metallic", 0.0),
    "roughness": ("roughness", 0.5),
    "clearcoat": ("clearcoat", 0.0),
    "clearcoat_roughness": ("clearcoatRoughness", 0.01),
    "ior": ("ior", 1.5),
    "opacity": ("opacity", 1.0),
}
Affine = tuple[tuple[float, float, float], ...]


class MaterialTable:
    """Numbers the materials of a stage in the order in which gprims ask for them.

    Call it with a gprim or a GeomSubset: it returns the index into `materials`.
    """

    def __init__(self, time: Usd.TimeCode, color: Color, notes: Notes) -> None:
        self.materials: list[Material] = []
        self._time, self._color, self._notes = time, color, notes
        self._index: dict[Any, int] = {}
        self._stand_ins: dict[int, dict[tuple[str, str], None]] = {}  # index -> (reason, prim)
        self._read: dict[Sdf.Path, Material | None] = {}

    def __call__(self, prim: Usd.Prim, given: Mapping[str, F64] = MappingProxyType({})) -> int:
        """Returns the index of the material that a gprim or GeomSubset shows.

        Args:
            given: primvars (k,) that a PointInstancer gives this instance of it.
        """
        bound = bound_material(prim)
        if bound:
            path = bound.GetPath()
            if path in self._index:
                return self._index[path]
            material = self._material(bound)
            if material is not None:
                return self._number(path, material)
            outputs = _what_it_has(bound)
            reason = f"no UsdPreviewSurface (but {outputs}) in {{}}: displayColor, else grey, is shown"
            why = (
                f"{path} has no UsdPreviewSurface (it has {outputs}): bind a new UsdPreviewSurface "
                f"material (--make-preview makes one), final renders by other contexts would not follow it"
            )
            return self._stand_in(prim, str(path), why, (reason, str(path)), given)
        is_named = not named_material(prim).isEmpty
        what = "the binding of {} names no material" if is_named else "no material is bound to {}"
        note = (f"{what}: displayColor, else grey, is shown", str(prim.GetPath()))
        why = "no material is bound: bind a UsdPreviewSurface material first (--make-preview makes one)"
        return self._stand_in(prim, "", why, note, given)

    def used(self, meshes: list[Mesh]) -> tuple[list[Mesh], list[Material]]:
        """Returns meshes and materials without the materials that no triangle has; notes used stand-ins."""
        count = len(self.materials)
        seen = np.zeros(count, bool)
        for mesh in meshes:
            seen[mesh.material_of_triangle] = True
        number = (np.cumsum(seen) - 1).astype(np.int32)
        for i in np.nonzero(seen)[0]:
            for reason, prim in self._stand_ins.get(int(i), {}):
                self._notes.add(reason, prim)
        if not seen.all():
            meshes = [replace(m, material_of_triangle=number[m.material_of_triangle]) for m in meshes]
        materials = [m for m, s in zip(self.materials, seen, strict=True) if s]
        self._load_textures(materials)
        return meshes, materials

    def _load_textures(self, materials: list[Material]) -> None:
        """Brings all textures into memory, several files at a time, and notes what cannot be read."""
        textures = list({v: None for m in materials for v in vars(m).values() if isinstance(v, Texture)})

        def read_all() -> list[tuple[list[tuple[str, str]], list[str]]]:
            with ThreadPoolExecutor() as pool:
                read = map_ahead(pool, lambda i: images.remarks(textures[i], self._color), range(len(textures)), 8)
                return [said for _, said in told(read)]

        for texture, (unreadable, remarks) in zip(textures, tell_during(read_all), strict=True):
            self._notes.missing |= dict.fromkeys([texture.prim], unreadable[-1]) if unreadable else {}
            for remark in remarks:
                self._notes.add(remark, texture.prim)

    def _number(self, key: Any, material: Material) -> int:
        if key not in self._index:
            self._index[key] = len(self.materials)
            self.materials.append(material)
        return self._index[key]

    def _stand_in(
        self, prim: Usd.Prim, path: str, why: str, note: tuple[str, str], given: Mapping[str, F64]
    ) -> int:  # fmt: skip
        """Numbers what a gprim shows without a UsdPreviewSurface: one entry for each look."""
        gprim = prim if prim.IsA(UsdGeom.Gprim) else prim.GetParent()
        diffuse, color_key = self._display(gprim, "displayColor", (0.18, 0.18, 0.18), given)
        opacity, opacity_key = self._display(gprim, "displayOpacity", (1.0,), given)
        material = Material(path=path, diffuse_color=diffuse, opacity=opacity, why_not_editable=why)
        index = self._number((path, color_key, opacity_key), material)
        self._stand_ins.setdefault(index, {})[note] = None
        return index

    def _display(
        self, gprim: Usd.Prim, name: str, fallback: tuple[float, ...], given: Mapping[str, F64]
    ) -> tuple[Input, Any]:  # fmt: skip
        """Returns displayColor or displayOpacity as an input, and a key for equal ones."""
        primvar = UsdGeom.PrimvarsAPI(gprim).FindPrimvarWithInheritance(name)
        value = primvar.Get(self._time) if primvar else None
        if name in given and len(given[name]) == len(fallback) and is_from_instancer(gprim, name):
            key = tuple(float(x) for x in given[name])
            return _constant(key, self._color, USD_DEFAULT_SPACE), key
        if value is None or len(value) == 0:
            return constant(*fallback), fallback
        if len(value) > 1:
            return PrimvarInput(name, fallback), name
        key = tuple(float(x) for x in np.ravel(value[0]))
        return _constant(key, self._color, USD_DEFAULT_SPACE), key

    def _material(self, bound: UsdShade.Material) -> Material | None:
        """Reads a material; those of equal instances are read once and differ by path."""
        prim = bound.GetPrim()
        source = prim.GetPrimInPrototype() if prim.IsInstanceProxy() else prim
        if source.GetPath() not in self._read:
            self._read[source.GetPath()] = self._read_material(bound)
        found = self._read[source.GetPath()]
        shader = preview_surface(bound)
        if found is None or shader is None:
            return None
        return replace(found, path=str(prim.GetPath()), shader=str(shader.GetPath()))

    def _read_material(self, bound: UsdShade.Material) -> Material | None:
        shader = preview_surface(bound)
        if shader is None:
            return None
        read = _Network(shader, self._time, self._color, self._notes)
        values: dict[str, Any] = {f: read.value(n, fb) for f, (n, fb) in _COLORS.items()}
        values |= {f: read.value(n, (fb,)) for f, (n, fb) in _SCALARS.items()}
        normal = read.value("normal", (0.0, 0.0, 1.0))
        if isinstance(normal, Texture):
            values["normal"] = self._normal_map(normal)
        displacement = read.value("displacement", (0.0,))
        if not isinstance(displacement, np.ndarray) or displacement[0] != 0:
            self._notes.add("displacement of {} is not shown", shader.GetPath())
        return Material(
            path=str(bound.GetPath()),
            shader=str(shader.GetPath()),
            use_specular_workflow=bool(read.numbers("useSpecularWorkflow", (0.0,))[0]),
            opacity_threshold=read.numbers("opacityThreshold", (0.0,))[0],
            opacity_mode=str(read.plain("opacityMode", "transparent")),
            **values,
        )

    def _normal_map(self, texture: Texture) -> Texture:
        """Returns a normal map whose integer texels are vectors in -1..1, as they are meant; notes repairs.

        Exporters leave out scale 2 and bias -1, or the raw colour space, without which no such file can mean
        a direction on both sides of the normal.
        """
        file = texture.tiles[0][1] if texture.tiles else texture.path
        if not images.is_integer(file):
            return texture
        if texture.scale[:2] == (1.0, 1.0) and texture.bias[:2] == (0.0, 0.0):
            self._notes.add("normal map {} has no scale 2 and bias -1: read as if it had", texture.prim)
            texture = replace(texture, scale=(2.0, 2.0, 2.0, 1.0), bias=(-1.0, -1.0, -1.0, 0.0))
        if not self._color.is_data(texture.color_space):
            self._notes.add("normal map {} is not marked raw: read as raw", texture.prim)
            texture = replace(texture, color_space="raw")
        return texture


def _what_it_has(material: UsdShade.Material) -> str:
    """Returns what gives the surface of a material without UsdPreviewSurface."""
    shader = material.ComputeSurfaceSource()[0]
    kinds = [str(shader.GetShaderId() or shader.GetPath())] if shader else []
    for context in render_contexts(material):
        found = material.ComputeSurfaceSource(context)[0]
        kinds.append(str(found.GetShaderId() or found.GetSourceAssetSubIdentifier(context) or "") if found else "")
    return ", ".join(dict.fromkeys(filter(None, [*render_contexts(material), *kinds]))) or "no surface output"


class _Network:
    """Inputs of one shader, followed through interfaces and node graphs to what feeds them."""

    def __init__(self, shader: UsdShade.Shader, time: Usd.TimeCode, color: Color, notes: Notes) -> None:
        self.shader, self.time, self.color, self.notes = shader, time, color, notes

    def value(self, name: str, fallback: tuple[float, ...]) -> Input:
        """Returns an input of as many values as the fallback has."""
        attribute = self._producer(name)
        if attribute is None:
            return constant(*fallback)
        if UsdShade.Output.IsOutput(attribute):
            return self._from_shader(attribute, name, fallback)
        value = attribute.Get(self.time)
        if value is None:
            return constant(*fallback)
        values = self._usable(name, value, fallback)
        is_color = len(values) == 3 and name != "normal"
        return _constant(values, self.color, color_space_of(attribute)) if is_color else constant(*values)

    def plain(self, name: str, fallback: Any) -> Any:
        """Returns an input that only makes sense as a constant."""
        attribute = self._producer(name)
        if attribute is None or UsdShade.Output.IsOutput(attribute):
            return fallback
        value = attribute.Get(self.time)
        return fallback if value is None else value

    def numbers(self, name: str, fallback: tuple[float, ...]) -> tuple[float, ...]:
        """Returns an input that only makes sense as constant numbers, as many as the fallback has."""
        return self._usable(name, self.plain(name, fallback), fallback)

    def _usable(self, name: str, value: Any, fallback: tuple[float, ...]) -> tuple[float, ...]:
        found = floats(value)
        if found is None or len(found) != len(fallback):
            self.notes.add(f"{name} of {{}} has no usable value: its fallback is used", self.shader.GetPath())
            return fallback
        return found

    def attribute(self, name: str) -> Usd.Attribute | None:
        """Returns the attribute that holds the value of an input."""
        return self._producer(name)

    def _producer(self, name: str) -> Usd.Attribute | None:
        port = self.shader.GetInput(name)
        if not port:
            return None
        found = port.GetValueProducingAttributes()
        if len(found) > 1:
            reason = f"{name} of {{}} has several connections: the first is used"
            self.notes.add(reason, self.shader.GetPath())
        return found[0] if found else (port.GetAttr() if port.GetAttr().HasValue() else None)

    def _other(self, prim: Usd.Prim) -> _Network:
        return _Network(UsdShade.Shader(prim), self.time, self.color, self.notes)

    def _from_shader(self, output: Usd.Attribute, name: str, fallback: tuple[float, ...]) -> Input:
        source = self._other(output.GetPrim())
        kind = str(source.shader.GetIdAttr().Get() or "")
        if kind == "UsdUVTexture":
            channels = output.GetName().rpartition(":")[2]
            channels = channels if channels in ("r", "g", "b", "a", "rgb") else "rgb"
            if len(fallback) == 1 and channels == "rgb":
                channels = "r"
            return source.texture(channels)
        if kind.startswith("UsdPrimvarReader_"):
            given = floats(source.plain("fallback", None))
            return PrimvarInput(str(source.plain("varname", "") or ""), given or (0.0,) * len(fallback))
        reason = f"{{}} ({kind or 'no id'}) cannot be read: {name} has its fallback"
        self.notes.add(reason, output.GetPrim().GetPath())
        return constant(*fallback)

    # ---- UsdUVTexture ------------------------------------------------------------------------
    def texture(self, channels: str) -> Texture:
        """Returns this UsdUVTexture, with the coordinates that lead to it."""
        prim = self.shader.GetPath()
        path, tiles, color_space = self._file()
        uv_set, st_from_uv, st_fallback = self._coordinates()
        first = tiles[0][1] if tiles else path
        wraps = [str(self.plain(n, "useMetadata")) for n in ("wrapS", "wrapT")]
        if "useMetadata" in wraps:
            authored = images.wrap_modes(first) if first else ("black", "black")
            wraps = [a if w == "useMetadata" else w for w, a in zip(wraps, authored, strict=True)]
        if color_space not in ("auto", "") and not self.color.knows(color_space):
            self.notes.add(f"colour space {color_space} of {{}} is unknown: taken as auto", prim)
            color_space = "auto"
        return Texture(
            prim=str(prim),
            path=path,
            tiles=tiles,
            color_space=color_space,
            wrap_s=wraps[0] if wraps[0] in WRAPS else "black",
            wrap_t=wraps[1] if wraps[1] in WRAPS else "black",
            scale=_four(self.numbers("scale", (1.0, 1.0, 1.0, 1.0))),
            bias=_four(self.numbers("bias", (0.0, 0.0, 0.0, 0.0))),
            fallback=_four(self.numbers("fallback", (0.0, 0.0, 0.0, 1.0))),
            channels=channels,
            uv_set=uv_set,
            st_from_uv=st_from_uv,
            st_fallback=st_fallback,
        )

    def _file(self) -> tuple[str, tuple[tuple[int, str], ...], str]:
        """Returns the resolved file, its UDIM tiles and its colour space."""
        attribute = self.attribute("file")
        is_value = attribute is not None and not UsdShade.Output.IsOutput(attribute)
        asset = attribute.Get(self.time) if is_value and attribute else None
        space = str(self.plain("sourceColorSpace", "auto"))
        if space == "auto" and attribute is not None and attribute.HasColorSpace():
            space = attribute.GetColorSpace()
        if not isinstance(asset, Sdf.AssetPath) or not asset.path or attribute is None:
            file = "" if self.attribute("fallback") else "(none)"  # a fallback that is authored may be what is meant
            self._miss("texture {} names no file", file, "it names no file")
            return "", (), space
        if UsdShade.UdimUtils.IsUdimIdentifier(asset.path):
            layers = [s.layer for s in attribute.GetPropertyStack(self.time)]
            tiles = UsdShade.UdimUtils.ResolveUdimTilePaths(asset.path, layers[0]) if layers else []
            found = tuple(sorted((int(tile), str(file)) for file, tile in tiles))
            if not found:
                self._miss(f"no tile of {asset.path} in {{}} can be found", asset.path, "no tile of it can be found")
            return asset.path, found, space
        if not asset.resolvedPath:
            self._miss(f"texture {asset.path} of {{}} cannot be found", asset.path, "it cannot be found")
        return str(asset.resolvedPath), (), space

    def _miss(self, reason: str, file: str, why: str) -> None:
        self.notes.add(f"{reason}: its fallback is used", self.shader.GetPath())
        self.notes.missing |= {str(self.shader.GetPath()): (file, why)} if file else {}

    def _coordinates(self) -> tuple[str, Affine, tuple[float, float]]:
        """Returns the primvar, the transform and the fallback of the coordinates of a texture."""
        matrix, node, name = np.eye(3), self, "st"
        for _ in range(8):
            attribute = node.attribute(name)
            if attribute is None:
                break
            if not UsdShade.Output.IsOutput(attribute):
                value = floats(attribute.Get(self.time))
                if value and len(value) > 1:  # the same coordinates everywhere
                    matrix = matrix @ np.array([[0, 0, value[0]], [0, 0, value[1]], [0, 0, 1.0]])
                break
            node = self._other(attribute.GetPrim())
            kind = str(node.shader.GetIdAttr().Get() or "")
            if kind == "UsdTransform2d":
                matrix, name = matrix @ node.transform_2d(), "in"
                continue
            if kind.startswith("UsdPrimvarReader_"):
                st = floats(node.plain("fallback", None)) or ()
                fallback = (st[0], st[1]) if len(st) > 1 else (0.0, 0.0)
                return str(node.plain("varname", "") or "st"), _affine(matrix), fallback
            reason = f"{{}} ({kind or 'no id'}) cannot give texture coordinates: st is used"
            self.notes.add(reason, node.shader.GetPath())
            break
        return "st", _affine(matrix), (0.0, 0.0)

    def transform_2d(self) -> np.ndarray:
        """Returns the matrix (3, 3) of a UsdTransform2d: scale, then rotation (degrees), then translation."""
        angle = math.radians(self.numbers("rotation", (0.0,))[0])
        sx, sy = self.numbers("scale", (1.0, 1.0))
        tx, ty = self.numbers("translation", (0.0, 0.0))
        c, s = math.cos(angle), math.sin(angle)
        return np.array([[c * sx, -s * sy, tx], [s * sx, c * sy, ty], [0.0, 0.0, 1.0]])


def _constant(values: tuple[float, ...], color: Color, space: str) -> Input:
    """Returns a constant input; colours of another space come into the working space."""
    if len(values) != 3:
        return constant(*values)
    return color.to_working(np.asarray(values, np.float32)[None], space)[0]


def color_space_of(attribute: Usd.Attribute) -> str:
    """Returns the colour space of an authored colour: the attribute's, an ancestor's, else USD's default."""
    return str(Usd.ColorSpaceAPI.ComputeColorSpaceName(attribute, None)) or USD_DEFAULT_SPACE


def _four(value: tuple[float, ...]) -> tuple[float, float, float, float]:
    a, b, c, d = value
    return a, b, c, d


def _affine(matrix: np.ndarray) -> Affine:
    return tuple((float(r[0]), float(r[1]), float(r[2])) for r in matrix)
