"""Infer, for indirect strokes: which other materials have to change so that a stroke's area looks as painted.

The cheapest explanation (explanations.py), or the one that was chosen, is fitted under all bounces; where the stroke's
radiance is still not met, the next material is asked on top of it and all are fitted together.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from usdslf.errors import SolveError
from usdslf.inference.answers import Alternative, Answer, Painted, Pool, means_of
from usdslf.inference.bilinear import Tables, pool_tables
from usdslf.inference.candidate import Candidate
from usdslf.inference.evidence import Evidence
from usdslf.inference.explanations import (
    Explanation,
    as_alternative,
    choose_explanation,
    find_explanations,
    is_tie,
)
from usdslf.inference.joint_fit import MET, Change, Fitted, fit_changes, mean_error, radiance_of
from usdslf.inference.pools import fixed_materials
from usdslf.inference.receivers import F64, Receiver, make_receiver, materials_in_sight
from usdslf.inference.residuals import relative_rms
from usdslf.inference.solve import relative_error
from usdslf.inference.tools import asks_for_nothing, expected_error
from usdslf.inference.weights import Options
from usdslf.light_field.light_field import LightField
from usdslf.light_field.links import element_of, is_link
from usdslf.light_field.surface import Surface
from usdslf.scene.records import Scene
from usdslf.strokes.remarks import About, Remark
from usdslf.strokes.stroke import Stroke
from usdslf.surfaces.reflectance import Parameters

# Light that went through the bins of two surfaces is foreseen worse, dab by dab, than what arrives directly; what is
# asked for is far from what is there, so that errors count by their squares for longer.
DAB_ERROR, DRIFT_ERROR, TINT_ERROR, OUTLIER, TAIL = 0.15, 0.05, 0.03, 100.0, 8.0
MOST_CHANGES = 4  # materials that are asked one after the other
BETTER = 0.8  # of the error that is left, for another material to be worth while
SEEN = 0.01  # change of a reflectance that is said
SERVES = 0.1  # share of the largest change of a stroke, for a material to count as changed for it


@dataclass(frozen=True)
class _Strokes:
    """All strokes, and which of them (rows) ask for light, hold theirs or do neither."""

    painted: list[Painted]
    evidence: list[Evidence]
    wanted: list[int]
    held: list[int]
    idle: list[int]

    @staticmethod
    def of(painted: list[Painted], field: LightField) -> _Strokes:
        """Sorts them.  A direct stroke's area has what it asked for: it holds it."""
        wanted = [i for i, p in enumerate(painted) if p.stroke.mode == "indirect" and not asks_for_nothing(p.stroke)]
        fixing = [i for i, p in enumerate(painted) if asks_for_nothing(p.stroke) and p.stroke.tool == "fixate"]
        held = fixing + [i for i, p in enumerate(painted) if p.stroke.mode == "direct" and i not in fixing]
        idle = [i for i, p in enumerate(painted) if p.stroke.mode == "indirect" and i not in wanted]
        return _Strokes(painted, [p.evidence(field) for p in painted], wanted, held, idle)

    @property
    def asking(self) -> list[Stroke]:
        """The strokes that ask for light."""
        return [self.painted[i].stroke for i in self.wanted]

    @property
    def paths(self) -> tuple[str, ...]:
        """Their prims."""
        return tuple(s.path for s in self.asking)

    @property
    def kept(self) -> set[int]:
        """Materials that stay: those that ask, and fixated ones."""
        return {int(m) for i in self.wanted for m in np.unique(self.evidence[i].material)} | set(
            fixed_materials(self.evidence)
        )


@dataclass(frozen=True)
class _Question:
    """What is asked of which materials, and under what."""

    receivers: list[Receiver]  # those that ask, then those that hold
    materials: list[int]  # in sight, that may change
    scene: Scene
    field: LightField
    start: Surface  # the reflectance that changes count from
    options: Options
    bounces: int

    @staticmethod
    def of(
        strokes: _Strokes, kept: set[int], scene: Scene, field: LightField, options: Options, bounces: int
    ) -> _Question:
        """The question of some strokes to all materials in sight but those that are kept."""
        painted, evidence = strokes.painted, strokes.evidence
        asking = [make_receiver(painted[i], evidence[i], field, False) for i in strokes.wanted]
        holding = [make_receiver(painted[i], evidence[i], field, True) for i in strokes.held]
        materials = materials_in_sight(asking, scene, kept)
        return _Question([*asking, *holding], materials, scene, field, field.surface, options, bounces)

    @property
    def asking(self) -> list[Receiver]:
        """The receivers that ask."""
        return [r for r in self.receivers if not r.is_held]

    def fit(self, changes: Sequence[Change], tables: Tables) -> Fitted:
        """Fits changes to it; the light field is left with them."""
        return fit_changes(changes, self.receivers, tables, self.start, self.field, self.options, self.bounces)


