"""Elsewhere: how much of the wanted change each explanation shows in other light.

    score_elsewhere(shot, solution, places) -> list[Scored]      HDRIs in place of the lights, or other shots
    prefer_what_holds(solution, scored, choose) -> {stroke: id}  at near ties

With the wanted relative change w of the painted dabs at home, and the change e that an explanation gives them there,
both relative to what is seen before, it shows

    share = sum w e / sum w w

1 where it changes the painted places there as it was wanted here, 0 where nothing is seen of it.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from usdslf.errors import InputError, UsdslfError
from usdslf.inference.answers import TIED_COST, Answer, Painted
from usdslf.inference.bilinear import Tables, pool_tables
from usdslf.inference.candidate import Candidate
from usdslf.inference.direct import gather_stroke
from usdslf.inference.residuals import relative_scale
from usdslf.lights.defaults import dome_of_picture
from usdslf.replacing import is_file
from usdslf.scene.records import F64
from usdslf.shot import Shot
from usdslf.solution import Solution
from usdslf.strokes.stroke import Stroke

PICTURES = (".hdr", ".exr", ".png", ".jpg", ".jpeg", ".tif", ".tiff")
BETTER = 0.15  # share by which an explanation has to hold better, to be taken in place of a cheaper one


@dataclass(frozen=True)
class Scored:
    """What the explanations of a stroke show in another place.

    Attributes:
        place: file name of the other light or shot, with as many folders as tell it apart from the others.
        strokes: names of those that were asked together.
        chosen: id of the explanation that is taken.
        shares: id of each explanation that costs about as little -> how much of the wanted change it shows there.
        why_not: why it could not be scored there; "" where it was.
    """

    place: str
    strokes: tuple[str, ...]
    chosen: str
    shares: Mapping[str, float]
    why_not: str = ""

    def as_values(self) -> dict[str, Any]:
        """Returns it as JSON-ready values."""
        return {**vars(self), "strokes": list(self.strokes), "shares": {k: round(v, 4) for k, v in self.shares.items()}}


def score_elsewhere(shot: Shot, solution: Solution, places: Sequence[str]) -> list[Scored]:
    """Scores the direct answers of a solution, and what costs about as little, in other light.

    Args:
        shot: that the solution is of.
        solution: of `usdslf.solve`.
        places: pictures of surroundings, or stages that show what was painted.

    Returns: what each answer shows in each place.

    Raises: InputError for a place that is neither.
    """
    found = []
    names = _told_apart([*places, shot.path])
    for place in places:
        name = names[place]
        if not is_file(place):
            raise InputError(f"there is no {place} to score in; mend `elsewhere` of the manifest")
        try:
            there = _there(shot, place)
            for answer in _asked(solution):
                strokes = [solution.strokes[i] for i in answer.pool.strokes]
                shares = _shares(shot, there, answer, [solution.painted[i] for i in answer.pool.strokes])
                found.append(Scored(name, tuple(s.name for s in strokes), answer.chosen.id, shares))
        except UsdslfError as error:
            found.append(Scored(name, tuple(s.name for s in solution.strokes), "", {}, str(error)))
    return found


def _told_apart(paths: Sequence[str]) -> dict[str, str]:
    """By path its last parts, as many as no other path has."""
    parts = {path: Path(path).resolve().parts for path in paths}
    found = {}
    for path, own in parts.items():
        others = [p for p in parts.values() if p != own]
        count = next((n for n in range(1, len(own)) if all(p[-n:] != own[-n:] for p in others)), len(own))
        found[path] = "/".join(own[-count:])
    return found


def prefer_what_holds(solution: Solution, scored: Sequence[Scored], choose: Mapping[str, str]) -> dict[str, str]:
    """Returns the explanations to take in place of cheaper ones, by stroke, as they hold better where they hold least.

    Args:
        scored: of `score_elsewhere`.
        choose: what the artist chose, which stays.
    """
    better: dict[str, str] = {}
    for answer in _asked(solution):
        names = tuple(solution.strokes[i].name for i in answer.pool.strokes)
        of = [s.shares for s in scored if s.strokes == names and s.shares]
        if not of or any(name in choose for name in names):
            continue
        least = {c: min(min(max(s[c], 0.0), 1.0) for s in of) for c in of[0] if all(c in s for s in of)}
        best = max(least, key=lambda c: least[c])
        if best != answer.chosen.id and least[best] > least.get(answer.chosen.id, 0.0) + BETTER:
            better |= dict.fromkeys(names, best)
    return better


def _asked(solution: Solution) -> Iterator[Answer]:
    """The answers that are scored: direct, of one value."""
    for a in solution.answers:
        if a.chosen.freed and not a.others and not a.varying and not a.pool.is_held:
            yield a


def _there(shot: Shot, place: str) -> Shot:
    """The shot in the light of a picture, or the other shot."""
    if Path(place).suffix.lower() in PICTURES:
        return shot.relit((dome_of_picture(place, shot.scene),))
    return Shot.open(
        place, shot.frame, shot.device, shot.ocio, shot.made is not None, elements=shot.element_count,
        bounces=shot.bounces, refine=shot.refine, model=shot.model, missing_dome=shot.missing_dome,
        memory=shot.memory,
    )  # fmt: skip


def _shares(shot: Shot, there: Shot, answer: Answer, painted: list[Painted]) -> dict[str, float]:
    """How much of the wanted change each near explanation shows in another shot, by id."""
    path = shot.scene.materials[answer.pool.material].path
    material = next((i for i, m in enumerate(there.scene.materials) if m.path == path), -1)
    if material < 0:
        raise InputError(f"{there.path} does not show {path}; score in shots of the same asset")
    is_relit = there.source is shot.source
    moved = [gather_stroke(_seen_there(p.stroke, there, is_relit), there.scene, there.pictured, []) for p in painted]
    here, now = (_pooled(s, p, m) for s, p, m in ((shot, painted, answer.pool.material), (there, moved, material)))
    _, rows, rows_there = np.intersect1d(here[1], now[1], return_indices=True)
    if not len(rows):
        raise InputError(f"{there.path} does not show the painted places of {path}")
    near = [c for c in answer.candidates if c.is_admitted and c.freed and abs(c.cost - answer.chosen.cost) < TIED_COST]
    near = [answer.chosen, *(c for c in near if c.id != answer.chosen.id)]
    t, t_there = here[0], now[0]
    wanted = ((t.target - t.before) / relative_scale(t.before))[rows]
    size = float((wanted * wanted).sum())
    scale = relative_scale(t_there.before)
    shown = {c.id: ((_radiance(t_there, c) - t_there.before) / scale)[rows_there] for c in near}
    return {name: float((wanted * e).sum() / max(size, 1e-12)) for name, e in shown.items()}


def _seen_there(stroke: Stroke, there: Shot, is_relit: bool) -> Stroke:
    """The stroke as its own eye sees it in other light, and the camera of another shot in that."""
    if is_relit:
        return stroke
    eye = np.asarray(there.camera().world_from_camera, np.float64)[:3, 3].astype(np.float32)
    return replace(stroke.seen_from(there.scene.origin), eye=np.broadcast_to(eye, stroke.eye.shape).copy())


def _pooled(shot: Shot, painted: list[Painted], material: int) -> tuple[Tables, F64]:
    """The tables of a material, and which dab (n,) of the strokes each row is."""
    field = shot.light_field
    evidence = [p.evidence(field) for p in painted]
    rows = [i * 1e7 + p.rows[e.material == material] for i, (p, e) in enumerate(zip(painted, evidence, strict=True))]
    if not any(len(r) for r in rows):
        raise InputError(f"{shot.path} does not show the painted places")
    return pool_tables(evidence, material, shot.model), np.concatenate(rows)


def _radiance(t: Tables, c: Candidate) -> F64:
    """What a candidate gives the dabs (n, 3), between the levels of roughness of these tables."""
    if "glossiness" not in c.freed:
        return replace(c, level=t.own).radiance(t)
    wanted = float(c.roughness_of(np.array([t.roughness]))[0])
    levels = t.levels[: t.own]
    order = np.argsort(levels)
    at = int(np.clip(np.searchsorted(levels[order], wanted), 1, len(order) - 1))
    low, high = order[at - 1], order[at]
    share = float(np.clip((wanted - levels[low]) / max(levels[high] - levels[low], 1e-9), 0, 1))
    ends = (replace(c, level=int(k)).radiance(t) for k in (low, high))
    return next(ends) * (1 - share) + next(ends) * share
