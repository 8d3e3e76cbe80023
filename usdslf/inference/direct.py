"""Infer: from strokes to changed materials, under all bounces of the light.

Strokes that say something about the same material in the same scope are asked together.  Then, until the
painted areas look as painted: new reflectance, new light, the chosen parameters fitted again.  Where the light
that comes back overshoots, less of the next step is taken.  A round that fits worse is not accepted.

Source: Nguyen et al. 2013, 5.3 (n-bounce) and Listing 1.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from usdslf.edits.storage import storage_of
from usdslf.errors import SolveError, StrokeError
from usdslf.inference.answer_residuals import varying_residual
from usdslf.inference.answers import Answer, Painted, Pool, changed_surface, means_of, scope_rows
from usdslf.inference.attainable import dimming, error_of, explains_nothing, seems_too_bright
from usdslf.inference.bilinear import Tables, pool_tables
from usdslf.inference.candidate import Candidate
from usdslf.inference.evidence import Evidence, evaluate_columns
from usdslf.inference.fit import Problem, Way, bounds_of_tables, hold_energy
from usdslf.inference.samples import Samples, gather_samples
from usdslf.inference.solve import enumerate_candidates, refit, refit_problem, relative_error
from usdslf.inference.tools import asks_for_nothing, expected_error, wanted_radiance
from usdslf.inference.varying import (
    VaryingAnswer,
    as_candidate,
    as_spread,
    asks_to_vary,
    places_of_dabs,
    refit_varying,
    varying_answers,
)
from usdslf.inference.weights import Options
from usdslf.light_field.light_field import LightField
from usdslf.lights.sources import LightSet
from usdslf.scene.records import Scene
from usdslf.similarity.materials import ALL, MOST, OF_MATERIALS, alike_materials
from usdslf.similarity.similarity import Weights, reach_of
from usdslf.strokes.stroke import Stroke
from usdslf.surfaces.reflectance import gloss_levels, moved_roughness

if TYPE_CHECKING:
    from usdslf.rays import RayTracer

CONVERGED = 0.01  # relative change of the painted residual between rounds
ROUNDS = 4  # n_b of the paper
FINE_LEVELS = 9  # between the neighbours of the chosen level


def gather_strokes(
    strokes: list[Stroke], scene: Scene, tracer: RayTracer, field: LightField, lights: LightSet, warnings: list[str]
) -> list[Painted]:
    """Traces the samples of all active strokes, and reads what their tools ask of the light field before any edit.

    Raises: StrokeError for a stroke that lies on no surface.
    """
    painted = []
    for stroke in strokes:
        if not stroke.active:
            continue
        stroke = stroke.seen_from(scene.origin)
        samples, rows = gather_samples(stroke, scene, tracer, field, lights, warnings)
        wanted = wanted_radiance(stroke, rows, samples, scene, tracer, field, lights, warnings)
        painted.append(Painted(stroke, samples, rows, wanted))
    return painted


def infer_changes(
    painted: list[Painted],
    scene: Scene,
    field: LightField,
    options: Options | None = None,
    choose: dict[str, str] | None = None,
    bounces: int = 6,
    warnings: list[str] | None = None,
    similarity: Weights | None = None,
) -> Iterator[list[Answer]]:
    """Finds the change of every painted material; yields the answers after each round of bounces.

    The light field is left at the last round's state, with the changed reflectance.

    Args:
        choose: stroke name -> id of the alternative to take instead of the best.
        options: weights; their `norm` is used for strokes that say mixed.
        warnings: takes a sentence for paint that is out of reach.
        similarity: weights of what strokes of scope `similar` change beside the painted material.

    Raises: SolveError where no stroke says anything about a material that can be changed.
    """
    options, choose = options or Options(), choose or {}
    said = warnings if warnings is not None else []
    original = field.surface
    evidence = [p.evidence(field) for p in painted]
    pools = _pools(evidence, scene)
    if not pools:
        raise SolveError("no stroke lies on a material; paint on a surface of the shot")
    answers = [_first_answer(p, evidence, painted, field, scene, options, choose, said) for p in pools]
    factors = _out_of_reach(answers, painted, field, scene, bounces, said)
    if factors:
        dimmed = [replace(p, wanted=factors.get(i, 1.0) * e.target) for i, (p, e) in enumerate(zip(painted, evidence))]
        painted = [dimmed[i] if i in factors else p for i, p in enumerate(painted)]
        evidence = [p.evidence(field) for p in painted]
        answers = [_first_answer(p, evidence, painted, field, scene, options, choose, said) for p in pools]
    answers = [_or_nothing(a, painted, choose, said) for a in answers]
    for i, a in enumerate(answers):  # what one change goes on to is taken for those that follow
        answers[i] = _with_alike(a, answers, evidence, painted, field, scene, similarity, said)
    kept: list[Answer] | None = None
    kept_surface = original
    at, step, share = np.zeros_like(_changes(answers)), _changes(answers), 1.0
    for number in range(ROUNDS):
        field.set_surface(changed_surface(original, field, scene, answers, painted))
        for _ in field.converge(bounces):
            pass
        evidence = [p.evidence(field) for p in painted]
        answers = [_after_bounce(a, evidence, painted, field, options) for a in answers]
        done = kept is not None and abs(_total(answers) - _total(kept)) < CONVERGED * max(_total(kept), 0.02)
        could_vary = {a.pool for a in kept or () if a.varying} & {a.pool for a in answers if not a.varying}
        if kept is None or _total(answers) <= _total(kept) * 1.02:
            kept, kept_surface = answers, field.surface
            said += [
                f"{pool_names(painted, pool)}: a change that varies could not be stored under the light that it sends "
                "round; it is constant"
                for pool in could_vary
            ]
        yield kept
        if done or number + 1 == ROUNDS:
            break
        # The light that comes back answers every step: how much of the next one is taken follows from the last two.
        at = _changes(answers)
        wanted = [_refit(a, evidence, painted, field, options) for a in answers]
        step, share = _relaxed(_changes(wanted) - at, step, share)
        answers = [_with_changes(a, x) for a, x in zip(wanted, at + share * step, strict=True)]
        answers = [_while_storable(a, scene) for a in answers]
    if kept_surface is not field.surface:
        field.set_surface(kept_surface)
        for _ in field.converge(bounces):
            pass


def _out_of_reach(
    answers: list[Answer], painted: list[Painted], field: LightField, scene: Scene, bounces: int, said: list[str]
) -> dict[int, float]:
    """Factors of the strokes that are too bright even for a white surface and the light that it sends round; said."""
    factors: dict[int, float] = {}
    original, as_it_was_d = field.surface, None
    for a in answers:
        if a.pool.is_held or not a.is_too_bright:
            continue
        as_it_was_d = field.outgoing_d.copy() if as_it_was_d is None else as_it_was_d
        rows = scope_rows(a.pool, field, scene, painted)
        one = np.ones(1, np.float32)
        white = {"f0": one, "f90": one} if a.tables.is_metal else {"diffuse": one}
        field.set_surface(original.with_rows(rows, **white))
        for _ in field.converge(bounces):
            pass
        mine = [painted[i].evidence(field) for i in a.pool.strokes]
        factor = dimming(pool_tables(mine, a.pool.material, field.model))
        if factor == 1:
            continue
        factors |= dict.fromkeys(a.pool.strokes, factor)
        names = ", ".join(painted[i].stroke.path for i in a.pool.strokes)
        said.append(
            f"{names}: painted {1 / factor:.1f} times brighter than the surface can be in this light; its hue is "
            "kept and its brightness lowered to that"
        )
    if as_it_was_d is not None:
        field.set_surface(original)
        field.outgoing_d = as_it_was_d
    return factors


def _or_nothing(answer: Answer, painted: list[Painted], choose: dict[str, str], said: list[str]) -> Answer:
    """The answer, unless its change explains next to nothing and nobody chose it: then none."""
    c, t = answer.chosen, answer.tables
    strokes = [painted[i].stroke for i in answer.pool.strokes]
    if not c.freed or answer.varying or any(choose.get(s.name) or s.choice for s in strokes):
        return answer
    none = replace(next((x for x in answer.candidates if x.id == "none"), Candidate(())), level=t.own)
    before, after = error_of(t, none), error_of(t, c)
    if not explains_nothing(before, after):
        return answer
    said.append(
        f"{', '.join(s.path for s in strokes)}: no change of the material comes near what was painted (the best "
        f"leaves {after / before:.0%} of the difference); nothing is changed"
    )
    before_, after_ = means_of(t, none)
    return replace(answer, chosen=none, before=before_, after=after_)


def _with_alike(
    answer: Answer, answers: list[Answer], evidence: list[Evidence], painted: list[Painted], field: LightField,
    scene: Scene, weights: Weights | None, said: list[str],
) -> Answer:  # fmt: skip
    """The answer with the materials that change too, wholly or in part, where one of its strokes says `similar`."""
    pool = answer.pool
    if not any(painted[i].stroke.scope == "similar" for i in pool.strokes) or not answer.chosen.freed:
        return answer
    taken = [a.pool for a in answers if a.pool != pool]
    leave = {pool.material, *(p.material for p in taken), *(m for p in taken for m in (*p.alike, *p.partly))}
    leave |= set(fixed_materials(evidence))
    mine = [evidence[i] for i in pool.strokes]  # all dabs that the change is known at, whatever their scope
    places = places_of_dabs(mine, pool.material)
    brush = float(np.mean([e.stroke.widths.mean() for e in mine]))
    reach = reach_of(places.position, 0.5 * brush)
    shares = alike_materials(scene, field.elements, places, reach, leave, weights)
    spread = as_spread(answer.chosen, answer.varying, places, reach, weights or OF_MATERIALS)
    whole, partly = [m for m, share in shares.items() if share > MOST], []
    for m in (m for m, share in shares.items() if share <= ALL):
        why = storage_of(scene, m, (), spread).why_not if spread else "its change has several parameters"
        if not why:
            partly.append(m)
        said.append(
            f"{pool_names(painted, pool)}: {shares[m]:.0%} of {scene.materials[m].path} is similar; "
            + (f"all or nothing of it changes: {why}" if why else "that part of it changes")
        )
    whole = [m for m in whole if m not in partly]
    pool = replace(pool, alike=tuple(whole), partly=tuple(partly))
    return replace(answer, pool=pool, spread=spread if partly else None)


def pool_names(painted: list[Painted], pool: Pool) -> str:
    """Returns the paths of a pool's strokes."""
    return ", ".join(painted[i].stroke.path for i in pool.strokes)


