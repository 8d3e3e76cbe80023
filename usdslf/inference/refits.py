"""Refits: an answer fitted again under the light of now, and how it looks once its light went round.

    refit_answer(answer, evidence, painted, field, options) -> Answer
    after_bounce(answer, evidence, painted, field) -> Answer with its residual
    with_changes(answer, change) -> Answer, for steps between rounds: changes_of_answers, relaxed, while_storable

Evidence, painted and a pool's strokes are counted alike; changes are (7,): delta diffuse, delta F0, shift of roughness.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from usdslf.edits.storage import storage_of
from usdslf.inference.answer_residuals import varying_residual
from usdslf.inference.answers import Answer, Painted, means_of
from usdslf.inference.bilinear import Tables, pool_tables
from usdslf.inference.candidate import Candidate
from usdslf.inference.evidence import Arriving, Evidence, kept_columns
from usdslf.inference.fit import Way, bounds_of_tables, hold_energy
from usdslf.inference.paint_errors import refit_as_painted
from usdslf.inference.samples import Samples
from usdslf.inference.solve import refit, refit_levels, refit_problem, relative_error
from usdslf.inference.varying import as_candidate, as_varying, refit_varying
from usdslf.inference.weights import Options
from usdslf.light_field.light_field import LightField
from usdslf.scene.records import Scene
from usdslf.surfaces.reflectance import gloss_levels, moved_roughness

FINE_LEVELS = 9  # between the neighbours of the chosen level


def refit_answer(
    answer: Answer, evidence: list[Evidence], painted: list[Painted], field: LightField, options: Options
) -> Answer:
    """Returns the answer with its chosen parameters fitted under the light of now; glossiness on finer levels."""
    mine = [evidence[i] for i in answer.pool.strokes]
    chosen = answer.chosen
    tables = pool_tables(mine, answer.pool.material, field.model)
    if answer.varying:
        varying = refit_varying(tables, answer.varying)
        chosen = as_candidate(tables, varying, chosen)
        before, after = means_of(tables, chosen)
        return replace(answer, chosen=chosen, tables=tables, before=before, after=after, varying=varying)
    if "glossiness" in chosen.freed:
        pairs = zip(mine, answer.pool.strokes, strict=True)
        fine = [finer(e, painted[i].samples, field, chosen) for e, i in pairs]
        tables = pool_tables(fine, answer.pool.material, field.model)
    chosen = refit_tables(tables, chosen, options, is_painted(mine))
    before, after = means_of(tables, chosen)
    return replace(answer, chosen=chosen, tables=tables, before=before, after=after)


def refit_tables(tables: Tables, chosen: Candidate, options: Options, painted: bool) -> Candidate:
    """Returns the chosen parameters fitted to tables: of `finer` evidence where glossiness is one of them.

    Args:
        painted: all strokes are colours that a painter chose.
    """
    if not chosen.freed:
        return replace(chosen, level=tables.own)
    if "glossiness" in chosen.freed:
        problem = refit_problem(tables, options)
        best = min(refit_levels(problem, chosen, range(FINE_LEVELS)), key=lambda c: c.misfit)
        chosen = replace(best, roughness_shift=float(tables.levels[best.level] - tables.roughness))
    else:
        chosen = refit(refit_problem(tables, options), replace(chosen, level=tables.own))
    return refit_as_painted(tables, options, chosen) if painted else chosen


def is_painted(evidence: list[Evidence]) -> bool:
    """Whether all strokes are painted colours; what the other tools ask for has no errors of a painter."""
    return all(e.stroke.tool == "replace" for e in evidence)


def finer(e: Evidence, samples: Samples, field: LightField, chosen: Candidate) -> Evidence:
    """Returns the evidence on levels around the chosen one, and the own level at the end."""
    own = e.levels[:, -1]
    steps = gloss_levels(field.model)
    step = np.interp(own.mean() + chosen.roughness_shift, steps, np.gradient(steps))
    shift = chosen.roughness_shift + np.linspace(-step, step, FINE_LEVELS)
    levels = np.concatenate([moved_roughness(own[:, None], shift, chosen.roughness_mean), own[:, None]], 1)
    columns = kept_columns(samples, field, levels, e.arriving or Arriving.at(samples, field))
    pad = np.repeat(e.background[:, -1:], levels.shape[1], 1)
    return replace(e, levels=levels, columns=columns, background=pad)


def after_bounce(answer: Answer, evidence: list[Evidence], painted: list[Painted], field: LightField) -> Answer:
    """Returns the answer with the residual of its chosen change now that its light went round."""
    mine = [evidence[i] for i in answer.pool.strokes]
    chosen = answer.chosen
    if answer.varying:
        error = varying_residual(answer, answer.varying, painted, field)
        return replace(answer, residual_after=error, rounds=(*answer.rounds, error))
    if "glossiness" in chosen.freed:
        mine = [_at_shift(e, painted[i].samples, field, chosen) for e, i in zip(mine, answer.pool.strokes, strict=True)]
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
    columns = kept_columns(samples, field, levels, e.arriving or Arriving.at(samples, field))
    return replace(e, levels=levels, columns=columns, background=pad)


def changes_of_answers(answers: list[Answer]) -> NDArray[np.float64]:
    """Returns the changes of all answers (n, 7): delta diffuse, delta F0, shift of roughness."""
    of = lambda c: np.concatenate([c.delta_diffuse, c.delta_f0, [c.roughness_shift]])  # noqa: E731
    return np.array([of(a.chosen) for a in answers])


def with_changes(answer: Answer, change: NDArray) -> Answer:
    """Returns the answer with another change (7,) of its freed parameters, held to what is possible."""
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
    onto = answer.onto_similar
    if onto:
        onto = as_varying(chosen, varying, onto.places, onto.reach, onto.weights)
    return replace(answer, chosen=chosen, before=before, after=after, varying=varying, onto_similar=onto)


def relaxed(step: NDArray, last: NDArray, share: float) -> tuple[NDArray, float]:
    """Returns the step and the share of it to take.  Source: Irons and Tuck 1969 (Aitken's method for vectors)."""
    turn = step - last
    length = float((turn * turn).sum())
    if length > 1e-12:
        share = float(np.clip(-share * (last * turn).sum() / length, 0.1, 1.5))
    return step, share


def while_storable(answer: Answer, scene: Scene) -> Answer:
    """Returns the answer; a constant where the light that went round moved it to where what varies cannot be stored."""
    v, pool = answer.varying, answer.pool
    if v is None or not storage_of(scene, pool.material, pool.targets, v).why_not:
        return answer
    return replace(answer, varying=None)


def mean_residual(answers: list[Answer]) -> float:
    """Returns the mean of the answers' residuals; what is held counts not."""
    return float(np.mean([a.residual_after for a in answers if not a.pool.is_held] or [0.0]))
