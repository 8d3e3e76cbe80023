"""Solve: which change of diffuse, specular and glossiness explains what was painted with the fewest freedoms.

Every candidate (nothing, diffuse, grey or coloured specular, glossiness and their unions, at every level) is fitted
to all dabs of a material at once (fit.py), and `score` says what each costs.  The choice weighs the misfit against
the degrees of freedom; then the chosen parameters alone are fitted again.

Source: Nguyen et al. 2013, 5.3 (Eqs. 3 to 6), pooled over the stroke; Schwarz 1978 (Bayesian information).
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from usdslf.edits.whole_set import Colored
from usdslf.inference.bilinear import Bilinear, Tables
from usdslf.inference.candidate import GROUPS, Candidate
from usdslf.inference.fit import (
    Problem,
    Rows,
    Specular,
    Way,
    fit_robustly,
    fit_rows,
    fit_rows_robustly,
    relative_residuals,
)
from usdslf.inference.weights import Options
from usdslf.progress import tell
from usdslf.scene.records import F64

FEWEST_HEARD = 4  # dabs; fewer count as many
COLOR_GAIN = 4.0  # misfit for which a grey metal becomes coloured
WANTING = 0.1  # relative error at which what was painted is not there yet
MOST_BACKGROUND = 1.5  # mean square relative change of the unpainted directions, where it counts no more
MOST_BESIDE = 1 << 13  # rows of all candidates that are looked at together
COLORED, GREY = 0.05, 0.02  # range of the channels of F0


def enumerate_candidates(t: Tables, o: Options | None = None, groups: tuple[str, ...] = GROUPS) -> list[Candidate]:
    """Fits every candidate at every level and returns the best of each set of parameters, cheapest first.

    Args:
        groups: parameters that may change.

    Returns: those that the norm admits come before the others.
    """
    problem = Problem.of(t, o or Options())
    ways: list[Way] = []
    levels: list[int] = []
    for free_gloss in (False, True) if "glossiness" in groups else (False,):
        for diffuse in (False, True) if "diffuse" in groups else (False,):
            for specular in _ways_of_specular(t) if "specular" in groups else (Specular.KEPT,):
                mine = range(t.own) if free_gloss else (t.own,)
                ways += [Way(diffuse, specular, free_gloss)] * len(mine)
                levels += mine
    best: dict[Way, Candidate] = {}
    for way, c in zip(ways, _fitted(problem, ways, levels), strict=True):
        if way not in best or c.rank < best[way].rank:
            best[way] = c
    robust = _fitted(problem, list(best), [c.level for c in best.values()], True)
    robust.sort(key=lambda c: c.rank)
    return [c for i, c in enumerate(robust) if c.id not in {other.id for other in robust[:i]}]


def _ways_of_specular(t: Tables) -> list[Specular]:
    """How the specular colour may change: not to a colour that could only be written by spoiling maps."""
    is_grey = t.colored is Colored.NEVER and not t.is_metal
    return [s for s in Specular if not (is_grey and s is Specular.COLOR)]


def _fitted(
    problem: Problem, ways: Sequence[Way], levels: Sequence[int], robust: bool = False
) -> list[Candidate]:  # fmt: skip
    """Candidates with their costs: by terms or, where a texture has other colours, by factors if these explain more."""
    t, how = problem.tables, fit_rows_robustly if robust else fit_rows
    tell()
    rows = Rows(tuple(ways), np.array(levels, np.int64))
    found, kinds = how(problem, rows), list(ways)
    can = rows.where(lambda w: t.is_textured if w.diffuse else t.is_textured_f0 and w.specular is Specular.COLOR)
    if len(can):
        factors = Rows(tuple(replace(ways[i], is_factor=True) for i in can), rows.levels[can])
        by_factor = how(problem, factors)
        wins = np.flatnonzero(by_factor.misfit < found.misfit[can])
        found = found.with_rows(can[wins], by_factor.rows(wins))
        for won in wins:
            kinds[can[won]] = factors.ways[won]
    candidates = []
    for i, (kind, level) in enumerate(zip(kinds, levels, strict=True)):
        shift = float(t.levels[level] - t.roughness) if kind.glossiness else 0.0
        mean = t.roughness if kind.glossiness and t.is_textured_roughness else 0.0
        c = kind.candidate(found.dd[i], found.df[i], level)
        candidates.append(replace(c, roughness_shift=shift, roughness_mean=mean, misfit=float(found.misfit[i])))
    costs = scores(t, problem.options, candidates)
    return [
        replace(c, cost=float(x), is_admitted=is_admitted(problem.options, c))
        for c, x in zip(candidates, costs, strict=True)
    ]  # fmt: skip


def is_admitted(o: Options, c: Candidate) -> bool:
    """Tells whether a norm lets a candidate be chosen: l0 one parameter at most, l2 all three alone, mixed any.

    Source: Nguyen et al. 2013, 5.3 (Eq. 4: infinite weights of l0 and l2).
    """
    return {"l0": len(c.freed) <= 1, "l2": len(c.freed) == len(GROUPS)}.get(o.norm, True)


def score(t: Tables, o: Options, c: Candidate) -> float:
    """Returns what one candidate costs; see `scores`."""
    return float(scores(t, o, [c])[0])


def scores(t: Tables, o: Options, candidates: Sequence[Candidate]) -> F64:
    """Returns what candidates (C,) cost, the less the better; costs compare within one norm and pool.

    With n dabs, h = max(n, FEWEST_HEARD), the misfit M of fit.py, the mean square B of the relative change of
    unpainted directions, the gain G of `place_gain`, and tail, background, ... the options of those names:

        l2          h tail log(1 + M / (n tail)) + background n min(B, 1.5) - place G
        mixed, l0   the same + freedom k + group (g - 1)+ + kind (is odd) + nothing (nothing changes, and should)
        factors     (M + background n B) f_g

    for k freedoms in g groups of parameters.  Odd are a metal that becomes diffuse, and a grey dielectric that
    becomes coloured; that is twice as odd where it takes the place of maps that say what is metal.  The first term is
    -2 log of a Lorentzian likelihood of the mean dab, so that a pool which nothing explains decides by its freedoms
    still (Black and Anandan 1996).  freedom k stands for k log n, which is 3 or 4 a freedom for dozens of dabs (Schwarz
    1978); group prefers few parameters as the paper's weights do.
    The last line is the paper's own choice, pooled over the stroke (Nguyen et al. 2013, Eq. 4).
    """
    n = len(t.target)
    misfit, background = np.array([c.misfit for c in candidates]), background_misfits(t, candidates)
    if o.norm == "mixed" and o.factors is not None:
        number = [max(len(c.freed), 1) - 1 for c in candidates]
        return (misfit + o.background * n * background) * np.array(o.factors, np.float64)[number]
    cost = tempered(misfit, n, o, max(n, FEWEST_HEARD)) + o.background * n * np.minimum(background, MOST_BACKGROUND)
    cost -= o.place * place_gains(t, o, candidates)
    if o.norm == "l2":
        return cost
    return cost + [_of_parameters(t, o, c) for c in candidates]


def _of_parameters(t: Tables, o: Options, c: Candidate) -> float:
    """What a candidate costs by what it changes, whatever it explains."""
    is_wanting = not c.freed and relative_error(t, c) > WANTING
    cost = o.nothing * is_wanting + o.freedom * c.freedoms + o.group * max(len(c.freed) - 1, 0)
    if t.is_metal and "diffuse" in c.freed:
        cost += o.kind
    is_colored = float(np.ptp(c.f0_of(t.f0))) > COLORED
    if not t.is_metal and "specular" in c.freed and is_colored and np.ptp(t.f0) < GREY:
        cost += o.kind * (2 if t.colored is Colored.MAPS else 1)
    return float(cost)


def tempered(misfit: F64 | float, n: int, o: Options, heard: int | None = None) -> F64:
    """Returns misfits of n dabs as they count: beyond Options.tail a dab, by their logarithm.

    Args:
        heard: dabs that these count as; None: n.
    """
    return np.asarray((heard or n) * o.tail * np.log1p(np.asarray(misfit) / (n * o.tail)))


def background_misfits(t: Tables, candidates: Sequence[Candidate]) -> F64:
    """Returns the mean square relative changes (C,) of the unpainted directions, 0..9."""
    if not len(t.background):
        return np.zeros(len(candidates))
    before = t.background.p[:, t.own]
    found = []
    for seen in _beside(t, t.background, candidates):
        r = np.minimum(np.abs((seen - before[:, None]) / t.background_scale[:, None]), 3.0)
        found.append(np.einsum("brc,brc->r", r, r) / (3 * len(before)))
    return np.concatenate(found)


def place_gains(t: Tables, o: Options, candidates: Sequence[Candidate]) -> F64:
    """Returns how much better than chance (C,) the stroke lies where candidates change what is seen.

    The sum over the dabs of log(change at the dab / mean change over the painted surfaces that the eye sees):
    nothing for a change that is the same everywhere, a gain for a highlight that was painted where it appears.
    """
    gains = np.zeros(len(candidates))
    rows = [i for i, c in enumerate(candidates) if c.freed]
    if not len(t.elsewhere) or not rows:
        return gains
    floor = max(o.visible * t.target.mean(), 1e-9)  # black paint
    before = t.elsewhere.p[:, t.own]
    asked = [candidates[i] for i in rows]
    there = np.concatenate(
        [(np.abs(seen - before[:, None]).sum(2) + floor).mean(0) for seen in _beside(t, t.elsewhere, asked)]
    )
    for i, c, mean in zip(rows, asked, there, strict=True):
        here = np.abs(c.radiance(t) - t.before).sum(1) + floor
        gains[i] = np.log(here / mean).sum()
    return gains


def _beside(t: Tables, beside: Bilinear, candidates: Sequence[Candidate]) -> Iterator[F64]:
    """What candidates make of rows (n) that were not painted: (n, r, 3) of some candidates after the others."""
    step = max(MOST_BESIDE // max(len(beside), 1), 1)
    for first in range(0, len(candidates), step):
        some = [c.as_terms(t) for c in candidates[first : first + step]]
        at = beside.levels([c.level for c in some])
        yield at.predict(np.array([c.delta_diffuse for c in some]), np.array([c.delta_f0 for c in some]))


def refit_problem(t: Tables, o: Options | None = None) -> Problem:
    """Returns the problem that `refit` solves: the painted directions alone, without a painter's drift and tint."""
    return Problem.of(t, replace(o or Options(), drift_error=0.0, tint_error=0.0, outlier=4.0))


