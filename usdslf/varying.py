"""Answers that vary over a surface, where the strokes ask for it: a gradient, a picture, a soft edge.

The parameter (diffuse or specular colour) gets a change of its own at each dab, smoothed over the stroke:

    delta_i = the value at i of the plane through delta*_j with weights K_ij w_j,
    delta*_j = (T_j - P_j) / U_j,   w_j = (U_j / scale_j)^2

with a Gaussian K of one of LENGTHS of the stroke's extent.  Planes, unlike means, leave a gradient as it is up to its
ends (Cleveland 1979).  Its freedoms are the trace of that smoother (Hastie and Tibshirani 1990); it competes with the
constant answers by the same cost, plus VARIATION: an uneven hand drifts and tints too, and that is no wish.  Between
and beyond the dabs the planes are blended by similarity (propagate.py), within the range of what the dabs have.

Source: Nguyen et al. 2013, 4.3 and 5.3; Schwarz 1978.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from usdslf.evidence import Evidence, mean_by
from usdslf.propagate import Places, Weights, propagate, reach_of
from usdslf.scene import F64
from usdslf.solve import Candidate, Options, Tables, score

LENGTHS = (0.5, 0.25, 0.12)  # of smoothing, in the stroke's extent
VARIATION = 30.0  # cost of an answer that varies
TILT = 1e-4  # that planes are held against across what was painted, where no dab says how they lie
FEWEST = 6  # dabs that can say that something varies
LEAST_STEP = 0.04  # of a reflectance, between dabs, for a change to vary
NEAR = Weights(position=4.0, normal=0.5, reflectance=1.0)  # between dabs, the nearest decide


@dataclass(frozen=True)
class Varying:
    """A change that varies: known at the n dabs of a pool."""

    parameter: str  # diffuse | specular
    length: float  # of smoothing [stage units]
    delta: F64  # (n, 3) of d or F0
    slope: F64  # (n, 3, 3) of each channel along each axis [1 / stage units]
    places: Places  # (n)
    reach: float  # of propagation [stage units]
    weights: Weights = NEAR

    def at(self, x: Places) -> F64:
        """Returns the change (k, 3) at places, held to what is possible there."""
        value = x.reflectance[:, :3] if self.parameter == "diffuse" else x.reflectance[:, 3:6]
        n = len(self.delta)
        at_origin = self.delta - np.einsum("nca,na->nc", self.slope, self.places.position)
        planes = np.concatenate([at_origin, self.slope.reshape(n, 9)], 1)
        blend = propagate(x, self.places, planes, self.reach, self.weights, gated=False)
        delta = blend[:, :3] + np.einsum("kca,ka->kc", blend[:, 3:].reshape(-1, 3, 3), x.position.astype(np.float64))
        delta = np.clip(delta, self.delta.min(0), self.delta.max(0))
        return np.clip(value + delta, 0, 1) - value

    @property
    def mean(self) -> F64:
        """Mean change (3,) over the dabs."""
        return self.delta.mean(0)

    def moved(self, mean: F64) -> Varying:
        """Returns the change with another mean."""
        return replace(self, delta=self.delta + (mean - self.mean))


def places_of_dabs(evidences: Sequence[Evidence], material: int) -> Places:
    """Returns the places of the dabs on a material, in the order of `pool_tables`."""
    parts: list[tuple[F64, F64, F64]] = []
    for e in evidences:
        s, n = e.surface, len(e.target)
        here = np.flatnonzero(e.material == material)
        reflectance = np.concatenate([s.diffuse, s.f0, s.roughness[:, None]], 1)
        rows = (s.position, s.geometric_normal, reflectance)
        parts.append(tuple(mean_by(x.astype(np.float64), e.dab_of_sample)[:n][here] for x in rows))  # type: ignore[arg-type]
    position, normal, reflectance = (np.concatenate(x) for x in zip(*parts, strict=True))
    normal = normal / np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-9)
    return Places(position, normal, reflectance)


def best_varying(
    t: Tables, o: Options, white: F64, places: Places, brush: float
) -> tuple[Candidate, Varying] | None:
    """Returns the cheapest answer that varies and its cost as a candidate; None where no stroke can ask for one.

    Args:
        brush: width [stage units].
    """
    n = len(t.target)
    if n < FEWEST or t.flat.all():
        return None
    extent = float(np.linalg.norm(np.ptp(places.position, axis=0)))
    reach = reach_of(places.position, 0.5 * brush)
    best: tuple[Candidate, Varying] | None = None
    for parameter in ("specular",) if t.is_metal else ("diffuse", "specular"):
        for share in LENGTHS:
            start = Varying(parameter, max(share * extent, 1e-9), np.zeros((n, 3)), np.zeros((n, 3, 3)), places, reach)
            varying, freedoms = _smoothed(t, start)
            if np.ptp(varying.delta, axis=0).max() < LEAST_STEP:
                continue
            r = white @ ((predicted_varying(t, varying) - t.target) / t.scale).reshape(-1)
            of_dab = (r * r).reshape(n, 3).sum(1)
            misfit = float((o.outlier * np.log1p(of_dab / o.outlier)).sum())
            c = _as_candidate(t, varying, misfit, freedoms)
            c = replace(c, cost=score(t, o, c) + VARIATION)
            if best is None or c.cost < best[0].cost:
                best = c, varying
    return best


def refit_varying(t: Tables, v: Varying) -> Varying:
    """Fits a change that varies again, under the light that the tables were made with."""
    return _smoothed(t, v)[0]


def predicted_varying(t: Tables, v: Varying) -> F64:
    """Returns the radiance (n, 3) of the dabs with a change that varies."""
    slope = t.u if v.parameter == "diffuse" else t.v
    return t.p[:, t.own] + v.delta * slope[:, t.own]


def varying_error(t: Tables, v: Varying) -> float:
    """Relative root mean square of the painted radiance minus what the change gives."""
    return float(np.sqrt(np.mean(((predicted_varying(t, v) - t.target) / t.scale) ** 2)))


def as_candidate(t: Tables, v: Varying, c: Candidate) -> Candidate:
    """Returns a candidate with the mean of the change, its cost as it was."""
    return replace(_as_candidate(t, v, c.misfit, c.freedoms), cost=c.cost)


def _as_candidate(t: Tables, v: Varying, misfit: float, freedoms: int) -> Candidate:
    mean, zero = v.mean, np.zeros(3)
    is_diffuse = v.parameter == "diffuse"
    return Candidate(
        (v.parameter,), mean if is_diffuse else zero, zero if is_diffuse else mean, level=t.own, misfit=misfit,
        freedoms=freedoms,
    )  # fmt: skip


def _smoothed(t: Tables, v: Varying) -> tuple[Varying, int]:
    """The smoothed change of each dab, and its freedoms."""
    slope, present = (t.u, t.diffuse) if v.parameter == "diffuse" else (t.v, t.f0)
    slope = slope[:, t.own]
    asked = (t.target - t.p[:, t.own]) / np.where(np.abs(slope) > 1e-12, slope, 1e-12)
    value = v.places.reflectance[:, :3] if v.parameter == "diffuse" else v.places.reflectance[:, 3:6]
    asked = np.clip(asked, -1 - present, 2 - present)  # what is out of reach must not pull at its neighbours
    weight = (slope / t.scale) ** 2
    apart = v.places.position[None] - v.places.position[:, None]  # (i, j, 3)
    k = np.exp(-0.5 * (apart**2).sum(-1) / v.length**2)
    design = np.concatenate([np.ones((*k.shape, 1)), apart / v.length], -1)  # (i, j, 4)
    w = k[..., None] * weight[None]  # (i, j, channel)
    normal = np.einsum("ijc,ija,ijb->icab", w, design, design)
    size = np.trace(normal, axis1=2, axis2=3)[..., None, None]
    normal = normal + np.diag([1e-9, TILT, TILT, TILT]) * (size + 1e-30)
    right = np.einsum("ijc,ija,jc->ica", w, design, asked)
    plane = np.linalg.solve(normal, right[..., None])[..., 0]  # (i, channel, 4)
    own = np.linalg.solve(normal, np.broadcast_to(np.eye(4)[:, :1], (*normal.shape[:2], 4, 1)))[..., 0, 0]
    freedoms = round(float((own * weight).sum()))  # K_ii = 1
    delta = np.clip(value + plane[..., 0], 0, 1) - value
    return replace(v, delta=delta, slope=plane[..., 1:] / v.length), freedoms
