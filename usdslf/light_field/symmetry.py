"""Symmetry: the reflection operator K in a basis in which it falls into small blocks.

K is isotropic, so it commutes with the eight symmetries of the square of bins: flips of either axis, and their swap.
Functions on a square of 2H x 2H bins that are even or odd under each flip, and alike or opposite under the swap, do not
mix.  With H = 8 a matrix of 256 x 256 becomes blocks of 36, 28, 36, 28 and one of 64 that serves twice: 5.3 times fewer
products, exactly.

    folding() -> (Q, Q)        takes light in bins to the basis; kernels/light_field.cl: gather_folded, fold_swapped
    unfolding() -> (Q, Q)      back; unfold
    blocks_of(matrix) -> (n,)  the blocks of a matrix that commutes with the symmetries, row by row; reflect_folded

Order of the basis, with y and x counted from the edge in a quarter of the square: both even, alike (y <= x), opposite
(y < x); both odd, alike and opposite; even in y and odd in x, by y and x; odd in y and even in x, by x and y.

Source: representations of the dihedral group D4, e.g. Serre 1977, 5.3.
"""

from __future__ import annotations

import functools

import numpy as np
from numpy.typing import NDArray

from usdslf.sampling.hemisphere import SIDE

H = SIDE // 4  # bins of a quarter's side, on the coarse map
QUARTER = H * H
ALIKE, OPPOSITE = H * (H + 1) // 2, H * (H - 1) // 2
SIZES = (ALIKE, OPPOSITE, ALIKE, OPPOSITE, QUARTER, QUARTER)


@functools.cache
def folding() -> NDArray[np.float64]:
    """Returns the matrix (Q, Q) that takes values in coarse bins to the basis."""
    y, x = np.divmod(np.arange(QUARTER), H)
    last = 2 * H - 1
    four = np.zeros((2, 2, QUARTER, QUARTER * 4))  # odd in y, odd in x; cell; bin
    for odd_y in (0, 1):
        for odd_x in (0, 1):
            for low, left in np.ndindex(2, 2):
                bins = np.where(low, last - y, y) * 2 * H + np.where(left, last - x, x)
                four[odd_y, odd_x, np.arange(QUARTER), bins] = (-1.0) ** (low * odd_y + left * odd_x)
    swapped = x * H + y
    parts = []
    for odd in (0, 1):
        cell = four[odd, odd]
        other = cell[swapped]
        parts += [np.where((y == x)[:, None], cell, cell + other)[y <= x], (cell - other)[y < x]]
    return np.concatenate([*parts, four[0, 1], four[1, 0][swapped]])


@functools.cache
def unfolding() -> NDArray[np.float64]:
    """Returns the inverse (Q, Q) of `folding`: a quarter of sums and differences, half of those for the swap."""
    f = folding()
    return f.T / (f * f).sum(1)


def output_scale() -> NDArray[np.float64]:
    """Returns the factors (Q,) of `unfolding` that rows of `blocks_of` hold already, so that `unfold` only adds."""
    return 1.0 / (folding() ** 2).sum(1)


def blocks_of(matrix: NDArray) -> NDArray[np.float32]:
    """Returns the blocks of a matrix between coarse bins, one row after another, with `output_scale`.

    Args:
        matrix: (Q, Q) that commutes with the symmetries; rows are outgoing bins.

    Returns: (n,) of four blocks and the one that serves twice.
    """
    folded = output_scale()[:, None] * (folding() @ np.asarray(matrix, np.float64) @ unfolding())
    ends = np.cumsum(SIZES[:-1])
    return np.concatenate(
        [folded[e - n : e, e - n : e].ravel() for e, n in zip(ends, SIZES[:-1], strict=True)]
    ).astype(np.float32)
