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

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import helmert

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

    def heard(self, by: F64) -> Left:
        """Returns the same of each dab times a number (m,)."""
        pairs = np.outer(by, by)
        return replace(
            self, residual=by[:, None] * self.residual, explained=by[:, None, None] * self.explained,
            drift=pairs * self.drift, tint=pairs * self.tint,
        )  # fmt: skip

    def modes(self, grey: float) -> tuple[F64, F64, F64]:
        """Returns variances (m k,) of what dabs share where a is 1, and by its modes residual (m k,) and columns.

        Args:
            grey: correlation of a dab's own errors, which are made independent, of unit variance where b is 1.
        """
        (m, k), share = self.residual.shape, self.share
        axes = helmert(k, full=True)  # the mean of the channels, and what is beside it
        own = 1 / np.sqrt([1 + (k - 1) * grey] + [1 - grey] * (k - 1))
        seen = np.concatenate([self.residual[..., None], self.explained], 2)
        if not np.ptp(share, axis=1).any():  # even in all channels: axis by axis
            seen = (own[:, None] * axes) @ seen
            modes = [self._even_modes[min(axis, 1)] for axis in range(k)]
            size = np.concatenate([o**2 * x for o, (x, _) in zip(own, modes, strict=True)])
            by_mode = np.concatenate([turn.T @ seen[:, axis] for axis, (_, turn) in enumerate(modes)])
            return size, by_mode[:, 0], by_mode[:, 1:]
        w = (axes.T * own) @ axes
        shares = (w * share[:, None]).reshape(m * k, k)  # rows of w, times what each dab and channel counts
        alike = np.repeat(np.repeat(self.drift, k, 0), k, 1) * np.outer(shares.sum(1), shares.sum(1))
        alike += np.repeat(np.repeat(self.tint, k, 0), k, 1) * (shares @ shares.T)
        size, turn = np.linalg.eigh(alike)
        by_mode = turn.T @ (w @ seen).reshape(m * k, -1)
        return size, by_mode[:, 0], by_mode[:, 1:]

    @cached_property
    def _even_modes(self) -> list[tuple[F64, F64]]:
        """Modes of what dabs share, even in all channels: of the channels' mean, and beside it."""
        share, k = np.outer(self.share[:, 0], self.share[:, 0]), self.share.shape[1]
        return [np.linalg.eigh(share * x) for x in (k * self.drift + self.tint, self.tint)[: min(k, 2)]]


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
        sizes = _likely_sizes(left.heard(1 / np.sqrt(of_paint + of_field / beside)), prior)
        b = sizes.middle[1]
        if not of_field.any() or abs(np.log(b / beside)) < SAME:
            break
    return sizes, beside


def _likely_sizes(left: Left, prior: Prior) -> Sizes:
    """The sizes where dabs' own errors have the variance b."""
    greys = (0.0, GREY) if left.residual.shape[1] > 1 else (0.0,)
    own = np.maximum(prior.slack * SIZES_OWN, prior.least)
    logs = np.stack([_chances(left, own, grey) for grey in greys], 2)
    of_a, of_b = (np.log(x / u) / SPREAD for x, u in zip((SIZES_ALIKE, SIZES_OWN), prior.usual, strict=True))
    of_a = of_a[:, None]
    logs -= (0.5 * (of_a**2 + of_b**2 - 2 * TOGETHER * of_a * of_b) / (1 - TOGETHER**2))[..., None]
    chance = np.exp(logs - logs.max())
    chance /= chance.sum()
    return Sizes(SIZES_ALIKE, own, chance.sum(2), float((chance.sum((0, 1)) * greys).sum()))


def mostly_grey(channels: int, grey: float) -> F64:
    """K: correlation (channels, channels) of a dab's own errors."""
    return np.asarray((1 - grey) * np.eye(channels) + grey)


def _chances(left: Left, own: F64, grey: float) -> F64:
    """Logarithms (g, h) of how likely what is left is with each a, variances `own` (h,) and correlation `grey` of K.

    With V = a `alike` + b I and the columns X, log|V| + log|X' V^-1 X| + r' (V^-1 - V^-1 X (X' V^-1 X)^-1 X' V^-1) r.
    """
    m, k = left.residual.shape
    size, residual, columns = left.modes(grey)
    basis, sizes, _ = np.linalg.svd(columns, full_matrices=False)
    rank = int((1e-9 * sizes.max(initial=1e-30) < sizes).sum())
    basis = basis[:, :rank]
    residual = residual - basis @ (basis.T @ residual)  # which V then leaves as it is, but for less rounding
    variance = (np.maximum(size, 0)[:, None, None] * SIZES_ALIKE[:, None] + own).reshape(m * k, -1)
    asked = np.concatenate([basis, residual[:, None]], 1)
    products = ((asked[:, :, None] * asked[:, None]).reshape(m * k, -1).T @ (1 / variance)).reshape(
        rank + 1, rank + 1, -1
    )
    log = np.log(variance).sum(0)
    for _ in range(rank):  # Schur complements, which leave what the residual has of its own
        log += np.log(products[0, 0])
        products = products[1:, 1:] - products[1:, :1] * (products[:1, 1:] / products[0, 0])
    of_axes = 0.5 * (np.log1p((k - 1) * grey) + (k - 1) * np.log1p(-grey))
    log = -0.5 * (log + products[0, 0]) - m * of_axes - np.log(sizes[:rank]).sum()
    return np.asarray(log.reshape(len(SIZES_ALIKE), -1))
