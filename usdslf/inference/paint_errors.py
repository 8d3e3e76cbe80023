"""Paint errors: what a painter got wrong in a pool of strokes, read off what an explanation leaves of the paint.

    paint_errors(tables, options, candidate) -> PaintErrors
    refit_as_painted(tables, options, candidate) -> Candidate, fitted by the errors of just this paint

Paint is what a surface shows times 1 + error, so that residuals are relative to what the candidate shows, and an error
has the covariance, over dabs i, j and channels,

    C = a s_i s_j (drift^2 exp(-ROUGH |x_i - x_j| / l) 1 + tint^2 I) + (b dab^2 / trust^2 + e_i^2) K     (of one stroke)
        + f_i f_j G + g_i g_j,    K = k 1 + (1 - k) I,  G the same with ALL_GREY

where 1 and I go over the channels, e, f and g are what the light field errs by at each dab, and at all of a stroke
(field_errors.py), and s is what is shown over what residuals are relative to: that has a floor, beside
which an error of all paint is less of a dark dab than of a bright one; without s a stroke that is too dark as a whole
would look like a weaker highlight.  What one dab errs by may be mostly grey (k is 0 or GREY), as the evidence saw more
or less of a light: with errors of three channels apart that would be drift, and exact paint of a bumpy surface
careless.  How large a and b are, and k, is read off the residual in the part of it that neither the candidate's
parameters nor the brightness of a whole stroke can explain (restricted maximum likelihood, averaged over a grid), so
that a careful painter is believed and a careless one is heard for the contrast.  A dab that is far off what its
neighbours say (an edge, a thin part) loses trust.  Dabs that share a swatch count as their mean.  The exponential keeps
rough errors possible: with a smoother one, small steps among dabs would prove large drifts.

Source: Patterson and Thompson 1971 (restricted likelihood); Aitken 1935 (generalized least squares); Lange, Little and
Taylor 1989 (trust by Student's t).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache

import numpy as np
from numpy.typing import NDArray

from usdslf.edits.whole_set import Colored
from usdslf.inference.bilinear import Tables
from usdslf.inference.candidate import Candidate, is_grey
from usdslf.inference.error_sizes import Left, Prior, Sizes, mostly_grey, read_sizes
from usdslf.inference.field_errors import ALL_DOUBT, ALL_GREY, OF_DOUBT, field_errors
from usdslf.inference.fit import Problem, Way, fit, relative_residuals
from usdslf.inference.residuals import mean_by_stroke, relative_scale
from usdslf.inference.weights import Options
from usdslf.inference.whitening import White, gaps_and_extents, inverse_root, white_of_parts
from usdslf.scene.records import F64

USUAL = (0.03, 0.03)  # middle of what a and b are where the dabs are few
USUAL_OF_SWATCHES = (0.015, 0.06)  # the same where all dabs have one of few colours, which was mixed with care
USUAL_OF_ONE = (0.02, 0.05)  # the same of one colour, which nothing can be held against
ROUGH = 0.4  # of the inverse length of drift, which the exponential needs to be as smooth near by
LEAST = 0.007  # relative error that every dab of paint has
SLACK = 1.4  # by which the variance of dabs with colours of their own grows, as t's scale is less than its width
OF_SWATCH = 0.4  # of the variance of what a swatch shows (natural logarithms) that its mean is uncertain by
DEGREES = 2.0  # of freedom of Student's t
ROUNDS = 3
COLOR_GAIN = 16.0  # misfit for which a grey specular change becomes coloured; grey paint gains 9 at most
COLORED = 0.05  # range of the channels of F0 that is a colour
CAREFUL = 0.035  # relative residual of paint that is fitted as it is: the light field's own error
AT_END = 1e-4  # of 0 and 1, where a colour is held
UNSAID = 3.0  # relative error of channels that are held there
UNLIKELY = 1e-3  # chance of a size that is left out
LEAST_DOUBT = 0.01  # of a dab, that is more than rounding
MOST_GROUPS = 96  # dabs and swatches that a and b are read off


@dataclass(frozen=True)
class PaintErrors:
    """Covariance of relative residuals of m dabs and swatches of n dabs, and the columns of what is free.

    C = s s' (kron(shared, 1) + kron(tinted, I)) + kron(sure, G) + doubt doubt' + sqrt(single) kron(I, K) sqrt(single) +
    unsaid, with 1, I, G and K over the channels.
    """

    together: F64 | None  # (m, n) takes the mean of dabs that share a swatch; None: all are alone
    sizes: Sizes  # what a and b are likely to be
    alike: float  # a
    own: float  # b
    trust: F64  # (m,) 0..1
    drift: F64  # (m, m) brightness that drifts, where a is 1
    tint: F64  # (m, m) the same
    sure: F64  # (m, m) covariance of what the light field errs by at all dabs of a stroke
    each: F64  # (m,) variance of a dab's own errors where b is 1, a part of which is the light field's
    of_means: F64  # (m, 3) what a palette's colours mean, beside it
    vague: F64  # (m, 3) least variance of a dab's own errors: the light field's
    unsaid: F64  # (m, 3) variances of channels that say nothing
    share: F64  # (m, 3) s
    doubt: F64  # (m, 3) g

    @property
    def grey(self) -> float:
        """k."""
        return self.sizes.grey

    @property
    def shared(self) -> F64:
        """Covariance (m, m) of brightness that drifts."""
        return self.alike * self.drift

    @property
    def tinted(self) -> F64:
        """Covariance (m, m) of tints."""
        return self.alike * self.tint

    @cached_property
    def single(self) -> F64:
        """Variances (m, 3) of a dab's own errors, which are mostly grey."""
        return np.maximum(self.own * self.each[:, None] + self.of_means, self.vague)

    def likely(self) -> list[tuple[float, PaintErrors]]:
        """Errors of each size that is likely, and its chance."""
        each = zip(self.sizes.of_alike, self.sizes.alike, self.sizes.own_beside, strict=True)
        return [(float(p), replace(self, alike=float(a), own=float(b))) for p, a, b in each if p > UNLIKELY]

    @cached_property
    def covariance(self) -> F64:
        """The whole of it (3 m, 3 m)."""
        alike = np.kron(self.shared, np.ones((3, 3))) + np.kron(self.tinted, np.eye(3))
        size = np.sqrt(self.single).reshape(-1)
        own = np.kron(self.sure, mostly_grey(3, ALL_GREY)) + np.diag(self.unsaid.reshape(-1))
        own += np.outer(size, size) * np.kron(np.eye(len(self.single)), mostly_grey(3, self.grey))
        return np.outer(self.share, self.share) * alike + np.outer(self.doubt, self.doubt) + own

    @cached_property
    def root(self) -> White:
        """What makes relative residuals of dabs and swatches independent, of unit variance."""
        if max(np.ptp(x, axis=1).max(initial=0) for x in (self.single, self.share, self.doubt, self.unsaid)) == 0:
            share, doubt, single = self.share[:, 0], self.doubt[:, 0], self.single[:, 0]
            of = (self.sure[np.unique(self.sure.argmax(1))] > 0).T  # (m, strokes)
            sizes = share * np.sqrt(np.diag(self.tinted)), np.sqrt((1 - ALL_GREY) * np.diag(self.sure))
            alike = np.outer(share, share) * self.shared + np.outer(doubt, doubt) + np.diag(self.grey * single)
            alike += ALL_GREY * self.sure
            own = (1 - self.grey) * single + self.unsaid[:, 0]
            return white_of_parts(alike, own, np.concatenate([x[:, None] * of for x in sizes], 1))
        return White(None, None, inverse_root(self.covariance))

    @property
    def white(self) -> White:
        """What does so with those of dabs."""
        root, by = self.root, self.together
        if by is None:
            return root
        if root.whole is None:
            assert root.grey is not None and root.color is not None
            return White(root.grey @ by, root.color @ by)
        m, n = by.shape
        by_channel = root.whole.reshape(3 * m, m, 3).transpose(0, 2, 1).reshape(-1, m) @ by
        return White(None, None, by_channel.reshape(3 * m, 3, n).transpose(0, 2, 1).reshape(3 * m, 3 * n))

    def seen(self, x: F64) -> F64:
        """Returns what numbers (3 n, ...) of dabs are of dabs and swatches: (3 m, ...)."""
        if self.together is None:
            return x
        m, n = self.together.shape
        return np.asarray((self.together @ x.reshape(n, -1)).reshape(3 * m, *x.shape[1:]))


