"""Error sizes: how large a painter's errors are, by what an explanation leaves of the paint.

    read_sizes(left, prior, of_paint, of_field) -> Sizes, their chances on a grid

What is left of the paint, whatever the explanation's parameters are, has the covariance a `alike` + b K over dabs
and channels: a drift and a tint that dabs share, and what each errs by itself.  A few dabs say little about a
drift, so that one size would be too much for careful paint and too little for a careless one: the fit takes the middle
of what is likely (of the roots), an interval all of it, each size by its chance.  Where the light field errs more than
a careful painter, a dab shows no painter; how far that is so goes with b, which is read twice.

Source: Patterson and Thompson 1971 (restricted likelihood); Harville 1974 (as the chance of sizes, the parameters
integrated out).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from usdslf.scene.records import F64

SIZES_ALIKE, SIZES_OWN = np.geomspace(1e-4, 4.0, 19), np.geomspace(1e-3, 4.0, 19)  # of a and b that are tried
SPREAD = 1.5  # width (natural logarithm) of what a and b are where the dabs are few
READINGS, SAME = 2, 0.2  # of b at most, and the change of its logarithm that asks for no other one
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


@dataclass(frozen=True)
class Left:
    """What is left of m dabs in k channels, and what may be of it."""

    residual: F64  # (m, k)
    explained: F64  # columns (m, k, p) of all that may be there whatever the painter does
    share: F64  # (m, k) by which errors that dabs share count
    drift: F64  # (m, m) covariance of brightness where a is 1
    tint: F64  # (m, m) the same of each channel

    def of(self, dabs: NDArray[np.int64], channels: NDArray[np.int64]) -> Left:
        """Returns that of some of the dabs and channels."""
        of, apart = np.ix_(dabs, channels), np.ix_(dabs, dabs)
        return Left(self.residual[of], self.explained[of], self.share[of], self.drift[apart], self.tint[apart])

    def heard(self, by: F64) -> tuple[F64, F64, F64]:
        """Returns residual, columns and covariance (m k, m k) where a is 1, each dab times a number (m,)."""
        k, pairs = self.residual.shape[1], np.outer(by, by)
        alike = np.kron(pairs * self.drift, np.ones((k, k))) + np.kron(pairs * self.tint, np.eye(k))
        alike *= np.outer(self.share, self.share)
        return by[:, None] * self.residual, by[:, None, None] * self.explained, alike


@dataclass(frozen=True)
class Prior:
    """What is known of a painter beforehand."""

    usual: tuple[float, float]  # middle of what a and b are where the dabs say little
    least: float  # b cannot be less
    slack: float  # by which b is more than what is seen, where dabs that are far off have lost trust


def read_sizes(left: Left, prior: Prior, of_paint: F64, of_field: F64) -> tuple[Sizes, float]:
    """Returns how large errors are that leave this of a paint, and the b that the light field's were held against.

    Args:
        of_paint: (m,) variance of a dab's own errors where b is 1.
        of_field: (m,) variance of what the light field errs by at it.
    """
    b = prior.usual[1]
    for _ in range(READINGS):
        beside = b
        sizes = _likely_sizes(*left.heard(1 / np.sqrt(of_paint + of_field / beside)), prior)
        b = sizes.middle[1]
        if not of_field.any() or abs(np.log(b / beside)) < SAME:
            break
    return sizes, beside


def _likely_sizes(residual: F64, explained: F64, alike: F64, prior: Prior) -> Sizes:
    """The sizes where dabs' own errors have the variance b."""
    greys = (0.0, GREY) if residual.shape[1] > 1 else (0.0,)
    own = np.maximum(prior.slack * SIZES_OWN, prior.least)
    logs = np.stack([_chances(residual, explained, alike, own, grey) for grey in greys], 2)
    of_a, of_b = (np.log(x / u) / SPREAD for x, u in zip((SIZES_ALIKE, SIZES_OWN), prior.usual, strict=True))
    of_a = of_a[:, None]
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
