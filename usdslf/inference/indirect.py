"""Infer, for indirect strokes: which other materials have to change so that a stroke's area looks as painted.

Every material in sight is asked with every candidate, and all of them together with their diffuse colours: these are
the explanations, cheapest first.  The cheapest, or the one that was chosen, is fitted under all bounces; where the
stroke's radiance is still not met, the next material is asked on top of it and all are fitted together.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from usdslf.errors import SolveError, StrokeError
from usdslf.inference.answers import Alternative, Answer, Painted, Pool, means_after, means_of
from usdslf.inference.bilinear import Tables, pool_tables
from usdslf.inference.candidate import Candidate
from usdslf.inference.fit import whiten
from usdslf.inference.joint_fit import Change, Fitted, fit_changes, mean_error, radiance_of
from usdslf.inference.least_squares import bounded_least_squares
from usdslf.inference.pools import fixed_materials
from usdslf.inference.receivers import F64, Receiver, make_receiver, materials_in_sight, receiver_tables
from usdslf.inference.residuals import relative_rms
from usdslf.inference.solve import enumerate_candidates, relative_error, tempered
from usdslf.inference.tools import asks_for_nothing, expected_error
from usdslf.inference.weights import Options
from usdslf.light_field.light_field import LightField, Surface
from usdslf.light_field.links import element_of, is_link
from usdslf.scene.records import Scene
from usdslf.surfaces.reflectance import Parameters

# Light that went through the bins of two surfaces is foreseen worse, dab by dab, than what arrives directly; what is
# asked for is far from what is there, so that errors count by their squares for longer.
DAB_ERROR, DRIFT_ERROR, TINT_ERROR, OUTLIER, TAIL = 0.15, 0.05, 0.03, 100.0, 8.0
MET = 0.05  # relative error of a stroke's mean colour at which it counts as met
MOST_CHANGES = 4  # materials that are asked one after the other
BETTER = 0.8  # of the error that is left, for another material to be worth while
UNMET_COST = 1.0  # of each percent beyond MET by which an explanation is foreseen to miss a stroke's mean
MOST_UNMET = 40.0
MATERIAL_COST = 4.0  # of each material beside the first
AMBIGUOUS = 5.0  # cost between two explanations that is no difference
SEEN = 0.01  # change of a reflectance that is said
MOST_DIELECTRIC = 0.3  # F0; no dielectric reflects as much
JOINT_REACH = 0.5  # of a reflectance, that counts as one dab's error where all in sight change together
SERVES = 0.1  # share of the largest change of a stroke, for a material to count as changed for it


@dataclass(frozen=True)
class Explanation:
    """One way to answer: changes of one material or of several."""

    id: str
    cost: float
    changes: tuple[Change, ...]
    tables: Tables
    is_admitted: bool = True  # by the norm

    @property
    def rank(self) -> tuple[bool, float]:
        """What explanations are sorted by, the best first."""
        return not self.is_admitted, self.cost


def infer_indirect(
    painted: list[Painted], scene: Scene, field: LightField, options: Options | None = None, bounces: int = 6,
    warnings: list[str] | None = None, choose: dict[str, str] | None = None, direct: Sequence[Answer] = (),
) -> list[Answer]:  # fmt: skip
    """Finds the changes of other materials that indirect strokes ask for; the light field is left with them.

    Args:
        painted: all strokes; what direct ones found stays as it is.
        warnings: takes the reason where a stroke's radiance cannot be met, and near ties.
        choose: stroke name -> id of the alternative to take instead of the best.
        direct: what the direct strokes found; the light field has it already.

    Raises: SolveError where nothing that may change is in sight and no direct stroke changes anything; StrokeError
    for an alternative that is none.
    """
    said = warnings if warnings is not None else []
    painted = [_with_answers(p, direct, scene) for p in painted]
    evidence = [p.evidence(field) for p in painted]
    wanted = [i for i, p in enumerate(painted) if p.stroke.mode == "indirect" and not asks_for_nothing(p.stroke)]
    fixing = [i for i, p in enumerate(painted) if asks_for_nothing(p.stroke) and p.stroke.tool == "fixate"]
    # a direct stroke's area has what it asked for: it holds it
    held = fixing + [i for i, p in enumerate(painted) if p.stroke.mode == "direct" and i not in fixing]
    receivers = [make_receiver(painted[i], evidence[i], field, False) for i in wanted]
    receivers += [make_receiver(painted[i], evidence[i], field, True) for i in held]
    idle = [i for i, p in enumerate(painted) if p.stroke.mode == "indirect" and i not in wanted]
    answers = [_no_change(i, painted, evidence, field) for i in idle]
    if not wanted:
        return answers
    asking = [painted[i].stroke for i in wanted]
    options = options or Options()
    norms = {s.norm for s in asking} - {"mixed"}
    options = replace(options, norm=norms.pop()) if len(norms) == 1 else options
    options = replace(
        options, dab_error=max(DAB_ERROR, options.dab_error, expected_error(asking)), drift_error=DRIFT_ERROR,
        tint_error=TINT_ERROR, outlier=OUTLIER, tail=TAIL,
    )  # fmt: skip
    kept = {int(m) for i in wanted for m in np.unique(evidence[i].material)} | set(fixed_materials(evidence))
    kept |= {a.pool.material for a in direct if a.chosen.freed}
    asked = next((w for s in asking if (w := (choose or {}).get(s.name) or s.choice)), "")

    start, before = field.surface, radiance_of(receivers, field)
    where = ", ".join(s.path for s in asking)
    materials = materials_in_sight(receivers[: len(wanted)], scene, kept)
    if not materials:
        note = _nothing_in_sight(receivers[: len(wanted)], scene, kept)
        if not any(a.chosen.freed for a in direct):
            raise SolveError(f"{where}: {note}")
        said.append(f"{where}: {note}")  # what the direct strokes found stands
        return answers + [replace(_no_change(i, painted, evidence, field), note=note) for i in wanted]
    explanations = _explanations(receivers, materials, scene, field, options)
    is_met = mean_error(receivers, before) < MET
    chosen = _choose(explanations, asked, is_met, options.norm == "mixed", where)
    fitted = _fit(chosen, receivers, start, field, options, bounces)
    others = [e for e in explanations if e.id != chosen.id and e.changes]
    if not asked and chosen.changes:
        ties = [e.id for e in others if _is_tie(e, chosen)]
        if ties:
            said.append(
                f"{where}: {chosen.id} and {' and '.join(ties[:3])} explain it about equally well; "
                "add fixate strokes or choose one"
            )
        fitted = _add_materials(fitted, chosen, receivers, start, materials, scene, field, options, bounces)
    error = mean_error(receivers, fitted.radiance)
    note = f"met within {error:.1%}"
    if error >= MET:
        note = f"the painted radiance is met within {error:.1%} only; {_reason(fitted, receivers, chosen, field)}"
        said.append(f"{where}: {note}")
    tied = {e.id for e in explanations if not asked and _is_tie(e, chosen)}
    alternatives = tuple(_alternative(e, scene, e.id == chosen.id, e.id in tied) for e in explanations)
    return answers + _answers(fitted, chosen, alternatives, note, wanted, before, painted, evidence, field)


# ── explanations ─────────────────────────────────────────────────────────────────────────────────


def _explanations(
    receivers: list[Receiver], materials: list[int], scene: Scene, field: LightField, options: Options
) -> list[Explanation]:
    """All explanations, cheapest first."""
    found: list[Explanation] = []
    own: list[tuple[int, Tables]] = []
    for m in materials:
        tables, as_metal = receiver_tables(receivers, m, field.surface, field)
        own.append((m, tables))
        candidates = [_plausible(c, tables, options) for c in enumerate_candidates(tables, options)]
        candidates = [replace(c, cost=c.cost + _unmet(c.radiance(tables), receivers)) for c in candidates]
        if as_metal is not None and options.norm == "mixed" and not scene.materials[m].use_specular_workflow:
            candidates += _as_metals(as_metal, tables, options, receivers)
        candidates.sort(key=lambda c: c.rank)
        for i, c in enumerate(candidates):
            if c.id in {other.id for other in candidates[:i]}:
                continue
            changes = (Change.of(m, c, tables),) if c.freed else ()
            name = f"{c.id} of {scene.materials[m].path}" if c.freed else "none"
            found.append(Explanation(name, c.cost, changes, tables, c.is_admitted))
    if len(own) > 1:
        if options.norm == "l2":  # it moves all that it can
            found = [replace(e, is_admitted=False) for e in found]
        found.append(_all_in_sight(own, options, receivers))
    found.sort(key=lambda e: e.rank)
    return [e for i, e in enumerate(found) if e.id not in {other.id for other in found[:i]}]


def _plausible(c: Candidate, t: Tables, o: Options) -> Candidate:
    """The candidate with the cost of a dielectric that reflects like a metal."""
    is_odd = not t.is_metal and "specular" in c.freed and float(c.f0_of(t.f0).mean()) > MOST_DIELECTRIC
    return replace(c, cost=c.cost + o.kind) if is_odd else c


def _unmet(radiance: F64, receivers: list[Receiver]) -> float:
    """Cost of strokes whose mean radiance would not be met."""
    return float(np.clip(100 * UNMET_COST * (mean_error(receivers, radiance) - MET), 0, MOST_UNMET))


def _as_metals(as_metal: Tables, t: Tables, o: Options, receivers: list[Receiver]) -> list[Candidate]:
    """The candidates that make a metal of a dielectric."""
    found = []
    for c in enumerate_candidates(as_metal, o, ("specular", "glossiness")):
        if "specular" not in c.freed:
            continue
        f0 = float(c.f0_of(t.f0).mean())
        cost = c.cost + (0.5 if f0 > MOST_DIELECTRIC else 2.0) * o.kind + _unmet(c.radiance(as_metal), receivers)
        freed = ("diffuse", *c.freed)
        found.append(replace(c, freed=freed, delta_diffuse=-t.diffuse, is_metallic=True, cost=cost))
    return found


def _all_in_sight(own: list[tuple[int, Tables]], o: Options, receivers: list[Receiver]) -> Explanation:
    """The diffuse colours of all materials in sight, each as little as need be."""
    t = own[0][1]
    white = whiten(t, o)
    columns = []
    for _, each in own:
        u = each.dabs.u[:, each.own] / t.scale
        columns += [white @ (u * channel).reshape(-1) for channel in np.eye(3)]
    a = np.stack(columns, 1)
    r = white @ ((t.target - t.before) / t.scale).reshape(-1)
    low, high = (np.concatenate(x) for x in zip(*((-each.diffuse, 1 - each.diffuse) for _, each in own), strict=True))
    x = bounded_least_squares(
        np.concatenate([a, np.eye(a.shape[1]) / JOINT_REACH]), np.concatenate([r, np.zeros(a.shape[1])]), low, high
    )
    n = len(t.target)
    misfit = float(((r - a @ x) ** 2).sum())
    freed = ("diffuse",) if o.norm != "l2" else ("diffuse", "specular", "glossiness")
    cost = tempered(misfit, n, o) + 3 * o.freedom + (len(own) - 1) * MATERIAL_COST
    changes, radiance = [], t.before
    for i, (m, each) in enumerate(own):
        delta = x[3 * i : 3 * i + 3]
        radiance = radiance + delta * each.dabs.u[:, each.own]
        c = Candidate(freed, delta_diffuse=delta, level=each.own, freedoms=3 if o.norm != "l2" else 7)
        changes.append(Change.of(m, c, each))
    cost += _unmet(radiance, receivers)
    return Explanation(f"{'+'.join(freed)} of all in sight", float(cost), tuple(changes), t)


def _shared(best: Explanation, explanations: list[Explanation]) -> Explanation:
    """Where the diffuse colours of several materials would do about as well, all in sight take their share."""
    near = [e for e in explanations if e.is_admitted and e.cost - best.cost < AMBIGUOUS and len(e.changes) == 1]
    materials = {e.changes[0].material for e in near if e.changes[0].candidate.freed == ("diffuse",)}
    joint = next((e for e in explanations if len(e.changes) > 1), None)
    if joint is None or len(materials) < 2 or best.changes[0].candidate.freed != ("diffuse",):
        return best
    cost = joint.cost - (len(joint.changes) - 1) * MATERIAL_COST
    return joint if cost < best.cost + AMBIGUOUS else best


def _choose(
    explanations: list[Explanation], asked: str, is_met: bool, is_mixed: bool, where: str
) -> Explanation:
    """The explanation that was asked for by its id or by its parameters alone, or the cheapest."""
    if not asked:
        if is_met:
            return explanations[0]
        # what is not met is wanted, however small
        best = next(e for e in explanations if e.changes)
        return _shared(best, explanations) if is_mixed else best
    name = asked.replace("@", " of ", 1)
    for e in explanations:
        if name in (e.id, e.id.split(" of ")[0]):
            return e
    known = ", ".join(e.id for e in explanations)
    raise StrokeError(f"{where}: there is no alternative '{asked}'; choose one of {known}")


# ── fit ──────────────────────────────────────────────────────────────────────────────────────────


def _fit(
    e: Explanation, receivers: list[Receiver], start: Surface, field: LightField, options: Options, bounces: int
) -> Fitted:
    if not e.changes:
        return Fitted((), (mean_error(receivers, radiance_of(receivers, field)),), radiance_of(receivers, field), start)
    fitted = fit_changes(e.changes, receivers, e.tables, start, field, options, bounces)
    visible = tuple(c for c in fitted.changes if np.abs(c.vector).max() > SEEN)
    if len(visible) < len(fitted.changes) and visible:
        fitted = fit_changes(visible, receivers, e.tables, start, field, options, bounces)
    return fitted


def _add_materials(
    fitted: Fitted, chosen: Explanation, receivers: list[Receiver], start: Surface, materials: list[int], scene: Scene,
    field: LightField, options: Options, bounces: int,
) -> Fitted:  # fmt: skip
    """Asks further materials while the strokes are not met and it helps."""
    error = mean_error(receivers, fitted.radiance)
    while error >= MET and len(fitted.changes) < MOST_CHANGES:
        free = [m for m in materials if m not in {c.material for c in fitted.changes}]
        if not free:
            break
        found = _explanations(receivers, free, scene, field, options)
        more = [e for e in found if len(e.changes) == 1]
        if not more:
            break
        tried = fit_changes(
            [*fitted.changes, *more[0].changes], receivers, chosen.tables, start, field, options, bounces
        )
        left = mean_error(receivers, tried.radiance)
        if left > BETTER * error:
            field.set_surface(fitted.surface)
            for _ in field.converge(bounces):
                pass
            break
        fitted, error = tried, left
    return fitted


# ── what is said ─────────────────────────────────────────────────────────────────────────────────


def _answers(
    fitted: Fitted, chosen: Explanation, alternatives: tuple[Alternative, ...], note: str, wanted: list[int],
    before: F64, painted: list[Painted], evidence: list, field: LightField,
) -> list[Answer]:  # fmt: skip
    """One answer for each changed material, and one for each stroke that no change serves."""
    t = chosen.tables
    counts = [len(evidence[i].target) for i in wanted]
    ends = np.cumsum(counts)
    spans = {i: slice(e - c, e) for i, e, c in zip(wanted, ends, counts, strict=True)}
    total = int(ends[-1])
    errors = [relative_rms(x[:total], t.target[:total], t.scale[:total]) for x in (before, fitted.radiance)]
    answers: list[Answer] = []
    serves = _serves(fitted, wanted, spans, field, painted)
    for c, strokes in zip(fitted.changes, serves, strict=True):
        tables = replace(t, diffuse=c.diffuse, f0=c.f0, roughness=c.roughness, is_metal=c.is_metal)
        old, new = means_of(tables, c.candidate)
        pool = Pool(c.material, "material", (), strokes)
        answers.append(
            Answer(
                pool, c.candidate, (c.candidate,), tables, old, new, errors[0], errors[1], fitted.rounds,
                others=alternatives, note=note,
            )
        )  # fmt: skip
    reached = {i for strokes in serves for i in strokes}
    for i in wanted:
        if i not in reached:
            answers.append(replace(_no_change(i, painted, evidence, field), others=alternatives, note=note))
    return answers


def _serves(
    fitted: Fitted, wanted: list[int], spans: dict[int, slice], field: LightField, painted: list[Painted]
) -> list[tuple[int, ...]]:
    """Which strokes each change is made for: those that see its material enough."""
    out = []
    for c in fitted.changes:
        shares = {i: _share(painted[i], c.material, field) for i in wanted}
        most = max(shares.values(), default=0.0)
        out.append(tuple(i for i in wanted if shares[i] > SERVES * most) or tuple(wanted))
    return out


def _share(painted: Painted, material: int, field: LightField) -> float:
    """How many of a stroke's rays meet a material."""
    links = field.device.download(painted.samples.links_d)[:, 0]
    met = element_of(links[is_link(links)])
    return float((field.elements.material[met] == material).sum()) / max(len(links), 1)


