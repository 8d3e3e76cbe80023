"""Reach: paint that is brighter than its surface can ever be.

Painters pick colours, not radiances.  Where no explanation comes near what was painted because all of it is too
bright for the light that falls there, the hue is still meant: the paint is dimmed, all channels alike, until its
brightest channel is what a white surface (a metal: a perfect one) would send.  That is said, with the factor.
A change that explains next to nothing is no answer and is not authored either.
"""

from __future__ import annotations

from collections.abc import Sequence

from usdslf.inference.bilinear import Tables
from usdslf.inference.candidate import Candidate
from usdslf.inference.evidence import mean_by
from usdslf.inference.residuals import relative_rms, relative_scale
from usdslf.inference.solve import relative_error

HOPELESS = 0.25  # relative error of the best explanation above which the paint is looked at again
TOO_BRIGHT = 0.9  # of what was painted is sent at most
LEAST_GAIN = 0.1  # of the residual that a change has to explain


def seems_too_bright(t: Tables, candidates: Sequence[Candidate]) -> bool:
    """Whether no candidate comes near the paint of a pool, and it is brighter than a white surface in this light."""
    return min(error_of(t, c) for c in candidates) > HOPELESS and dimming(t) < 1


def dimming(t: Tables) -> float:
    """Returns the factor that brings the paint of a pool within reach of a white surface; 1 where it is, as black is.

    Args:
        t: under the light that the white surface itself sends round, where that matters.
    """
    now = t.dabs.at_level(t.own)
    brightest = now.p + ((1 - t.f0) * now.v if t.is_metal else (1 - t.diffuse) * now.u)
    painted, sent = t.target.mean(0), brightest.mean(0)
    lit = painted > 1e-3 * painted.max()
    if not lit.any():  # black paint
        return 1.0
    factor = float((sent[lit] / painted[lit]).min())
    return factor if 0 < factor < TOO_BRIGHT else 1.0


def error_of(t: Tables, c: Candidate) -> float:
    """Relative error of a candidate; of the mean colours of dabs that share one: they say no more than that."""
    if not t.has_one_color.all():
        return relative_error(t, c) if (t.swatch < 0).all() else _error_of_swatches(t, c)
    painted = t.target.mean(0)
    return relative_rms(c.radiance(t).mean(0), painted, relative_scale(painted))


def _error_of_swatches(t: Tables, c: Candidate) -> float:
    """Relative root mean square over the dabs, each of them as the mean of all that share its colour."""
    group = t.group
    radiance, target, scale = (mean_by(x, group)[group] for x in (c.radiance(t), t.target, t.scale))
    return relative_rms(radiance, target, scale)


def explains_nothing(before: float, after: float) -> bool:
    """Whether a change leaves nearly all that was asked for, from its residuals."""
    return before > HOPELESS and after > (1 - LEAST_GAIN) * before
