"""Answers: what was asked together, what was inferred for it, and the elements' reflectance that it gives.

    Pool, Answer, Alternative, Painted
    means_of(tables, candidate) -> before, after
    changed_surface(original, field, scene, answers, painted) -> Surface
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from usdslf.errors import SolveError
from usdslf.inference.bilinear import Tables
from usdslf.inference.candidate import Candidate
from usdslf.inference.evidence import Evidence, build_evidence
from usdslf.inference.samples import Samples
from usdslf.inference.varying import Varying, VaryingAnswer
from usdslf.scene.records import Scene
from usdslf.similarity.similarity import Places
from usdslf.strokes.stroke import Stroke
from usdslf.surfaces.reflectance import Parameters

if TYPE_CHECKING:
    from usdslf.light_field.light_field import LightField
    from usdslf.light_field.surface import Surface

TIED_COST = 4.0  # cost between two explanations that is no difference


@dataclass(frozen=True)
class Pool:
    """What is asked together: one material in one scope."""

    material: int
    scope: str  # material | prim | stroke
    targets: tuple[str, ...]  # gprims of the scope; () for the whole material
    strokes: tuple[int, ...]  # into the strokes that were read
    is_held: bool = False  # asks for no change: a fixate stroke, or a strength of zero
    similar: tuple[int, ...] = ()  # materials that change by the same delta: what is similar to the painted places
    similar_in_part: tuple[int, ...] = ()  # materials that change where they are similar, and nowhere else


@dataclass(frozen=True)
class Alternative:
    """One of the explanations of an indirect stroke."""

    id: str  # "specular+glossiness of /World/mtl/ring"
    cost: float | None  # None: not admitted by the norm
    materials: tuple[str, ...]  # paths of what would change
    after: dict[str, NDArray]  # of the first of them, as in Answer; empty where nothing would change
    is_chosen: bool
    is_tie: bool  # explains it about as well as the chosen one, by another change


@dataclass(frozen=True)
class Answer:
    """What was inferred for one pool."""

    pool: Pool
    chosen: Candidate
    candidates: tuple[Candidate, ...]  # cheapest first
    tables: Tables  # at the last round
    before: dict[str, NDArray]  # diffuse (3,), specular (3,), roughness (1,): means over the painted area
    after: dict[str, NDArray]
    residual_before: float
    residual_after: float
    rounds: tuple[float, ...]  # residual after each round of bounces
    is_too_bright: bool = False  # so it seems before the light went round
    others: tuple[Alternative, ...] = ()  # of an indirect stroke: explanations by all materials in sight
    note: str = ""  # of an indirect stroke: how well its radiance is met, or why it cannot be
    varied: tuple[VaryingAnswer, ...] = ()  # the best of each parameter that could be stored, for choosing
    onto_similar: Varying | None = None  # the change as it goes on to what is partly similar
    varying: Varying | None = None  # where the change varies over the surface; `chosen` holds its mean
    # by candidate: what choosing it gives in the light as it is, means as in `after`; only candidates that can be
    if_chosen: Mapping[str, dict[str, NDArray]] = field(default_factory=dict)

    @property
    def is_ambiguous(self) -> bool:
        """Whether another explanation costs about the same."""
        if self.others:
            return any(a.is_tie for a in self.others)
        return bool(self.ties)

    @property
    def ties(self) -> tuple[str, ...]:
        """Names of the other candidates that cost about the same, the cheapest first."""
        others = (c for c in self.candidates if c.id != self.chosen.id and c.is_admitted)
        return tuple(c.id for c in others if abs(c.cost - self.chosen.cost) < TIED_COST)

    def as_chosen(self, id_: str) -> Answer:
        """Returns what it would be by another explanation, before the light that its change sends round.

        Raises: SolveError where there is none of that id, or it is of an indirect stroke, whose materials are found
            by solving.
        """
        varied = next((a for a in self.varied if a.id == id_), None)
        c = next((c for c in self.candidates if c.id == id_), varied.mean if varied else None)
        if c is None or self.others:
            known = ", ".join([*(c.id for c in self.candidates), *(a.id for a in self.varied)])
            raise SolveError(f"there is no alternative '{id_}' that can be had without solving; choose one of {known}")
        after = self.if_chosen.get(id_) or means_of(self.tables, c)[1]
        return replace(self, chosen=c, after=after, varying=varied.varying if varied else None, onto_similar=None)


@dataclass
class Painted:
    """A stroke with its samples: what stays from round to round."""

    stroke: Stroke
    samples: Samples
    rows: NDArray  # of the stroke, per dab
    wanted: NDArray | None = None  # (n, 3) what its tool asks of the light before any edit; None: its colours
    name: str = ""  # of all that it was gathered from, on its shot; "" where that is not known

    def evidence(self, field: LightField, is_weighed: bool = True, on_levels: bool = False) -> Evidence:
        """The evidence under the light of now.

        Args:
            is_weighed: explanations will be weighed by it, for which all levels and unpainted directions count.
            on_levels: all levels do in any case.
        """
        return build_evidence(
            self.stroke, self.rows, self.samples, field, self.wanted, is_weighed, is_weighed or on_levels
        )


def means_of(t: Tables, c: Candidate) -> tuple[dict[str, NDArray], dict[str, NDArray]]:
    """Returns mean diffuse, specular and roughness over the painted area, before and after a candidate."""
    roughness = np.array([t.roughness])
    return means_after(Candidate(()), t.diffuse, t.f0, roughness), means_after(c, t.diffuse, t.f0, roughness)


def means_after(c: Candidate, diffuse: NDArray, f0: NDArray, roughness: NDArray) -> dict[str, NDArray]:
    """Returns what becomes of mean diffuse (3,), specular (3,) and roughness (1,), by those names."""
    return {
        "diffuse": c.diffuse_of(diffuse), "specular": c.f0_of(f0), "roughness": c.roughness_of(roughness),
    }  # fmt: skip


def means_of_similar(answer: Answer, material: int, field: LightField) -> tuple[dict[str, NDArray], dict[str, NDArray]]:
    """Returns mean diffuse, specular and roughness of a material that is alike, before and after the same change.

    Args:
        field: with the reflectance of before.
    """
    rows, s, c = field.elements.material == material, field.surface, answer.chosen
    weight = field.elements.area[rows].astype(np.float64)
    mean = lambda x: np.average(np.asarray(x, np.float64)[rows], axis=0, weights=weight)  # noqa: E731
    d, f0, roughness = mean(s.diffuse), mean(s.f0), np.atleast_1d(mean(s.roughness))
    before = means_after(Candidate(()), d, f0, roughness)
    if answer.onto_similar and material in answer.pool.similar_in_part:
        s = _varied_surface(s, s, answer, answer.onto_similar, field, rows)
        d, f0, roughness = mean(s.diffuse), mean(s.f0), np.atleast_1d(mean(s.roughness))
        return before, means_after(Candidate(()), d, f0, roughness)
    return before, means_after(c, d, f0, roughness)


def changed_surface(
    original: Surface, field: LightField, scene: Scene, answers: list[Answer], painted: list[Painted]
) -> Surface:
    """Returns the elements' reflectance with all answers applied."""
    surface = original
    for a in answers:
        if not a.chosen.freed:
            continue
        rows = scope_rows(a.pool, field, scene, painted)
        alike = np.isin(field.elements.material, a.pool.similar)
        if a.varying:
            surface = _varied_surface(surface, original, a, a.varying, field, rows)
            rows = alike  # which change by the mean of it
        else:
            rows = rows | alike
        if a.onto_similar:
            there = np.isin(field.elements.material, a.pool.similar_in_part)
            surface = _varied_surface(surface, original, a, a.onto_similar, field, there)
        surface = surface.with_rows(rows, **vars(a.chosen.apply(Parameters.of(original, rows), a.tables.is_metal)))
    return surface


