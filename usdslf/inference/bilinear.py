"""Bilinear tables: the evidence about one material, pooled over strokes, bilinear in the change of its colours.

    pool_tables(evidences, material, model) -> Tables
    Bilinear(p, u, v, w)                L = P + dd U + dF V - dd dF W

Source: Nguyen et al. 2013, 5.3 (Eqs. 3 to 6), pooled over the stroke.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from usdslf.edits.whole_set import Colored
from usdslf.inference.columns import DeviceColumns, Means
from usdslf.inference.evidence import Evidence, mean_by, varies
from usdslf.inference.residuals import mean_by_stroke, relative_scale
from usdslf.scene.records import F64
from usdslf.surfaces.reflectance import is_metal, model_of

SHARED = 3  # dabs of one colour that were painted with one swatch, and do not say how they differ
PALETTE = 0.8  # share of a stroke's dabs that do so, above which the others have a swatch of their own
MOST_SWATCHES = 1 << 16  # of a stroke
TEXTURED = 5e-3  # standard deviation of a reflectance over the dabs, above which it varies


@dataclass(frozen=True)
class Bilinear:
    """Radiance of n rows at J levels of roughness, bilinear in the changes dd and dF of two colours.

        L = P + dd U + dF V - dd dF W

    All four are (n, J, 3), or (n, 3) at one level.
    """

    p: F64
    u: F64
    v: F64
    w: F64

    def __len__(self) -> int:
        return len(self.p)

    def at_level(self, level: int) -> Bilinear:
        """Returns the rows (n, 3) at one level."""
        return Bilinear(self.p[:, level], self.u[:, level], self.v[:, level], self.w[:, level])

    def levels(self, levels: Sequence[int] | NDArray[np.int64]) -> Bilinear:
        """Returns the rows (n, r, 3) at some of the levels."""
        return Bilinear(*(x[:, levels] for x in (self.p, self.u, self.v, self.w)))

    def rows(self, rows: NDArray) -> Bilinear:
        """Returns some of the rows."""
        return Bilinear(self.p[rows], self.u[rows], self.v[rows], self.w[rows])

    def predict(self, dd: F64, df: F64) -> F64:
        """Returns the radiance, shaped like P, that changes (3,) of both colours give."""
        return self.p + dd * self.u + df * self.v - dd * df * self.w

    @staticmethod
    def joined(parts: list[Bilinear]) -> Bilinear:
        """Puts the rows of all parts into one."""
        return Bilinear(*(np.concatenate([getattr(b, k) for b in parts]) for k in "puvw"))

    @staticmethod
    def empty(levels: int) -> Bilinear:
        """Returns no rows at so many levels."""
        none = np.zeros((0, levels, 3))
        return Bilinear(none, none, none, none)


@dataclass(frozen=True)
class Tables:
    """Evidence about one material, pooled.  n dabs, B background rows, J levels (the last: own roughness)."""

    target: F64  # (n, 3)
    scale: F64  # (n, 3) that makes residuals relative
    place: F64  # (n, 3) position of each dab
    stroke: NDArray[np.int64]  # (n,) which stroke
    has_one_color: NDArray[np.bool_]  # (n,) its stroke does
    swatch: NDArray[np.int64]  # (n,) which colour it shares with dabs of its stroke, -1: its own; see `swatches`
    dabs: Bilinear  # (n, J, 3)
    factor_u: F64  # (n, J, 3) U and W of a factor on d, V of one on F0, instead of a term, for textured colours
    factor_w: F64
    factor_v: F64
    background: Bilinear  # (B, J, 3) of unpainted directions
    background_scale: F64  # (B, 3)
    elsewhere: Bilinear  # (E, J, 3) of unpainted points that the same eye sees
    dab_levels: F64  # (n, J) roughness of each dab at each level
    levels: F64  # (J,) their means
    diffuse: F64  # (3,) means over the dabs
    f0: F64
    roughness: float
    is_metal: bool  # F90 follows F0, no diffuse reflection
    is_textured: bool  # d varies
    is_textured_f0: bool = False
    is_textured_roughness: bool = False  # glossiness changes by a factor
    most_diffuse: float = 1.0  # that the material can reflect: its opacity, where it is seen through
    must_hold_energy: bool = False  # d + F0 <= 1 is for the fit to keep
    colored: Colored = Colored.FREE  # what a coloured specular colour takes of the material, where it is no metal
    noise: F64 = field(default_factory=lambda: np.zeros((1, 3)))  # (n, 3) standard error of `before`, by its points
    doubt: F64 = field(default_factory=lambda: np.zeros((1, 3, 3)))  # (n, 3, 3) of `before`, by d, F0 and F90: doubt.py

    @property
    def own(self) -> int:
        """Level of the roughness as it is."""
        return len(self.levels) - 1

    @property
    def group(self) -> NDArray[np.int64]:
        """Which dabs (n,) count as one: those of a swatch, each other one alone; numbered from 0."""
        alone = np.arange(-len(self.swatch), 0)
        _, number = np.unique(np.where(self.swatch < 0, alone, self.swatch), return_inverse=True)
        return number.reshape(-1)

    @property
    def before(self) -> F64:
        """Radiance (n, 3) of the dabs with nothing changed."""
        return self.dabs.p[:, self.own]

    def with_factors(self, of_diffuse: bool, of_f0: bool) -> Bilinear:
        """Returns the dabs' tables for changes of which one may be a factor less one in place of a term."""
        b = self.dabs
        return Bilinear(
            b.p,
            self.factor_u if of_diffuse else b.u,
            self.factor_v if of_f0 else b.v,
            self.factor_w if of_diffuse else b.w,
        )


