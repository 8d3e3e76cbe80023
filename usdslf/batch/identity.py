"""Identity: names of what an answer stands on, part by part, so that a later run can say why it is another one.

    identity_of(shot, strokes, options) -> {light, surface, asset, strokes, options: name or {path: name}}

Light are lights and surroundings, surface the materials with their textures, asset the shapes and what they show.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

import usdslf
from usdslf.scene.fingerprint import digest
from usdslf.shot import Shot
from usdslf.shot_cache import contents
from usdslf.strokes.stroke import Stroke


def identity_of(shot: Shot, strokes: Sequence[Stroke], options: Mapping[str, Any]) -> dict[str, Any]:
    """Returns names of all that an answer stands on, equal where that is equal."""
    scene = shot.scene

    def name(value: Any) -> str:
        return digest(value, contents)[:16]

    shapes = {}
    for mesh in scene.meshes:
        shows = [scene.materials[int(i)].path for i in np.unique(mesh.material_of_triangle)]
        of = (mesh.positions, mesh.triangles, mesh.corner_normals, mesh.uvs, mesh.primvars, mesh.double_sided, shows)
        shapes[mesh.path] = name(of)
    return {
        "light": {x.path or "the default light": name(x) for x in shot.lights},
        "surface": {m.path or "no material": name(m) for m in scene.materials},
        "asset": shapes,
        "strokes": {s.path: name(s) for s in strokes},
        "options": name(dict(options)),
        "version": usdslf.__version__,
    }