def refit_as_painted(t: Tables, o: Options, c: Candidate) -> Candidate:
    """Fits what a candidate frees again, by the errors that this paint shows, glossiness on all levels but the own.

    A grey specular change becomes coloured where this paint is too careful for its hue to be an error.

    Args:
        c: fitted already, at a level of the tables.
    """
    if not c.freed:
        return c
    left = relative_residuals(as_shown(t, c), c)
    if float(np.sqrt(np.mean(left**2))) < CAREFUL:
        return c  # contrast would be believed more than light fields are right
    found, errors = _refit(t, o, c)
    if "specular" not in c.freed or not is_grey(c) or (t.colored is Colored.NEVER and not t.is_metal):
        return found
    colored, errors = _refit(t, o, replace(c, freedoms=c.freedoms + 2))
    problem = Problem(as_shown(t, colored), replace(o, outlier=1e9), errors.white)
    grey, color = (_fitted(problem, x, (colored.level,))[0] for x in (c, colored))
    gain = grey.misfit - color.misfit
    asked = COLOR_GAIN * (2 if t.colored is Colored.MAPS and not t.is_metal else 1)
    is_colored = gain > asked and np.ptp(colored.f0_of(t.f0)) > COLORED
    return colored if is_colored else found


def _refit(t: Tables, o: Options, c: Candidate) -> tuple[Candidate, PaintErrors]:
    """The candidate fitted by the errors that it leaves, and those."""
    levels = range(t.own) if "glossiness" in c.freed else (c.level,)
    trust = None
    for _ in range(ROUNDS):
        t = as_shown(t, c)
        errors = paint_errors(t, o, c, trust)
        problem = Problem(t, replace(o, outlier=1e9), errors.white)
        c = _between_levels(t, _fitted(problem, c, levels))
        trust = _trust(t, o, c, errors)
    return c, errors