@dataclass(frozen=True)
class _Rows:
    """What one stroke says about a material: n dabs, E unpainted points, B unpainted directions."""

    target: F64
    place: F64
    has_one_color: NDArray
    swatch: NDArray
    varied: NDArray
    dabs: Bilinear
    factor_u: F64
    factor_w: F64
    factor_v: F64
    elsewhere: Bilinear
    background: Bilinear
    levels: F64
    opacity: F64
    diffuse: F64
    f0: F64
    f90: F64
    noise: F64
    doubt: F64


def pool_tables(evidences: list[Evidence], material: int, model: str = "preview_surface") -> Tables:
    """Sums the evidence of strokes about one material into tables over dabs.

    Args:
        material: into the scene's; some dab has to lie on it.
        model: name of the reflectance model that the evidence was taken with.
    """
    rows = [e.once(("rows", material, model), partial(_rows_of, e, material, model)) for e in evidences]
    numbers = [i for i, part in enumerate(rows) if len(part.target)]
    parts = [rows[i] for i in numbers]
    assert parts, "no dab on the material"

    def cat(name: str) -> NDArray:
        return np.concatenate([getattr(part, name) for part in parts])

    dabs, background = (Bilinear.joined([getattr(part, k) for part in parts]) for k in ("dabs", "background"))
    target, levels = cat("target"), cat("levels")
    stroke = np.repeat(numbers, [len(part.target) for part in parts])
    d, f0 = cat("diffuse"), cat("f0")
    mean = mean_by_stroke(target, stroke, dabs.p[:, -1])
    return Tables(
        target=target,
        scale=relative_scale(target, mean[:, None]),
        place=cat("place"),
        stroke=stroke,
        has_one_color=cat("has_one_color"),
        swatch=np.where(cat("swatch") < 0, -1, cat("swatch") + MOST_SWATCHES * stroke),
        dabs=dabs,
        factor_u=cat("factor_u"),
        factor_w=cat("factor_w"),
        factor_v=cat("factor_v"),
        background=background,
        background_scale=relative_scale(background.p[:, -1], least=1e-9) if len(background) else np.zeros((0, 3)),
        elsewhere=Bilinear.joined([part.elsewhere for part in parts]),
        dab_levels=levels,
        levels=levels.mean(0),
        diffuse=d.mean(0),
        f0=f0.mean(0),
        roughness=float(levels[:, -1].mean()),
        is_metal=is_metal(d, f0, cat("f90")),
        is_textured=bool(d.std(0).max() > TEXTURED),
        is_textured_f0=bool(f0.std(0).max() > TEXTURED),
        is_textured_roughness=bool(cat("varied").any()),
        most_diffuse=float(np.clip(cat("opacity").min(), 0, 1)),
        must_hold_energy=not model_of(model).has_fresnel,
        noise=cat("noise"),
        doubt=cat("doubt"),
    )


