"""Solve: which change of diffuse, specular and glossiness explains what was painted with the fewest freedoms.

At a fixed roughness the mean radiance of a dab is bilinear in the shared change (delta d, delta F0):

    L = P + dd U + df V - dd df W

with four tables P, U, V, W per dab, level and channel.  Every candidate (nothing, diffuse, grey or coloured
specular, glossiness and their unions, at every level) is fitted to all dabs of a material at once, under the
covariance of a painter's errors: independent error of a dab, brightness that drifts over the stroke, a tint.
The choice weighs the misfit against the degrees of freedom; then the chosen parameters alone are fitted again.

Source: Nguyen et al. 2013, 5.3 (Eqs. 3 to 6), pooled over the stroke; Schwarz 1978 (Bayesian information).
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from usdslf.inference.bilinear import Tables
from usdslf.inference.candidate import GROUPS, Candidate, ways_of
from usdslf.inference.weights import Options
from usdslf.scene.records import F64

TRUST = (0.5, 0.25, 0.15, 0.1, 0.07, 0.05)  # relative error of a dab at which it has half its weight, round by round
FEWEST_HEARD = 4  # dabs; fewer count as many
COLOR_GAIN = 4.0  # misfit for which a grey metal becomes coloured
ROUNDS = 4  # of Gauss and Newton, for the bilinear candidates


def whiten(t: Tables, o: Options) -> F64:
    """Returns the matrix (3n, 3n) that makes relative residuals, dab by dab and channel by channel, independent."""
    n = len(t.target)
    same = (t.stroke[:, None] == t.stroke[None]).astype(float)
    gap = np.linalg.norm(t.place[:, None] - t.place[None], axis=-1)
    extent = np.array([gap[np.ix_(t.stroke == s, t.stroke == s)].max() for s in t.stroke])
    length = np.maximum(o.drift_length * extent, 1e-9)
    drift = same * np.exp(-0.5 * (gap / length[:, None]) ** 2) * o.drift_error**2
    drift = 0.5 * (drift + drift.T)
    eye, one = np.eye(3), np.ones((3, 3))
    cov = np.kron(drift, one) + np.kron(same * o.tint_error**2, eye) + np.eye(3 * n) * o.dab_error**2
    # who paints with one colour gets the mean right, not the contrast
    for s in np.unique(t.stroke[t.flat]):
        mine = (t.stroke == s).astype(float)
        cov += np.kron(o.flat_error**2 * (np.diag(mine) - np.outer(mine, mine) / mine.sum()), eye)
    return np.linalg.inv(np.linalg.cholesky(cov))


def enumerate_candidates(t: Tables, o: Options | None = None, groups: tuple[str, ...] = GROUPS) -> list[Candidate]:
    """Fits every candidate at every level and returns the best of each set of parameters, cheapest first."""
    o = o or Options()
    white = whiten(t, o)
    best: dict[tuple, Candidate] = {}  # by parameters and whether the specular change is grey
    for free_gloss in (False, True) if "glossiness" in groups else (False,):
        for level in range(t.own) if free_gloss else (t.own,):
            for diffuse in _choices("diffuse" in groups, ("color",)):
                for specular in _choices("specular" in groups, ("grey", "color")):
                    c = fit(t, o, white, level, diffuse, specular, free_gloss)
                    if (c.id, specular) not in best or c.cost < best[c.id, specular].cost:
                        best[c.id, specular] = c
    found = [fit(t, o, white, c.level, *ways_of(c), True) for c in best.values()]
    found.sort(key=lambda c: c.cost)
    return [c for i, c in enumerate(found) if c.id not in {other.id for other in found[:i]}]


def _choices(allowed: bool, ways: tuple[str, ...]) -> tuple[str, ...]:
    return ("", *ways) if allowed else ("",)


def fit(
    t: Tables, o: Options, white: F64, level: int, diffuse: str, specular: str, free_gloss: bool, robust: bool = False
) -> Candidate:
    """Fits one candidate: `diffuse` in "", "color"; `specular` in "", "grey", "color"; robustly against single dabs."""
    freed = tuple(g for g, f in zip(GROUPS, (diffuse, specular, free_gloss), strict=True) if f)
    can_tint = t.is_textured if diffuse else t.is_textured_f0 and specular == "color"
    tries = [False, True] if can_tint else [False]
    how = _fit_robustly if robust else _fit
    fits = [how(t, o, white, level, diffuse, specular, tint) for tint in tries]
    tint = int(len(fits) > 1 and fits[1][2] < fits[0][2])
    dd, df, misfit = fits[tint]
    freedoms = 3 * bool(diffuse) + {"": 0, "grey": 1, "color": 3}[specular] + free_gloss
    c = Candidate(
        freed, dd, df, float(t.levels[level] - t.roughness) if free_gloss else 0.0, bool(tint), level,
        misfit, freedoms,
    )  # fmt: skip
    return replace(c, cost=score(t, o, c))


def score(t: Tables, o: Options, c: Candidate) -> float:
    """Cost of a candidate: misfit, unpainted directions, freedoms, and how odd it is for the kind of surface."""
    n = len(t.target)
    heard = max(n, FEWEST_HEARD)  # a dab alone is meant as much as a few
    cost = heard * o.tail * np.log1p(c.misfit / (n * o.tail)) + o.background * n * min(background_misfit(t, c), 1.5)
    if o.norm == "mixed" and o.factors is not None:  # Eq. 4 with the paper's weights, pooled
        return float((c.misfit + o.background * n * background_misfit(t, c)) * o.factors[max(len(c.freed), 1) - 1])
    cost -= o.place * place_gain(t, o, c)
    if o.norm == "l0" and len(c.freed) > 1:
        return float(cost + 1e6)
    if o.norm == "l2":
        return float(cost if len(c.freed) == 3 else cost + 1e6)
    is_wanting = not c.freed and relative_error(t, c) > 0.1
    cost += o.nothing * is_wanting + o.freedom * c.freedoms + o.group * max(len(c.freed) - 1, 0)
    if t.is_metal and "diffuse" in c.freed:
        cost += o.kind
    is_colored = float(np.ptp(c.f0_of(t.f0))) > 0.05
    if not t.is_metal and "specular" in c.freed and is_colored and np.ptp(t.f0) < 0.02:
        cost += o.kind
    return float(cost)


def background_misfit(t: Tables, c: Candidate) -> float:
    """Mean square relative change of the unpainted directions."""
    p, u, v, w, scale = t.back
    if not len(p):
        return 0.0
    change = _predict(c.as_terms(t), p, u, v, w) - p[:, t.own]
    r = np.minimum(np.abs(change / scale), 3.0)
    return float((r * r).mean())


def place_gain(t: Tables, o: Options, c: Candidate) -> float:
    """How much better than chance the stroke lies where the candidate changes what is seen.

    The sum over the dabs of log(change at the dab / mean change over the painted surfaces that the eye sees):
    nothing for a change that is the same everywhere, a gain for a highlight that was painted where it appears.
    """
    p, u, v, w = t.elsewhere
    if not len(p) or not c.freed:
        return 0.0
    here = np.abs(predicted(t, c) - t.p[:, t.own])
    there = np.abs(_predict(c.as_terms(t), p, u, v, w) - p[:, t.own])
    floor = max(o.visible * t.target.mean(), 1e-9)  # black paint
    here, there = here.sum(1) + floor, there.sum(1) + floor
    return float(np.log(here / there.mean()).sum())


def _predict(c: Candidate, p: F64, u: F64, v: F64, w: F64) -> F64:
    """Radiance (n, 3) that a candidate gives, from tables (n, J, 3)."""
    j = c.level
    dd, df = c.delta_diffuse, c.delta_f0
    return p[:, j] + dd * u[:, j] + df * v[:, j] - dd * df * w[:, j]


def _fit_robustly(
    t: Tables, o: Options, white: F64, level: int, diffuse: str, specular: str, tint: bool
) -> tuple[F64, F64, float]:
    """Least squares again and again, with less and less trust in dabs that stay far off (Holland and Welsch 1977)."""
    best = _fit(t, o, white, level, diffuse, specular, tint)
    if not (diffuse or specular):
        return best
    starts = [best[:2]]
    if not (diffuse and specular):
        starts.append(_median_change(t, level, diffuse, specular, tint))
    for dd, df in starts:
        for reach in TRUST:
            freed = (*["diffuse"] * bool(diffuse), *["specular"] * bool(specular))
            off = _relative(t, Candidate(freed, dd, df, is_tint=tint, level=level))
            trust = np.sqrt(1 / (1 + (off * off).mean(1) / reach**2))
            dd, df, misfit = _fit(t, o, white, level, diffuse, specular, tint, trust)
            if misfit < best[2]:
                best = (dd, df, misfit)
    return best


def _median_change(t: Tables, level: int, diffuse: str, specular: str, tint: bool) -> tuple[F64, F64]:
    """The change that half of the dabs, weighed by how much they feel it, would have smaller, channel by channel."""
    of_d, of_f0 = (t.tint_u, t.tint_v) if tint else (t.u, t.v)
    slope = of_d[:, level] if diffuse else of_f0[:, level]
    wanted = (t.target - t.p[:, level]) / np.where(np.abs(slope) > 1e-12, slope, 1e-12)
    weight = np.abs(slope) / t.scale
    if specular == "grey":
        wanted, weight = wanted.reshape(-1, 1), weight.reshape(-1, 1)
    order = np.argsort(wanted, 0)
    cumulated = np.cumsum(np.take_along_axis(weight, order, 0), 0)
    middle = (cumulated < 0.5 * cumulated[-1:]).sum(0)
    change = np.take_along_axis(np.take_along_axis(wanted, order, 0), middle[None], 0)[0] * np.ones(3)
    bounds = bounds_of(t.diffuse, tint, t.most_diffuse) if diffuse else bounds_of(t.f0, tint)
    change = np.clip(change, *bounds)
    return (change, np.zeros(3)) if diffuse else (np.zeros(3), change)


def bounds_of(color: F64, tint: bool, most: float = 1.0) -> tuple[F64, F64]:
    """Returns the least and the greatest change (3,), or factor less one, that keep a colour (3,) in 0..most."""
    return (-np.ones(3), most / np.maximum(color, 1e-3) - 1) if tint else (-color, np.maximum(most - color, 0))


def predicted(t: Tables, c: Candidate) -> F64:
    """Returns the radiance (n, 3) of the dabs that a candidate gives."""
    if not c.is_tint:
        return _predict(c, t.p, t.u, t.v, t.w)
    if c.is_tint_f0:
        return _predict(c, t.p, t.u, t.tint_v, t.w)
    return _predict(c, t.p, t.tint_u, t.v, t.tint_w)


def _relative(t: Tables, c: Candidate) -> F64:
    """Relative residuals (n, 3) of a candidate."""
    return (predicted(t, c) - t.target) / t.scale


def _fit(
    t: Tables, o: Options, white: F64, level: int, diffuse: str, specular: str, tint: bool, trust: F64 | None = None
) -> tuple[F64, F64, float]:
    """Least squares of the whitened residual under the bounds; returns delta d (or factor), delta F0, misfit."""
    tint_d, tint_f0 = tint and bool(diffuse), tint and not diffuse
    u, w = (t.tint_u, t.tint_w) if tint_d else (t.u, t.w)
    p, u, v, w = (x[:, level] for x in (t.p, u, t.tint_v if tint_f0 else t.v, w))
    (low_d, high_d), (low_f, high_f) = bounds_of(t.diffuse, tint_d, t.most_diffuse), bounds_of(t.f0, tint_f0)
    dd, df = hold_energy(t, np.zeros(3), np.zeros(3), diffuse, specular, tint)
    n = len(t.target)

    scale = t.scale if trust is None else t.scale / trust[:, None]

    def residual(dd: F64, df: F64, scale: F64) -> F64:
        return white @ ((p + dd * u + df * v - dd * df * w - t.target) / scale).reshape(-1)

    r = residual(dd, df, scale)
    if diffuse or specular:
        for _ in range(ROUNDS if diffuse and specular else 2):
            columns: list[F64] = []
            lows: list[float] = []
            highs: list[float] = []
            at: list[float] = []
            if diffuse:
                g = (u - df * w) / scale
                for c in range(3):
                    columns.append(_channel(g, c, n))
                lows, highs, at = [*lows, *low_d], [*highs, *high_d], [*at, *dd]
            if specular:
                g = (v - dd * w) / scale
                if specular == "color":
                    for c in range(3):
                        columns.append(_channel(g, c, n))
                    lows, highs, at = [*lows, *low_f], [*highs, *high_f], [*at, *df]
                else:
                    columns.append(g.reshape(-1))
                    lows, highs, at = [*lows, low_f.max()], [*highs, high_f.min()], [*at, df[0]]
            a = white @ np.stack(columns, 1)
            x = bounded_least_squares(a, a @ np.array(at) - r, np.array(lows), np.array(highs))
            if diffuse:
                dd, x = x[:3], x[3:]
            if specular:
                df = x[:3] if specular == "color" else np.full(3, x[0])
            dd, df = hold_energy(t, dd, df, diffuse, specular, tint)
            r = residual(dd, df, scale)
    r = residual(dd, df, t.scale)
    of_dab = (r * r).reshape(n, 3).sum(1)
    return dd, df, float((o.outlier * np.log1p(of_dab / o.outlier)).sum())


def hold_energy(t: Tables, dd: F64, df: F64, diffuse: str, specular: str, tint: bool) -> tuple[F64, F64]:
    """Scales what a change of phong's k_d and k_s frees until both reflect no more than arrives.

    One free parameter is lowered alone, two are scaled alike; a grey k_s stays grey.  preview_surface cannot gain
    energy.  Source: Nguyen et al. 2013, 5.3.
    """
    if not t.is_phong or not (diffuse or specular):
        return dd, df
    tint_d, tint_f0 = tint and bool(diffuse), tint and not diffuse
    k_d, k_s = t.diffuse * (1 + dd) if tint_d else t.diffuse + dd, t.f0 * (1 + df) if tint_f0 else t.f0 + df
    if diffuse and specular:
        share = 1 / np.maximum(k_d + k_s, 1)
        k_d, k_s = k_d * share, k_s * share
    elif diffuse:
        k_d = np.minimum(k_d, np.maximum(1 - k_s, 0))
    else:
        k_s = np.minimum(k_s, np.maximum(1 - k_d, 0))
    if diffuse:
        dd = k_d / np.maximum(t.diffuse, 1e-12) - 1 if tint_d else k_d - t.diffuse
    if specular:
        df = k_s / np.maximum(t.f0, 1e-12) - 1 if tint_f0 else k_s - t.f0
        df = np.full(3, df.min()) if specular == "grey" else df
    return dd, df


def _channel(g: F64, c: int, n: int) -> F64:
    out = np.zeros((n, 3))
    out[:, c] = g[:, c]
    return out.reshape(-1)


def bounded_least_squares(a: F64, b: F64, low: F64, high: F64) -> F64:
    """Least squares a x = b, low <= x <= high: what leaves the bounds is fixed on them and the rest solved again."""
    free = np.ones(len(low), bool)
    x = np.clip(np.zeros(len(low)), low, high)
    for _ in range(len(low)):
        if not free.any():
            break
        normal = a[:, free].T @ a[:, free]
        normal[np.diag_indices_from(normal)] += 1e-9 * (np.trace(normal) / len(normal) + 1e-30)
        x[free] = np.linalg.solve(normal, a[:, free].T @ (b - a[:, ~free] @ x[~free]))
        out = free & ((x < low) | (x > high))
        x = np.clip(x, low, high)
        if not out.any():
            break
        free &= ~out
    return x


def refit(t: Tables, chosen: Candidate, o: Options | None = None) -> Candidate:
    """Fits the chosen parameters again, on the painted directions alone and without a painter's drift and tint."""
    o = o or Options()
    exact = replace(o, drift_error=0.0, tint_error=0.0, outlier=4.0)
    white = whiten(t, exact)
    diffuse, specular, _ = ways_of(chosen)
    dd, df, misfit = _fit_robustly(t, exact, white, chosen.level, diffuse, specular, chosen.is_tint)
    if specular == "grey" and t.is_metal:  # a metal's colour, where the strokes are sure of it
        color = _fit_robustly(t, exact, white, chosen.level, diffuse, "color", chosen.is_tint)
        if misfit - color[2] > COLOR_GAIN:
            dd, df, misfit = color
            chosen = replace(chosen, freedoms=chosen.freedoms + 2)
    return replace(chosen, delta_diffuse=dd, delta_f0=df, misfit=misfit)


def relative_error(t: Tables, c: Candidate) -> float:
    """Relative root mean square of the painted radiance minus what the candidate gives."""
    return float(np.sqrt(np.mean(_relative(t, c) ** 2)))