def _no_change(i: int, painted: list[Painted], evidence: list, field: LightField) -> Answer:
    """The answer of a stroke that changes nothing."""
    values, counts = np.unique(evidence[i].material, return_counts=True)
    material = int(values[counts.argmax()])
    t = pool_tables([evidence[i]], material, field.model)
    none = Candidate((), level=t.own)
    before, _ = means_of(t, none)
    error = relative_error(t, none)
    return Answer(Pool(material, "material", (), (i,), True), none, (none,), t, before, before, error, error, ())


def _look(e: Explanation) -> tuple:
    """What an explanation does, as far as it is seen: to shine like a metal or to be one is alike."""
    freed = lambda c: tuple(g for g in c.freed if g != "diffuse" or not c.is_metallic)  # noqa: E731
    return tuple((c.material, freed(c.candidate)) for c in e.changes)


def _is_tie(e: Explanation, chosen: Explanation) -> bool:
    """Whether another explanation is as good as the chosen one, and not the same in other words."""
    is_near = e.is_admitted and abs(e.cost - chosen.cost) < AMBIGUOUS and len(e.changes) == 1
    return is_near and bool(chosen.changes) and _look(e) != _look(chosen)


def _alternative(e: Explanation, scene: Scene, is_chosen: bool, is_tie: bool) -> Alternative:
    first = e.changes[0] if e.changes else None
    after: dict[str, NDArray] = {}
    if first is not None:
        after = means_after(first.candidate, first.diffuse, first.f0, np.array([first.roughness]))
    materials = tuple(scene.materials[c.material].path for c in e.changes)
    return Alternative(e.id, e.cost if e.is_admitted else None, materials, after, is_chosen, is_tie)


