"""What answers ask of the places that were painted: to be compared with what a look shows there.

    asked_of(answers, painted, scene, elements, field) -> list[Asked]     one for each material that changes
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from usdslf.edits.edits import Reflectance
from usdslf.edits.read_back import Asked
from usdslf.inference.answers import Answer, Painted, means_of_similar
from usdslf.light_field.light_field import LightField
from usdslf.scene.records import Scene

PLACES = 256  # that are looked at where the changed material is not the painted one


def asked_of(
    answers: Sequence[Answer], painted: Sequence[Painted], scene: Scene, field: LightField, mode: str = ""
) -> list[Asked]:  # fmt: skip
    """Returns what each answer asks: at the painted samples of its material, else anywhere on that.

    What is similar to the painted material asks for the change that goes on to it.

    Args:
        painted: the strokes with their samples, numbered as by the pools of the answers.
        scene: the shot.
        field: with the reflectance of before.
        mode: of writing; `new` is of painted gprims only.
    """
    out = []
    table = scene.triangles
    for a in answers:
        if not a.chosen.freed:
            continue
        surfaces = [painted[i].samples.surface for i in a.pool.strokes if i < len(painted)]
        own = [s.material == a.pool.material for s in surfaces]
        triangle = np.concatenate([s.triangle[m] for s, m in zip(surfaces, own, strict=True)] or [np.zeros(0, int)])
        at = np.concatenate([s.barycentric[m] for s, m in zip(surfaces, own, strict=True)] or [np.zeros((0, 2))])
        if not len(triangle):  # an indirect stroke changes what it is lit by
            meshes = [i for i, m in enumerate(scene.meshes) if not a.pool.targets or m.path in a.pool.targets]
            shown = np.flatnonzero((table.material == a.pool.material) & np.isin(table.mesh, meshes))
            triangle = shown[np.linspace(0, len(shown) - 1, min(PLACES, len(shown))).astype(int)]
            at = np.full((len(triangle), 2), 1 / 3)
        before, after = Reflectance.of(a.before), Reflectance.of(a.after)
        path = scene.materials[a.pool.material].path
        out.append(Asked(path, triangle, at, before, after, a.chosen.freed))
        similar = () if mode == "new" else (*a.pool.similar, *a.pool.similar_in_part)
        out += [_of_similar(a, m, scene, field) for m in similar]
    return out


def _of_similar(answer: Answer, material: int, scene: Scene, field: LightField) -> Asked:
    """What an answer asks of a material that is similar to the painted one: at its elements."""
    elements = field.elements
    rows = np.flatnonzero(elements.material == material)
    rows = rows[np.linspace(0, len(rows) - 1, min(PLACES, len(rows))).astype(int)]
    before, after = (Reflectance.of(means) for means in means_of_similar(answer, material, field))
    at = elements.triangle[rows], elements.barycentric[rows]
    return Asked(scene.materials[material].path, *at, before, after, answer.chosen.freed)
