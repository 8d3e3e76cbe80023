"""Fit the changes of several materials at once to what receivers ask, under all bounces of the light.

    for ever: r = target - L(x);  J = dL/dx by one bounce;  x += argmin |W (r - g J dx)|^2 + |dx / REACH|^2

with x the freed parameters of all changes, held to what is possible, and L the converged light field's.  One bounce
sees too little of what a change does; g is how much more the last step did than was foreseen.  The means of the
strokes weigh more than their dabs: that is the radiance that has to be met.  A round that fits worse is halved.

Source: Levenberg 1944; Marquardt 1963.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from usdslf.inference.bilinear import Tables
from usdslf.inference.candidate import Candidate, is_grey
from usdslf.inference.fit import bounds_of
from usdslf.inference.least_squares import bounded_least_squares
from usdslf.inference.receivers import F64, Receiver, carried, present_radiance, rows_in_sight
from usdslf.inference.residuals import relative_scale
from usdslf.inference.weights import Options
from usdslf.inference.whitening import whiten
from usdslf.light_field.light_field import LightField
from usdslf.light_field.surface import Surface
from usdslf.surfaces.reflectance import Parameters, column_weights

MOST_STEPS = 8  # of Gauss and Newton, each under new light
DONE = 0.02  # relative error of the strokes' means at which nothing is left to do
MET = 0.05  # relative error of a stroke's mean colour at which it counts as met
MEAN_ERROR = 0.03  # relative, of a stroke's mean colour
FIT_ERROR = 0.06  # relative, of each dab
TRUST = 0.1  # relative error at which a dab has half its weight
OUTLIER = 4.0  # misfit of a dab beyond which it counts by its logarithm
REACH = 0.5  # of a reflectance, that a step may take at the cost of one dab's error
GLOSS_STEP = 0.1  # of roughness in one round
PROBE = 0.02  # of roughness, for its derivative


@dataclass(frozen=True)
class Change:
    """A change of one material, of which `candidate` says what is freed and how far it goes."""

    material: int
    candidate: Candidate
    diffuse: F64  # (3,) means over what is in sight, before
    f0: F64
    roughness: float
    is_metal: bool

    @staticmethod
    def of(material: int, candidate: Candidate, t: Tables) -> Change:
        """A change whose start the tables know."""
        return Change(material, candidate, t.diffuse, t.f0, t.roughness, t.is_metal)

    def apply(self, surface: Surface, start: Surface, field: LightField) -> Surface:
        """Returns a surface with the change of the elements' reflectance at the start."""
        rows = field.elements.material == self.material
        changed = self.candidate.apply(Parameters.of(start, rows), self.is_metal)
        return surface.with_rows(rows, **vars(changed))

    # ── parameters as a vector: diffuse (3), F0 (1 or 3), roughness (1), as far as freed ──────────

    @property
    def parts(self) -> list[tuple[str, int]]:
        """Names and lengths of the vector's parts."""
        c = self.candidate
        parts = [("diffuse", 3)] if "diffuse" in c.freed and not c.is_metallic else []
        if "specular" in c.freed:
            parts.append(("specular", 1 if is_grey(c) else 3))
        return parts + ([("glossiness", 1)] if "glossiness" in c.freed else [])

    @property
    def vector(self) -> F64:
        """Where the parameters are."""
        return np.concatenate([self.candidate.delta_of(name)[:count] for name, count in self.parts] or [np.zeros(0)])

    @property
    def bounds(self) -> tuple[F64, F64]:
        """Lowest and highest values of the vector."""
        d, f0, c = self.diffuse, self.f0, self.candidate
        limits = {
            "diffuse": bounds_of(d, c.is_factor_diffuse),
            "specular": bounds_of(f0, c.is_factor_f0),
            "glossiness": (np.array([0.01 - self.roughness]), np.array([1 - self.roughness])),
        }
        low, high = [], []
        for name, count in self.parts:
            lower, upper = limits[name]
            low.append(np.full(1, lower.max()) if count < len(lower) else lower)
            high.append(np.full(1, upper.min()) if count < len(upper) else upper)
        return np.concatenate(low or [np.zeros(0)]), np.concatenate(high or [np.zeros(0)])

    def at(self, vector: F64) -> Change:
        """The change with other values of its parameters."""
        values: dict[str, F64 | float] = {}
        first = 0
        for name, count in self.parts:
            x = vector[first : first + count]
            if name == "glossiness":
                values["roughness_shift"] = float(x[0])
            else:
                values["delta_diffuse" if name == "diffuse" else "delta_f0"] = np.broadcast_to(x, 3).copy()
            first += count
        return replace(self, candidate=replace(self.candidate, **values))  # type: ignore[arg-type]


