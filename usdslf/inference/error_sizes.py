"""Error sizes: how large a painter's errors are, by what an explanation leaves of the paint.

    likely_sizes(left, explained, alike, usual, least, slack) -> Sizes, their chances on a grid

What is left of the paint, whatever the explanation's parameters are, has the covariance a `alike` + b K over dabs
and channels: a drift and a tint that dabs share, and what each errs by itself.  A few dabs say little about a
drift, so that one size would be too much for careful paint and too little for a careless one: the fit takes the middle
of what is likely (of the roots), an interval all of it, each size by its chance.

Source: Patterson and Thompson 1971 (restricted likelihood); Harville 1974 (as the chance of sizes, the parameters
integrated out).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from usdslf.scene.records import F64

SIZES_ALIKE, SIZES_OWN = np.geomspace(1e-4, 4.0, 19), np.geomspace(1e-3, 4.0, 19)  # of a and b that are tried
SPREAD = 1.5  # width (natural logarithm) of what a and b are where the dabs are few
TOGETHER = 0.6  # correlation of both: who is careless with dabs is so with the stroke
GREY = 0.5  # correlation of a dab's own errors in two channels, where they are mostly grey


@dataclass(frozen=True)
class Sizes:
    """Chances (g, h) that a is one of (g,) and b one of (h,), and the correlation k of a dab's own errors."""

    alike: F64
    own: F64
    chance: F64
    grey: float

    @property
    def middle(self) -> tuple[float, float]:
        """Means of a and of b, of their roots."""
        of_a, of_b = self.chance.sum(1), self.chance.sum(0)
        return float((of_a * np.sqrt(self.alike)).sum() ** 2), float((of_b * np.sqrt(self.own)).sum() ** 2)

    @property
    def of_alike(self) -> F64:
        """Chance (g,) of each a."""
        return np.asarray(self.chance.sum(1))

    @property
    def own_beside(self) -> F64:
        """Mean (g,) of b where a is each of its sizes."""
        return np.asarray((self.chance @ self.own) / np.maximum(self.chance.sum(1), 1e-30))


def likely_sizes(
    left: F64, explained: F64, alike: F64, usual: tuple[float, float], least: float, slack: float
) -> Sizes:
    """Returns how large errors are that leave this of a paint.

    Args:
        left: (m, k) of m dabs in k channels.
        explained: columns (m, k, p) of all that may be there whatever the painter does.
        alike: (m k, m k) covariance of what dabs share where a is 1.
        usual: middle of what a and b are where the dabs say little.
        least: b cannot be less.
        slack: by which b is more than what is seen, where dabs that are far off have lost trust.
    """
    greys = (0.0, GREY) if left.shape[1] > 1 else (0.0,)
    own = np.maximum(slack * SIZES_OWN, least)
    logs = np.stack([_chances(left, explained, alike, own, grey) for grey in greys], 2)
    of_a, of_b = np.log(SIZES_ALIKE / usual[0])[:, None] / SPREAD, np.log(SIZES_OWN / usual[1]) / SPREAD
    logs -= (0.5 * (of_a**2 + of_b**2 - 2 * TOGETHER * of_a * of_b) / (1 - TOGETHER**2))[..., None]
    chance = np.exp(logs - logs.max())
    chance /= chance.sum()
    return Sizes(SIZES_ALIKE, own, chance.sum(2), float((chance.sum((0, 1)) * greys).sum()))


def mostly_grey(channels: int, grey: float) -> F64:
    """K: correlation (channels, channels) of a dab's own errors."""
    return np.asarray((1 - grey) * np.eye(channels) + grey)


def _chances(left: F64, explained: F64, alike: F64, own: F64, grey: float) -> F64:
    """Logarithms (g, h) of how likely what is left is with each a, variances `own` (h,) and correlation `grey` of K."""
    m, k = left.shape
    mean = np.full((k, k), 1 / k)
    w = mean / np.sqrt(1 + (k - 1) * grey) + (np.eye(k) - mean) / np.sqrt(1 - grey)  # makes them independent
    columns, even = (w @ explained).reshape(m * k, -1), (left @ w).reshape(-1)
    turned = (w @ (alike.reshape(m, k, m, k) @ w).reshape(m, k, -1)).reshape(m * k, -1)
    basis, sizes, _ = np.linalg.svd(columns, full_matrices=False)
    rank = int((1e-9 * sizes.max(initial=1e-30) < sizes).sum())
    rest = np.linalg.qr(basis[:, :rank], mode="complete").Q[:, rank:]
    size, turn = np.linalg.eigh(rest.T @ turned @ rest)
    seen = (turn.T @ (rest.T @ even)) ** 2
    variance = SIZES_ALIKE[:, None, None] * np.maximum(size, 0) + own[:, None]
    log = -0.5 * (np.log(variance) + seen / variance).sum(2)
    return np.asarray(log + m * np.linalg.slogdet(w)[1] - np.log(sizes[:rank]).sum())