def _relaxed(step: NDArray, last: NDArray, share: float) -> tuple[NDArray, float]:
    """Returns the step and the share of it to take.  Source: Irons and Tuck 1969 (Aitken's method for vectors)."""
    turn = step - last
    length = float((turn * turn).sum())
    if length > 1e-12:
        share = float(np.clip(-share * (last * turn).sum() / length, 0.1, 1.5))
    return step, share


def _changes(answers: list[Answer]) -> NDArray[np.float64]:
    """The changes of all answers (n, 7): delta diffuse, delta F0, shift of roughness."""
    of = lambda c: np.concatenate([c.delta_diffuse, c.delta_f0, [c.roughness_shift]])  # noqa: E731
    return np.array([of(a.chosen) for a in answers])


def _with_changes(answer: Answer, change: NDArray) -> Answer:
    """The answer with another change (7,) of its freed parameters, held to what is possible."""
    c, t = answer.chosen, answer.tables
    of_diffuse, of_f0 = bounds_of_tables(t, c.is_factor_diffuse, c.is_factor_f0)
    dd, df = hold_energy(t, np.clip(change[:3], *of_diffuse), np.clip(change[3:6], *of_f0), Way.of(c))
    chosen = replace(
        c,
        delta_diffuse=dd,
        delta_f0=df,
        roughness_shift=float(change[6]),
    )
    before, after = means_of(t, chosen)
    varying = answer.varying
    if varying:
        varying = varying.moved(chosen.delta_of(varying.parameter))
    spread = answer.spread
    if spread:
        spread = as_spread(chosen, varying, spread.places, spread.reach, spread.weights)
    return replace(answer, chosen=chosen, before=before, after=after, varying=varying, spread=spread)