@dataclass(frozen=True)
class Fitted:
    """What came out: the changes, and how well the strokes are met."""

    changes: tuple[Change, ...]
    rounds: tuple[float, ...]  # relative error of the strokes' means after each round
    radiance: F64  # (n, 3) of all receivers' dabs
    surface: Surface


def fit_changes(
    changes: Sequence[Change], receivers: list[Receiver], tables: Tables, start: Surface, field: LightField,
    options: Options, bounces: int,
) -> Fitted:  # fmt: skip
    """Fits all freed parameters together; the light field is left as the fitted changes make it.

    Args:
        tables: of any material for these receivers: targets, scales and places of the dabs.
        start: reflectance that the changes count from.
    """
    rows = _Rows(receivers, tables, options)
    x = np.concatenate([c.vector for c in changes])
    low, high = (np.concatenate(b) for b in zip(*(c.bounds for c in changes), strict=True))
    best: tuple[float, F64, F64, Surface, F64] | None = None
    trust = np.ones(len(tables.target))
    gain, share, step, foreseen, rounds = 1.0, 1.0, np.zeros(len(x)), None, []
    for _ in range(MOST_STEPS):
        now = _at(changes, x)
        surface = start
        for c in now:
            surface = c.apply(surface, start, field)
        field.set_surface(surface)
        for _ in field.converge(bounces):
            pass
        seen = radiance_of(receivers, field)
        misfit = rows.misfit(seen)
        rounds.append(mean_error(receivers, seen))
        if foreseen is not None and best is not None:
            came = rows.residual(best[2], trust) - rows.residual(seen, trust)
            gain *= float(np.clip((came @ foreseen) / max(foreseen @ foreseen, 1e-12), 0.5, 2.0))
        if best is None or misfit < best[0] * 0.999:
            is_small = best is not None and best[0] - misfit < 0.01 * best[0]
            best, share = (misfit, x, seen, surface, _columns(now, receivers, start, field)), 1.0
            if rounds[-1] < DONE or is_small:
                break
        elif share < 0.5 or np.abs(step).max() < 0.004:
            break
        else:
            share *= 0.5
        trust = rows.trust(best[2])
        jacobian = rows.columns(best[4], trust) * np.clip(gain, 0.3, 4)
        step = share * _step(jacobian, rows.residual(best[2], trust), best[1], low, high, now)
        if np.abs(step).max(initial=0.0) < 1e-4:
            break
        foreseen = jacobian @ step
        x = best[1] + step
    assert best is not None
    if field.surface is not best[3]:
        field.set_surface(best[3])
        for _ in field.converge(bounces):
            pass
    return Fitted(tuple(_at(changes, best[1])), tuple(rounds), best[2], best[3])


def radiance_of(receivers: list[Receiver], field: LightField) -> F64:
    """Returns what the dabs of all receivers (n, 3) send to their eyes under the light of now."""
    return np.concatenate([present_radiance(r.painted, field) for r in receivers])


def mean_error(receivers: list[Receiver], radiance: F64) -> float:
    """Largest relative error, of any channel, of the mean radiance of a stroke that wants something."""
    errors, first = [0.0], 0
    for r in receivers:
        got, target = radiance[first : first + len(r.target)].mean(0), r.target.mean(0)
        first += len(r.target)
        if not r.is_held:
            errors.append(float((np.abs(got - target) / relative_scale(target, least=1e-9)).max()))
    return max(errors)


