"""Ideal observer: how narrow an interval of a stroke's paint can be, for one who knows how its painter errs.

    half_widths(truth, way, answer, parameter) -> half of the 90 % interval (3,) or (1,)

The bound of Cramer and Rao from the columns of the answer itself: with J the derivatives of the dabs' relative radiance
by what the answer frees, and C the covariance of this painter's errors, of dab i and j and over channels,

    exact, display   MODEL^2 I + (MODEL / 2)^2 1, and the squares of what 8 bits changed
    uneven, few      the same + .10^2 exp(-|x_i - x_j|^2 / 2 l^2) 1 + .05^2 I (of the stroke), l: LENGTH of its extent
    dark             the same + the variance of a factor that is uniform from .7 to 1
    swatch, flat     the same as exact + what differs among the dabs of a colour, and the square of what its mean lacks

The waves of painters.py have the curvature of that Gaussian; that they are waves of one length, and a tint's channels
sum to zero, an observer of paint would not know.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray
from truth.recovery.painters import DARKEST, painted

from usdslf.inference.answers import Answer
from usdslf.inference.paint_errors import as_shown, columns_of

MODEL = 0.02  # relative error of a dab that the evidence itself has
LENGTH = 0.3  # of the stroke's extent
NINETY = 1.645
LEAST = 1e-4  # of a standard deviation


def half_widths(truth: dict[str, Any], way: str, answer: Answer, parameter: str) -> NDArray[np.float64]:
    """Returns half of the interval that holds 90 %, of each channel of a parameter that the answer frees."""
    t = as_shown(answer.tables, answer.chosen)
    names, columns = columns_of(t, answer.chosen)
    j = np.stack(columns, 1)
    variance = np.diag(np.linalg.pinv(j.T @ np.linalg.solve(_covariance(truth, way, t), j)))
    out = np.zeros(1 if parameter == "roughness" else 3)
    for (name, channel), v in zip(names, variance, strict=True):
        if name == parameter:
            out[slice(None) if channel is None else channel] = np.sqrt(max(v, LEAST**2))
    return NINETY * out


def _covariance(truth: dict[str, Any], way: str, t: Any) -> NDArray[np.float64]:
    n = len(t.target)
    every, eye = np.ones((n, n)), np.eye(3)
    c = MODEL**2 * np.eye(3 * n) + (MODEL / 2) ** 2 * np.kron(every, eye)
    if way in ("uneven", "few", "dark"):
        gap = np.linalg.norm(t.place[:, None] - t.place[None], axis=-1)
        drift = 0.10**2 * np.exp(-0.5 * (gap / (LENGTH * gap.max())) ** 2)
        c += np.kron(drift, np.ones((3, 3))) + 0.05**2 * np.kron(every, eye)
        return c + (way == "dark") * (1 - DARKEST) ** 2 / 12
    chosen, paint = painted(truth, way)
    if len(chosen) != n:  # a dab is on another material; how the others err is not known any more
        return c
    off = (paint - np.array(truth["colors"]["exact"], float)[chosen]) / t.scale
    if way == "display":
        return c + np.diag((off**2).reshape(-1))
    for s in np.unique(t.swatch[t.swatch >= 0]):
        mine = (t.swatch == s).astype(float)
        inside = np.diag(mine) - np.outer(mine, mine) / mine.sum()
        for channel in range(3):
            here = off[mine > 0, channel]
            own = np.zeros((3, 3))
            own[channel, channel] = 1
            c += np.kron((here.var() + 1e-9) * inside + here.mean() ** 2 * np.outer(mine, mine), own)
    return c
