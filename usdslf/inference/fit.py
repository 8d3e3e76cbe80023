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

from dataclasses import dataclass
from enum import Enum

import numpy as np

from usdslf.inference.bilinear import Bilinear, Tables
from usdslf.inference.candidate import GROUPS, Candidate, is_grey
from usdslf.inference.least_squares import bounded_least_squares
from usdslf.inference.weights import Options
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
class Fitted:
    """Changes of both colours (3,), and what they leave of the dabs."""

    dd: F64
    df: F64
    misfit: float


@dataclass(frozen=True)
class Problem:
    """The dabs of a pool and the errors that are expected of them; fits of one pool share it."""

    tables: Tables
    options: Options
    white: F64  # (3n, 3n)

    @staticmethod
    def of(t: Tables, o: Options) -> Problem:
        """Whitens the dabs of a pool, once for all fits."""
        return Problem(t, o, whiten(t, o))

    def misfit(self, r: F64) -> float:
        """Returns the sum of squares of a whitened residual (3n,), of single dabs by the logarithm."""
        of_dab = (r * r).reshape(-1, 3).sum(1)
        outlier = self.options.outlier
        return float((outlier * np.log1p(of_dab / outlier)).sum())


def whiten(t: Tables, o: Options) -> F64:
    """Returns the matrix (3n, 3n) that makes relative residuals, dab by dab and channel by channel, independent.

    It is formed, and not solved with, because some hundred products with it follow.
    """
    n, eye = len(t.target), np.eye(3)
    cov = shared_errors(t, o) + np.eye(3 * n) * o.dab_error**2
    # who paints with one colour gets the mean right, not the contrast among what has it
    for s in np.unique(t.swatch[t.swatch >= 0]):
        mine = (t.swatch == s).astype(float)
        cov += np.kron(o.flat_error**2 * (np.diag(mine) - np.outer(mine, mine) / mine.sum()), eye)
    return np.linalg.inv(np.linalg.cholesky(cov))


def shared_errors(t: Tables, o: Options) -> F64:
    """Returns the covariance (3n, 3n) of what a painter gets wrong alike: drift over the stroke, and its tint."""
    same = (t.stroke[:, None] == t.stroke[None]).astype(float)
    gap = np.linalg.norm(t.place[:, None] - t.place[None], axis=-1)
    extent = np.array([gap[np.ix_(t.stroke == s, t.stroke == s)].max() for s in t.stroke])
    length = np.maximum(o.drift_length * extent, 1e-9)
    drift = same * np.exp(-0.5 * (gap / length[:, None]) ** 2) * o.drift_error**2
    drift = 0.5 * (drift + drift.T)
    return np.kron(drift, np.ones((3, 3))) + np.kron(same * o.tint_error**2, np.eye(3))


def relative_residuals(t: Tables, c: Candidate) -> F64:
    """Returns the relative residuals (n, 3) of a candidate."""
    return (c.radiance(t) - t.target) / t.scale


def fit_robustly(problem: Problem, way: Way, level: int) -> Fitted:
    """Least squares again and again, with less and less trust in dabs that stay far off."""
    best = fit(problem, way, level)
    if not way.has_colors:
        return best
    starts = [(best.dd, best.df)]
    if not (way.diffuse and way.has_specular):
        starts.append(_median_change(problem.tables, way, level))
    for dd, df in starts:
        for reach in TRUST:
            off = relative_residuals(problem.tables, way.candidate(dd, df, level))
            trust = np.sqrt(1 / (1 + (off * off).mean(1) / reach**2))
            found = fit(problem, way, level, trust)
            dd, df = found.dd, found.df
            if found.misfit < best.misfit:
                best = found
    return best


def _median_change(t: Tables, way: Way, level: int) -> tuple[F64, F64]:
    """The change that half of the dabs, weighed by how much they feel it, would have smaller, channel by channel."""
    b = t.with_factors(way.is_factor, way.is_factor).at_level(level)
    slope = b.u if way.diffuse else b.v
    wanted = (t.target - b.p) / np.where(np.abs(slope) > 1e-12, slope, 1e-12)
    weight = np.abs(slope) / t.scale
    if way.specular is Specular.GREY:
        wanted, weight = wanted.reshape(-1, 1), weight.reshape(-1, 1)
    order = np.argsort(wanted, 0)
    cumulated = np.cumsum(np.take_along_axis(weight, order, 0), 0)
    middle = (cumulated < 0.5 * cumulated[-1:]).sum(0)
    change = np.take_along_axis(np.take_along_axis(wanted, order, 0), middle[None], 0)[0] * np.ones(3)
    of_diffuse, of_f0 = bounds_of_tables(t, way.is_factor, way.is_factor)
    change = np.clip(change, *(of_diffuse if way.diffuse else of_f0))
    return (change, np.zeros(3)) if way.diffuse else (np.zeros(3), change)


