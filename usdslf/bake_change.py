"""A change that varies over a surface -> textures of the inputs of its UsdPreviewSurface.

    bake_change(scene, material, triangles, varying, folder, color, warnings) -> {input: Baked or ByVertex}

Which input says it: diffuseColor for the diffuse colour of what is no metal and for the specular colour of a metal,
specularColor in the specular workflow.  A constant input of gprims without texture coordinates of their own gets a
value at each of their points.  Where neither can say it, that is said, and the mean stays a constant.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from usdslf.bake import Baked, bake_texture, plain_texture
from usdslf.color import Color
from usdslf.edits import ByVertex
from usdslf.nearest import nearest_on_triangles
from usdslf.propagate import places_at
from usdslf.scene import F64, Material, Scene, Texture
from usdslf.style_textures import common_sets, lies_flat
from usdslf.varying import Varying

METAL, DIELECTRIC = 0.999, 0.001


def bake_change(
    scene: Scene, material: int, triangles: NDArray, varying: Varying, folder: Path, color: Color, warnings: list[str]
) -> dict[str, Baked | ByVertex]:  # fmt: skip
    """Writes the texture that a varying change needs; returns it by input, nothing where a constant has to do.

    Args:
        material: into scene.materials; triangles: (k,) of the scene that show the change.
        warnings: takes the reason where it cannot vary.

    Raises: AuthorError where a texture cannot be read or written.
    """
    m = scene.materials[material]
    name = _input_of(m, varying.parameter)
    value = getattr(m, {"diffuseColor": "diffuse_color", "specularColor": "specular_color"}.get(name, ""), None)
    uv_set = value.uv_set if isinstance(value, Texture) else next(iter(common_sets(scene, triangles)), "")
    why = ""
    if not name:
        why = f"a varying {varying.parameter} colour cannot be said in one texture of its inputs"
    elif not isinstance(value, (Texture, np.ndarray)):
        why = f"a primvar drives its {name}"
    elif not uv_set or not lies_flat(scene, triangles, uv_set):
        if isinstance(value, np.ndarray):
            return {name: _by_vertex(scene, material, value, varying)}
        why = "its texture coordinates lie upon each other or are missing"
    if why:
        warnings.append(f"the change of {m.path} varies, but {why}: its mean is written")
        return {}
    texture = value if isinstance(value, Texture) else plain_texture(np.asarray(value), uv_set)

    def delta(triangle: NDArray, barycentric: NDArray) -> F64:
        return varying.at(places_at(scene, triangle, barycentric))

    stem = f"{m.path.rsplit('/', 1)[-1]}_{name}"
    return {name: bake_texture(scene, texture, triangles, delta, folder, stem, color=color, warnings=warnings)}


def _by_vertex(scene: Scene, material: int, value: NDArray, varying: Varying) -> ByVertex:
    """The constant plus the change at any points of a gprim: that of the nearest place of its surface."""
    table = scene.triangles

    def at(gprim: str, points: F64) -> F64:
        mesh = next(i for i, m in enumerate(scene.meshes) if m.path == gprim)
        own = np.flatnonzero((table.mesh == mesh) & (table.material == material))
        near = nearest_on_triangles(table.positions[own], points)
        places = places_at(scene, own[near.triangle].astype(np.int32), near.barycentric.astype(np.float32))
        return np.asarray(value, np.float64) + varying.at(places)

    before = tuple(float(x) for x in value)
    after = tuple(float(x) for x in np.clip(value + varying.mean, 0, 1))
    return ByVertex(before, after, at, scene.frame)


def _input_of(m: Material, parameter: str) -> str:
    """The input whose value is the parameter plus the same change, "" where there is none."""
    if m.use_specular_workflow:
        return "diffuseColor" if parameter == "diffuse" else "specularColor"
    metallic = float(m.metallic[0]) if isinstance(m.metallic, np.ndarray) else -1.0
    if parameter == "diffuse" and 0 <= metallic <= DIELECTRIC:
        return "diffuseColor"
    return "diffuseColor" if parameter == "specular" and metallic >= METAL else ""
