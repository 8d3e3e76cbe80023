"""Accepting: what is accepted of a look, also where one of several strokes that were answered together is not.

    accept(shot, look, out, wish, options) -> Accepted      writes `out`; look, strokes and shot stay as they are

What several strokes ask of a material is one answer: no part of the layer is one stroke's alone.  To reject one of them
is to ask what the others say without it.  So all strokes are solved again without those, in the shot's light, and the
wish is carried out on what comes of that.  It is solved as the look says that it was (usdslf/provenance.py): norm,
weights, mode and the light's quality are those of then.  Explanations of all other strokes stay those that were
reviewed, their values follow the light; what was added by hand, silenced or held as an alternative stays too.
"""

from __future__ import annotations

import os
import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from usdslf.errors import InputError
from usdslf.look import author
from usdslf.progress import step
from usdslf.provenance import solved_with
from usdslf.shot import Shot
from usdslf.solution import Settings, Solution, find_solution
from usdslf.strokes.stroke import Stroke, frame_of
from usdslf.usd.review.accept import Accepted, Again, Wish, accept_look, shared_strokes
from usdslf.usd.review.kept import Kept, copy_look, kept_of
from usdslf.usd.review.review import over_its_shot, strokes_of_look
from usdslf.usd.review.toggle import toggle

PathLike = str | os.PathLike[str]


def accept(
    shot: PathLike, look: PathLike, out: PathLike, wish: Wish | None = None, options: Mapping[str, Any] | None = None
) -> Accepted:
    """Writes what is accepted of a look as a look of its own; solves where a layer alone cannot say it.

    Args:
        shot: with or without the look.
        out: another file than the look.
        wish: None: all is accepted.
        options: of `Shot.open`, for a solve, in place of those that the look was solved with; `frame` None: as it was.

    Returns: as of `accept_look`; a warning names what was solved again.

    Raises: as `accept_look`; InputError where the strokes are gone, SolveError where the rest cannot be solved.
    """
    wish = wish or Wish()
    shared = shared_strokes(shot, look, wish)
    if not shared:
        return accept_look(shot, look, out, wish)
    without = tuple(x.stroke for x in shared)
    kept, strokes = kept_of(look), _left(look, without)
    said = [f"solved again without {x.in_words()}: review {os.fspath(out)}" for x in shared]
    _, below = over_its_shot(shot, look)
    how = solved_with(kept.settings, [s.name for s in strokes])
    said += how.warnings
    asked = {**how.quality, **(options or {})}
    frame = asked.pop("frame", None)
    here = Shot.open(below, frame_of(strokes, kept.frame if frame is None else frame, said), **asked)
    solution = _solved(here, strokes, kept, how.settings, said)
    with tempfile.TemporaryDirectory(prefix="usdslf_accept_") as folder:
        solved = Path(folder, Path(look).name)
        copy_look(look, solved)
        authored = author(here, solution, solved, kept.strokes, None, how.mode, kept.alternatives)
        there = {f"{e.prim}.{e.attribute}" for e in authored.edits}
        if silent := [name for name in kept.silent if name in there]:
            toggle(solved, silent, on=False)
        done = accept_look(shot, solved, out, replace(wish, again=Again(os.fspath(look), without)))
    warnings = (*said, *solution.warnings, *authored.warnings, *done.warnings)
    return replace(done, warnings=tuple(dict.fromkeys(warnings)))


def _left(look: PathLike, without: Sequence[str]) -> list[Stroke]:
    """The active strokes of a look but for some."""
    strokes = [s for s in strokes_of_look(look) if s.active]
    missing = [path for path in without if path not in {s.path for s in strokes}]
    if missing:
        raise InputError(
            f"{missing[0]} is not in the stroke layer of {look} any more, so that the others cannot be solved without "
            "it: solve again, or reject the material"
        )
    return [s for s in strokes if s.path not in without]


def _solved(shot: Shot, strokes: Sequence[Stroke], kept: Kept, settings: Settings, said: list[str]) -> Solution:
    """Solves strokes; those that nobody left keep the explanation that was reviewed, others what was once chosen."""
    with step("solve"):
        found = find_solution(shot, strokes, replace(settings, choose={}))
    other: dict[str, str] = {}
    for answer in found.answers:
        mine = [found.strokes[i] for i in answer.pool.strokes]
        chosen = next((settings.choose[s.name] for s in mine if s.name in settings.choose), "")
        wanted = kept.inferred.get(frozenset(s.path for s in mine), chosen)
        if wanted in ("", answer.chosen.id):
            continue
        if wanted in {c.id for c in answer.candidates}:
            other |= dict.fromkeys((s.name for s in mine), wanted)
        else:
            names = ", ".join(s.path for s in mine)
            said.append(f"{names}: {wanted}, as it was, explains nothing any more: {answer.chosen.id} is taken")
    return find_solution(shot, strokes, replace(settings, choose=other)) if other else found