@dataclass(frozen=True)
class _Found:
    """What the strokes that ask were answered by."""

    fitted: Fitted
    chosen: Explanation
    alternatives: tuple[Alternative, ...]
    note: str
    before: F64  # (n, 3) radiance of all receivers' dabs


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
    strokes = _Strokes.of([_with_answers(p, direct, scene) for p in painted], field)
    answers = [_no_change(i, strokes.evidence, field) for i in strokes.idle]
    if not strokes.wanted:
        return answers
    kept = strokes.kept | {a.pool.material for a in direct if a.chosen.freed}
    q = _Question.of(strokes, kept, scene, field, _weights(options or Options(), strokes.asking), bounces)
    if not q.materials:
        note = _nothing_in_sight(q.asking, scene, kept)
        if not any(a.chosen.freed for a in direct):
            raise SolveError(f"{', '.join(strokes.paths)}: {note}")
        said.append(Remark(strokes.paths, note, About.PAINT))  # what the direct strokes found stands
        return answers + [replace(_no_change(i, strokes.evidence, field), note=note) for i in strokes.wanted]
    asked = next((w for s in strokes.asking if (w := (choose or {}).get(s.name) or s.choice)), "")
    return answers + _answers(_find(q, strokes.paths, asked, said), strokes, field)


def _find(q: _Question, paths: Sequence[str], asked: str, said: list[str]) -> _Found:
    """The cheapest explanation or the one that was asked for, fitted; the light field is left with it."""
    before = radiance_of(q.receivers, q.field)
    explanations = find_explanations(q.receivers, q.materials, q.scene, q.field, q.options)
    is_met = mean_error(q.receivers, before) < MET
    chosen = choose_explanation(explanations, asked, is_met, q.options.norm == "mixed", ", ".join(paths))
    fitted = _fit(chosen, q)
    tied = [e.id for e in explanations if not asked and is_tie(e, chosen)]
    if not asked and chosen.changes:
        ties = [str(e) for e in tied if e != chosen.id]
        if ties:
            what = f"{chosen.id} and {' and '.join(ties[:3])} explain it about equally well; "
            said.append(Remark(paths, f"{what}add fixate strokes or choose one", About.TIE))
        fitted = _add_materials(fitted, chosen, q)
    error = mean_error(q.receivers, fitted.radiance)
    note = f"met within {error:.1%}"
    if error >= MET:
        note = f"the painted radiance is met within {error:.1%} only; {_reason(fitted, q.receivers, chosen)}"
        said.append(Remark(paths, note, About.PAINT))
    alternatives = tuple(as_alternative(e, q.scene, e.id == chosen.id, e.id in tied) for e in explanations)
    return _Found(fitted, chosen, alternatives, note, before)


def _weights(options: Options, asking: list[Stroke]) -> Options:
    """The weights for light that went through two surfaces, by the norm that the strokes agree on."""
    norms = {s.norm for s in asking} - {"mixed"}
    options = replace(options, norm=norms.pop()) if len(norms) == 1 else options
    return replace(
        options, dab_error=max(DAB_ERROR, options.dab_error, expected_error(asking)), drift_error=DRIFT_ERROR,
        tint_error=TINT_ERROR, outlier=OUTLIER, tail=TAIL,
    )  # fmt: skip


def _fit(e: Explanation, q: _Question) -> Fitted:
    """An explanation fitted under all bounces, without the changes that nobody would see."""
    if not e.changes:
        now = radiance_of(q.receivers, q.field)
        return Fitted((), (mean_error(q.receivers, now),), now, q.start)
    fitted = q.fit(e.changes, e.tables)
    visible = tuple(c for c in fitted.changes if np.abs(c.vector).max() > SEEN)
    if len(visible) < len(fitted.changes) and visible:
        fitted = q.fit(visible, e.tables)
    return fitted


