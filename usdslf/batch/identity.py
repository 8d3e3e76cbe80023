"""Identity: names of what an answer stands on, part by part, so that a later run can say why it is another one.

    identity_of(shot, strokes, options) -> {light, surface, asset, strokes, options: name or {path: name}}
    what_changed(before, after) -> Changed      of two results of one job

Light are lights and surroundings, surface the materials with their textures, asset the shapes and what they show.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

import usdslf
from usdslf.batch.job import Result
from usdslf.scene.fingerprint import digest
from usdslf.shot import Shot
from usdslf.shot_cache import contents
from usdslf.strokes.stroke import Stroke
from usdslf.usd.border import in_words

CAUSES = ("light", "surface", "asset")
SAME = 2e-3  # difference of a value that is none
MOST = 3  # paths that a sentence names


@dataclass(frozen=True)
class Changed:
    """What became another one between two results of a job.

    Attributes:
        why: sentences: which lights, surfaces, shapes, strokes or options changed.
        answers: sentences: which answers are others, and how.
    """

    why: tuple[str, ...]
    answers: tuple[str, ...]

    def as_values(self) -> dict[str, list[str]]:
        """Returns it as JSON-ready values."""
        return {"why": list(self.why), "answers": list(self.answers)}


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


def what_changed(before: Result, after: Result) -> Changed:
    """Returns what changed in the answers of a job, and why.

    Args:
        before, after: results of the job, an earlier and a later one.
    """
    was, now = before.values.get("identity", {}), after.values.get("identity", {})
    why = []
    for cause in (*CAUSES, "strokes"):
        a, b = was.get(cause, {}), now.get(cause, {})
        for words, paths in (
            ("changed", [p for p in b if p in a and a[p] != b[p]]),
            ("is new", [p for p in b if p not in a]),
            ("is gone", [p for p in a if p not in b]),
        ):
            if paths:
                more = f" and {len(paths) - MOST} more" if len(paths) > MOST else ""
                why.append(f"{cause}: {', '.join(paths[:MOST])}{more} {words}")
    why += [f"{k} changed" for k in ("options", "version") if was.get(k) != now.get(k)]
    earlier = {s["path"]: s for s in before.values.get("strokes", ())}
    answers = []
    for stroke in after.values.get("strokes", ()):
        answers += _of_stroke(earlier.get(stroke["path"]), stroke)
    return Changed(tuple(why), tuple(answers))


def _of_stroke(before: Mapping[str, Any] | None, after: Mapping[str, Any]) -> list[str]:
    """What changed in the answer of a stroke, in sentences."""
    path = after["path"]
    if before is None:
        return [f"{path}: {after['inferred']}, was not asked before"]
    found = []
    if before["inferred"] != after["inferred"] or before["material"] != after["material"]:
        of = f" of {after['material']}" if before["material"] != after["material"] else ""
        found.append(f"{path}: {before['inferred']} became {after['inferred']}{of}")
    for key in after["after"]:
        a, b = (np.atleast_1d(np.asarray(s["after"].get(key, np.nan), float)) for s in (before, after))
        if a.shape != b.shape or not (np.abs(a - b) <= SAME).all():
            found.append(f"{path}: {key} {in_words(before['after'].get(key))} became {in_words(after['after'][key])}")
    was, now = float(before["residual_after"]), float(after["residual_after"])
    if abs(was - now) > max(0.02, 0.25 * was):
        found.append(f"{path}: residual {was:.3f} became {now:.3f}")
    return found
