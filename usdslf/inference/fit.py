"""Fit: the change of some parameters, at one roughness, that explains the dabs of a pool best.

The mean radiance of a dab is bilinear in the shared changes dd and dF, L = P + dd U + dF V - dd dF W, so that a fit
is a few linear least squares, each about the last (Gauss and Newton), of the residual r whitened by a painter's
errors:

    misfit = sum_i o log(1 + |r_i|^2 / o)       r = C^(-1/2) (L - target) / scale       o: Options.outlier
    C = [drift^2 exp(-|x_i - x_j|^2 / 2 l^2) 1 + tint^2 I] (of one stroke) + dab^2 I

with 1 and I over the three channels: brightness that drifts over the stroke, a tint of the stroke, errors of dabs.

Source: Nguyen et al. 2013, 5.3 (Eqs. 3 to 6), pooled over the stroke; Holland and Welsch 1977 (trust in dabs).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from enum import Enum

import numpy as np
from numpy.typing import NDArray

from usdslf.inference.bilinear import Bilinear, Tables
from usdslf.inference.candidate import GROUPS, Candidate, is_grey
from usdslf.inference.least_squares import bounded_solutions
from usdslf.inference.weights import Options
from usdslf.inference.whitening import White, Whitened, whiten
from usdslf.scene.records import F64

TRUST = (0.5, 0.25, 0.15, 0.1, 0.07, 0.05)  # relative error of a dab at which it has half its weight, round by round
STEPS = 4  # of Gauss and Newton, for the bilinear candidates


class Specular(Enum):
    """How the specular colour may change; the value is the number of freedoms."""

    KEPT = 0
    GREY = 1  # all channels by the same
    COLOR = 3


@dataclass(frozen=True)
class Way:
    """Which parameters a fit may change, and how."""

    diffuse: bool = False
    specular: Specular = Specular.KEPT
    glossiness: bool = False
    is_factor: bool = False  # the change of the diffuse colour, else of the specular one, is a factor less one

    @staticmethod
    def of(c: Candidate) -> Way:
        """Returns how a candidate was fitted."""
        grey = Specular.GREY if is_grey(c) else Specular.COLOR
        specular = grey if "specular" in c.freed else Specular.KEPT
        return Way("diffuse" in c.freed, specular, "glossiness" in c.freed, c.is_factor)

    @property
    def freed(self) -> tuple[str, ...]:
        """Names of the parameters."""
        flags = (self.diffuse, self.has_specular, self.glossiness)
        return tuple(name for name, is_free in zip(GROUPS, flags, strict=True) if is_free)

    @property
    def freedoms(self) -> int:
        """Number of values that are free."""
        return 3 * self.diffuse + self.specular.value + self.glossiness

    @property
    def has_specular(self) -> bool:
        """Whether the specular colour may change."""
        return self.specular is not Specular.KEPT

    @property
    def has_colors(self) -> bool:
        """Whether a colour may change."""
        return self.diffuse or self.has_specular

    @property
    def is_factor_diffuse(self) -> bool:
        """Whether the change of the diffuse colour is a factor less one."""
        return self.is_factor and self.diffuse

    @property
    def is_factor_f0(self) -> bool:
        """Whether the change of the specular colour is a factor less one."""
        return self.is_factor and not self.diffuse

    def candidate(self, dd: F64, df: F64, level: int) -> Candidate:
        """Returns the candidate of changes (3,) at a level, without its costs."""
        return Candidate(self.freed, dd, df, is_factor=self.is_factor, level=level, freedoms=self.freedoms)


@dataclass(frozen=True)
class Fits:
    """Changes of both colours (J, 3) at J levels, and what they leave of the dabs (J,)."""

    dd: F64
    df: F64
    misfit: F64

    def with_those(self, other: Fits, wins: NDArray[np.bool_]) -> Fits:
        """Returns these, and the others where they win (J,)."""
        dd, df = (np.where(wins[:, None], b, a) for a, b in ((self.dd, other.dd), (self.df, other.df)))
        return Fits(dd, df, np.where(wins, other.misfit, self.misfit))

    def rows(self, rows: slice) -> Fits:
        """Returns those of some of the levels."""
        return Fits(self.dd[rows], self.df[rows], self.misfit[rows])


@dataclass(frozen=True)
class Problem:
    """The dabs of a pool and the errors that are expected of them; fits of one pool share it."""

    tables: Tables
    options: Options
    white: White  # (3 m, 3 n)
    _whitened: dict[tuple[bool, bool], Whitened] = field(default_factory=dict, init=False, repr=False)

    @staticmethod
    def of(t: Tables, o: Options) -> Problem:
        """Whitens the dabs of a pool, once for all fits."""
        return Problem(t, o, whiten(t, o))

    def misfit(self, r: F64) -> F64:
        """Returns the sum of squares of whitened residuals (..., m), of single dabs by the logarithm."""
        of_dab = (r * r).reshape(*r.shape[:-1], -1, 3).sum(-1)
        outlier = self.options.outlier
        return (outlier * np.log1p(of_dab / outlier)).sum(-1)

    def whitened(self, way: Way, levels: Sequence[int]) -> Whitened:
        """Returns the whitened tables at some levels; all levels are whitened at once, and kept."""
        kind = way.is_factor_diffuse, way.is_factor_f0
        if kind not in self._whitened:
            t = self.tables
            self._whitened[kind] = self._made_white(t.with_factors(*kind), np.ones((len(t.target), len(t.levels))))
        return self._whitened[kind].levels(list(levels))

    def trusted(self, way: Way, levels: Sequence[int], trust: F64) -> Whitened:
        """Returns the same by trust (n, J) in each dab at each level, 0..1."""
        b, rows = self.tables.with_factors(way.is_factor_diffuse, way.is_factor_f0), list(levels)
        return self._made_white(Bilinear(b.p[:, rows], b.u[:, rows], b.v[:, rows], b.w[:, rows]), trust)

    def _made_white(self, b: Bilinear, trust: F64) -> Whitened:
        return self.white.of_tables(b, self.tables.target, trust[..., None] / self.tables.scale[:, None])


def relative_residuals(t: Tables, c: Candidate) -> F64:
    """Returns the relative residuals (n, 3) of a candidate."""
    return (c.radiance(t) - t.target) / t.scale


def fit_robustly(problem: Problem, way: Way, levels: Sequence[int]) -> Fits:
    """Least squares again and again, with less and less trust in dabs that stay far off; at each level by itself."""
    best = fit(problem, way, levels)
    if not way.has_colors:
        return best
    t, count = problem.tables, len(levels)
    dd, df, twice = best.dd, best.df, list(levels)
    if not (way.diffuse and way.has_specular):
        other = _median_change(t, way, levels)
        dd, df, twice = np.concatenate([dd, other[0]]), np.concatenate([df, other[1]]), 2 * twice
    b = t.with_factors(way.is_factor_diffuse, way.is_factor_f0)
    b = Bilinear(b.p[:, twice], b.u[:, twice], b.v[:, twice], b.w[:, twice])
    for reach in TRUST:
        off = (b.predict(dd, df) - t.target[:, None]) / t.scale[:, None]
        found = fit(problem, way, twice, np.sqrt(1 / (1 + (off * off).mean(2) / reach**2)))
        dd, df = found.dd, found.df
        for first in range(0, len(twice), count):
            part = found.rows(slice(first, first + count))
            best = best.with_those(part, part.misfit < best.misfit)
    return best


def _median_change(t: Tables, way: Way, levels: Sequence[int]) -> tuple[F64, F64]:
    """The changes (J, 3) that half of the dabs, weighed by how much they feel it, would have smaller, by channels."""
    b, rows = t.with_factors(way.is_factor, way.is_factor), list(levels)
    slope = (b.u if way.diffuse else b.v)[:, rows]
    wanted = (t.target[:, None] - b.p[:, rows]) / np.where(np.abs(slope) > 1e-12, slope, 1e-12)
    weight = np.abs(slope) / t.scale[:, None]
    if way.specular is Specular.GREY:
        wanted, weight = (x.transpose(0, 2, 1).reshape(-1, len(rows), 1) for x in (wanted, weight))
    order = np.argsort(wanted, 0)
    cumulated = np.cumsum(np.take_along_axis(weight, order, 0), 0)
    middle = (cumulated < 0.5 * cumulated[-1:]).sum(0)
    change = np.take_along_axis(np.take_along_axis(wanted, order, 0), middle[None], 0)[0] * np.ones(3)
    of_diffuse, of_f0 = bounds_of_tables(t, way.is_factor, way.is_factor)
    change = np.clip(change, *(of_diffuse if way.diffuse else of_f0))
    return (change, np.zeros_like(change)) if way.diffuse else (np.zeros_like(change), change)


def bounds_of(color: F64, is_factor: bool, most: float = 1.0) -> tuple[F64, F64]:
    """Returns the least and the greatest change (3,), or factor less one, that keep a colour (3,) in 0..most."""
    if is_factor:
        return -np.ones(3), most / np.maximum(color, 1e-3) - 1
    return -color, np.maximum(most - color, 0)


def bounds_of_tables(t: Tables, of_diffuse: bool, of_f0: bool) -> tuple[tuple[F64, F64], tuple[F64, F64]]:
    """Returns the bounds of the changes of d and of F0, either of which may be a factor less one."""
    return bounds_of(t.diffuse, of_diffuse, t.most_diffuse), bounds_of(t.f0, of_f0)


def fit(problem: Problem, way: Way, levels: Sequence[int], trust: F64 | None = None) -> Fits:
    """Least squares of the whitened residual under the bounds, at each level by itself.

    Args:
        trust: (n, J) in each dab at each level, 0..1; None: whole.
    """
    t = problem.tables
    whole = problem.whitened(way, levels)
    now = whole if trust is None else problem.trusted(way, levels, trust)
    zero = np.zeros((len(levels), 3))
    dd, df = hold_energy(t, zero, zero, way)
    rounds = STEPS if way.diffuse and way.has_specular else 2
    for _ in range(rounds if way.has_colors else 0):
        a, at, low, high = _linear(now, t, way, dd, df)
        across = a.transpose(0, 2, 1)
        normal = across @ a
        right = normal @ at[..., None] - across @ now.at(dd, df)[..., None]
        x = bounded_solutions(normal, right[..., 0], low, high)
        if way.diffuse:
            dd, x = x[:, :3], x[:, 3:]
        if way.has_specular:
            df = x[:, :3] if way.specular is Specular.COLOR else x[:, :1] * np.ones(3)
        dd, df = hold_energy(t, dd, df, way)
    return Fits(dd, df, problem.misfit(whole.at(dd, df)))


def _linear(x: Whitened, t: Tables, way: Way, dd: F64, df: F64) -> tuple[F64, F64, F64, F64]:
    """Slopes (J, m, k) of the residuals about changes (J, 3); the k changes (J, k), their least and greatest (k,)."""
    columns: list[F64] = []
    at: list[F64] = []
    low: list[F64] = []
    high: list[F64] = []
    (low_d, high_d), (low_f, high_f) = bounds_of_tables(t, way.is_factor_diffuse, way.is_factor_f0)
    if way.diffuse:
        columns.append(x.u - df[:, None] * x.w)
        at, low, high = [*at, dd], [*low, low_d], [*high, high_d]
    if way.has_specular:
        slope = x.v - dd[:, None] * x.w
        if way.specular is Specular.COLOR:
            columns.append(slope)
            at, low, high = [*at, df], [*low, low_f], [*high, high_f]
        else:
            columns.append(slope.sum(2, keepdims=True))
            at, low, high = [*at, df[:, :1]], [*low, low_f.max(keepdims=True)], [*high, high_f.min(keepdims=True)]
    return np.concatenate(columns, 2), np.concatenate(at, 1), np.concatenate(low), np.concatenate(high)


def hold_energy(t: Tables, dd: F64, df: F64, way: Way) -> tuple[F64, F64]:
    """Scales what a change of phong's k_d and k_s frees until both reflect no more than arrives.

    Changes are (..., 3).  One free parameter is lowered alone, two are scaled alike; a grey k_s stays grey.
    preview_surface cannot gain energy.  Source: Nguyen et al. 2013, 5.3.
    """
    if not t.must_hold_energy or not way.has_colors:
        return dd, df
    k_d = t.diffuse * (1 + dd) if way.is_factor_diffuse else t.diffuse + dd
    k_s = t.f0 * (1 + df) if way.is_factor_f0 else t.f0 + df
    if way.diffuse and way.has_specular:
        share = 1 / np.maximum(k_d + k_s, 1)
        k_d, k_s = k_d * share, k_s * share
    elif way.diffuse:
        k_d = np.minimum(k_d, np.maximum(1 - k_s, 0))
    else:
        k_s = np.minimum(k_s, np.maximum(1 - k_d, 0))
    if way.diffuse:
        dd = k_d / np.maximum(t.diffuse, 1e-12) - 1 if way.is_factor_diffuse else k_d - t.diffuse
    if way.has_specular:
        df = k_s / np.maximum(t.f0, 1e-12) - 1 if way.is_factor_f0 else k_s - t.f0
        df = df.min(-1, keepdims=True) * np.ones(3) if way.specular is Specular.GREY else df
    return dd, df


