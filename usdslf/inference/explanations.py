"""Explanations: which changes of other materials would make indirect strokes' areas look as painted.

    find_explanations(receivers, materials, scene, field, options) -> list[Explanation], cheapest first
    choose_explanation(explanations, asked, ...) -> Explanation
    as_alternative(explanation, ...) -> Alternative as it is reported

Every material in sight is asked with every candidate, and all of them together with their diffuse colours.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from usdslf.edits.whole_set import Colored, colored_specular
from usdslf.errors import StrokeError
from usdslf.inference.answers import Alternative, means_after
from usdslf.inference.bilinear import Tables
from usdslf.inference.candidate import Candidate
from usdslf.inference.joint_fit import MET, Change, mean_error
from usdslf.inference.least_squares import bounded_least_squares
from usdslf.inference.receivers import F64, Receiver, receiver_tables
from usdslf.inference.solve import enumerate_candidates, tempered
from usdslf.inference.weights import Options
from usdslf.inference.whitening import whiten
from usdslf.light_field.light_field import LightField
from usdslf.scene.records import Scene

UNMET_COST = 1.0  # of each percent beyond MET by which an explanation is foreseen to miss a stroke's mean
MOST_UNMET = 40.0
MATERIAL_COST = 4.0  # of each material beside the first
TIED_COST = 5.0  # cost between two explanations that is no difference
MOST_DIELECTRIC = 0.3  # F0; no dielectric reflects as much
JOINT_REACH = 0.5  # of a reflectance, that counts as one dab's error where all in sight change together


@dataclass(frozen=True)
class Meaning:
    """What an explanation changes, in words: its id."""

    parameters: str  # specular+glossiness; none: nothing changes
    of: str = ""  # path of the material, or all in sight

    def __str__(self) -> str:
        """The id that reports say: `specular+glossiness of /World/mtl/ring`."""
        return f"{self.parameters} of {self.of}" if self.of else self.parameters

    def is_called(self, asked: str) -> bool:
        """Tells whether an artist's words mean it: the id, with @ for ` of ` too, or the parameters alone."""
        return asked.replace("@", " of ", 1) in (str(self), self.parameters)


@dataclass(frozen=True)
class Explanation:
    """One way to answer: changes of one material or of several."""

    id: Meaning
    cost: float
    changes: tuple[Change, ...]
    tables: Tables
    is_admitted: bool = True  # by the norm

    @property
    def rank(self) -> tuple[bool, float]:
        """What explanations are sorted by, the best first."""
        return not self.is_admitted, self.cost


def find_explanations(
    receivers: list[Receiver], materials: list[int], scene: Scene, field: LightField, options: Options
) -> list[Explanation]:
    """Returns all explanations by some materials under the light of now, cheapest first."""
    found: list[Explanation] = []
    own: list[tuple[int, Tables]] = []
    for m in materials:
        tables, as_metal = receiver_tables(receivers, m, field.surface, field)
        colored = colored_specular(scene.materials[m])
        tables = replace(tables, colored=colored)
        own.append((m, tables))
        candidates = [_plausible(c, tables, options) for c in enumerate_candidates(tables, options)]
        candidates = [replace(c, cost=c.cost + _unmet(c.radiance(tables), receivers)) for c in candidates]
        can_be_metal = colored is not Colored.NEVER and not scene.materials[m].use_specular_workflow
        if as_metal is not None and options.norm == "mixed" and can_be_metal:
            candidates += _as_metals(as_metal, tables, options, receivers)
        candidates.sort(key=lambda c: c.rank)
        for i, c in enumerate(candidates):
            if c.id in {other.id for other in candidates[:i]}:
                continue
            changes = (Change.of(m, c, tables),) if c.freed else ()
            name = Meaning(c.id, scene.materials[m].path if c.freed else "")
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
    return Explanation(Meaning("+".join(freed), "all in sight"), float(cost), tuple(changes), t)


def choose_explanation(
    explanations: list[Explanation], asked: str, is_met: bool, is_mixed: bool, where: str
) -> Explanation:
    """Returns the explanation that was asked for by its id or by its parameters alone, or the cheapest.

    Raises: StrokeError where none has that id.
    """
    if not asked:
        if is_met:
            return explanations[0]
        # what is not met is wanted, however small
        best = next(e for e in explanations if e.changes)
        return _shared(best, explanations) if is_mixed else best
    for e in explanations:
        if e.id.is_called(asked):
            return e
    known = ", ".join(str(e.id) for e in explanations)
    raise StrokeError(f"{where}: there is no alternative '{asked}'; choose one of {known}")


def _shared(best: Explanation, explanations: list[Explanation]) -> Explanation:
    """Where the diffuse colours of several materials would do about as well, all in sight take their share."""
    near = [e for e in explanations if e.is_admitted and e.cost - best.cost < TIED_COST and len(e.changes) == 1]
    materials = {e.changes[0].material for e in near if e.changes[0].candidate.freed == ("diffuse",)}
    joint = next((e for e in explanations if len(e.changes) > 1), None)
    if joint is None or len(materials) < 2 or best.changes[0].candidate.freed != ("diffuse",):
        return best
    cost = joint.cost - (len(joint.changes) - 1) * MATERIAL_COST
    return joint if cost < best.cost + TIED_COST else best


def _look(e: Explanation) -> tuple:
    """What an explanation does, as far as it is seen: to shine like a metal or to be one is alike."""
    freed = lambda c: tuple(g for g in c.freed if g != "diffuse" or not c.is_metallic)  # noqa: E731
    return tuple((c.material, freed(c.candidate)) for c in e.changes)


def is_tie(e: Explanation, chosen: Explanation) -> bool:
    """Tells whether another explanation is as good as the chosen one, and not the same in other words."""
    is_near = e.is_admitted and abs(e.cost - chosen.cost) < TIED_COST and len(e.changes) == 1
    return is_near and bool(chosen.changes) and _look(e) != _look(chosen)


def as_alternative(e: Explanation, scene: Scene, is_chosen: bool, is_tie: bool) -> Alternative:
    """Returns an explanation as it is reported."""
    first = e.changes[0] if e.changes else None
    after: dict[str, NDArray] = {}
    if first is not None:
        after = means_after(first.candidate, first.diffuse, first.f0, np.array([first.roughness]))
    materials = tuple(scene.materials[c.material].path for c in e.changes)
    return Alternative(str(e.id), e.cost if e.is_admitted else None, materials, after, is_chosen, is_tie)