def _total(answers: list[Answer]) -> float:
    return float(np.mean([a.residual_after for a in answers if not a.pool.is_held] or [0.0]))


def _pools(evidence: list[Evidence], scene: Scene) -> list[Pool]:
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


def _first_answer(
    pool: Pool, evidence: list[Evidence], painted: list[Painted], field: LightField, scene: Scene, options: Options,
    choose: dict[str, str], said: list[str],
) -> Answer:  # fmt: skip
    mine = [evidence[i] for i in pool.strokes]
    tables = pool_tables(mine, pool.material, field.model)
    norms = {e.stroke.norm for e in mine} - {"mixed"}
    options = replace(options, norm=norms.pop()) if len(norms) == 1 else options
    options = replace(options, dab_error=max(options.dab_error, expected_error([e.stroke for e in mine])))
    candidates = enumerate_candidates(tables, options)
    if pool.is_held:
        candidates = [c for c in candidates if not c.freed]
    wanted = [choose.get(e.stroke.name) or e.stroke.choice for e in mine]
    wanted = [w for w in wanted if w and not pool.is_held]
    varied: list[VaryingAnswer] = []
    if not pool.is_held and options.norm == "mixed":
        constant = None if wanted else candidates[0]
        varied = _storable(pool, tables, options, constant, mine, scene, said)
    chosen, varying = candidates[0], None
    if wanted:
        found = next((c for c in candidates if c.id == wanted[0]), None)
        other = next((a for a in varied if a.id == wanted[0]), None)
        if found is None and other is None:
            known = ", ".join([*(c.id for c in candidates), *(a.id for a in varied)])
            raise StrokeError(f"{mine[0].stroke.path}: there is no alternative '{wanted[0]}'; choose one of {known}")
        chosen, varying = (other.mean, other.varying) if found is None and other else (found or chosen, None)
    else:
        best = next((a for a in varied if asks_to_vary(tables, options, a, chosen)), None)
        chosen, varying = (best.mean, best.varying) if best else (chosen, None)
    none = next((c for c in candidates if c.id == "none"), Candidate(()))
    before = relative_error(tables, replace(none, level=tables.own))
    start = Answer(
        pool, chosen, tuple(candidates), tables, {}, {}, before, before, (),
        varying is None and seems_too_bright(tables, candidates), varied=tuple(varied), varying=varying,
    )  # fmt: skip
    return _refit(start, evidence, painted, field, options)


