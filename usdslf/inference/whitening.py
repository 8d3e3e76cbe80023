"""Whitening: what makes relative residuals of dabs independent, under a painter's errors.

A covariance that treats the three channels alike, kron(A, 1) + kron(B, I) with 1 and I over the channels, falls into
three in the axes of a dab, grey and two colours: 3 A + B and twice B.  So do its roots, and products with them: a sixth
of the work of the whole matrix.

Source: Aitken 1935 (generalized least squares).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np
from numpy.typing import NDArray
from scipy.linalg.lapack import dtrtri

from usdslf.inference.bilinear import Bilinear, Tables
from usdslf.inference.weights import Options
from usdslf.scene.records import F64

GREY_AND_COLORS = np.array([[2, 2, 2], [0, 6**0.5, -(6**0.5)], [-(8**0.5), 2**0.5, 2**0.5]]) / 12**0.5  # axes of a dab

MANY = 8  # times as many dabs as parts of a covariance, from which on a root by its parts is quicker


@dataclass(frozen=True)
class Whitened:
    """Residuals r = rest + dd U + dF V - dd dF W, whitened: (J, m), and (J, m, 3) of the channels' own changes."""

    rest: F64
    u: F64
    v: F64
    w: F64

    def at(self, dd: F64, df: F64) -> F64:
        """Returns the residuals (J, m) of changes (J, 3)."""
        both = np.concatenate([dd, df, -dd * df], 1)[..., None]
        return self.rest + (np.concatenate([self.u, self.v, self.w], 2) @ both)[..., 0]

    def products(self) -> F64:
        """Returns the products (J, 10, 10) of rest, and of three channels of U, V and W, with each other."""
        all_of = np.concatenate([self.rest[..., None], self.u, self.v, self.w], 2)
        return np.asarray(all_of.transpose(0, 2, 1) @ all_of)

    def levels(self, rows: NDArray[np.int64]) -> Whitened:
        """Returns those of some of the levels."""
        return Whitened(self.rest[rows], self.u[rows], self.v[rows], self.w[rows])


