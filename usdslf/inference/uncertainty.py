"""Uncertainty: how far the paint allows each parameter to be elsewhere, and how likely each explanation is.

    interval(tables, options, candidate) -> diffuse, specular, roughness: least and greatest value, 90 %
    probabilities(candidates) -> of each set of parameters

With J the columns of what a candidate frees (the derivative of each dab's relative radiance by each of its numbers) and
y what it leaves of the dabs, the fit's parameters have the covariance

    P C P',   P = (J'J)^-1 J',   C = a K + b N

where K holds what a painter gets wrong alike (drift of brightness over a stroke, its tint) and N what each dab has of
its own.  How large both are, a and b, is read off y itself, in the part of it that J cannot explain (restricted
maximum likelihood, averaged over a grid): a painter whose dabs agree with the candidate is taken to be as exact in what
they have in common.  Dabs that share a swatch count as their mean.  The chance of a set of parameters follows from its
cost, which is minus the logarithm of a probability times TEMPERATURE.

Source: Patterson and Thompson 1971 (restricted likelihood); Rao and Toutenburg 1995, Linear Models, 4.2 (P C P').
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from usdslf.inference.bilinear import Tables
from usdslf.inference.candidate import Candidate, is_grey
from usdslf.inference.fit import relative_residuals, shared_errors
from usdslf.inference.weights import Options
from usdslf.scene.records import F64

NINETY = 1.645  # standard deviations that hold 90 % of a normal distribution
SIZES = np.geomspace(1e-3, 4.0, 15)  # of a and b that are tried
USUAL, SPREAD = (0.2, 0.05), 2.5  # middle and width (natural logarithm) of what a and b are where the dabs are few
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
    names, columns = _columns(t, c)
    center = {
        "diffuse": c.diffuse_of(t.diffuse), "specular": c.f0_of(t.f0),
        "roughness": c.roughness_of(np.array([t.roughness])),
    }  # fmt: skip
    spread = {name: np.zeros(len(value)) for name, value in center.items()}
    if columns:
        sd = np.sqrt(np.diag(_covariance(t, o, c, np.stack(columns, 1))))
        for (name, channel), one in zip(names, sd, strict=True):
            spread[name][slice(None) if channel is None else channel] = NINETY * one
    ends = {k: np.clip([v - spread[k], v + spread[k]], 0, 1) for k, v in center.items()}
    return Interval(**ends)


def _columns(t: Tables, c: Candidate) -> tuple[list[tuple[str, int | None]], list[F64]]:
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


def _covariance(t: Tables, o: Options, c: Candidate, j: F64) -> F64:
    """Covariance (k, k) of the numbers that the columns j (3 n, k) are of."""
    together = _means_of_swatches(t)
    own = 1 / (o.dab_error * np.linalg.norm(together, axis=1))  # makes what each row has of its own a unit variance
    y = own * (together @ relative_residuals(t, c).reshape(-1))
    j = own[:, None] * (together @ j)
    alike = own[:, None] * (together @ shared_errors(t, o) @ together.T) * own
    left = np.linalg.svd(j, full_matrices=True)
    rank = int((1e-9 * left.S.max(initial=1e-30) < left.S).sum())
    rest = left.U[:, rank:]  # what the columns cannot explain
    size, turn = np.linalg.eigh(rest.T @ alike @ rest)
    seen = (turn.T @ (rest.T @ y)) ** 2
    a, b = (x.reshape(-1, 1) for x in np.meshgrid(SIZES, SIZES, indexing="ij"))
    variance = a * np.maximum(size, 0) + b
    log = -0.5 * (np.log(variance) + seen / variance).sum(1, keepdims=True)
    log -= 0.5 * ((np.log(a / USUAL[0]) / SPREAD) ** 2 + (np.log(b / USUAL[1]) / SPREAD) ** 2)
    chance = np.exp(log - log.max())
    chance /= chance.sum()
    p = np.linalg.pinv(j, rcond=1e-6)
    of_alike, of_own = (float((chance * np.sqrt(x)).sum() ** 2) for x in (a, b))
    found: F64 = p @ (of_alike * alike + of_own * np.eye(len(y))) @ p.T
    return found


def _means_of_swatches(t: Tables) -> F64:
    """Matrix (m, 3 n) that takes the mean of dabs that share a swatch, and leaves the others."""
    group = t.group
    one = (group[None] == np.arange(group.max() + 1)[:, None]).astype(float)
    out: F64 = np.kron(one / one.sum(1, keepdims=True), np.eye(3))
    return out


def probabilities(candidates: Sequence[Candidate]) -> NDArray[np.float64]:
    """Returns how likely each of the candidates (n,) is, given that one of them is right."""
    if not candidates:
        return np.zeros(0)
    cost = np.array([c.cost if c.is_admitted else np.inf for c in candidates])
    odds = np.exp(-(cost - cost.min()) / TEMPERATURE)
    out: NDArray[np.float64] = odds / odds.sum()
    return out
