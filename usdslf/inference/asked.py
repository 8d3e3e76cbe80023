"""What answers ask of the places that were painted: to be compared with what a look shows there.

    asked_of(answers, painted, scene) -> list[Asked]     one for each answer that changes something
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from usdslf.edits.edits import Reflectance
from usdslf.edits.read_back import Asked
from usdslf.inference.answers import Answer, Painted
from usdslf.scene.records import Scene

PLACES = 256  # that are looked at where the changed material is not the painted one


def asked_of(answers: Sequence[Answer], painted: Sequence[Painted], scene: Scene) -> list[Asked]:
    """Returns what each answer asks: at the painted samples of its material, else anywhere on that.

    Args:
        painted: the strokes with their samples, numbered as by the pools of the answers.
        scene: the shot.
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
    return out
