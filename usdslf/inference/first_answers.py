"""First answers: what each pool of strokes asks for in the light as it is, before any change goes round.

    first_answers(pools, evidence, painted, ask) -> answers, strokes; what was painted too bright asks for less

An answer is the cheapest candidate or the one that was chosen, varies where the strokes ask for it and it can be
stored, is none where no change explains what was painted, and goes on to what is similar where a stroke says so.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from dataclasses import field as dataclass_field
from functools import partial

import numpy as np
from numpy.typing import NDArray

from usdslf.edits.storage import storage_of
from usdslf.edits.whole_set import colored_specular
from usdslf.errors import StrokeError
from usdslf.inference.answers import Answer, Painted, Pool, means_of, scope_rows
from usdslf.inference.attainable import dimming, error_of, explains_nothing, seems_too_bright
from usdslf.inference.bilinear import Tables, pool_tables
from usdslf.inference.candidate import Candidate
from usdslf.inference.evidence import Evidence
from usdslf.inference.fit import Problem
from usdslf.inference.gathered import Found, Gathered, name_of
from usdslf.inference.if_chosen import IfChosen
from usdslf.inference.pools import fixed_materials, pool_paths
from usdslf.inference.refits import is_painted, refit_answer
from usdslf.inference.solve import enumerate_candidates, relative_error
from usdslf.inference.tools import expected_error
from usdslf.inference.unchanged import by_own_errors, may_be_unchanged
from usdslf.inference.varying import (
    BestConstant,
    VaryingAnswer,
    as_varying,
    asks_to_vary,
    places_of_dabs,
    varying_answers,
)
from usdslf.inference.weights import Options
from usdslf.light_field.importance import seen_from
from usdslf.light_field.light_field import LightField
from usdslf.light_field.renewal import renew
from usdslf.scene.records import Scene
from usdslf.similarity.materials import ALL, MOST, OF_MATERIALS, alike_materials
from usdslf.similarity.similarity import Weights, reach_of
from usdslf.strokes.remarks import About, Remark

UNSEEN = 2e-3  # of the light that surfaces send to strokes, that rounds may leave out


@dataclass(frozen=True)
class Asking:
    """What all strokes of a solve are asked under."""

    scene: Scene
    field: LightField  # of the shot as it is, where strokes have names
    options: Options = dataclass_field(default_factory=Options)
    choose: Mapping[str, str] = dataclass_field(default_factory=dict)  # stroke name -> id of the alternative to take
    bounces: int = 6  # most of a round
    similarity: Weights | None = None  # of what strokes of scope `similar` change beside the painted material
    said: list[str] = dataclass_field(default_factory=list)  # takes sentences
    left_out: list[float] = dataclass_field(default_factory=list)  # takes of each round the light that it left out
    kept: Gathered = dataclass_field(default_factory=Gathered)  # what was found before for strokes that have names
    follows_light: bool = True  # False: all is asked in the light as it is, and not what others would give
    light: LightField | None = None  # as `field` is at first, and stays; None: alternatives are found at once

    def evidence(self, painted: Painted) -> Evidence:
        """Returns the evidence of a stroke in the light as it is."""
        if not painted.name:
            return painted.evidence(self.field)
        return self.kept.once(f"evidence {painted.name}", lambda _: painted.evidence(self.field), self.said)

    def matters(self, painted: list[Painted]) -> NDArray[np.float64]:
        """Returns how much elements (N,) do to what strokes see."""
        names, met = [p.name for p in painted], lambda p: p.samples.met(self.field)
        of = lambda p: self.kept.once(f"met {p.name}", lambda _: met(p), []) if p.name else met(p)  # noqa: E731
        find = lambda _: seen_from(self.field, np.sum([of(p) for p in painted], axis=0))  # noqa: E731
        return self.kept.once(name_of("seen", names), find, []) if all(names) else find([])

    def settle(self, field: LightField, painted: list[Painted]) -> None:
        """Lets light follow a change as far as strokes see it."""
        found = renew(field, self.bounces, UNSEEN, self.matters(painted))
        if field is self.field:
            self.left_out.append(found.left)

    def of_pool(
        self, what: str, pool: Pool, painted: list[Painted], find: Callable[[Asking], Found], *more: object
    ) -> Found:
        """Returns what is found once for the strokes of a pool, under its options.

        Args:
            find: is given this asking, its sentences apart.
            more: that it depends on.
        """
        mine = [painted[i] for i in pool.strokes]
        if not all(p.name for p in mine):
            return find(self)
        asked = (pool.material, pool.scope, pool.targets, pool.is_held, vars(self.options))
        chosen = [self.choose.get(p.stroke.name, "") for p in mine]
        name = name_of(what, [p.name for p in mine], asked, chosen, *more)
        return self.kept.once(name, lambda said: find(replace(self, said=said)), self.said)


def first_answers(
    pools: list[Pool], evidence: list[Evidence], painted: list[Painted], ask: Asking
) -> tuple[list[Answer], list[Painted]]:
    """Returns the answer of each pool, and the strokes: what was painted too bright asks for what is possible.

    The light field is left as it was.

    Raises: StrokeError for an alternative that is none.
    """
    answers = [_first_answer(p, evidence, painted, ask) for p in pools]
    factors = _out_of_reach(answers, painted, ask)
    if factors:
        painted = [
            replace(p, wanted=factors[i] * e.target, name=p.name and name_of(p.name, factors[i])) if i in factors else p
            for i, (p, e) in enumerate(zip(painted, evidence, strict=True))
        ]
        evidence = [ask.evidence(p) for p in painted]
        answers = [_first_answer(p, evidence, painted, ask) for p in pools]
    answers = [_weighed(a, evidence, painted, ask) for a in answers]
    for i, a in enumerate(answers):  # what one change goes on to is taken for those that follow
        answers[i] = _with_alike(a, answers, evidence, painted, ask)
    return answers, painted


def _first_answer(pool: Pool, evidence: list[Evidence], painted: list[Painted], ask: Asking) -> Answer:
    """The best or chosen answer of a pool in the light as it is, found once."""
    find = lambda own: _found_answer(pool, evidence, painted, own)  # noqa: E731
    return replace(ask.of_pool("first answer", pool, painted, find), pool=pool)


def _weighed(answer: Answer, evidence: list[Evidence], painted: list[Painted], ask: Asking) -> Answer:
    """The first answer or none, with what the others would give, found once."""
    if not ask.follows_light:
        return _or_nothing(answer, painted, ask)

    def find(own: Asking) -> Answer:
        a = _or_nothing(answer, painted, own)
        if a.pool.is_held:
            return a
        found = IfChosen.of(a, evidence, painted, own.light or own.field, own.options)
        return replace(a, if_chosen=found if own.light else dict(found))

    return replace(ask.of_pool("weighed answer", answer.pool, painted, find), pool=answer.pool)


def _found_answer(pool: Pool, evidence: list[Evidence], painted: list[Painted], ask: Asking) -> Answer:
    mine = [evidence[i] for i in pool.strokes]
    tables = pool_tables(mine, pool.material, ask.field.model)
    tables = replace(tables, colored=colored_specular(ask.scene.materials[pool.material]))
    norms = {e.stroke.norm for e in mine} - {"mixed"}
    options = replace(ask.options, norm=norms.pop()) if len(norms) == 1 else ask.options
    options = replace(options, dab_error=max(options.dab_error, expected_error([e.stroke for e in mine])))
    candidates = enumerate_candidates(tables, options)
    is_copied = options.norm != "l2" and options.factors is None and is_painted(mine) and may_be_unchanged(tables)
    if is_copied:
        candidates = by_own_errors(tables, options, candidates)
    if pool.is_held:
        candidates = [c for c in candidates if not c.freed]
    wanted = [ask.choose.get(e.stroke.name) or e.stroke.choice for e in mine]
    wanted = [w for w in wanted if w and not pool.is_held]
    best_constant = BestConstant(tables, options, candidates[0])
    varied: list[VaryingAnswer] = []
    if not (pool.is_held or is_copied) and options.norm == "mixed":
        constant = None if wanted else best_constant
        varied = _storable(pool, tables, options, constant, mine, ask)
    chosen, varying = candidates[0], None
    if wanted:
        found = next((c for c in candidates if c.id == wanted[0]), None)
        other = next((a for a in varied if a.id == wanted[0]), None)
        if found is None and other is None:
            known = ", ".join([*(c.id for c in candidates), *(a.id for a in varied)])
            raise StrokeError(f"{mine[0].stroke.path}: there is no alternative '{wanted[0]}'; choose one of {known}")
        chosen, varying = (other.mean, other.varying) if found is None and other else (found or chosen, None)
    else:
        best = next((a for a in varied if asks_to_vary(a, best_constant)), None)
        chosen, varying = (best.mean, best.varying) if best else (chosen, None)
    none = next((c for c in candidates if c.id == "none"), Candidate(()))
    before = relative_error(tables, replace(none, level=tables.own))
    start = Answer(
        pool, chosen, tuple(candidates), tables, {}, {}, before, before, (),
        varying is None and seems_too_bright(tables, candidates), varied=tuple(varied), varying=varying,
    )  # fmt: skip
    return refit_answer(start, evidence, painted, ask.field, ask.options)


def _storable(
    pool: Pool, tables: Tables, options: Options, constant: BestConstant | None, mine: list[Evidence], ask: Asking,
) -> list[VaryingAnswer]:  # fmt: skip
    """The best answer of each parameter that varies and can be stored; says what is asked for and cannot be.

    Args:
        constant: the best constant answer; None where the artist has chosen.
    """
    brush = float(np.mean([e.stroke.widths.mean() for e in mine]))
    places = places_of_dabs(mine, pool.material)
    found: dict[str, VaryingAnswer] = {}
    why: dict[str, None] = {}
    refused: set[tuple[str, bool]] = set()
    for a in varying_answers(Problem.of(tables, options), places, brush, pool.scope == "stroke"):
        kind = (a.id, a.varying.is_grey)
        if a.id in found or kind in refused:
            continue
        storage = storage_of(ask.scene, pool.material, pool.targets, a.varying)
        why_not = storage.why_not
        if not why_not:
            found[a.id] = a
            continue
        if not storage.is_too_coarse:  # a smoother change could be stored no better
            refused.add(kind)
        if constant is not None and asks_to_vary(a, constant):
            why[f"a {a.id}: {why_not}"] = None
    if why and not (constant and any(asks_to_vary(a, constant) for a in found.values())):
        ask.said.append(
            f"{', '.join(e.stroke.path for e in mine)}: the strokes ask for a change that varies over "
            f"{ask.scene.materials[pool.material].path}, which cannot be stored ({'; '.join(why)}); it is constant"
        )
    return list(found.values())


def _out_of_reach(answers: list[Answer], painted: list[Painted], ask: Asking) -> dict[int, float]:
    """Factors of the strokes that are too bright even for a white surface and the light that it sends round; said."""
    factors = dict[int, float]()
    for a in answers:
        if a.pool.is_held or not a.is_too_bright:
            continue
        factor = ask.of_pool("dimming", a.pool, painted, partial(_dimming, a, painted), ask.bounces)
        if factor == 1:
            continue
        factors |= dict.fromkeys(a.pool.strokes, factor)
        what = (
            f"painted {1 / factor:.1f} times brighter than the surface can be in this light; its hue is "
            "kept and its brightness lowered to that"
        )
        ask.said.append(Remark(pool_paths(painted, a.pool), what, About.PAINT))
    return factors


def _dimming(answer: Answer, painted: list[Painted], ask: Asking) -> float:
    """The factor that brings the paint of a pool within reach of a white surface, in the light that it sends round."""
    start = ask.field.surface
    rows = scope_rows(answer.pool, ask.field, ask.scene, painted)
    one = np.ones(1, np.float32)
    white = {"f0": one, "f90": one} if answer.tables.is_metal else {"diffuse": one}
    field = ask.field.with_surface(start.with_rows(rows, **white))
    ask.settle(field, [painted[i] for i in answer.pool.strokes])
    mine = [painted[i].evidence(field, is_weighed=False) for i in answer.pool.strokes]
    return dimming(pool_tables(mine, answer.pool.material, field.model))


def _or_nothing(answer: Answer, painted: list[Painted], ask: Asking) -> Answer:
    """The answer, unless its change explains next to nothing and nobody chose it: then none."""
    c, t = answer.chosen, answer.tables
    strokes = [painted[i].stroke for i in answer.pool.strokes]
    if not c.freed or answer.varying or any(ask.choose.get(s.name) or s.choice for s in strokes):
        return answer
    none = replace(next((x for x in answer.candidates if x.id == "none"), Candidate(())), level=t.own)
    before, after = error_of(t, none), error_of(t, c)
    if not explains_nothing(before, after):
        return answer
    what = (
        f"no change of the material comes near what was painted (the best leaves {after / before:.0%} of the "
        "difference); nothing is changed"
    )
    ask.said.append(Remark(pool_paths(painted, answer.pool), what, About.PAINT))
    before_, after_ = means_of(t, none)
    return replace(answer, chosen=none, before=before_, after=after_)


def _with_alike(
    answer: Answer, answers: list[Answer], evidence: list[Evidence], painted: list[Painted], ask: Asking
) -> Answer:
    """The answer with the materials that change too, wholly or in part, where one of its strokes says `similar`."""
    pool, scene = answer.pool, ask.scene
    if not any(painted[i].stroke.scope == "similar" for i in pool.strokes) or not answer.chosen.freed:
        return answer
    taken = [a.pool for a in answers if a.pool != pool]
    leave = {pool.material, *(p.material for p in taken), *(m for p in taken for m in (*p.similar, *p.similar_in_part))}
    leave |= set(fixed_materials(evidence))
    mine = [evidence[i] for i in pool.strokes]  # all dabs that the change is known at, whatever their scope
    places = places_of_dabs(mine, pool.material)
    brush = float(np.mean([e.stroke.widths.mean() for e in mine]))
    reach = reach_of(places.position, 0.5 * brush)
    shares = alike_materials(scene, ask.field.elements, places, reach, leave, ask.similarity)
    onto_similar = as_varying(answer.chosen, answer.varying, places, reach, ask.similarity or OF_MATERIALS)
    whole, partly = [m for m, share in shares.items() if share > MOST], []
    for m in (m for m, share in shares.items() if share <= ALL):
        why = storage_of(scene, m, (), onto_similar).why_not if onto_similar else "its change has several parameters"
        if not why:
            partly.append(m)
        part = f"all or nothing of it changes: {why}" if why else "that part of it changes"
        what = f"{shares[m]:.0%} of {scene.materials[m].path} is similar; {part}"
        ask.said.append(Remark(pool_paths(painted, pool), what, About.PLACE))
    whole = [m for m in whole if m not in partly]
    pool = replace(pool, similar=tuple(whole), similar_in_part=tuple(partly))
    return replace(answer, pool=pool, onto_similar=onto_similar if partly else None)
