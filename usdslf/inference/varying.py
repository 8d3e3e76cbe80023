"""Answers that vary over a surface, where the strokes ask for it: a gradient, a picture, a soft edge.

One parameter v (diffuse or specular colour, a grey specular, roughness) gets a quantity q of its own at each dab:

    add   v + q              factor   v (1 + q), for what is textured              value   q, in place of a texture

smoothed over the stroke: q_i is the value at i of the plane through q*_j with weights K_ij w_j, where q*_j alone would
give dab j what was painted, w_j = (dL_j/dq / scale_j)^2, and K is a Gaussian of one of LENGTHS of the stroke's extent.
Planes, unlike means, leave a gradient as it is up to its ends (Cleveland 1979).  Radiance is linear in colours, not
in roughness: there q* follows from the tangent, again and again (Gauss and Newton), from the best of even steps on.
Its freedoms are the trace of that smoother (Hastie and Tibshirani 1990); it competes with the constant answers by the
same cost, plus Options.variation: an uneven hand drifts and tints too, and that is no wish.  Between and beyond the
dabs the planes are blended by similarity (propagate.py), within the range of what the dabs have; far from them as at
their rim.

Source: Nguyen et al. 2013, 4.3 and 5.3; Schwarz 1978.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from usdslf.inference.attainable import error_of
from usdslf.inference.bilinear import Tables
from usdslf.inference.candidate import Candidate
from usdslf.inference.evidence import Evidence, mean_by
from usdslf.inference.fit import Problem
from usdslf.inference.planes import nearness, planes
from usdslf.inference.solve import refit, refit_problem, score
from usdslf.inference.weights import Options
from usdslf.sampling.nearest import tree_of
from usdslf.scene.records import F64
from usdslf.similarity.similarity import Places, Weights, blocks, reach_of, shares
from usdslf.surfaces.reflectance import COLUMNS, Parameters

if TYPE_CHECKING:
    from scipy.spatial import cKDTree

LENGTHS = (0.5, 0.25, 0.12, 0.06, 0.03)  # of smoothing, in the stroke's extent
FEWEST = 6  # dabs that can say that something varies
LEAST_STEP = 0.04  # of a reflectance or roughness, between dabs, for a change to vary
NEAR = Weights(position=4.0, normal=0.5, reflectance=1.0)  # between dabs, the nearest decide
HOPELESS, NEARER = 0.35, 0.4  # relative error of a constant, and share of it that is left, to vary at any cost
OVER_TEXTURE = 10.0  # cost of a texture that is painted over
LEADS = 0.25  # lengths beyond the dabs that a gradient goes on
DARKEST = 0.02  # reflectance that a factor can be told from
NEWTON, LONGEST_STEP = 6, 0.15  # rounds for roughness, and how far one goes


@dataclass(frozen=True)
class Varying:
    """A change that varies: known at the n dabs of a pool.  C is 1 for roughness and a grey specular, else 3."""

    parameter: str  # diffuse | specular | glossiness
    form: str  # add | factor | value
    length: float  # of smoothing [stage units]
    q: F64  # (n, C)
    slope: F64  # (n, C, 3) of q along each axis [1 / stage units]
    places: Places  # (n)
    reach: float  # of propagation [stage units]
    is_gated: bool = False  # fades where nothing painted is near: of strokes that change only what they cover
    weights: Weights = NEAR
    is_noisy: bool = False  # whether it is worth having where it is met on the whole

    @property
    def is_grey(self) -> bool:
        """Whether it is a specular change with one value for all channels."""
        return self.parameter == "specular" and self.q.shape[1] == 1

    def at(self, x: Places) -> F64:
        """Returns the change of the parameter (k, 3), of roughness (k, 1), at places, held to what is possible."""
        out = np.empty((len(x), 1 if self.parameter == "glossiness" else 3))
        for rows in blocks(len(x), len(self.places)):
            out[rows] = self._at(x.rows(rows))
        return out

    def _at(self, x: Places) -> F64:
        # beyond the dabs, the next ones decide as they do among them, and their planes lead on only so far
        off = self._tree.query(x.position)[0]
        k, opened = shares(x, self.places, self.reach if self.is_gated else np.maximum(self.reach, off), self.weights)
        leads = np.exp(-0.5 * np.square(np.maximum(off - self.reach, 0) / (LEADS * self.length)))
        q, start, slope = np.split(k @ self._about_middle, [self.q.shape[1], 2 * self.q.shape[1]], axis=1)
        way = (x.position - self._middle)[:, None]
        q = q + leads[:, None] * ((way * slope.reshape(len(x), -1, 3)).sum(2) - start)
        q = np.clip(q, self.q.min(0), self.q.max(0))
        change = _changed(self, q, _value(self, x)) - _value(self, x)
        return change * opened[:, None] if self.is_gated else change

    @cached_property
    def _tree(self) -> cKDTree:
        """The dabs, for the nearest of them."""
        return tree_of(self.places.position)

    @cached_property
    def _middle(self) -> F64:
        """Middle (3,) of the dabs: about the origin, products would lose what is far from it."""
        return np.asarray(self.places.position.mean(0, dtype=np.float64))

    @cached_property
    def _about_middle(self) -> F64:
        """Of the plane of each dab (n, C + C + 3 C): its value there, and its offset and slopes about the middle."""
        at = (self.places.position - self._middle)[:, None]
        return np.concatenate([self.q, (at * self.slope).sum(2), self.slope.reshape(len(self.q), -1)], 1)

    def of_dabs(self) -> F64:
        """Returns the change of the parameter (n, 3), of roughness (n, 1), at the dabs themselves."""
        return _changed(self, self.q, _value(self, self.places)) - _value(self, self.places)

    @property
    def is_even(self) -> bool:
        """Whether it is the same change, or factor, everywhere."""
        return not (self.is_gated or self.slope.any() or np.ptp(self.q, axis=0).any())

    @property
    def mean(self) -> F64:
        """Mean change (3,) or (1,) over the dabs."""
        return self.of_dabs().mean(0)

    def moved(self, mean: F64) -> Varying:
        """Returns the change with about another mean."""
        step = (np.asarray(mean, np.float64) - self.mean)[: self.q.shape[1]]
        if self.form == "factor":
            step = step / np.maximum(_value(self, self.places).mean(0), DARKEST)
        return replace(self, q=self.q + step)


def _value(v: Varying, x: Places) -> F64:
    """The parameter (k, C) as it is."""
    return np.asarray(x.reflectance[:, COLUMNS[v.parameter]], np.float64)


def _changed(v: Varying, q: F64, value: F64) -> F64:
    new = {"add": value + q, "factor": value * (1 + q), "value": q + 0 * value}[v.form]
    return np.clip(new, 0.001 if v.parameter == "glossiness" else 0, 1)


def as_varying(c: Candidate, v: Varying | None, places: Places, reach: float, weights: Weights) -> Varying | None:
    """Returns a change as it goes on to all that is similar to the dabs; None where it has several parameters.

    Args:
        c, v: the constant change, or the one that varies.
    """
    if v is not None:
        return replace(v, places=places, reach=reach, weights=weights, is_gated=True)
    if len(c.freed) != 1:
        return None
    q = np.tile(c.delta_of(c.freed[0]), (len(places), 1))
    is_factor = c.is_factor
    if c.freed[0] == "glossiness":
        is_factor = c.roughness_mean > 0
        q = q / c.roughness_mean if is_factor else q
    form = "factor" if is_factor else "add"
    return Varying(c.freed[0], form, reach, q, np.zeros((*q.shape, 3)), places, reach, True, weights)


def as_even(c: Candidate) -> Varying:
    """Returns a constant change of one parameter as one of each place."""
    nowhere = Places(np.zeros((1, 3)), np.array([[0.0, 0.0, 1.0]]), np.zeros((1, 7)))
    even = as_varying(c, None, nowhere, 1.0, NEAR)
    assert even is not None, c.freed
    return replace(even, is_gated=False)


def places_of_dabs(evidences: Sequence[Evidence], material: int) -> Places:
    """Returns the places of the dabs on a material, in the order of `pool_tables`."""
    parts: list[tuple[F64, F64, F64]] = []
    for e in evidences:
        s, n = e.surface, len(e.target)
        here = np.flatnonzero(e.material == material)
        rows = (s.position, s.geometric_normal, Parameters.of(s).packed)
        parts.append(tuple(mean_by(x.astype(np.float64), e.dab_of_sample)[:n][here] for x in rows))  # type: ignore[arg-type]
    position, normal, reflectance = (np.concatenate(x) for x in zip(*parts, strict=True))
    normal = normal / np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-9)
    return Places(position, normal, reflectance)


@dataclass(frozen=True)
class VaryingAnswer:
    """A change that varies, as one of the explanations of a pool."""

    mean: Candidate  # its mean change, with the cost of the answer
    varying: Varying
    error_left_out: float  # relative, of dabs foreseen from the others

    @property
    def id(self) -> str:
        """Name in reports, and for choosing it."""
        return f"varying {self.varying.parameter}"


def varying_answers(
    problem: Problem, places: Places, brush: float, is_gated: bool = False
) -> list[VaryingAnswer]:
    """Returns answers that vary, best first, each with its cost as a candidate; none where no stroke can ask.

    Args:
        brush: width [stage units].
        is_gated: whether they fade where nothing painted is near.
    """
    t, o = problem.tables, problem.options
    n = len(t.target)
    if n < FEWEST or t.has_one_color.all():
        return []
    extent = float(np.linalg.norm(np.ptp(places.position, axis=0)))
    reach = reach_of(places.position, 0.5 * brush)
    found: list[VaryingAnswer] = []
    for parameter, form, channels in _forms(t, places):
        for share in LENGTHS:
            length = max(share * extent, 1e-9)
            near = reach if is_gated else min(reach, length)  # what fades has to be whole between the dabs
            zero, level = np.zeros((n, channels)), np.zeros((n, channels, 3))
            v = Varying(parameter, form, length, zero, level, places, near, is_gated)
            v, leverage = _smoothed(t, v)
            if np.ptp(v.q if form == "value" else v.of_dabs(), axis=0).max() < LEAST_STEP:
                continue
            misfit = float(problem.misfit(problem.white @ ((predicted_varying(t, v) - t.target) / t.scale).reshape(-1)))
            c = _as_candidate(t, v, misfit, round(float(leverage.sum())))
            c = replace(c, cost=score(t, o, c) + o.variation + OVER_TEXTURE * (form == "value"))
            found.append(VaryingAnswer(c, v, _error_left_out(t, v, leverage)))
    return sorted(found, key=lambda a: _plain_cost(o, a.mean) + OVER_TEXTURE * (a.varying.form == "value"))


@dataclass(frozen=True, eq=False)
class BestConstant:
    """The best constant answer of a pool, that those which vary are held against."""

    tables: Tables
    options: Options
    candidate: Candidate

    @cached_property
    def error(self) -> float:
        """Its relative error."""
        return error_of(self.tables, self.candidate)

    @cached_property
    def least_error(self) -> float:
        """The same where its parameters are fitted to the dabs alone."""
        return error_of(self.tables, refit(refit_problem(self.tables, self.options), self.candidate))


def asks_to_vary(a: VaryingAnswer, constant: BestConstant) -> bool:
    """Whether an answer that varies is better than the best constant one.

    By their costs, if it foresees each dab from the others better than the constant has it: a few dabs in a highlight
    may have all the freedoms.  Or where no constant comes near what was painted and this foresees it: of a picture in
    many colours the best constant is as far off everywhere, which passes for a painter's drift.  Of dabs that share a
    colour the mean has to be met, as in everything else.
    """
    if a.mean.cost < constant.candidate.cost and a.error_left_out < constant.error:
        return True
    return constant.least_error > HOPELESS and a.error_left_out < NEARER * constant.least_error


def _error_left_out(t: Tables, v: Varying, leverage: F64) -> float:
    """Error of the dabs where each is foreseen by a smoother that has not seen it (Hastie and Tibshirani 1990)."""
    r = (predicted_varying(t, v) - t.target) / t.scale
    own = leverage.mean(1, keepdims=True)
    return float(np.sqrt(np.mean((r / np.maximum(1 - own, 1e-3)) ** 2)))


def _plain_cost(o: Options, c: Candidate) -> float:
    return c.misfit + o.freedom * c.freedoms


def _forms(t: Tables, places: Places) -> list[tuple[str, str, int]]:
    """Which parameters can vary, how, and in how many channels."""
    textured = {k: np.ptp(places.reflectance[:, rows], axis=0).max() > LEAST_STEP for k, rows in COLUMNS.items()}
    of = lambda k: ("add", "factor", "value") if textured[k] or (k == "diffuse" and t.is_textured) else ("add",)  # noqa: E731
    forms = [] if t.is_metal else [("diffuse", form, 3) for form in of("diffuse")]
    forms += [("specular", form, 3) for form in of("specular")]
    if not t.is_metal:
        forms.append(("specular", "add", 1))
    return [*forms, ("glossiness", "add", 1)]


def refit_varying(t: Tables, v: Varying) -> Varying:
    """Fits a change that varies again, under the light that the tables were made with."""
    return _smoothed(t, v)[0]


def predicted_varying(t: Tables, v: Varying) -> F64:
    """Returns the radiance (n, 3) of the dabs with a change that varies."""
    if v.parameter == "glossiness":
        return _at_roughness(t, v.places.reflectance[:, 6] + v.of_dabs()[:, 0])[0]
    slope, base = _slope(t, v)
    q = np.broadcast_to(v.q, slope.shape)
    if v.form == "value":
        return t.before - base + q * slope
    return t.before + v.of_dabs() * slope if v.form == "add" else t.before + q * slope


def as_candidate(t: Tables, v: Varying, c: Candidate) -> Candidate:
    """Returns a candidate with the mean of the change, its cost as it was."""
    return replace(_as_candidate(t, v, c.misfit, c.freedoms), cost=c.cost)


def _as_candidate(t: Tables, v: Varying, misfit: float, freedoms: int) -> Candidate:
    mean, zero = v.mean, np.zeros(3)
    c = Candidate((v.parameter,), zero, zero, level=t.own, misfit=misfit, freedoms=freedoms)
    if v.parameter == "glossiness":
        level = int(np.abs(t.levels[:-1] - t.roughness - mean[0]).argmin())
        return replace(c, roughness_shift=float(mean[0]), level=level)
    mean = mean * np.ones(3)
    return replace(c, delta_diffuse=mean) if v.parameter == "diffuse" else replace(c, delta_f0=mean)


def _slope(t: Tables, v: Varying) -> tuple[F64, F64]:
    """dL/dq (n, 3) of a colour, and what the colour itself sends now (n, 3)."""
    if v.parameter == "diffuse":
        u, base = t.dabs.u[:, t.own], t.factor_u[:, t.own]
    else:
        u, base = t.dabs.v[:, t.own], t.factor_v[:, t.own]
    return (base if v.form == "factor" else u), base


def _smoothed(t: Tables, v: Varying) -> tuple[Varying, F64]:
    """The smoothed quantity of each dab, and its leverage (n, C): how much of it is the dab's own wish."""
    if v.parameter == "glossiness":
        return _smoothed_roughness(t, v)
    slope, base = _slope(t, v)
    asked = t.target - t.before + (base if v.form == "value" else 0)
    weight = (slope / t.scale) ** 2
    wanted = asked / np.where(np.abs(slope) > 1e-12, slope, 1e-12)
    value = _value(v, v.places)
    least, most = _range(v.form, value, t.most_diffuse if v.parameter == "diffuse" else 1.0)
    # what is out of reach must not pull at its neighbours
    wanted = np.clip(wanted, least - 1, np.minimum(most, 1 / DARKEST) + 1)
    if v.q.shape[1] == 1:
        wanted, weight = _as_one(wanted, weight)
        least, most = least.max(1, keepdims=True), most.min(1, keepdims=True)
    q, slopes, leverage = planes(v.places.position, v.length, wanted, weight)
    return replace(v, q=np.clip(q, least, most), slope=slopes), leverage


