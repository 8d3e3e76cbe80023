"""Pools: strokes sorted into what is asked together, one material in one scope.

    sort_into_pools(evidence, scene) -> list[Pool]
    fixed_materials(evidence) -> {material: path of the stroke that fixates it}
    pool_paths(painted, pool) -> prims of its strokes
"""

from __future__ import annotations

import numpy as np

from usdslf.errors import StrokeError
from usdslf.inference.answers import Painted, Pool
from usdslf.inference.evidence import Evidence
from usdslf.inference.tools import asks_for_nothing
from usdslf.scene.records import Scene


def sort_into_pools(evidence: list[Evidence], scene: Scene) -> list[Pool]:
    """Sorts strokes by the material and scope that they speak of; the material with most dabs of a stroke counts.

    Raises: StrokeError for a stroke on a material that another stroke fixates.
    """
    found: dict[tuple, list[int]] = {}
    fixed = fixed_materials(evidence)
    for i, e in enumerate(evidence):
        if not len(e.material) or e.stroke.mode == "indirect":
            continue
        values, counts = np.unique(e.material, return_counts=True)
        material = int(values[counts.argmax()])
        scope = {"similar": "material"}.get(e.stroke.scope, e.stroke.scope)
        is_held = asks_for_nothing(e.stroke)
        if material in fixed and not is_held:
            raise StrokeError(
                f"{e.stroke.path} asks for a change of {scene.materials[material].path or 'a material'}, which "
                f"{fixed[material]} fixates; deactivate one of the two strokes"
            )
        targets: tuple[str, ...] = ()
        if scope in ("prim", "stroke"):
            under_brush = e.dab_of_sample < len(e.target)  # the other samples are unpainted
            meshes = np.unique(e.surface.mesh[under_brush & (e.surface.material == material)])
            targets = tuple(scene.meshes[m].path for m in meshes)
        key = (material, scope, targets, i if scope == "stroke" or is_held else -1, is_held)
        found.setdefault(key, []).append(i)
    return [Pool(m, s, t, tuple(i), held) for (m, s, t, _, held), i in found.items()]


def fixed_materials(evidence: list[Evidence]) -> dict[int, str]:
    """Returns the materials that fixate strokes lie on, with the path of such a stroke."""
    fixing = [e for e in evidence if e.stroke.tool == "fixate" and e.stroke.strength > 0]
    return {int(m): e.stroke.path for e in fixing for m in np.unique(e.material)}


def pool_paths(painted: list[Painted], pool: Pool) -> tuple[str, ...]:
    """Returns the prims of a pool's strokes."""
    return tuple(painted[i].stroke.path for i in pool.strokes)
