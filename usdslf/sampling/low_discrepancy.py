"""Well spread sample points in the unit square.

The first two dimensions of the Sobol' sequence are a (0, 2)-sequence in base 2: every aligned run of
2^m points has one point in each elementary interval of area 2^-m.  A random digital shift (an
exclusive or of all digits) keeps that and makes the points of every set uniform, hence estimates
unbiased.  Source: Kollig and Keller 2002, "Efficient multidimensional sampling".
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray


@lru_cache(maxsize=8)
def _sobol_digits(end: int) -> NDArray[np.uint32]:
    """Points 0 .. end-1 of the sequence (end, 2) as 32 binary digits."""
    index = np.arange(end, dtype=np.uint32)
    out = np.zeros((end, 2), np.uint32)
    corput, sobol = 1 << 31, 1 << 31
    for bit in range(int(end - 1).bit_length()):
        on = (index >> np.uint32(bit)) & np.uint32(1)
        out[:, 0] ^= on * np.uint32(corput)
        out[:, 1] ^= on * np.uint32(sobol)
        corput, sobol = corput >> 1, sobol ^ (sobol >> 1)
    out.setflags(write=False)
    return out


def random_shifts(sets: int, rng: np.random.Generator) -> NDArray[np.uint32]:
    """Returns a digital shift (sets, 2) for each set of points."""
    return rng.integers(0, 1 << 32, (sets, 2), dtype=np.uint32)


def sobol_points(first: int, end: int, shifts: NDArray[np.uint32]) -> NDArray[np.float64]:
    """Returns points `first` .. `end`-1 of the sequence for every shift: (sets, end - first, 2) in (0, 1)."""
    digits = _sobol_digits(end)[first:]
    return ((digits[None] ^ shifts[:, None]).astype(np.float64) + 0.5) * 2.0**-32
