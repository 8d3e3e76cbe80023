"""Surface: what a material is at points on triangles.

    UsdPreviewSurface, F = mix(F0, F90, (1 - V.H)^5):
      metal workflow     S = mix(1, diffuseColor, metallic);  R = (1 - ior) / (1 + ior)
                         F0 = mix(R^2 S, S, metallic);  F90 = S;  d = diffuseColor (1 - metallic)
      specular workflow  F0 = specularColor;  F90 = 1;  d = diffuseColor
    Source: previewSurface.glslfx of OpenUSD 26.11.

Opacity: with a threshold the surface is there or not; else mode `presence` scales all of it, and mode
`transparent` scales the diffuse colour only.  In every case the light from behind is seen by 1 - opacity:

    seen = presence * L_o + (1 - opacity) * behind
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from usdslf.color import USD_DEFAULT_SPACE, Color, color_of
from usdslf.scene.records import F32, I32, Input, Material, PrimvarInput, Scene, Texture
from usdslf.textures.images import sample_texture

MIN_ROUGHNESS = 0.001
_COLORS = ("diffuse_color", "specular_color", "emissive_color")
_SCALARS = ("metallic", "roughness", "clearcoat", "clearcoat_roughness", "ior", "opacity")


@dataclass(frozen=True)
class SurfacePoints:
    """Points on surfaces and their reflectance, all (n, ...) float32 unless said otherwise."""

    position: F32  # (n, 3)
    geometric_normal: F32  # (n, 3) unit, by the winding
    normal: F32  # (n, 3) unit, shading and normal map; on the side of geometric_normal
    mesh: I32  # (n,)
    material: I32  # (n,)
    triangle: I32  # (n,)
    barycentric: F32  # (n, 2)
    diffuse: F32  # (n, 3) d, times opacity where the material is transparent
    f0: F32  # (n, 3)
    f90: F32  # (n, 3)
    roughness: F32  # (n,) the input, 0.001..1; alpha is its square
    clearcoat: F32  # (n,)
    clearcoat_roughness: F32  # (n,)
    coat_f0: F32  # (n,)
    emission: F32  # (n, 3)
    opacity: F32  # (n,) 1 - what is seen of the light from behind
    presence: F32  # (n,) factor on all of the outgoing radiance
    base_color: F32  # (n, 3) diffuseColor
    metallic: F32  # (n,)
    ior: F32  # (n,)
    specular_color: F32  # (n, 3)


def evaluate_surface(
    scene: Scene,
    triangle: NDArray,
    barycentric: NDArray,
    normal_maps: bool = True,
) -> SurfacePoints:
    """Returns position, normals and reflectance at points on triangles.

    Args:
        scene: the shot.
        triangle: (n,) into scene.triangles.
        barycentric: (n, 2), point = (1 - u - v) P0 + u P1 + v P2.
        normal_maps: False keeps the interpolated normals.
    """
    color = color_of(scene.ocio, scene.working_space)
    tri = np.asarray(triangle, np.int32).reshape(-1)
    bary = np.asarray(barycentric, np.float32).reshape(-1, 2)
    table = scene.triangles
    weight = _weights(bary)
    material = table.material[tri]
    geometric = table.face_normals[tri]
    normal = _unit(_interpolate(table.normals[tri], weight), geometric)
    normal = np.where((normal * geometric).sum(1, keepdims=True) < 0, -normal, normal)

    values, normal = _inputs(scene, tri, weight, color, normal, normal_maps)
    base, emission = np.maximum(values["diffuse_color"], 0), np.maximum(values["emissive_color"], 0)
    specular = np.clip(values["specular_color"], 0, 1)
    scalars = {name: values[name][:, 0] for name in _SCALARS}
    is_specular = np.array([x.use_specular_workflow for x in scene.materials], bool)[material]
    opacity, presence = _coverage(scene.materials, material, scalars["opacity"])
    metallic = np.clip(scalars["metallic"], 0, 1)
    ior = np.maximum(scalars["ior"], 1e-3)
    d, f0, f90, r2 = reflectance_at(is_specular, base, specular, metallic, ior)
    # Opacity of what is there: below 1 in mode transparent only.
    solid = np.where(presence > 0, opacity / np.maximum(presence, 1e-20), 1)
    return SurfacePoints(
        position=_interpolate(table.positions[tri], weight),
        geometric_normal=geometric,
        normal=normal.astype(np.float32),
        mesh=table.mesh[tri],
        material=material,
        triangle=tri,
        barycentric=bary,
        diffuse=(d * solid[:, None]).astype(np.float32),
        f0=f0.astype(np.float32),
        f90=f90.astype(np.float32),
        roughness=np.clip(scalars["roughness"], MIN_ROUGHNESS, 1),
        clearcoat=np.clip(scalars["clearcoat"], 0, 1),
        clearcoat_roughness=np.clip(scalars["clearcoat_roughness"], MIN_ROUGHNESS, 1),
        coat_f0=r2.astype(np.float32),
        emission=emission,
        opacity=opacity,
        presence=presence,
        base_color=base,
        metallic=metallic,
        ior=ior,
        specular_color=specular,
    )


def _inputs(
    scene: Scene, tri: I32, weight: F32, color: Color, normal: NDArray, normal_maps: bool
) -> tuple[dict[str, F32], NDArray]:
    """Returns all inputs (n, 1 or 3) by name, and normals (n, 3) with the maps of materials on them.

    Constant inputs come from a table of all materials, the others are read material by material.
    """
    material = scene.triangles.material[tri]
    table_of_inputs, varying = _constant_inputs(scene.materials)
    values = {name: rows[material] for name, rows in table_of_inputs.items()}
    for m, at in _groups(material, np.array([bool(v) for v in varying], bool)):
        read = _Reader(scene, tri[at], weight[at], color)
        for name in set(varying[m]) - {"normal"}:
            values[name][at] = read(getattr(scene.materials[m], name), values[name].shape[1])
        bump = scene.materials[m].normal
        if normal_maps and bump is not None:
            normal[at] = _mapped_normal(read, bump, normal[at])
    return values, normal


def reflectance_at(
    is_specular: NDArray[np.bool_], base: F32, specular: F32, metallic: F32, ior: F32
) -> tuple[F32, F32, F32, F32]:
    """Returns d, F0 and F90 (n, 3) by the workflow of each point, and R^2 (n,) of its ior."""
    r2 = ((1 - ior) / (1 + ior)) ** 2
    m_, r2_ = metallic[:, None], r2[:, None]
    s = 1 + (base - 1) * m_
    workflow = is_specular[:, None]
    d = np.where(workflow, base, base * (1 - m_))
    f0 = np.where(workflow, specular, r2_ * s + (s - r2_ * s) * m_)
    return d, f0, np.where(workflow, 1, s), r2


def turned_to_viewer(normal: NDArray, geometric: NDArray, view: NDArray) -> NDArray:
    """Bends unit shading normals (n, 3) that point away from the viewer until they are seen just so.

    Args:
        geometric: (n, 3) unit normals, on the side of the viewer as `normal` is.
        view: (n, 3) unit, towards the viewer.
    """
    facing = np.einsum("nk,nk->n", normal, view)
    least = np.minimum(0.02, np.maximum(np.einsum("nk,nk->n", geometric, view), 1e-3))
    bent = normal + (1.5 * np.maximum(least - facing, 0))[:, None] * view
    return bent / np.maximum(np.linalg.norm(bent, axis=1, keepdims=True), 1e-12)


def evaluate_opacity(
    scene: Scene, triangle: NDArray, barycentric: NDArray
) -> tuple[F32, F32]:
    """Returns opacity and presence (n,), (n,) as `evaluate_surface` does, without the rest."""
    color = color_of(scene.ocio, scene.working_space)
    tri = np.asarray(triangle, np.int32).reshape(-1)
    weight = _weights(np.asarray(barycentric, np.float32).reshape(-1, 2))
    material = scene.triangles.material[tri]
    opacity = _constant_inputs(scene.materials)[0]["opacity"][:, 0][material]
    varies = np.array([not isinstance(x.opacity, np.ndarray) for x in scene.materials], bool)
    for m, at in _groups(material, varies):
        read = _Reader(scene, tri[at], weight[at], color)
        opacity[at] = read(scene.materials[m].opacity, 1)[:, 0]
    return _coverage(scene.materials, material, opacity)


def _constant_inputs(materials: tuple[Material, ...]) -> tuple[dict[str, F32], list[list[str]]]:
    """Returns a table (M, 1 or 3) of each input, and for each material the inputs that vary over it."""
    table: dict[str, F32] = {}
    varying: list[list[str]] = [["normal"] if m.normal is not None else [] for m in materials]
    for name in (*_COLORS, *_SCALARS):
        size = 3 if name in _COLORS else 1
        rows = np.zeros((len(materials), size), np.float32)
        for m, material in enumerate(materials):
            value = getattr(material, name)
            if isinstance(value, np.ndarray):
                rows[m] = value
            else:
                varying[m].append(name)
        table[name] = rows
    return table, varying


def _coverage(materials: tuple[Material, ...], material: I32, opacity: F32) -> tuple[F32, F32]:
    """Returns opacity and presence (n,), (n,) from the opacity input (n,)."""
    threshold = np.array([m.opacity_threshold for m in materials], np.float32)[material]
    scales_all = np.array([m.opacity_mode == "presence" for m in materials], bool)[material]
    cut_out = threshold > 0
    opacity = np.where(cut_out, opacity >= threshold, np.clip(opacity, 0, 1)).astype(np.float32)
    return opacity, np.where(cut_out | scales_all, opacity, 1).astype(np.float32)


class _Reader:
    """Values of material inputs at the same points of triangles; texture reads are shared."""

    def __init__(self, scene: Scene, tri: NDArray, weight: F32, color: Color) -> None:
        self.scene, self.tri, self.weight, self.color = scene, tri, weight, color
        self._st: dict[tuple, NDArray] = {}
        self._rgba: dict[tuple, F32] = {}

    def __call__(self, value: Input, size: int) -> F32:
        """Returns (n, size) in the working space."""
        n = len(self.tri)
        if isinstance(value, Texture):
            rgba = self.texture(value)
            out = rgba[:, :3] if value.channels == "rgb" else rgba[:, ["rgba".index(value.channels)]]
        elif isinstance(value, PrimvarInput):
            out = self.primvar(value, size)
        else:
            out = np.broadcast_to(np.asarray(value, np.float32).reshape(1, -1), (n, np.size(value)))
        if out.shape[1] == size:
            return out
        return np.repeat(out[:, :1], size, 1)

    def primvar(self, value: PrimvarInput, size: int) -> F32:
        """Returns a primvar (n, size), its fallback where a gprim has none."""
        out = _interpolate(self.scene.corner_primvar(value.name, size)[self.tri], self.weight)
        fallback = np.asarray(value.fallback or (0.0,), np.float32)
        fallback = fallback[:size] if len(fallback) >= size else np.repeat(fallback[:1], size)
        out = np.where(np.isfinite(out).all(1, keepdims=True), out, fallback)
        return self.color.to_working(out, USD_DEFAULT_SPACE) if size == 3 else out

    def texture(self, texture: Texture) -> F32:
        """Returns texel * scale + bias (n, 4)."""
        key = (texture.prim, texture.path, texture.scale, texture.bias, texture.color_space)
        if key not in self._rgba:
            self._rgba[key] = sample_texture(texture, self.st(texture), self.color)
        return self._rgba[key]

    def st(self, texture: Texture) -> NDArray[np.float64]:
        """Returns texture coordinates (n, 2), transformed."""
        key = (texture.uv_set, texture.st_from_uv, texture.st_fallback)
        if key not in self._st:
            uv = _interpolate(self.scene.corner_uvs(texture.uv_set)[self.tri], self.weight)
            uv = np.where(np.isfinite(uv), uv, np.asarray(texture.st_fallback, np.float32))
            m = np.asarray(texture.st_from_uv, np.float64)
            self._st[key] = uv @ m[:2, :2].T + m[:2, 2]
        return self._st[key]


def _mapped_normal(read: _Reader, texture: Texture, normal: F32) -> F32:
    """Returns normals (n, 3) perturbed by a tangent-space map.

    Tangent and bitangent are the triangle's dP/ds and dP/dt, made orthogonal to the shading normal;
    where st has no area the normal stays.
    """
    m = np.asarray(texture.st_from_uv, np.float64)[:2, :2]
    uv = read.scene.corner_uvs(texture.uv_set)[read.tri].astype(np.float64) @ m.T
    p = read.scene.triangles.positions[read.tri].astype(np.float64)
    e1, e2 = p[:, 1] - p[:, 0], p[:, 2] - p[:, 0]
    (s1, t1), (s2, t2) = (uv[:, 1] - uv[:, 0]).T, (uv[:, 2] - uv[:, 0]).T
    area = s1 * t2 - s2 * t1
    usable = np.isfinite(area) & (np.abs(area) > 1e-20)
    sign = np.where(usable, np.sign(area), 1.0)[:, None]
    dp_ds = (e1 * t2[:, None] - e2 * t1[:, None]) * sign
    dp_dt = (e2 * s1[:, None] - e1 * s2[:, None]) * sign
    n = normal.astype(np.float64)
    tangent = _unit(dp_ds - n * (dp_ds * n).sum(1, keepdims=True), np.zeros_like(n))
    bitangent = np.cross(n, tangent)
    bitangent *= np.where((bitangent * dp_dt).sum(1, keepdims=True) < 0, -1.0, 1.0)
    x, y, z = read.texture(texture)[:, :3].astype(np.float64).T[:, :, None]
    usable &= (np.abs(tangent) > 0).any(1)
    mapped = np.where(usable[:, None], x * tangent + y * bitangent + z * n, n)
    return _unit(mapped, n).astype(np.float32)


def _groups(material: I32, wanted: NDArray[np.bool_]) -> Iterator[tuple[int, NDArray[np.intp]]]:
    """Yields each wanted material that occurs with the places where it does."""
    places = np.nonzero(wanted[material])[0]
    order = places[np.argsort(material[places], kind="stable")]
    values, first = np.unique(material[order], return_index=True)
    last = np.append(first[1:], len(order))
    for m, low, high in zip(values, first, last, strict=False):  # no points: last has one more
        yield int(m), order[low:high]


def _weights(barycentric: F32) -> F32:
    u, v = barycentric.T
    return np.stack([1 - u - v, u, v], 1)


def _interpolate(corners: F32, weight: F32) -> F32:
    """Returns values (n, C) from corners (n, 3, C)."""
    return np.einsum("nkc,nk->nc", corners, weight).astype(np.float32)


def _unit(v: NDArray, otherwise: NDArray) -> NDArray:
    """Returns unit vectors, `otherwise` where the length is zero or not finite."""
    length = np.linalg.norm(v, axis=1, keepdims=True)
    ok = (length > 1e-20) & np.isfinite(length)
    return np.where(ok, v / np.where(ok, length, 1), otherwise)