@dataclass(frozen=True)
class White:
    """A matrix (3 m, 3 n), three rows of each of m dabs or swatches and three columns of each of n dabs.

    Attributes:
        grey, color: (m, n) of the axis grey, and of both axes of colour; None: there is `whole` instead.
        whole: (3 m, 3 n), of errors that do not treat the channels alike.
        is_diagonal: whether `grey` and `color` are: no dab's errors are another's.
    """

    grey: F64 | None
    color: F64 | None
    whole: F64 | None = None
    is_diagonal: bool = False

    @cached_property
    def matrix(self) -> F64:
        """The matrix."""
        if self.whole is not None:
            return self.whole
        assert self.grey is not None and self.color is not None
        roots, (m, n) = np.stack([self.grey, self.color, self.color]), self.grey.shape
        return np.einsum("aij,ac->iajc", roots, GREY_AND_COLORS).reshape(3 * m, 3 * n)

    def __matmul__(self, x: F64) -> F64:
        """Returns the product with numbers (3 n,) or (3 n, k)."""
        if self.whole is not None:
            return np.asarray(self.whole @ x)
        assert self.grey is not None and self.color is not None
        m, n = self.grey.shape
        turned = np.einsum("ac,nck->ank", GREY_AND_COLORS, x.reshape(n, 3, -1))
        out = np.stack([self.grey @ turned[0], self.color @ turned[1], self.color @ turned[2]], 1)
        return out.reshape(3 * m, *x.shape[1:])

    def transposed(self, x: F64) -> F64:
        """Returns the product of the transposed matrix with numbers (3 m,)."""
        if self.whole is not None:
            return np.asarray(self.whole.T @ x)
        assert self.grey is not None and self.color is not None
        by_axis = x.reshape(-1, 3)
        parts = [self.grey.T @ by_axis[:, 0], self.color.T @ by_axis[:, 1], self.color.T @ by_axis[:, 2]]
        return np.asarray((np.stack(parts, 1) @ GREY_AND_COLORS).reshape(-1))

    def of_tables(self, b: Bilinear, target: F64, share: F64) -> Whitened:
        """Returns the whitened residuals of tables (n, J, 3) against a target (n, 3).

        Args:
            share: (n, J, 3) that each residual is multiplied by before.
        """
        n, count = share.shape[:2]
        if self.whole is not None:
            rest, u, v, w = (x * share for x in (b.p - target[:, None], b.u, b.v, b.w))
            parts = np.zeros((n, 3, count, 10))  # a channel's change moves that channel alone
            parts[..., 0] = rest.transpose(0, 2, 1)
            for k, x in enumerate((u, v, w)):
                for channel in range(3):
                    parts[:, channel, :, 1 + 3 * k + channel] = x[..., channel]
            white = (self.whole @ parts.reshape(3 * n, -1)).reshape(-1, count, 10).transpose(1, 0, 2)
            return Whitened(white[..., 0], white[..., 1:4], white[..., 4:7], white[..., 7:])
        of_grey, of_color = self._by_axes(b, target, share)
        m = len(of_grey)
        first = np.concatenate([of_grey[..., :1], of_color[..., :2]], 2)  # (m, J, axis)
        axes = np.stack([of_grey[..., 1:], of_color[..., 2:], of_color[..., 2:]], 1)  # (m, axis, J, 9)
        changes = axes.reshape(m, 3, count, 3, 3) * GREY_AND_COLORS[:, None, None]
        changes = np.ascontiguousarray(changes.transpose(3, 2, 0, 1, 4)).reshape(3, count, 3 * m, 3)
        return Whitened(first.transpose(1, 0, 2).reshape(count, 3 * m), *changes)

    def products_of_tables(self, b: Bilinear, target: F64, share: F64) -> F64:
        """Returns `of_tables(...).products()`, (J, 10, 10), from those along the axes of a dab."""
        if self.whole is not None:
            return self.of_tables(b, target, share).products()
        (grey, color), out = self._by_axes(b, target, share), np.empty((share.shape[1], 10, 10))
        of_grey, of_color = (np.asarray(x.transpose(1, 2, 0) @ x.transpose(1, 0, 2)) for x in (grey, color))
        turn = np.tile(GREY_AND_COLORS, 3)  # of the axes, by columns of channels' own changes
        out[:, 0, 0] = of_grey[:, 0, 0] + of_color[:, 0, 0] + of_color[:, 1, 1]
        out[:, 0, 1:] = (
            turn[0] * of_grey[:, 0, 1:] + turn[1] * of_color[:, 0, 2:] + turn[2] * of_color[:, 1, 2:]
        )  # fmt: skip
        out[:, 1:, 0] = out[:, 0, 1:]
        by_color = np.outer(turn[1], turn[1]) + np.outer(turn[2], turn[2])
        out[:, 1:, 1:] = np.outer(turn[0], turn[0]) * of_grey[:, 1:, 1:] + by_color * of_color[:, 2:, 2:]
        return out

    def _by_axes(self, b: Bilinear, target: F64, share: F64) -> tuple[F64, F64]:
        """Rest and own changes of nine channels along grey (m, J, 1 + 9), and the same along colours (m, J, 2 + 9)."""
        assert self.grey is not None and self.color is not None
        (n, count), m = share.shape[:2], len(self.grey)
        turned = ((b.p - target[:, None]) * share) @ GREY_AND_COLORS.T
        own = np.concatenate([x * share for x in (b.u, b.v, b.w)], 2)  # (n, J, 9)
        of_grey, of_color = (
            (np.diagonal(root)[:, None] * x if self.is_diagonal else root @ x).reshape(m, count, -1)
            for root, x in (
                (self.grey, np.concatenate([turned[..., :1], own], 2).reshape(n, -1)),
                (self.color, np.concatenate([turned[..., 1:], own], 2).reshape(n, -1)),
            )
        )
        return of_grey, of_color


def whiten(t: Tables, o: Options) -> White:
    """Returns what makes relative residuals, dab by dab and channel by channel, independent.

    It is formed, and not solved with, because some hundred products with it follow.
    """
    errors = o.dab_error, o.drift_error, o.drift_length, o.tint_error, o.flat_error
    stroke, swatch = (x.astype(np.int64).tobytes() for x in (t.stroke, t.swatch))
    return _white_of(np.asarray(t.place, np.float64).tobytes(), stroke, swatch, errors)