def _varied_surface(
    surface: Surface, original: Surface, answer: Answer, varying: Varying, field: LightField, rows: NDArray
) -> Surface:
    """The elements' reflectance with a change that varies on some of them."""
    s, e = original, field.elements
    delta = varying.at(Places(e.position[rows], e.geometric_normal[rows], Parameters.of(s, rows).packed))
    if varying.parameter == "glossiness":
        return surface.with_rows(rows, roughness=s.roughness[rows] + delta[:, 0])
    if varying.parameter == "diffuse":
        return surface.with_rows(rows, diffuse=s.diffuse[rows] + delta)
    f0 = s.f0[rows] + delta
    return surface.with_rows(rows, f0=f0, f90=f0 if answer.tables.is_metal else s.f90[rows])


def scope_rows(pool: Pool, field: LightField, scene: Scene, painted: list[Painted]) -> NDArray[np.bool_]:
    """Returns which elements (N,) a pool's change covers."""
    elements = field.elements
    rows = elements.material == pool.material
    if pool.scope in ("prim", "stroke"):
        paths = np.array([m.path in pool.targets for m in scene.meshes])
        rows &= paths[elements.mesh]
    if pool.scope == "stroke":
        near = np.zeros(len(rows), bool)
        for i in pool.strokes:
            s = painted[i].stroke
            for first in range(0, len(s.points), 64):
                gap = elements.position[:, None] - s.points[None, first : first + 64]
                near |= (np.linalg.norm(gap, axis=2) < 0.5 * s.widths[None, first : first + 64] + 1e-9).any(1)
        rows &= near
    return rows