def _storable(
    pool: Pool, tables: Tables, options: Options, constant: Candidate | None, mine: list[Evidence], scene: Scene,
    said: list[str],
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
        storage = storage_of(scene, pool.material, pool.targets, a.varying)
        why_not = storage.why_not
        if not why_not:
            found[a.id] = a
            continue
        if not storage.is_too_coarse:  # a smoother change could be stored no better
            refused.add(kind)
        if constant is not None and asks_to_vary(tables, options, a, constant):
            why[f"a {a.id}: {why_not}"] = None
    if why and not (constant and any(asks_to_vary(tables, options, a, constant) for a in found.values())):
        said.append(
            f"{', '.join(e.stroke.path for e in mine)}: the strokes ask for a change that varies over "
            f"{scene.materials[pool.material].path}, which cannot be stored ({'; '.join(why)}); it is constant"
        )
    return list(found.values())


def _while_storable(answer: Answer, scene: Scene) -> Answer:
    """The answer; a constant where the light that went round moved it to where what varies cannot be stored."""
    v, pool = answer.varying, answer.pool
    if v is None or not storage_of(scene, pool.material, pool.targets, v).why_not:
        return answer
    return replace(answer, varying=None)


def _refit(
    answer: Answer, evidence: list[Evidence], painted: list[Painted], field: LightField, options: Options
) -> Answer:
    """Fits the chosen parameters under the light of now; glossiness on finer levels."""
    mine = [evidence[i] for i in answer.pool.strokes]
    chosen = answer.chosen
    tables = pool_tables(mine, answer.pool.material, field.model)
    if answer.varying:
        varying = refit_varying(tables, answer.varying)
        chosen = as_candidate(tables, varying, chosen)
        before, after = means_of(tables, chosen)
        return replace(answer, chosen=chosen, tables=tables, before=before, after=after, varying=varying)
    if chosen.freed:
        if "glossiness" in chosen.freed:
            pairs = zip(mine, answer.pool.strokes, strict=True)
            fine = [_finer(e, painted[i].samples, field, chosen) for e, i in pairs]
            tables = pool_tables(fine, answer.pool.material, field.model)
            problem = refit_problem(tables, options)
            fits = [refit(problem, replace(chosen, level=j)) for j in range(FINE_LEVELS)]
            best = min(fits, key=lambda c: c.misfit)
            chosen = replace(best, roughness_shift=float(tables.levels[best.level] - tables.roughness))
        else:
            chosen = refit(refit_problem(tables, options), replace(chosen, level=tables.own))
    before, after = means_of(tables, chosen)
    return replace(answer, chosen=chosen, tables=tables, before=before, after=after)


def _finer(e: Evidence, samples: Samples, field: LightField, chosen: Candidate) -> Evidence:
    """The evidence on levels around the chosen one, and the own level at the end."""
    own = e.levels[:, -1]
    steps = gloss_levels(field.model)
    step = np.interp(own.mean() + chosen.roughness_shift, steps, np.gradient(steps))
    shift = chosen.roughness_shift + np.linspace(-step, step, FINE_LEVELS)
    levels = np.concatenate([moved_roughness(own[:, None], shift, chosen.roughness_mean), own[:, None]], 1)
    columns = evaluate_columns(samples, field, levels)
    pad = np.repeat(e.background[:, -1:], levels.shape[1], 1)
    return replace(e, levels=levels, columns=columns, background=pad)


def _after_bounce(
    answer: Answer, evidence: list[Evidence], painted: list[Painted], field: LightField, options: Options
) -> Answer:
    """How the chosen change looks now that its light went round."""
    mine = [evidence[i] for i in answer.pool.strokes]
    chosen = answer.chosen
    if answer.varying:
        error = varying_residual(answer, answer.varying, painted, field)
        return replace(answer, residual_after=error, rounds=(*answer.rounds, error))
    if "glossiness" in chosen.freed:
        mine = [
            _at_shift(e, painted[i].samples, field, chosen)
            for e, i in zip(mine, answer.pool.strokes, strict=True)
        ]
        tables = pool_tables(mine, answer.pool.material, field.model)
        error = relative_error(tables, replace(chosen, level=0))
    else:
        tables = pool_tables(mine, answer.pool.material, field.model)
        error = relative_error(tables, replace(chosen, level=tables.own))
    return replace(answer, residual_after=error, rounds=(*answer.rounds, error))


def _at_shift(e: Evidence, samples: Samples, field: LightField, chosen: Candidate) -> Evidence:
    own = e.levels[:, -1]
    levels = np.stack([moved_roughness(own, chosen.roughness_shift, chosen.roughness_mean), own], 1)
    pad = np.repeat(e.background[:, -1:], 2, 1)
    return replace(e, levels=levels, columns=evaluate_columns(samples, field, levels), background=pad)
