"""Solve: which change of diffuse, specular and glossiness explains what was painted with the fewest freedoms.

Every candidate (nothing, diffuse, grey or coloured specular, glossiness and their unions, at every level) is fitted
to all dabs of a material at once (fit.py), and `score` says what each costs.  The choice weighs the misfit against
the degrees of freedom; then the chosen parameters alone are fitted again.

Source: Nguyen et al. 2013, 5.3 (Eqs. 3 to 6), pooled over the stroke; Schwarz 1978 (Bayesian information).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from usdslf.edits.whole_set import Colored
from usdslf.inference.bilinear import Tables
from usdslf.inference.candidate import GROUPS, Candidate
from usdslf.inference.fit import Problem, Specular, Way, fit, fit_robustly, relative_residuals
from usdslf.inference.weights import Options
from usdslf.progress import tell

FEWEST_HEARD = 4  # dabs; fewer count as many
COLOR_GAIN = 4.0  # misfit for which a grey metal becomes coloured
WANTING = 0.1  # relative error at which what was painted is not there yet
MOST_BACKGROUND = 1.5  # mean square relative change of the unpainted directions, where it counts no more
COLORED, GREY = 0.05, 0.02  # range of the channels of F0


def enumerate_candidates(t: Tables, o: Options | None = None, groups: tuple[str, ...] = GROUPS) -> list[Candidate]:
    """Fits every candidate at every level and returns the best of each set of parameters, cheapest first.

    Args:
        groups: parameters that may change.

    Returns: those that the norm admits come before the others.
    """
    problem = Problem.of(t, o or Options())
    best: dict[tuple[str, Specular], Candidate] = {}
    for free_gloss in (False, True) if "glossiness" in groups else (False,):
        levels = range(t.own) if free_gloss else (t.own,)
        for diffuse in (False, True) if "diffuse" in groups else (False,):
            for specular in _ways_of_specular(t) if "specular" in groups else (Specular.KEPT,):
                way = Way(diffuse, specular, free_gloss)
                found = min(_fitted(problem, way, levels), key=lambda c: c.rank)
                if (found.id, specular) not in best or found.rank < best[found.id, specular].rank:
                    best[found.id, specular] = found
    robust = [_fitted(problem, replace(Way.of(c), is_factor=False), (c.level,), True)[0] for c in best.values()]
    robust.sort(key=lambda c: c.rank)
    return [c for i, c in enumerate(robust) if c.id not in {other.id for other in robust[:i]}]


def _ways_of_specular(t: Tables) -> list[Specular]:
    """How the specular colour may change: not to a colour that could only be written by spoiling maps."""
    is_grey = t.colored is Colored.NEVER and not t.is_metal
    return [s for s in Specular if not (is_grey and s is Specular.COLOR)]


def _fitted(problem: Problem, way: Way, levels: Sequence[int], robust: bool = False) -> list[Candidate]:
    """Candidates with their costs: by terms or, where a texture has other colours, by factors if these explain more."""
    t = problem.tables
    can_be_factor = t.is_textured if way.diffuse else t.is_textured_f0 and way.specular is Specular.COLOR
    how = fit_robustly if robust else fit
    tell()
    ways = (way, replace(way, is_factor=True)) if can_be_factor else (way,)
    fits = [how(problem, w, levels) for w in ways]
    candidates = []
    for i, level in enumerate(levels):
        which = int(np.argmin([f.misfit[i] for f in fits]))
        found, kind = fits[which], ways[which]
        shift = float(t.levels[level] - t.roughness) if way.glossiness else 0.0
        mean = t.roughness if way.glossiness and t.is_textured_roughness else 0.0
        c = kind.candidate(found.dd[i], found.df[i], level)
        c = replace(c, roughness_shift=shift, roughness_mean=mean, misfit=float(found.misfit[i]))
        candidates.append(replace(c, cost=score(t, problem.options, c), is_admitted=is_admitted(problem.options, c)))
    return candidates


def is_admitted(o: Options, c: Candidate) -> bool:
    """Tells whether a norm lets a candidate be chosen: l0 one parameter at most, l2 all three alone, mixed any.

    Source: Nguyen et al. 2013, 5.3 (Eq. 4: infinite weights of l0 and l2).
    """
    return {"l0": len(c.freed) <= 1, "l2": len(c.freed) == len(GROUPS)}.get(o.norm, True)


def score(t: Tables, o: Options, c: Candidate) -> float:
    """Returns what a candidate costs, the less the better; costs compare within one norm and pool.

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
    background = background_misfit(t, c)
    if o.norm == "mixed" and o.factors is not None:
        return float((c.misfit + o.background * n * background) * o.factors[max(len(c.freed), 1) - 1])
    cost = tempered(c.misfit, n, o, max(n, FEWEST_HEARD)) + o.background * n * min(background, MOST_BACKGROUND)
    cost -= o.place * place_gain(t, o, c)
    if o.norm == "l2":
        return float(cost)
    is_wanting = not c.freed and relative_error(t, c) > WANTING
    cost += o.nothing * is_wanting + o.freedom * c.freedoms + o.group * max(len(c.freed) - 1, 0)
    if t.is_metal and "diffuse" in c.freed:
        cost += o.kind
    is_colored = float(np.ptp(c.f0_of(t.f0))) > COLORED
    if not t.is_metal and "specular" in c.freed and is_colored and np.ptp(t.f0) < GREY:
        cost += o.kind * (2 if t.colored is Colored.MAPS else 1)
    return float(cost)


def tempered(misfit: float, n: int, o: Options, heard: int | None = None) -> float:
    """Returns a misfit of n dabs as it counts: beyond Options.tail a dab, by its logarithm.

    Args:
        heard: dabs that these count as; None: n.
    """
    return float((heard or n) * o.tail * np.log1p(misfit / (n * o.tail)))


def background_misfit(t: Tables, c: Candidate) -> float:
    """Returns the mean square relative change of the unpainted directions, 0..9."""
    if not len(t.background):
        return 0.0
    change = c.radiance_beside(t, t.background) - t.background.p[:, t.own]
    r = np.minimum(np.abs(change / t.background_scale), 3.0)
    return float((r * r).mean())


def place_gain(t: Tables, o: Options, c: Candidate) -> float:
    """Returns how much better than chance the stroke lies where the candidate changes what is seen.

    The sum over the dabs of log(change at the dab / mean change over the painted surfaces that the eye sees):
    nothing for a change that is the same everywhere, a gain for a highlight that was painted where it appears.
    """
    if not len(t.elsewhere) or not c.freed:
        return 0.0
    here = np.abs(c.radiance(t) - t.before)
    there = np.abs(c.radiance_beside(t, t.elsewhere) - t.elsewhere.p[:, t.own])
    floor = max(o.visible * t.target.mean(), 1e-9)  # black paint
    here, there = here.sum(1) + floor, there.sum(1) + floor
    return float(np.log(here / there.mean()).sum())


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
