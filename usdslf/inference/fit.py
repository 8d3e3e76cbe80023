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

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from enum import Enum

import numpy as np
from numpy.typing import NDArray

from usdslf.inference.bilinear import Tables
from usdslf.inference.candidate import GROUPS, Candidate, is_grey
from usdslf.inference.least_squares import bounded_solutions
from usdslf.inference.weights import Options
from usdslf.inference.whitening import White, Whitened, whiten
from usdslf.scene.records import F64

TRUST = (0.5, 0.25, 0.15, 0.1, 0.07, 0.05)  # relative error of a dab at which it has half its weight, round by round
STEPS = 4  # of Gauss and Newton, for the bilinear candidates
Kind = tuple[bool, bool]
"""Whether the change of diffuse is a factor less one, and that of F0."""


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

    def rows(self, rows: NDArray[np.int64]) -> Fits:
        """Returns some of them."""
        return Fits(self.dd[rows], self.df[rows], self.misfit[rows])

    def with_rows(self, rows: NDArray[np.int64], other: Fits) -> Fits:
        """Returns these with some of them replaced."""
        dd, df, misfit = self.dd.copy(), self.df.copy(), self.misfit.copy()
        dd[rows], df[rows], misfit[rows] = other.dd, other.df, other.misfit
        return Fits(dd, df, misfit)


@dataclass(frozen=True)
class Problem:
    """The dabs of a pool and the errors that are expected of them; fits of one pool share it."""

    tables: Tables
    options: Options
    white: White  # (3 m, 3 n)
    _whitened: dict[Kind, tuple[Whitened, F64]] = field(default_factory=dict, init=False, repr=False)

    @staticmethod
    def of(t: Tables, o: Options) -> Problem:
        """Whitens the dabs of a pool, once for all fits."""
        return Problem(t, o, whiten(t, o))

    def misfit(self, r: F64) -> F64:
        """Returns the sum of squares of whitened residuals (..., m), of single dabs by the logarithm."""
        of_dab = (r * r).reshape(*r.shape[:-1], -1, 3).sum(-1)
        outlier = self.options.outlier
        return (outlier * np.log1p(of_dab / outlier)).sum(-1)

    def whitened(self, kind: Kind, levels: NDArray[np.int64]) -> Whitened:
        """Returns the whitened tables at some levels; all levels are whitened at once, and kept."""
        return self._whole(kind)[0].levels(levels)

    def products(self, kind: Kind, levels: NDArray[np.int64]) -> F64:
        """Returns their products with each other: (R, 10, 10), see `Whitened.products`."""
        found = self._whole(kind)[1]
        return found[levels]

    def _whole(self, kind: Kind) -> tuple[Whitened, F64]:
        if kind not in self._whitened:
            t = self.tables
            share = np.broadcast_to(1 / t.scale[:, None], (len(t.target), len(t.levels), 3))
            white = self.white.of_tables(t.with_factors(*kind), t.target, share)
            self._whitened[kind] = white, white.products()
        return self._whitened[kind]

    def trusted_products(self, kind: Kind, levels: NDArray[np.int64], trust: F64) -> F64:
        """Returns the same by trust (n, R) in each dab at each of the levels, 0..1."""
        b, t = self.tables.with_factors(*kind).levels(levels), self.tables
        return self.white.products_of_tables(b, t.target, trust[..., None] / t.scale[:, None])


def relative_residuals(t: Tables, c: Candidate) -> F64:
    """Returns the relative residuals (n, 3) of a candidate."""
    return (c.radiance(t) - t.target) / t.scale


@dataclass(frozen=True)
class Rows:
    """R fits that are made side by side: how each changes the material, and at which level of the tables."""

    ways: tuple[Way, ...]
    levels: NDArray[np.int64]  # (R,)

    @staticmethod
    def of(way: Way, levels: Sequence[int]) -> Rows:
        """One way at some levels."""
        return Rows((way,) * len(levels), np.asarray(levels, np.int64))

    def __len__(self) -> int:
        return len(self.ways)

    def some(self, rows: NDArray[np.int64]) -> Rows:
        """Returns some of them, or some several times."""
        return Rows(tuple(self.ways[i] for i in rows), self.levels[rows])

    def where(self, is_so: Callable[[Way], bool]) -> NDArray[np.int64]:
        """Returns which of them (r,) change the material in a way that is so."""
        return np.flatnonzero([is_so(w) for w in self.ways])

    @property
    def kinds(self) -> dict[Kind, NDArray[np.int64]]:
        """Which of them (r,) have factors in place of terms, of diffuse and of F0."""
        each = np.array([(w.is_factor_diffuse, w.is_factor_f0) for w in self.ways]).reshape(-1, 2)
        return {(bool(a), bool(b)): np.flatnonzero((each == (a, b)).all(1)) for a, b in np.unique(each, axis=0)}

    @property
    def freed(self) -> F64:
        """Unknowns (R, 6, 6): 1 where one, a column, moves a channel of d or F0; a grey F0 has one for all channels."""
        turn = np.zeros((len(self), 6, 6))
        for i, way in enumerate(self.ways):
            turn[i, range(3), range(3)] = way.diffuse
            if way.specular is Specular.COLOR:
                turn[i, range(3, 6), range(3, 6)] = 1
            elif way.specular is Specular.GREY:
                turn[i, 3:, 3] = 1
        return turn


