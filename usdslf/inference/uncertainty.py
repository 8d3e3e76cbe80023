"""Uncertainty: how far the paint allows each parameter to be elsewhere, and how likely each explanation is.

    interval(tables, options, candidate) -> diffuse, specular, roughness: least and greatest value, 90 %
    probabilities(costs) -> of each explanation

With J the columns of what a candidate frees (the derivative of each dab's relative radiance by each of its numbers),
and the covariance C of the errors that this paint shows (paint_errors.py), the fit's parameters have the covariance

    (J' C^-1 J)^-1 = P C P',   P = (J' C^-1 J)^-1 J' C^-1

Some paint whole strokes too dark, hardly anybody too bright: with the chance IS_DARK the paint is less than what is
meant by a share that is uniform up to DARKEST, of a painter whose errors have the size CARELESS or more, and in
proportion of a more careful one (not at all of one who mixed a few colours for all dabs), which moves the numbers
along P s, s the share of a residual's scale that is shown. The ends of an interval are the quantiles OUTSIDE and
1 - OUTSIDE of that mixture, so that it reaches further up than down. The chance of a set of parameters follows from its
cost, which is minus the logarithm of a probability times TEMPERATURE.

Source: Rao and Toutenburg 1995, Linear Models, 4.2 (P C P').
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtr

from usdslf.inference.bilinear import Tables
from usdslf.inference.candidate import Candidate
from usdslf.inference.paint_errors import as_shown, columns_of, held_channels, paint_errors
from usdslf.inference.weights import Options
from usdslf.scene.records import F64

OUTSIDE = 0.05  # chance of a value below an interval, and of one above
IS_DARK, DARKEST = 0.4, 0.3  # chance that a stroke is too dark as a whole, and by how much at most
CARELESS = 0.2  # size a of errors from which a stroke may be as dark as that
STEPS = 31  # of how dark
HALVINGS = 20  # of where an end may lie
BETWEEN_LEVELS = 0.1  # of the step between levels of roughness, that its value may be off
TEMPERATURE = 2.0  # cost by which the odds of two explanations change by a factor of e


@dataclass(frozen=True)
class Interval:
    """Least and greatest value of each parameter that the paint allows; both the value itself where it is not freed."""

    diffuse: F64  # (2, 3)
    specular: F64  # (2, 3)
    roughness: F64  # (2, 1)


def interval(t: Tables, o: Options, c: Candidate) -> Interval:
    """Returns what holds 90 % of the values that the strokes may mean, given that the candidate's parameters changed.

    Args:
        t: tables in which `c.level` is the candidate's roughness, with its neighbours beside it where that is freed.
        o: a painter's errors.
    """
    center = {
        "diffuse": c.diffuse_of(t.diffuse), "specular": c.f0_of(t.f0),
        "roughness": c.roughness_of(np.array([t.roughness])),
    }  # fmt: skip
    ends = {name: np.array([value, value], np.float64) for name, value in center.items()}
    if c.freed:
        t = as_shown(t, c)
        names, columns = columns_of(t, c)
        errors = paint_errors(t, o, c)
        held = held_channels(t, c)
        j = errors.seen(np.stack(columns, 1))
        weighed = np.linalg.solve(errors.covariance, j)
        p = np.linalg.pinv(j.T @ weighed, rcond=1e-9) @ weighed.T
        along = p @ errors.share.reshape(-1)  # by how much a number grows where all paint is brighter
        likely = errors.likely()
        chance = np.array([share for share, _ in likely])
        variance = np.stack([((p @ e.covariance) * p).sum(1) for _, e in likely], 1)
        sizes = np.array([e.alike for _, e in likely])
        dark = np.zeros(len(sizes)) if (t.swatch >= 0).all() else DARKEST * np.minimum(1.0, sizes / CARELESS)
        for (name, channel), v, g in zip(names, variance, along, strict=True):
            if name == "roughness":
                v = v + (BETWEEN_LEVELS * float(np.abs(np.diff(t.levels[:-1])).min(initial=1.0))) ** 2
            reach = np.array(_quantiles(np.sqrt(np.maximum(v, 1e-12)), float(g), dark, chance))
            if channel is None or not held[channel]:
                ends[name][:, slice(None) if channel is None else slice(channel, channel + 1)] += reach[:, None]
    return Interval(**{name: np.clip(value, 0, 1) for name, value in ends.items()})


def _quantiles(sd: F64, along: float, dark: F64, chance: F64) -> tuple[float, float]:
    """Ends that leave OUTSIDE beyond each, of normal errors (g,) of sizes and, at times, of paint that is too dark."""
    meant = along * (1 / (1 - dark[:, None] * np.linspace(0, 1, STEPS)) - 1)  # (g, STEPS)
    weight, aim = chance / chance.sum(), np.array([OUTSIDE, 1 - OUTSIDE])
    reach = 4 * sd.max()
    low, high = np.full(2, min(meant.min(), 0) - reach), np.full(2, max(meant.max(), 0) + reach)
    for _ in range(HALVINGS):
        x = 0.5 * (low + high)
        too_dark = ndtr((x[:, None, None] - meant) / sd[:, None]).mean(2)
        is_above = ((1 - IS_DARK) * ndtr(x[:, None] / sd) + IS_DARK * too_dark) @ weight > aim
        low, high = np.where(is_above, low, x), np.where(is_above, x, high)
    return float(x[0]), float(x[1])


def probabilities(costs: Sequence[float | None]) -> NDArray[np.float64]:
    """Returns how likely each of n explanations is by its cost, None for one not admitted, if one of them is right."""
    cost = np.array([np.inf if c is None else c for c in costs])
    if not np.isfinite(cost).any():
        return np.full(len(cost), 1 / max(len(cost), 1))
    odds = np.exp(-(cost - cost.min()) / TEMPERATURE)
    out: NDArray[np.float64] = odds / odds.sum()
    return out