def _add_materials(fitted: Fitted, chosen: Explanation, q: _Question) -> Fitted:
    """Asks further materials while the strokes are not met and it helps."""
    error = mean_error(q.receivers, fitted.radiance)
    while error >= MET and len(fitted.changes) < MOST_CHANGES:
        free = [m for m in q.materials if m not in {c.material for c in fitted.changes}]
        if not free:
            break
        found = find_explanations(q.receivers, free, q.scene, q.field, q.options)
        more = [e for e in found if len(e.changes) == 1]
        if not more:
            break
        tried = q.fit([*fitted.changes, *more[0].changes], chosen.tables)
        left = mean_error(q.receivers, tried.radiance)
        if left > BETTER * error:
            q.field.set_surface(fitted.surface)
            for _ in q.field.converge(q.bounces):
                pass
            break
        fitted, error = tried, left
    return fitted


def _answers(found: _Found, strokes: _Strokes, field: LightField) -> list[Answer]:
    """One answer for each changed material, and one for each stroke that no change serves."""
    t, fitted, total = found.chosen.tables, found.fitted, sum(len(strokes.evidence[i].target) for i in strokes.wanted)
    before, after = (
        relative_rms(x[:total], t.target[:total], t.scale[:total]) for x in (found.before, fitted.radiance)
    )
    answers: list[Answer] = []
    serves = _serves(fitted, strokes, field)
    for c, served in zip(fitted.changes, serves, strict=True):
        tables = replace(t, diffuse=c.diffuse, f0=c.f0, roughness=c.roughness, is_metal=c.is_metal)
        old, new = means_of(tables, c.candidate)
        pool = Pool(c.material, "material", (), served)
        one = Answer(pool, c.candidate, (c.candidate,), tables, old, new, before, after, fitted.rounds)
        answers.append(replace(one, others=found.alternatives, note=found.note))
    reached = {i for served in serves for i in served}
    for i in strokes.wanted:
        if i not in reached:
            none = _no_change(i, strokes.evidence, field)
            answers.append(replace(none, others=found.alternatives, note=found.note))
    return answers


def _serves(fitted: Fitted, strokes: _Strokes, field: LightField) -> list[tuple[int, ...]]:
    """Which strokes each change is made for: those that see its material enough."""
    out, wanted = [], strokes.wanted
    for c in fitted.changes:
        shares = {i: _share(strokes.painted[i], c.material, field) for i in wanted}
        most = max(shares.values(), default=0.0)
        out.append(tuple(i for i in wanted if shares[i] > SERVES * most) or tuple(wanted))
    return out


def _share(painted: Painted, material: int, field: LightField) -> float:
    """How many of a stroke's rays meet a material."""
    links = field.device.download(painted.samples.light.links_d)[:, 0]
    met = element_of(links[is_link(links)])
    return float((field.elements.material[met] == material).sum()) / max(len(links), 1)


def _no_change(i: int, evidence: list[Evidence], field: LightField) -> Answer:
    """The answer of a stroke that changes nothing."""
    values, counts = np.unique(evidence[i].material, return_counts=True)
    material = int(values[counts.argmax()])
    t = pool_tables([evidence[i]], material, field.model)
    none = Candidate((), level=t.own)
    before, _ = means_of(t, none)
    error = relative_error(t, none)
    return Answer(Pool(material, "material", (), (i,), True), none, (none,), t, before, before, error, error, ())


def _nothing_in_sight(receivers: list[Receiver], scene: Scene, kept: set[int]) -> str:
    """Why no material can be asked."""
    seen = {m for r in receivers for m in r.sees}
    reasons = {scene.materials[m].why_not_editable for m in seen - kept} - {""}
    if reasons:
        return f"nothing that may change is in sight of the stroke ({sorted(reasons)[0]}); paint a direct one"
    if seen:
        return "the stroke sees only its own material and fixated ones, nothing that may change is in sight"
    return "nothing that may change is in sight of the stroke; paint a direct one"


def _reason(fitted: Fitted, receivers: list[Receiver], chosen: Explanation) -> str:
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