def _range(form: str, value: F64, most: float) -> tuple[F64, F64]:
    """Least and greatest quantity (n, C) that keeps a colour in 0..most; of a factor, that of the darkest."""
    zero = np.zeros_like(value)
    if form == "add":
        return -value, np.maximum(most - value, 0)
    return (zero, zero + most) if form == "value" else (zero - 1, most / np.maximum(value, DARKEST) - 1)


def _as_one(wanted: F64, weight: F64) -> tuple[F64, F64]:
    """What three channels want of one quantity (n, 1), and how much."""
    total = weight.sum(1, keepdims=True)
    return (weight * wanted).sum(1, keepdims=True) / np.maximum(total, 1e-30), total


# ---- roughness -------------------------------------------------------------------------------
def _smoothed_roughness(t: Tables, v: Varying) -> tuple[Varying, F64]:
    own = v.places.reflectance[:, 6].astype(np.float64)
    rho = own + v.q[:, 0] if v.q.any() else _best_step(t, v)
    leverage, slopes = np.zeros((len(own), 1)), v.slope
    for _ in range(NEWTON):
        radiance, tangent = _at_roughness(t, rho)
        tangent = np.where(np.abs(tangent) > 1e-9, tangent, 1e-9)
        wanted, weight = _as_one((t.target - radiance) / tangent, (tangent / t.scale) ** 2)
        wanted = rho[:, None] + np.clip(wanted, -LONGEST_STEP, LONGEST_STEP) - own[:, None]
        q, slopes, leverage = planes(v.places.position, v.length, wanted, weight)
        rho = np.clip(own + q[:, 0], 0.001, 1)
    return replace(v, q=(rho - own)[:, None], slope=slopes), leverage


def _best_step(t: Tables, v: Varying) -> F64:
    """The level of roughness (n,) that explains the neighbourhood of each dab best."""
    k = nearness(v.places.position, v.length)
    off = (((t.dabs.p[:, : t.own] - t.target[:, None]) / t.scale[:, None]) ** 2).sum(2)  # (n, J)
    best = (k @ off).argmin(1)
    return np.take_along_axis(t.dab_levels[:, : t.own], best[:, None], 1)[:, 0]


def _at_roughness(t: Tables, rho: F64) -> tuple[F64, F64]:
    """Radiance (n, 3) of the dabs at a roughness (n,) each, and its slope: linear between the levels."""
    levels, p = t.dab_levels[:, : t.own], t.dabs.p[:, : t.own]
    i = np.clip((levels <= rho[:, None]).sum(1) - 1, 0, t.own - 2)[:, None]
    low, high = (np.take_along_axis(levels, i + k, 1) for k in (0, 1))
    at_low, at_high = (np.take_along_axis(p, (i + k)[..., None], 1)[:, 0] for k in (0, 1))
    slope = (at_high - at_low) / np.maximum(high - low, 1e-6)
    return at_low + slope * (np.clip(rho[:, None], low, high) - low), slope