def fit_robustly(problem: Problem, way: Way, levels: Sequence[int]) -> Fits:
    """Least squares again and again, with less and less trust in dabs that stay far off; at each level by itself."""
    return fit_rows_robustly(problem, Rows.of(way, levels))


def fit_rows_robustly(problem: Problem, rows: Rows) -> Fits:
    """The same of fits side by side, each by itself."""
    best = fit_rows(problem, rows)
    for kind, of_kind in rows.kinds.items():
        mine = of_kind[rows.some(of_kind).where(lambda w: w.has_colors)]
        if len(mine):
            best = best.with_rows(mine, _robust_fits(problem, rows.some(mine), kind, best.rows(mine)))
    return best


def _robust_fits(problem: Problem, rows: Rows, kind: Kind, best: Fits) -> Fits:
    """Fits of one kind that all change colours, from the best so far."""
    t, twice = problem.tables, rows.where(lambda w: not (w.diffuse and w.has_specular))
    dd, df = best.dd, best.df
    for way in dict.fromkeys(rows.ways[i] for i in twice):
        other = _median_change(t, way, [int(rows.levels[i]) for i in twice if rows.ways[i] == way])
        dd, df = np.concatenate([dd, other[0]]), np.concatenate([df, other[1]])
    again = [i for way in dict.fromkeys(rows.ways[i] for i in twice) for i in twice if rows.ways[i] == way]
    number = np.concatenate([np.arange(len(rows)), np.array(again, np.int64)])
    both = rows.some(number)
    b = t.with_factors(*kind).levels(both.levels)
    for reach in TRUST:
        off = (b.predict(dd, df) - t.target[:, None]) / t.scale[:, None]
        size = np.einsum("nrc,nrc->nr", off, off) / 3
        found = fit_rows(problem, both, np.sqrt(1 / (1 + size / reach**2)))
        dd, df = found.dd, found.df
        for part in (np.arange(len(rows)), np.arange(len(rows), len(both))):
            of, of_part = number[part], found.rows(part)
            wins = of_part.misfit < best.misfit[of]
            best = best.with_rows(of[wins], of_part.rows(np.flatnonzero(wins)))
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
    return fit_rows(problem, Rows.of(way, levels), trust)


def fit_rows(problem: Problem, rows: Rows, trust: F64 | None = None) -> Fits:
    """The same of fits side by side, each by itself.

    Args:
        trust: (n, R) in each dab; None: whole.
    """
    found = Fits(np.zeros((len(rows), 3)), np.zeros((len(rows), 3)), np.zeros(len(rows)))
    for kind, mine in rows.kinds.items():
        part = _fits_of_kind(problem, rows.some(mine), kind, None if trust is None else trust[:, mine])
        found = found.with_rows(mine, part)
    return found


def _fits_of_kind(problem: Problem, rows: Rows, kind: Kind, trust: F64 | None) -> Fits:
    t, zero = problem.tables, np.zeros((len(rows), 3))
    if trust is None:
        products = problem.products(kind, rows.levels)
    else:
        products = problem.trusted_products(kind, rows.levels, trust)
    dd, df = _held(t, zero, zero, rows)
    turn = rows.freed
    is_free, back = np.asarray(turn.any(1)), turn.transpose(0, 2, 1)
    ends = [np.concatenate(x) for x in zip(*bounds_of_tables(t, *kind), strict=True)]
    some = np.where(turn > 0, 1.0, np.nan)
    low, high = (
        np.where(is_free, how(np.where(np.isnan(some), fill, some * x[:, None]), 1), 0.0)
        for how, fill, x in ((np.max, -np.inf, ends[0]), (np.min, np.inf, ends[1]))
    )
    steps = STEPS if any(w.diffuse and w.has_specular for w in rows.ways) else 2
    for _ in range(steps if is_free.any() else 0):
        state = np.concatenate([np.ones((len(rows), 1)), dd, df, -dd * df], 1)
        slope = _slopes(dd, df) @ turn  # of the state, (R, 10, 6)
        by_state = slope.transpose(0, 2, 1) @ products
        normal = by_state @ slope
        at = np.concatenate([dd, df], 1)
        at = (back @ at[..., None])[..., 0] / np.maximum(turn.sum(1), 1)
        right = (normal @ at[..., None] - by_state @ state[..., None])[..., 0]
        x = np.asarray(turn @ bounded_solutions(normal, right, low, high, is_free)[..., None])[..., 0]
        dd, df = _held(t, x[:, :3], x[:, 3:], rows)
    return Fits(dd, df, problem.misfit(problem.whitened(kind, rows.levels).at(dd, df)))


def _slopes(dd: F64, df: F64) -> F64:
    """Derivatives (R, 10, 6) of 1, dd, dF, -dd dF by dd and dF."""
    out = np.zeros((len(dd), 10, 6))
    for k in range(3):
        out[:, 1 + k, k] = out[:, 4 + k, 3 + k] = 1
        out[:, 7 + k, k], out[:, 7 + k, 3 + k] = -df[:, k], -dd[:, k]
    return out


def _held(t: Tables, dd: F64, df: F64, rows: Rows) -> tuple[F64, F64]:
    """Changes (R, 3) of fits, each held to what its way may reflect."""
    if not t.must_hold_energy:
        return dd, df
    dd, df = dd.copy(), df.copy()
    for way in set(rows.ways):
        mine = rows.where(lambda w, way=way: w == way)  # type: ignore[misc]
        dd[mine], df[mine] = hold_energy(t, dd[mine], df[mine], way)
    return dd, df


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