def _rows_of(e: Evidence, material: int, model: str) -> _Rows:
    n = len(e.target)
    here = np.flatnonzero(e.material == material)
    mean = lambda x: mean_by(x, e.dab_of_sample)[:n][here]  # noqa: E731
    s = e.surface
    d, f0, f90 = (x.astype(np.float64) for x in (s.diffuse, s.f0, s.f90))
    f0 = model_of(model).held(d, f0)[1]  # as the light field reflects it
    tied = is_metal(d, f0, f90)
    row = e.background_sample
    keep = e.material[e.dab_of_sample[row]] == material
    other = np.flatnonzero((e.dab_of_sample >= n) & (s.material == material))
    parts = _parts_of(e, d, f0, f90, tied, model)
    own = parts.means.own + e.unchanging[: parts.first]
    elsewhere = bilinear(parts.behind[other - parts.first], d[other], f0[other], f90[other], tied, model)
    colors = e.target[here]
    is_even = bool((colors.std(0) <= 0.01 * colors.mean() + 1e-9).all()) if len(here) > 2 else False
    return _Rows(
        target=colors,
        place=mean(s.position.astype(np.float64)),
        has_one_color=np.full(len(here), e.stroke.tool == "replace" and is_even),
        swatch=swatches(colors, is_even) if e.stroke.tool == "replace" else np.full(len(here), -1),
        varied=np.full(len(here), varies(e.levels[:, -1])),
        dabs=parts.dabs(here, mean(e.unchanging)),
        factor_u=parts.means.factor_u[here],
        factor_w=parts.means.factor_w[here],
        factor_v=parts.means.factor_v[here],
        elsewhere=replace(elsewhere, p=elsewhere.p + e.unchanging[other, None]),
        background=bilinear(e.background, d[row], f0[row], f90[row], tied, model).rows(keep),
        levels=mean(e.levels),
        opacity=mean(s.opacity.astype(np.float64)),
        diffuse=mean(d),
        f0=mean(f0),
        f90=mean(f90),
        noise=np.sqrt(_variances_of_means(own, e.dab_of_sample[: parts.first])[here]),
        doubt=np.zeros((len(here), 3, 3)) if e.doubtful is None else mean(e.doubtful),
    )


def _variances_of_means(values: F64, group: NDArray) -> F64:
    """Variances of the means of rows by group, for every group: what one point is off says how far their mean is."""
    spread = mean_by((values - mean_by(values, group)[group]) ** 2, group)
    return spread / np.maximum(np.bincount(group), 1)[:, None]


@dataclass(frozen=True)
class _Parts:
    """What samples make of their columns: those of the dabs as means over each, and those behind them."""

    means: Means
    first: int  # of the samples behind the dabs
    behind: NDArray[np.float32]  # (S - first, J, 4, 3) columns

    def dabs(self, here: NDArray[np.int64], unchanging: F64) -> Bilinear:
        """Returns the radiance of some dabs; `unchanging` (k, 3) is theirs that no parameter changes."""
        m = self.means
        return Bilinear(m.p[here] + unchanging[:, None], m.u[here], m.v[here], m.w[here])


def _parts_of(e: Evidence, d: F64, f0: F64, f90: F64, tied: bool, model: str) -> _Parts:
    """The parts of evidence whose samples have d, F0, F90 (S, 3); on the device where its columns are."""
    n, known = len(e.target), e.columns
    bounds = np.searchsorted(e.dab_of_sample, np.arange(n + 1))
    first = int(bounds[-1])
    if isinstance(known, DeviceColumns):
        assert known.model == model, (known.model, model)
        return _Parts(known.means(bounds, d, f0, f90, tied), first, known.behind(first))
    dab, of = e.dab_of_sample[:first], slice(first)
    mean = lambda x: mean_by(x, dab)  # noqa: E731
    b = bilinear(known[of], d[of], f0[of], f90[of], tied, model)
    by = lambda color, x: mean(color[of, None] * x)  # noqa: E731
    means = Means(
        mean(b.p), mean(b.u), mean(b.v), mean(b.w), by(d, b.u), by(d, b.w), by(f0, b.v), b.p[:, -1]
    )  # fmt: skip
    return _Parts(means, first, known[first:])


def swatches(colors: F64, is_even: bool) -> NDArray[np.int64]:
    """Returns which colour (n,) each dab shares with SHARED - 1 others or more, -1 where it has one of its own.

    Where nearly all share one, the others were painted from the same palette: a pair, or a dab, is a swatch as well.

    Args:
        colors: (n, 3) that were painted.
        is_even: all count as one colour.
    """
    if is_even or not len(colors):
        return np.zeros(len(colors), np.int64)
    step = 1e-3 * max(float(np.abs(colors).mean()), 1e-9)
    _, which, count = np.unique(np.round(colors / step), axis=0, return_inverse=True, return_counts=True)
    which = which.reshape(-1)
    shares = count[which] >= SHARED
    return np.where(shares | (shares.mean() >= PALETTE), which, -1)


def bilinear(columns: NDArray[np.floating], d: F64, f0: F64, f90: F64, tied: bool, model: str) -> Bilinear:
    """Turns columns (n, J, 4, 3) into P, U, V, W (n, J, 3) about the present parameters (n, 3).

    Args:
        tied: F90 changes with F0, as in a metal of the metal workflow.
    """
    return Bilinear(
        *model_of(model).bilinear(np.asarray(columns, np.float64), d[:, None], f0[:, None], f90[:, None], tied)
    )