def _fitted(problem: Problem, c: Candidate, levels: Sequence[int]) -> list[Candidate]:
    """The candidate fitted at each of some levels."""
    found = fit(problem, Way.of(c), levels)
    return [
        replace(c, level=j, delta_diffuse=found.dd[i], delta_f0=found.df[i], misfit=float(found.misfit[i]))
        for i, j in enumerate(levels)
    ]


def _between_levels(t: Tables, fits: list[Candidate]) -> Candidate:
    """The best fit, its roughness at the bottom of the parabola through the misfits of its neighbours."""
    best = int(np.argmin([c.misfit for c in fits]))
    c = fits[best]
    if "glossiness" not in c.freed:
        return c
    at = float(t.levels[c.level])
    if 0 < best < len(fits) - 1:
        x = np.array([t.levels[f.level] for f in fits[best - 1 : best + 2]])
        y = np.array([f.misfit for f in fits[best - 1 : best + 2]])
        if np.ptp(x) > 1e-9 and (np.diff(x) != 0).all():
            bend, slope, _ = np.polyfit(x - at, y, 2)
            if bend > 0:
                at = float(np.clip(at - 0.5 * slope / bend, *sorted((0.5 * (x[0] + x[1]), 0.5 * (x[1] + x[2])))))
    return replace(c, roughness_shift=at - t.roughness)


def as_shown(t: Tables, c: Candidate) -> Tables:
    """Returns the tables with residuals relative to what a candidate shows, as paint is that times an error.

    Dabs of one swatch have one scale, for their mean is compared; where there are several swatches, the half way to
    what was painted, so that the logarithms' mean is: a palette's colours are chosen by ratios.
    """
    shown, group = np.abs(c.radiance(t)), t.group
    count = np.bincount(group)
    shown = np.stack([np.bincount(group, shown[:, k]) / count for k in range(3)], 1)[group]
    several = (t.swatch >= 0) & ~t.has_one_color
    shown = np.where(several[:, None], 0.5 * (shown + np.abs(t.target)), shown)
    mean = mean_by_stroke(t.target, t.stroke, t.before)
    return replace(t, scale=relative_scale(shown, mean[:, None]))


