"""Infer, for indirect strokes: which other material has to change so that a stroke's area looks as painted.

The cheapest pair of material and candidate is taken, its light sent round, its values fitted again; where the
stroke's radiance is still not met, the next material is asked on top of it.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from usdslf.errors import SolveError
from usdslf.indirect import Receiver, make_receiver, materials_in_sight, present_total, receiver_tables
from usdslf.infer import Answer, Painted, Pool, fixed_materials, means_of
from usdslf.light_field import LightField, Surface
from usdslf.scene import Scene
from usdslf.solve import Candidate, Options, Tables, enumerate_candidates, refit, relative_error
from usdslf.tools import asks_for_nothing

MET = 0.05  # relative error of a stroke's mean colour at which it counts as met
MOST_CHANGES = 3  # materials that one set of strokes may change
ROUNDS = 3  # of bounces for each
FINE = (-0.05, -0.025, 0.0, 0.025, 0.05)  # roughness about the chosen level
MATERIAL_COST = 4.0  # of each material beside the first


def infer_indirect(
    painted: list[Painted], scene: Scene, field: LightField, options: Options | None = None, bounces: int = 6,
    warnings: list[str] | None = None,
) -> list[Answer]:  # fmt: skip
    """Finds the changes of other materials that indirect strokes ask for; the light field is left with them.

    Args:
        painted: all strokes; direct ones other than fixate are passed over.
        warnings: takes the reason where a stroke's radiance cannot be met, and near ties of materials.

    Raises: SolveError where nothing that may change is in sight.
    """
    options, said = options or Options(), warnings if warnings is not None else []
    evidence = [p.evidence(field) for p in painted]
    wanted = [i for i, p in enumerate(painted) if p.stroke.mode == "indirect" and not asks_for_nothing(p.stroke)]
    held = [i for i, p in enumerate(painted) if p.stroke.tool == "fixate" and p.stroke.strength > 0]
    receivers = [make_receiver(painted[i], evidence[i], field, False) for i in wanted]
    receivers += [make_receiver(painted[i], evidence[i], field, True) for i in held]
    kept = {int(m) for i in wanted for m in np.unique(evidence[i].material)} | set(fixed_materials(evidence))
    where = ", ".join(painted[i].stroke.path for i in wanted)
    answers: list[Answer] = []
    unmet = np.inf
    for number in range(MOST_CHANGES):
        used = kept | {a.pool.material for a in answers}
        materials = materials_in_sight(receivers[: len(wanted)], scene, used)
        answer = _best_answer(receivers, materials, tuple(wanted), scene, field, options, number, said)
        if answer is None:
            if not answers:
                raise SolveError(f"{where}: nothing that may change is in sight of the stroke; paint a direct one")
            break
        if not answer.chosen.freed:
            break
        answers.append(_settle(answer, receivers, len(wanted), field, options, bounces))
        unmet = mean_error(receivers[: len(wanted)], field)
        if unmet < MET:
            return answers
    if answers:
        bound = any(_at_bound(a) for a in answers)
        reason = "a reflectance is at its bound" if bound else "nothing else in sight explains more of it"
        said.append(f"{where}: the painted radiance is met within {unmet:.0%} only; {reason}")
    return answers


def _best_answer(
    receivers: list[Receiver], materials: list[int], strokes: tuple[int, ...], scene: Scene, field: LightField,
    options: Options, number: int, said: list[str],
) -> Answer | None:  # fmt: skip
    """The cheapest candidate over all materials in sight."""
    asked: list[tuple[float, int, list[Candidate], Tables]] = []
    for material in materials:
        tables = receiver_tables(receivers, material, field.surface, field)
        candidates = enumerate_candidates(tables, options)
        asked.append((candidates[0].cost + MATERIAL_COST * number, material, candidates, tables))
    if not asked:
        return None
    asked.sort(key=lambda a: a[0])
    cost, material, candidates, tables = asked[0]
    if len(asked) > 1 and asked[1][0] - cost < MATERIAL_COST and candidates[0].freed:
        names = " and ".join(f"{a[2][0].id} of {scene.materials[a[1]].path}" for a in asked[:2])
        said.append(f"an indirect stroke is ambiguous: {names} explain it about equally well; add a fixate stroke")
    before = relative_error(_only(tables, len(strokes)), Candidate((), level=tables.own))
    none, _ = means_of(tables, Candidate(()))
    pool = Pool(material, "material", (), strokes)
    return Answer(pool, candidates[0], tuple(candidates), tables, none, none, before, before, ())


def _settle(
    answer: Answer, receivers: list[Receiver], wanted: int, field: LightField, options: Options, bounces: int
) -> Answer:
    """Sends the changed light round and fits the values again, until they stay."""
    start = field.surface
    chosen, rounds = answer.chosen, list(answer.rounds)
    best: tuple[float, Candidate, Surface] | None = None
    for _ in range(ROUNDS):
        field.set_surface(changed(start, field, answer.pool.material, chosen, answer.tables.is_metal))
        for _ in field.converge(bounces):
            pass
        levels = np.zeros(0)
        if "glossiness" in chosen.freed:
            center = answer.tables.roughness + chosen.roughness_shift
            levels = np.unique(np.clip(center + np.array(FINE), 0.01, 1.0))
        tables = receiver_tables(receivers, answer.pool.material, start, field, levels)
        now = int(np.abs(levels - center).argmin()) if len(levels) else tables.own
        error = relative_error(_only(tables, wanted), replace(chosen, level=now))
        rounds.append(error)
        if best is None or error < best[0]:
            best = (error, chosen, field.surface)
        if error < 0.01 or (len(rounds) > 1 and abs(rounds[-1] - rounds[-2]) < 0.01 * rounds[-2]):
            break
        choice = range(len(levels)) if len(levels) else [tables.own]
        fits = [refit(tables, replace(chosen, level=j), options) for j in choice]
        chosen = min(fits, key=lambda c: c.misfit)
        if len(levels):
            chosen = replace(chosen, roughness_shift=float(tables.levels[chosen.level] - tables.roughness))
    assert best is not None
    error, chosen, surface = best
    field.set_surface(surface)
    for _ in field.converge(bounces):
        pass
    before, after = means_of(answer.tables, chosen)
    return replace(answer, chosen=chosen, before=before, after=after, residual_after=error, rounds=tuple(rounds))


def mean_error(receivers: list[Receiver], field: LightField) -> float:
    """Largest relative error of a receiver's mean colour, any channel, under the light of now."""
    errors = []
    for r in receivers:
        got, target = present_total(r, field).sum(0), r.target.sum(0)
        errors.append(np.abs(got - target) / (target + 0.1 * target.mean() + 1e-9))
    return float(np.max(errors))


def changed(start: Surface, field: LightField, material: int, c: Candidate, is_metal: bool) -> Surface:
    """Returns the elements' reflectance with a candidate applied to a material."""
    rows = field.elements.material == material
    f0 = c.f0_of(start.f0[rows])
    f90 = f0 if is_metal and "specular" in c.freed else start.f90[rows]
    return start.with_rows(
        rows, diffuse=c.diffuse_of(start.diffuse[rows]), f0=f0, f90=f90, roughness=c.roughness_of(start.roughness[rows])
    )


def _only(t: Tables, strokes: int) -> Tables:
    """The tables of the first strokes alone: those that want something."""
    rows: NDArray = t.stroke < strokes
    named = {k: getattr(t, k)[rows] for k in ("target", "scale", "place", "stroke", "flat")}
    named |= {k: getattr(t, k)[rows] for k in ("p", "u", "v", "w", "tint_u", "tint_w")}
    return replace(t, **named)


def _at_bound(a: Answer) -> bool:
    values = np.concatenate([a.after["diffuse"], a.after["specular"]])
    moved = values != np.concatenate([a.before["diffuse"], a.before["specular"]])
    return bool(np.any(moved & ((values < 1e-3) | (values > 1 - 1e-3))))