def _nothing_in_sight(receivers: list[Receiver], scene: Scene, kept: set[int]) -> str:
    """Why no material can be asked."""
    seen = {m for r in receivers for m in r.sees}
    reasons = {scene.materials[m].why_not_editable for m in seen - kept} - {""}
    if reasons:
        return f"nothing that may change is in sight of the stroke ({sorted(reasons)[0]}); paint a direct one"
    if seen:
        return "the stroke sees only its own material and fixated ones, nothing that may change is in sight"
    return "nothing that may change is in sight of the stroke; paint a direct one"


def _reason(fitted: Fitted, receivers: list[Receiver], chosen: Explanation, field: LightField) -> str:
    """Why the strokes cannot be met."""
    at_bound = [c for c in fitted.changes if _is_at_bound(c)]
    n = sum(len(r.target) for r in receivers if not r.is_held)
    got, target = fitted.radiance[:n], chosen.tables.target[:n]
    is_short = bool(got.mean() < target.mean())
    if at_bound and is_short:
        return "what it sees reflects all it can: there is not enough light for more"
    if at_bound:
        return "what it sees reflects nothing any more: the rest comes from elsewhere"
    if any(r.is_held for r in receivers):
        return "more would change what other strokes hold"
    return "no reflectance of what is in sight gives this colour"


def _is_at_bound(c: Change) -> bool:
    low, high = c.bounds
    x = c.vector
    return bool(len(x)) and bool((((x - low) < 2e-3) | ((high - x) < 2e-3)).any())


def _with_answers(painted: Painted, direct: Sequence[Answer], scene: Scene) -> Painted:
    """A stroke whose samples have the reflectance that direct strokes found."""
    s = painted.samples.surface
    for a in direct:
        c = a.chosen
        if not c.freed:
            continue
        rows = s.material == a.pool.material
        if a.pool.targets:
            rows &= np.isin(s.mesh, [i for i, m in enumerate(scene.meshes) if m.path in a.pool.targets])
        new = vars(c.apply(Parameters.of(s), a.tables.is_metal))
        there = {k: rows if x.ndim == 1 else rows[:, None] for k, x in new.items()}
        s = replace(s, **{k: np.where(there[k], x, getattr(s, k)).astype(np.float32) for k, x in new.items()})
    return replace(painted, samples=replace(painted.samples, surface=s))