def columns_of(t: Tables, c: Candidate) -> tuple[list[tuple[str, int | None]], list[F64]]:
    """Derivatives (3 n,) of the relative radiance of the dabs by what a candidate frees, and what each is of."""
    j, n = c.level, len(t.target)
    names: list[tuple[str, int | None]] = []
    columns: list[F64] = []

    def add(name: str, g: F64, one_value: bool) -> None:
        if one_value:
            names.append((name, None))
            columns.append((g / t.scale).reshape(-1))
            return
        for channel in range(3):
            column = np.zeros((n, 3))
            column[:, channel] = (g / t.scale)[:, channel]
            names.append((name, channel))
            columns.append(column.reshape(-1))

    b = t.with_factors(c.is_factor_diffuse, c.is_factor_f0).at_level(c.level)
    if "diffuse" in c.freed:
        g = b.u - c.delta_f0 * b.w
        add("diffuse", g / np.maximum(t.diffuse, 1e-6) if c.is_factor_diffuse else g, False)
    if "specular" in c.freed:
        g = b.v - c.delta_diffuse * b.w
        add("specular", g / np.maximum(t.f0, 1e-6) if c.is_factor_f0 else g, is_grey(c))
    if "glossiness" in c.freed:
        low, high = max(j - 1, 0), min(j + 1, t.own - 1)
        ends = [replace(c, level=k).radiance(t) for k in (low, high)]
        apart = float(t.levels[high] - t.levels[low])
        add("roughness", (ends[1] - ends[0]) / apart if abs(apart) > 1e-9 else 0 * ends[0], True)
    return names, columns


def paint_errors(t: Tables, o: Options, c: Candidate, trust: F64 | None = None) -> PaintErrors:
    """Returns how large the errors of the paint are, if a candidate is what is meant.

    Args:
        t: as_shown, where the candidate is near.
        trust: (m,) in each dab or swatch; None: by the residual alone.
    """
    group = t.group
    count = np.bincount(group).astype(float)
    together = None
    if len(count) < len(group):
        together = (group[None] == np.arange(len(count))[:, None]) / count[:, None]
    mean = lambda x: x if together is None else together @ x  # noqa: E731
    residual = mean(relative_residuals(t, c))  # (m, 3)
    if trust is None:
        size = count * (residual**2).sum(1)
        trust = np.sqrt(np.minimum(1, (DEGREES + 3) / (DEGREES + 3 * size / (np.median(size) + 3 * LEAST**2))))
    drift, same = _shared(t, o)
    errs = field_errors(t, c)
    sure = np.outer(errs.shared, errs.shared) * same
    if together is not None:
        drift, same, sure = (together @ x @ together.T for x in (drift, same, sure))
    m, n, tint = len(count), len(group), o.tint_error**2 * same
    columns = np.stack(columns_of(t, c)[1], 1).reshape(n, -1) if c.freed else np.zeros((n, 0))
    held = held_channels(t, c)  # what they leave says how far the paint is from what can be
    share, doubt = (mean(x) for x in (np.minimum(np.abs(c.radiance(t)) / t.scale, 1), errs.doubt))
    points = errs.points if together is None else np.sqrt(together**2 @ errs.points**2)  # of a swatch's mean less
    if m > MOST_GROUPS:  # where channels are alike, grey and colours are apart, which is much faster
        share, points, doubt = (np.repeat(x.mean(1, keepdims=True), 3, 1) for x in (share, points, doubt))
    vague = points**2 + (OF_DOUBT * doubt) ** 2
    parts = [mean(columns).reshape(m, 3, -1), share[:, :, None] * mean(_of_strokes(t))[:, None]]
    if doubt.max(initial=0) > LEAST_DOUBT:
        parts.append(doubt[:, :, None])
    of_swatches = bool((t.swatch >= 0).all())
    usual = (USUAL_OF_ONE if t.has_one_color.all() else USUAL_OF_SWATCHES) if of_swatches else USUAL
    some = np.arange(m) if m <= MOST_GROUPS else np.linspace(0, m - 1, MOST_GROUPS).round().astype(int)
    left = Left(residual, np.concatenate(parts, 2), share, drift, tint).of(some, np.flatnonzero(~held))
    prior = Prior(usual, (LEAST / o.dab_error) ** 2, 1.0 if of_swatches else SLACK)
    of_paint, of_field = o.dab_error**2 / (count * trust**2), vague.mean(1) / trust**2
    sizes, beside = read_sizes(left, prior, of_paint[some], of_field[some])
    a, b = sizes.middle
    of_means = np.zeros((m, 3)) if together is None else _of_swatch_means(t, c, together)
    unsaid = np.broadcast_to(UNSAID**2 * held, (m, 3))
    return PaintErrors(
        together, sizes, alike=a, own=b, trust=trust, drift=drift, tint=tint, sure=sure,
        each=of_paint + of_field / beside, of_means=of_means, vague=vague, unsaid=unsaid, share=share,
        doubt=ALL_DOUBT * doubt,
    )  # fmt: skip


