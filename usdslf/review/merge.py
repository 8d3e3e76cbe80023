"""Merge: the strokes of several artists on one shot, solved together, and where they contradict each other.

    merge_strokes(shot, layers, settings) -> Merged        nothing is written
    write_merged(path, merged, shot) -> None               the strokes of all, as one layer

Each artist's strokes are solved alone and all of them together.  Two answers for one material contradict each other
where they change different parameters, or give one parameter values further apart than TOLERANCE.
"""

from __future__ import annotations

import os
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from usdslf.errors import InputError, SolveError
from usdslf.inference.alternatives import as_plain
from usdslf.inference.answers import Answer
from usdslf.shot import Shot
from usdslf.solution import Settings, Solution, find_solution
from usdslf.strokes.stroke import Stroke
from usdslf.usd.border import in_words
from usdslf.usd.stroke_layer import read_strokes, write_strokes

PathLike = str | os.PathLike[str]
TOLERANCE = {"diffuse": 0.05, "specular": 0.05, "roughness": 0.07}  # two answers may differ by


@dataclass(frozen=True)
class Said:
    """What some strokes ask of a material.

    Attributes:
        layer: the stroke layer's file; "" for all of them together.
        strokes: names, as they are in the merged layer.
        inferred: parameters that change, joined by "+".
        after: means of diffuse, specular and roughness.
        residual: relative error of what these strokes painted, with that answer.
    """

    layer: str
    strokes: tuple[str, ...]
    inferred: str
    after: Mapping[str, Any]
    residual: float

    def as_values(self) -> dict[str, Any]:
        """As JSON holds it."""
        return dict(vars(self)) | {"strokes": list(self.strokes), "after": dict(self.after)}

    def in_words(self) -> str:
        """A line."""
        changed = ", ".join(f"{k} {in_words(v)}" for k, v in self.after.items())
        who = Path(self.layer).name if self.layer else "together"
        return f"{who}: {self.inferred}: {changed}; residual {self.residual:.3f}"


@dataclass(frozen=True)
class Conflict:
    """A material that artists want otherwise.

    Attributes:
        material: its path.
        why: in words.
        said: the answer of each, then that of all together.
    """

    material: str
    why: str
    said: tuple[Said, ...]

    def as_values(self) -> dict[str, Any]:
        """As JSON holds it."""
        return {"material": self.material, "why": self.why, "said": [s.as_values() for s in self.said]}


@dataclass(frozen=True, eq=False)
class Merged:
    """The strokes of several layers as one.

    Attributes:
        strokes: in the order of the layers, with names that nobody else has.
        renamed: by layer and old name the new one.
        conflicts: materials that they contradict each other about.
        together: what all of them ask.
        warnings: sentences.
    """

    strokes: tuple[Stroke, ...]
    renamed: Mapping[str, str]
    conflicts: tuple[Conflict, ...]
    together: Solution
    warnings: tuple[str, ...] = ()

    def as_values(self) -> dict[str, Any]:
        """As JSON holds it."""
        return {
            "strokes": [s.path for s in self.strokes],
            "renamed": dict(self.renamed),
            "conflicts": [c.as_values() for c in self.conflicts],
            "warnings": list(self.warnings),
        }


def merge_strokes(shot: Shot, layers: Sequence[PathLike], settings: Settings | None = None) -> Merged:
    """Puts the strokes of several layers together, solves them alone and together, and names contradictions.

    Args:
        layers: files; two or more.

    Raises: StrokeError for a layer, SolveError where nothing can be solved.
    """
    if len(layers) < 2:
        raise InputError("one stroke layer is nothing to merge; name two or more")
    said: list[str] = []
    strokes, renamed, of = _named_apart([(os.fspath(p), read_strokes(p, said)) for p in layers])
    together = find_solution(shot, strokes, settings)
    alone: list[tuple[str, Solution]] = []
    for layer in [os.fspath(p) for p in layers]:
        mine = [s for s in strokes if of[s.name] == layer and s.active]
        try:
            alone.append((layer, find_solution(shot, mine, settings)))
        except SolveError as error:
            said.append(f"{layer}: {error}")
    conflicts = tuple(_conflicts(shot, alone, together))
    return Merged(tuple(strokes), renamed, conflicts, together, tuple(dict.fromkeys([*said, *together.warnings])))


def write_merged(path: PathLike, merged: Merged, shot: Shot) -> None:
    """Writes the strokes as one layer.

    Raises: AuthorError where it cannot be written.
    """
    write_strokes(path, merged.strokes, shot.source)


def _named_apart(
    layers: Sequence[tuple[str, list[Stroke]]],
) -> tuple[list[Stroke], dict[str, str], dict[str, str]]:
    """The strokes of layers under names of their own: new names by layer and old one, and the layer of each name."""
    found: list[Stroke] = []
    renamed: dict[str, str] = {}
    of: dict[str, str] = {}
    for layer, strokes in layers:
        stem = re.sub(r"\W+", "_", Path(layer).stem, flags=re.ASCII).strip("_") or "strokes"
        for stroke in strokes:
            name = stroke.name
            if name in of:
                base, number = f"{stem}_{name}", 2
                name = base if not base[0].isdigit() else f"_{base}"
                while name in of:
                    name, number = f"{base}_{number}", number + 1
                renamed[f"{layer}:{stroke.name}"] = name
            of[name] = layer
            found.append(replace(stroke, name=name, prim=f"/SlfStrokes/{name}"))
    return found, renamed, of


def _conflicts(shot: Shot, alone: Sequence[tuple[str, Solution]], together: Solution) -> list[Conflict]:
    answers: dict[tuple[int, tuple[str, ...]], list[tuple[str, Solution, Answer]]] = {}
    for layer, solution in alone:
        for a in solution.answers:
            if not a.pool.is_held:
                answers.setdefault((a.pool.material, a.pool.targets), []).append((layer, solution, a))
    joint = {(a.pool.material, a.pool.targets): a for a in together.answers}
    found = []
    for key, each in answers.items():
        why = _why_contrary([a for _, _, a in each])
        if why:
            said = [_said(layer, solution, a) for layer, solution, a in each]
            said += [_said("", together, joint[key])] if key in joint else []
            found.append(Conflict(shot.scene.materials[key[0]].path, why, tuple(said)))
    return found


def _why_contrary(answers: Sequence[Answer]) -> str:
    """Why answers contradict each other, "" where they do not."""
    for i, a in enumerate(answers):
        for b in answers[i + 1 :]:
            apart = [
                name
                for name, tolerance in TOLERANCE.items()
                if float(np.abs(np.asarray(a.after[name]) - np.asarray(b.after[name])).max()) > tolerance
            ]
            if apart and a.chosen.id != b.chosen.id:
                return f"one asks for {a.chosen.id}, another for {b.chosen.id}"
            if apart:
                return f"they ask for different values of {' and '.join(apart)}"
    return ""


def _said(layer: str, solution: Solution, a: Answer) -> Said:
    names = tuple(solution.strokes[i].name for i in a.pool.strokes)
    return Said(layer, names, a.chosen.id, as_plain(a.after), a.residual_after)