def bounds_of(color: F64, is_factor: bool, most: float = 1.0) -> tuple[F64, F64]:
    """Returns the least and the greatest change (3,), or factor less one, that keep a colour (3,) in 0..most."""
    if is_factor:
        return -np.ones(3), most / np.maximum(color, 1e-3) - 1
    return -color, np.maximum(most - color, 0)


def bounds_of_tables(t: Tables, of_diffuse: bool, of_f0: bool) -> tuple[tuple[F64, F64], tuple[F64, F64]]:
    """Returns the bounds of the changes of d and of F0, either of which may be a factor less one."""
    return bounds_of(t.diffuse, of_diffuse, t.most_diffuse), bounds_of(t.f0, of_f0)


def fit(problem: Problem, way: Way, level: int, trust: F64 | None = None) -> Fitted:
    """Least squares of the whitened residual under the bounds.

    Args:
        trust: (n,) in each dab, 0..1; None: whole.
    """
    t, white = problem.tables, problem.white
    b = t.with_factors(way.is_factor_diffuse, way.is_factor_f0).at_level(level)
    bounds = bounds_of_tables(t, way.is_factor_diffuse, way.is_factor_f0)
    dd, df = hold_energy(t, np.zeros(3), np.zeros(3), way)
    scale = t.scale if trust is None else t.scale / trust[:, None]

    def residual(dd: F64, df: F64, scale: F64) -> F64:
        return white @ ((b.p + dd * b.u + df * b.v - dd * df * b.w - t.target) / scale).reshape(-1)

    rounds = STEPS if way.diffuse and way.has_specular else 2
    r = residual(dd, df, scale)
    for _ in range(rounds if way.has_colors else 0):
        columns, at, low, high = _linear(b, way, dd, df, scale, bounds)
        a = white @ columns
        x = bounded_least_squares(a, a @ at - r, low, high)
        if way.diffuse:
            dd, x = x[:3], x[3:]
        if way.has_specular:
            df = x[:3] if way.specular is Specular.COLOR else np.full(3, x[0])
        dd, df = hold_energy(t, dd, df, way)
        r = residual(dd, df, scale)
    return Fitted(dd, df, problem.misfit(residual(dd, df, t.scale)))


def _linear(
    b: Bilinear, way: Way, dd: F64, df: F64, scale: F64, bounds: tuple[tuple[F64, F64], tuple[F64, F64]]
) -> tuple[F64, F64, F64, F64]:
    """Slopes (3n, k) of the residual about changes dd and dF; the k changes themselves, their least and greatest."""
    columns: list[F64] = []
    at: list[float] = []
    low: list[float] = []
    high: list[float] = []
    (low_d, high_d), (low_f, high_f) = bounds
    if way.diffuse:
        columns.append(_by_channel((b.u - df * b.w) / scale))
        at, low, high = [*at, *dd], [*low, *low_d], [*high, *high_d]
    if way.has_specular:
        slope = (b.v - dd * b.w) / scale
        if way.specular is Specular.COLOR:
            columns.append(_by_channel(slope))
            at, low, high = [*at, *df], [*low, *low_f], [*high, *high_f]
        else:
            columns.append(slope.reshape(-1, 1))
            at, low, high = [*at, df[0]], [*low, low_f.max()], [*high, high_f.min()]
    return np.concatenate(columns, 1), np.array(at), np.array(low), np.array(high)


def _by_channel(slope: F64) -> F64:
    """Slopes (n, 3) of three channels, each by a change of its own: (3n, 3)."""
    out = np.zeros((len(slope), 3, 3))
    each = np.arange(3)
    out[:, each, each] = slope
    return out.reshape(-1, 3)


def hold_energy(t: Tables, dd: F64, df: F64, way: Way) -> tuple[F64, F64]:
    """Scales what a change of phong's k_d and k_s frees until both reflect no more than arrives.

    One free parameter is lowered alone, two are scaled alike; a grey k_s stays grey.  preview_surface cannot gain
    energy.  Source: Nguyen et al. 2013, 5.3.
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
        df = np.full(3, df.min()) if way.specular is Specular.GREY else df
    return dd, df


