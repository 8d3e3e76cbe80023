"""Unchanged: paint that is what the picture shows already, as near as the evidence itself is right.

    may_be_unchanged(tables) -> whether most of the paint is
    by_own_errors(tables, options, candidates) -> the candidates with what they cost then

Who copies the picture errs by nothing, and what is left at a dab is the evidence's error: MODEL of its radiance, and
the standard error of the mean over its points.  Of what renderers do not agree on (doubt.py), whoever made the picture
may have left a share out, the same everywhere, and OF_DOUBT more or less at each dab.  Where most dabs are within that
of what they show now, a painter's drift and tint are no excuse for what the others leave, and explanations are weighed
by these errors alone,

    cost = sum_i min((DEGREES + 3) log(1 + (|r_i / s_i|^2 - AS_SHOWN)+ / DEGREES), FAR)
           + freedom k + group (g - 1)+ + CHANGED (if anything changes)

minus twice the logarithm of Student's t, of dabs that are clearly not as shown: the errors of the others are shared,
and a small change would explain them.  No dab counts more than FAR: at edges and in caustics the evidence can be off by
anything, and a change has to explain what several dabs leave.  Dabs that share a colour count as their mean.

Source: Lange, Little and Taylor 1989 (Student's t); Schwarz 1978.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from usdslf.inference.bilinear import Tables
from usdslf.inference.candidate import Candidate
from usdslf.inference.evidence import mean_by
from usdslf.inference.field_errors import doubt_of
from usdslf.inference.fit import relative_residuals
from usdslf.inference.weights import Options
from usdslf.scene.records import F64

MODEL = 0.03  # relative error of a dab's radiance that the evidence has where it has points enough
AS_SHOWN = 9.0  # squared residuals of three channels over their variances, up to which a dab is as shown
OF_DOUBT = 0.3  # of what renderers do not agree on at a dab, by which dabs differ in who is right
DEGREES = 3.0  # of freedom of Student's t
FAR = 9.0  # most that one dab counts
CHANGED = 12.0  # cost of any change: odds of 400 for paint that is mostly as shown to mean none
WITHIN = 3.0  # the same of the middle dab, up to which most may be unchanged


def may_be_unchanged(t: Tables) -> bool:
    """Tells whether half of the dabs, or swatches, are painted as they look now."""
    return bool(np.median(_sizes(t, Candidate((), level=t.own))) <= WITHIN)


def by_own_errors(t: Tables, o: Options, candidates: Sequence[Candidate]) -> list[Candidate]:
    """Returns the candidates, cheapest first, with costs by the errors of the evidence alone."""
    weighed = []
    for c in candidates:
        beyond = np.maximum(_sizes(t, c) - AS_SHOWN, 0)
        misfit = float(np.minimum((DEGREES + 3) * np.log1p(beyond / DEGREES), FAR).sum())
        freedoms = o.freedom * c.freedoms + o.group * max(len(c.freed) - 1, 0)
        weighed.append(replace(c, cost=misfit + freedoms + CHANGED * bool(c.freed)))
    return sorted(weighed, key=lambda c: c.rank)


def _sizes(t: Tables, c: Candidate) -> F64:
    """Squared residuals (m,) of dabs and swatches over the evidence's variances, summed over the channels."""
    group = t.group
    count = np.bincount(group)[:, None]
    off = mean_by(relative_residuals(t, c), group)
    doubt = mean_by(doubt_of(t, c), group)
    variance = MODEL**2 + mean_by((t.noise / t.scale) ** 2, group) / count + (OF_DOUBT * doubt) ** 2
    weighed = doubt / variance
    off -= np.clip((off * weighed).sum() / max((doubt * weighed).sum(), 1e-12), 0, 1) * doubt
    size: F64 = (off**2 / variance).sum(1)
    return size
