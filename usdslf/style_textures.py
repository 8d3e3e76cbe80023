"""Style textures: a stylized change as textures that vary over a surface, where its coordinates allow it.

An input takes a baked texture where all triangles that show the material lie beside each other in its texture
coordinates.  Where they lie upon each other, or there are none, the change stays the mean over the material.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from usdslf.bake import Delta, bake_texture, plain_texture
from usdslf.color import Color
from usdslf.edits import MaterialChange
from usdslf.elements import Elements
from usdslf.propagate import Places, places_at
from usdslf.scene import F64, Input, Scene, Texture
from usdslf.stylize import MaterialStyle, Stylized
from usdslf.texel_cover import texel_points
from usdslf.upsample import upsample

SIZE = (256, 256)  # of a texture for an input that had none: elements are further apart than its texels
GRID = 128  # texels on a side that tell whether triangles lie upon each other
OVERLAP = 0.02  # of the covered ones


def with_textures(
    change: MaterialChange, style: MaterialStyle, stylized: Stylized, scene: Scene, elements: Elements, folder: Path,
    color: Color, warnings: list[str],
) -> MaterialChange:  # fmt: skip
    """Bakes what can be; returns the change with its textures."""
    triangles = np.flatnonzero(scene.triangles.material == style.material)
    at = style.elements
    baked = {}
    for name, value, moved in _inputs(change, stylized.change_at(at)):
        texture = value if isinstance(value, Texture) else None
        sets = [texture.uv_set] if texture else common_sets(scene, triangles)
        if not isinstance(value, Texture | np.ndarray) or not sets or not lies_flat(scene, triangles, sets[0]):
            warnings.append(
                f"{change.material.path}: its texture coordinates lie upon each other or are missing, so {name} "
                "changes by the mean"
            )
            continue
        source = value if isinstance(value, Texture) else plain_texture(value, sets[0])
        delta = _upsampled(scene, elements, at, moved)
        stem = f"{change.material.path.strip('/').replace('/', '_')}_{name}"
        baked[name] = bake_texture(
            scene, source, triangles, delta, folder, stem, size=None if texture else SIZE, color=color,
            warnings=warnings,
        )  # fmt: skip
    return replace(change, baked=baked)


def _upsampled(scene: Scene, elements: Elements, at: NDArray, moved: F64) -> Delta:
    """The change of elements (n,) as a function of all points; `at`: which elements."""
    reflectance = np.concatenate([elements.diffuse[at], elements.f0[at], elements.roughness[at, None]], 1)
    known = Places(elements.position[at], elements.geometric_normal[at], reflectance)
    spacing = float(np.sqrt(np.mean(elements.area[at])))
    return lambda triangle, barycentric: upsample(places_at(scene, triangle, barycentric), known, moved, spacing)


def _inputs(change: MaterialChange, moved: tuple[F64, F64, F64]) -> Iterator[tuple[str, Input, F64]]:
    """The inputs that carry a part of the change alone, what drives them, and the change at the elements."""
    m = change.material
    d, f0, roughness = moved
    metallic = float(m.metallic[0]) if isinstance(m.metallic, np.ndarray) else np.nan
    is_opaque = isinstance(m.opacity, np.ndarray) and float(m.opacity[0]) == 1
    if "diffuse" in change.freed and is_opaque and (m.use_specular_workflow or metallic == 0):
        yield "diffuseColor", m.diffuse_color, d
    if "specular" in change.freed and m.use_specular_workflow:
        yield "specularColor", m.specular_color, f0
    elif "specular" in change.freed and metallic == 1:
        yield "diffuseColor", m.diffuse_color, f0
    if "glossiness" in change.freed:
        yield "roughness", m.roughness, roughness


def common_sets(scene: Scene, triangles: NDArray) -> list[str]:
    """Returns the texture coordinates that all meshes of the triangles have, `st` first."""
    meshes = [scene.meshes[i] for i in np.unique(scene.triangles.mesh[triangles])]
    common = set.intersection(*(set(m.uvs) for m in meshes)) if meshes else set()
    return sorted(common, key=lambda name: (name != "st", name))


def lies_flat(scene: Scene, triangles: NDArray, uv_set: str) -> bool:
    """Whether triangles lie within 0..1 of their texture coordinates, each beside the others and none without area."""
    uv = scene.corner_uvs(uv_set)[triangles].astype(np.float64)
    if not np.isfinite(uv).all() or uv.min() < -1e-3 or uv.max() > 1 + 1e-3:
        return False
    hits = np.zeros(GRID * GRID, np.int64)
    for points in texel_points(uv, GRID, GRID, "clamp", "clamp"):
        np.add.at(hits, points.y * GRID + points.x, 1)
    a, b = uv[:, 1] - uv[:, 0], uv[:, 2] - uv[:, 0]
    area = scene.triangles.areas[triangles]
    collapsed = area[np.abs(a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]) < 1e-10].sum()
    return bool(collapsed <= OVERLAP * area.sum() and (hits > 1).sum() < OVERLAP * max((hits > 0).sum(), 1))