def held_channels(t: Tables, c: Candidate) -> NDArray[np.bool_]:
    """Tells in which channels (3,) all freed colours are at an end of what can be; none where it is all of them.

    What is left there is no error of the painter's, and asks nothing of the other channels.
    """
    freed = [x for name, x in (("diffuse", c.diffuse_of(t.diffuse)), ("specular", c.f0_of(t.f0))) if name in c.freed]
    if not freed:
        return np.zeros(3, bool)
    at_end = np.asarray(np.all([(x <= AT_END) | (x >= 1 - AT_END) for x in freed], axis=0))
    return np.zeros(3, bool) if at_end.all() else at_end


def _of_swatch_means(t: Tables, c: Candidate, together: F64) -> F64:
    """Variance (m, 3) of what a palette's colours mean where much is shown: means of several kinds differ by spread."""
    shown = np.maximum(np.abs(c.radiance(t)), 1e-2 * np.abs(t.target).mean() + 1e-9)
    logs = np.log(shown)
    spread = together @ logs**2 - (together @ logs) ** 2
    several = together @ ((t.swatch >= 0) & ~t.has_one_color).astype(float)
    return several[:, None] * (OF_SWATCH * np.maximum(spread, 0)) ** 2


def _of_strokes(t: Tables) -> F64:
    """(n, strokes) 1 where a dab is of a stroke."""
    return (t.stroke[:, None] == np.unique(t.stroke)[None]).astype(float)


def _shared(t: Tables, o: Options) -> tuple[F64, F64]:
    """Covariance (n, n) of drift, and which dabs are of one stroke; not to be written to."""
    place, stroke = np.asarray(t.place, np.float64).tobytes(), t.stroke.astype(np.int64).tobytes()
    return _shared_by(place, stroke, o.drift_length, o.drift_error)


@lru_cache(maxsize=4)
def _shared_by(at: bytes, group: bytes, drift_length: float, drift_error: float) -> tuple[F64, F64]:
    """The same by the values that it depends on: all explanations of a pool ask for it."""
    place, stroke = np.frombuffer(at, np.float64).reshape(-1, 3), np.frombuffer(group, np.int64)
    same = (stroke[:, None] == stroke[None]).astype(float)
    gap, extent = gaps_and_extents(place, stroke)
    drift = same * np.exp(-ROUGH * gap / np.maximum(drift_length * extent, 1e-9)[:, None])
    drift = drift_error**2 * 0.5 * (drift + drift.T)
    for x in (drift, same):
        x.flags.writeable = False
    return drift, same


def _trust(t: Tables, o: Options, c: Candidate, errors: PaintErrors) -> F64:
    """Trust (m,) in each dab or swatch, by what is left of it beside what it shares with the others."""
    residual = errors.seen(relative_residuals(t, c).reshape(-1))
    count = np.bincount(t.group)
    variance = errors.own * o.dab_error**2 / (count * errors.trust**2)
    weighed = errors.root.transposed(errors.root @ residual).reshape(-1, 3)
    own = (weighed @ mostly_grey(3, errors.grey) * weighed).sum(1)
    size = variance**2 * own * count / (errors.own * o.dab_error**2)
    return np.sqrt(np.minimum(1, (DEGREES + 3) / (DEGREES + size)))