@lru_cache(maxsize=4)
def _white_of(place: bytes, stroke: bytes, swatch: bytes, errors: tuple[float, ...]) -> White:
    """The same by the values that it depends on: it stays from light to light."""
    at = np.frombuffer(place, np.float64).reshape(-1, 3)
    group, colors = np.frombuffer(stroke, np.int64), np.frombuffer(swatch, np.int64)
    dab_error, drift_error, drift_length, tint_error, flat_error = errors
    n = len(at)
    if not (drift_error or tint_error or (colors >= 0).any()):  # each dab has errors of its own
        root = np.eye(n) / dab_error
        root.flags.writeable = False
        return White(root, root, is_diagonal=True)
    same = (group[:, None] == group[None]).astype(float)
    gap, extent = gaps_and_extents(at, group)
    length = np.maximum(drift_length * extent, 1e-9)
    drift = same * np.exp(-0.5 * (gap / length[:, None]) ** 2) * drift_error**2
    own = same * tint_error**2 + np.eye(n) * dab_error**2
    # who paints with one colour gets the mean right, not the contrast among what has it
    for s in np.unique(colors[colors >= 0]):
        mine = (colors == s).astype(float)
        own += flat_error**2 * (np.diag(mine) - np.outer(mine, mine) / mine.sum())
    return white_of_axes(1.5 * (drift + drift.T) + own, own)


def white_of_axes(grey: F64, color: F64) -> White:
    """Returns what whitens errors whose covariances (n, n) along grey and along colours are known."""
    return _white_of_roots(inverse_root(grey), inverse_root(color))


def white_of_parts(alike: F64, own: F64, parts: F64) -> White:
    """Returns the same of kron(alike, 1) + kron(diag(own) + parts parts', I), (n, n), (n,) and (n, r)."""
    color = np.diag(own) + parts @ parts.T
    is_quick = len(own) > MANY * parts.shape[1]
    return _white_of_roots(
        inverse_root(3 * alike + color), inverse_root_of_parts(own, parts) if is_quick else inverse_root(color)
    )


def _white_of_roots(grey: F64, color: F64) -> White:
    for x in (grey, color):
        x.flags.writeable = False
    return White(grey, color)


def gaps_and_extents(place: F64, stroke: NDArray) -> tuple[F64, F64]:
    """Returns the distances of dabs (n, n), and the extent of the stroke (n,) that each is of; not to be written to."""
    return _gaps_of(np.asarray(place, np.float64).tobytes(), stroke.astype(np.int64).tobytes())


@lru_cache(maxsize=4)
def _gaps_of(at: bytes, group: bytes) -> tuple[F64, F64]:
    """The same by the values that it depends on."""
    place, stroke = np.frombuffer(at, np.float64).reshape(-1, 3), np.frombuffer(group, np.int64)
    gap = np.linalg.norm(place[:, None] - place[None], axis=-1)
    which, number = np.unique(stroke, return_inverse=True)
    extent = np.array([gap[np.ix_(stroke == s, stroke == s)].max() for s in which])
    extent = extent[number.reshape(-1)]
    for x in (gap, extent):
        x.flags.writeable = False
    return gap, extent


def inverse_root_of_parts(own: F64, shared: F64) -> F64:
    """Returns a root W, W' W = C^-1, of C = diag(own) + shared shared', (k,) and (k, r): few parts make it quick.

    Source: Woodbury 1950, of the root: (1 + V V')^(-1/2) = 1 + Q ((1 + S^2)^(-1/2) - 1) Q' where V = Q S R'.
    """
    scale = 1 / np.sqrt(own)
    q, size, _ = np.linalg.svd(scale[:, None] * shared, full_matrices=False)
    root: F64 = (q * (1 / np.sqrt(1 + size**2) - 1)) @ q.T
    root[np.diag_indices(len(own))] += 1
    root *= scale
    return root


def inverse_root(covariance: F64) -> F64:
    """Returns the inverse of the lower triangular root of a covariance (k, k)."""
    inverse, failed = dtrtri(np.linalg.cholesky(covariance), lower=1)
    assert not failed, failed
    return np.asarray(inverse, np.float64)