class _Rows:
    """Whitened residuals: of dabs, and of the means of strokes that want something.

    Dabs that stay far off, at edges and in corners where the light field is coarse, are trusted less.
    """

    def __init__(self, receivers: list[Receiver], t: Tables, o: Options) -> None:
        self.target, self.scale = t.target, t.scale
        self.white = whiten(t, replace(o, dab_error=FIT_ERROR, drift_error=0.0, tint_error=0.0))
        number = np.concatenate([np.full(len(r.target), i) for i, r in enumerate(receivers)])
        self.strokes = [number == i for i, r in enumerate(receivers) if not r.is_held]
        self.certain = t.has_one_color  # one colour on everything says nothing about single dabs

    def misfit(self, radiance: F64) -> float:
        """Sum of squares of radiance (n, 3), of single dabs by the logarithm."""
        r = self._dabs(self.target - radiance, np.ones(len(self.target)))
        of_dab = (r.reshape(-1, 3) ** 2).sum(1)
        capped = np.where(self.certain, of_dab, OUTLIER * np.log1p(of_dab / OUTLIER)).sum()
        return float(capped + (self._means(self.target - radiance, self.trust(radiance)) ** 2).sum())

    def trust(self, radiance: F64) -> F64:
        """How much each dab (n,) is believed."""
        off = (((self.target - radiance) / self.scale) ** 2).mean(1)
        return np.where(self.certain, 1.0, np.sqrt(1 / (1 + off / TRUST**2)))

    def residual(self, radiance: F64, trust: F64) -> F64:
        """Of radiance (n, 3), as a vector."""
        return self._white(self.target - radiance, trust)

    def columns(self, jacobian: F64, trust: F64) -> F64:
        """Of derivatives (P, n, 3): a matrix with a column each."""
        return np.stack([self._white(j, trust) for j in jacobian], 1)

    def _white(self, change: F64, trust: F64) -> F64:
        return np.concatenate([self._dabs(change, trust), self._means(change, trust)])

    def _dabs(self, change: F64, trust: F64) -> F64:
        return self.white @ (change / self.scale * trust[:, None]).reshape(-1)

    def _means(self, change: F64, trust: F64) -> F64:
        mean = lambda x, s: (trust[s] ** 2) @ x[s] / (trust[s] ** 2).sum()  # noqa: E731
        return np.concatenate([mean(change, s) / mean(self.scale, s) for s in self.strokes]) / MEAN_ERROR


def _step(jacobian: F64, residual: F64, x: F64, low: F64, high: F64, changes: Sequence[Change]) -> F64:
    """The step that lowers the residual most, within the bounds, and not further than need be."""
    is_gloss = np.concatenate([[name == "glossiness"] * count for c in changes for name, count in c.parts])
    reach = np.where(is_gloss, GLOSS_STEP, REACH)
    low, high = low - x, high - x
    low, high = np.where(is_gloss, np.maximum(low, -reach), low), np.where(is_gloss, np.minimum(high, reach), high)
    return bounded_least_squares(
        np.concatenate([jacobian, np.diag(1 / reach)]), np.concatenate([residual, 0 * x]), low, high
    )


def _at(changes: Sequence[Change], x: F64) -> list[Change]:
    out, first = [], 0
    for c in changes:
        count = len(c.vector)
        out.append(c.at(x[first : first + count]))
        first += count
    return out


def _columns(changes: Sequence[Change], receivers: list[Receiver], start: Surface, field: LightField) -> F64:
    """Derivatives (P, n, 3) of the dabs' radiance by the parameters, by one bounce from the light of now."""
    out: list[NDArray] = []
    for c in changes:
        rows = rows_in_sight(receivers, c.material, field)
        now = field.surface
        d, f0, f90, rough = (getattr(now, k)[rows].astype(np.float64) for k in ("diffuse", "f0", "f90", "roughness"))
        weights = column_weights(field.model, d, f0, f90)

        def seen(w: NDArray, r: NDArray, rows: NDArray = rows) -> F64:
            return carried(receivers, field, field.respond(rows, w.astype(np.float32), r))

        for name, count in c.parts:
            if name == "glossiness":
                up, down = np.clip(rough + PROBE, 0.001, 1), np.clip(rough - PROBE, 0.001, 1)
                out.append((seen(weights, up) - seen(weights, down)) / float((up - down).mean()))
                continue
            if name == "diffuse":
                unit = start.diffuse[rows] if c.candidate.is_factor_diffuse else np.ones_like(d)
                moved = column_weights(field.model, d + unit, f0, f90)
            else:
                unit = start.f0[rows] if c.candidate.is_factor_f0 else np.ones_like(d)
                follows = c.is_metal or c.candidate.is_metallic
                moved = column_weights(field.model, d, f0 + unit, f90 + unit if follows else f90)
            column = seen(moved - weights, rough)
            out += [column] if count == 1 else [column * channel for channel in np.eye(3)]
    return np.array(out)