def refit(problem: Problem, chosen: Candidate) -> Candidate:
    """Fits the chosen parameters again, at the level that they were chosen at.

    Args:
        problem: of `refit_problem`, which all levels share.
    """
    return refit_levels(problem, chosen, (chosen.level,))[0]


def refit_levels(problem: Problem, chosen: Candidate, levels: Sequence[int]) -> list[Candidate]:
    """Fits the chosen parameters again, at each of some levels."""
    way = Way.of(chosen)
    fits = fit_robustly(problem, way, levels)
    freedoms = [chosen.freedoms] * len(levels)
    if way.specular is Specular.GREY and problem.tables.is_metal:  # a metal's colour, where the strokes are sure of it
        color = fit_robustly(problem, replace(way, specular=Specular.COLOR), levels)
        is_sure = fits.misfit - color.misfit > COLOR_GAIN
        freedoms = [f + 2 * bool(sure) for f, sure in zip(freedoms, is_sure, strict=True)]
        fits = fits.with_those(color, is_sure)
    return [
        replace(
            chosen, level=level, delta_diffuse=fits.dd[i], delta_f0=fits.df[i], misfit=float(fits.misfit[i]),
            freedoms=freedoms[i],
        )
        for i, level in enumerate(levels)
    ]  # fmt: skip


def relative_error(t: Tables, c: Candidate) -> float:
    """Returns the relative root mean square of what the candidate gives minus the painted radiance."""
    return float(np.sqrt(np.mean(relative_residuals(t, c) ** 2)))
