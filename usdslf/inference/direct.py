"""Infer: from strokes to changed materials, under all bounces of the light.

Strokes that say something about the same material in the same scope are asked together.  Then, until the
painted areas look as painted: new reflectance, new light, the chosen parameters fitted again.  Where the light
that comes back overshoots, less of the next step is taken.  A round that fits worse is not accepted; a step whose
own light strokes would not see is the last.

Source: Nguyen et al. 2013, 5.3 (n-bounce) and Listing 1.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import TYPE_CHECKING

from usdslf.errors import SolveError
from usdslf.inference.answers import Answer, Painted, changed_surface
from usdslf.inference.doubt import doubtful_radiance
from usdslf.inference.first_answers import UNSEEN, Asking, first_answers
from usdslf.inference.pictured import Pictured
from usdslf.inference.pools import pool_paths, sort_into_pools
from usdslf.inference.refits import (
    after_bounce,
    changes_of_answers,
    mean_residual,
    refit_answer,
    relaxed,
    while_storable,
    with_changes,
)
from usdslf.inference.samples import gather_samples
from usdslf.inference.tools import wanted_radiance
from usdslf.light_field.light_field import LightField
from usdslf.light_field.renewal import foreseen
from usdslf.light_field.surface import Surface
from usdslf.lights.sources import LightSet
from usdslf.scene.records import Scene
from usdslf.strokes.remarks import About, Remark
from usdslf.strokes.stroke import Stroke

if TYPE_CHECKING:
    from usdslf.rays import RayTracer

CONVERGED = 0.01  # relative change of the painted residual between rounds
MOST_ROUNDS = 4  # n_b of the paper
STANDS = 0.5 * UNSEEN  # of the light that strokes see, that a step may change of which no light is sent round


def gather_strokes(
    strokes: list[Stroke], scene: Scene, tracer: RayTracer, field: LightField, lights: LightSet, warnings: list[str]
) -> list[Painted]:
    """Traces the samples of all active strokes, and reads what their tools ask of the light field before any edit.

    Raises: StrokeError for a stroke that lies on no surface.
    """
    light = Pictured.of(tracer, field, lights)
    return [gather_stroke(s, scene, light, warnings) for s in strokes if s.active]


def gather_stroke(stroke: Stroke, scene: Scene, light: Pictured, warnings: list[str]) -> Painted:
    """Traces the samples of one stroke, and reads what its tool asks of the light before any edit.

    Raises: StrokeError where it lies on no surface.
    """
    stroke = stroke.seen_from(scene.origin)
    light = light.as_sent if stroke.mode == "indirect" else light  # it asks for what surfaces send
    samples, rows = gather_samples(stroke, scene, light.tracer, light.field, light.lights, warnings, light)
    samples = replace(samples, doubtful=doubtful_radiance(samples, light.field))
    return Painted(stroke, samples, rows, wanted_radiance(stroke, rows, samples, scene, light, warnings))


def infer_changes(painted: list[Painted], ask: Asking) -> Iterator[list[Answer]]:
    """Finds the change of every painted material; yields the answers after each round of bounces.

    The light field is left at the last round's state, with the changed reflectance.

    Args:
        ask: what all is asked under; its sentences take one for paint that is out of reach.  Where it follows no light
            the first answers are all, and the light field stays.

    Raises: SolveError where no stroke says anything about a material that can be changed.
    """
    evidence = [ask.evidence(p) for p in painted]
    pools = sort_into_pools(evidence, ask.scene)
    if not pools:
        raise SolveError("no stroke lies on a material; paint on a surface of the shot")
    original = ask.field.surface
    answers, painted = first_answers(pools, evidence, painted, ask)
    if not ask.follows_light:
        evidence = [ask.evidence(p) for p in painted]
        yield [after_bounce(a, evidence, painted, ask.field) for a in answers]
        return
    yield from _rounds(answers, painted, original, ask)


def _rounds(answers: list[Answer], painted: list[Painted], original: Surface, ask: Asking) -> Iterator[list[Answer]]:
    """Sends the changes' light round and fits again, until that changes little; yields the best so far each time."""
    field, kept, kept_surface = ask.field, None, original
    step, share = changes_of_answers(answers), 1.0
    for number in range(MOST_ROUNDS):
        _send_round(changed_surface(original, field, ask.scene, answers, painted), painted, ask)
        varies = any(a.varying and a.varying.parameter == "glossiness" for a in answers)
        evidence = [p.evidence(field, False, True) if varies else p.evidence(field, False) for p in painted]
        answers = [after_bounce(a, evidence, painted, field) for a in answers]
        done = kept is not None and _is_settled(answers, kept)
        if kept is None or mean_residual(answers) <= mean_residual(kept) * 1.02:
            _say_what_became_constant(kept or [], answers, painted, ask)
            kept, kept_surface = answers, field.surface
        yield kept
        if done or number + 1 == MOST_ROUNDS:
            break
        # The light that comes back answers every step: how much of the next one is taken follows from the last two.
        at = changes_of_answers(answers)
        wanted = [refit_answer(a, evidence, painted, field, ask.options) for a in answers]
        step, share = relaxed(changes_of_answers(wanted) - at, step, share)
        answers = [with_changes(a, x) for a, x in zip(wanted, at + share * step, strict=True)]
        answers = [while_storable(a, ask.scene) for a in answers]
        surface = changed_surface(original, field, ask.scene, answers, painted)
        if foreseen(field, surface, ask.matters(painted)) < STANDS:
            answers = [after_bounce(a, evidence, painted, field) for a in answers]
            if mean_residual(answers) <= mean_residual(kept) * 1.02:
                kept, kept_surface = answers, surface
                field.set_surface(surface)
                yield kept
            break
    if kept_surface is not field.surface:
        _send_round(kept_surface, painted, ask)


def _send_round(surface: Surface, painted: list[Painted], ask: Asking) -> None:
    """Gives the light field a reflectance, and the light that strokes see of it."""
    ask.field.set_surface(surface)
    ask.settle(ask.field, painted)


def _is_settled(answers: list[Answer], kept: list[Answer]) -> bool:
    now, before = mean_residual(answers), mean_residual(kept)
    return abs(now - before) < CONVERGED * max(before, 0.02)


def _say_what_became_constant(kept: list[Answer], answers: list[Answer], painted: list[Painted], ask: Asking) -> None:
    """A sentence for each change that varied, in answers that are replaced, and does no more."""
    for pool in {a.pool for a in kept if a.varying} & {a.pool for a in answers if not a.varying}:
        what = "a change that varies could not be stored under the light that it sends round; it is constant"
        ask.said.append(Remark(pool_paths(painted, pool), what, About.PAINT))
