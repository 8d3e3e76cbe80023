"""Field errors: what the light field itself errs by at dabs, by what is known of each.

    field_errors(tables, candidate) -> FieldErrors

Held against path-traced dabs, of unchanged surfaces and of changed ones, what the evidence errs by at a dab goes with
what little else would tell: how much its points differ in what they show, and what of that renderers do not agree on
(doubt.py).  With p the standard error of the mean of a dab's points and q what is in doubt, both relative to what is
shown, a dab has errors of its own and a part in those of its stroke,

    own^2 = (OF_POINTS p)^2 + (OF_DOUBT q)^2        all^2 = SURE^2 + (ALL_POINTS p)^2, and ALL_DOUBT q

of which the former are mostly grey, and the latter nearly.  p is of the dab before any change, as is what it is
relative to; how far the surface is tilted, its texture and the spread of its normals say no more once p and q are
known.  The tails are those of Student's t with 3 degrees of freedom (5 of a stroke); the factors are of the normal
distribution which leaves as much outside of 90 %.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from usdslf.inference.bilinear import Tables
from usdslf.inference.candidate import Candidate
from usdslf.inference.residuals import mean_by_stroke, relative_scale
from usdslf.scene.records import F64

OF_POINTS = 0.8  # of the standard error of a dab's points: they lie apart, so that light errs more than they do
OF_DOUBT = 1.0  # of what renderers do not agree on at a dab
SURE = 0.002  # relative error that all dabs of a stroke may share, at least
ALL_POINTS = 0.13  # of the standard error of their points, that they share
ALL_DOUBT = 2.2  # of what renderers do not agree on: who made the picture shows one share everywhere
ALL_GREY = 0.95  # correlation of what a stroke's dabs share in two channels
GROWN = (0.0, 16.0)  # times which what is in doubt may grow with a colour


@dataclass(frozen=True)
class FieldErrors:
    """Relative errors of n dabs, in their residuals' measure."""

    points: F64  # (n, 3) standard deviation of each dab's own, by its points
    doubt: F64  # (n, 3) q
    shared: F64  # (n,) share of each dab in what its stroke errs by


def field_errors(t: Tables, c: Candidate) -> FieldErrors:
    """Returns what is to be expected of a pool's dabs, if a candidate is what is meant."""
    before = t.before
    was = relative_scale(before, mean_by_stroke(before, t.stroke, before)[:, None])
    p = np.broadcast_to(t.noise, was.shape) / was
    return FieldErrors(OF_POINTS * p, doubt_of(t, c), np.hypot(SURE, ALL_POINTS * p.mean(1)))


def doubt_of(t: Tables, c: Candidate) -> F64:
    """Returns how much of the dabs (n, 3), in their residuals' measure, renderers do not agree on.

    It grows with the colours that the candidate changes.
    """
    ratios = [c.diffuse_of(t.diffuse) / np.maximum(t.diffuse, 1e-3), c.f0_of(t.f0) / np.maximum(t.f0, 1e-3)]
    ratios.append(ratios[1] if t.is_metal else np.ones(3))
    q = (t.doubt * np.clip(ratios, *GROWN)).sum(1)
    return np.asarray(np.broadcast_to(q, t.target.shape) / t.scale)
