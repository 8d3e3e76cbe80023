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


def scrambled_points(count: int, seeds: NDArray[np.uint32]) -> NDArray[np.float32]:
    """Returns `count` points (sets, count, 2) in [0, 1) of the sequence for every seed, scrambled by hashing (Owen).

    Every aligned run of 2^m points is stratified, as of `sobol_points`; beyond that they are as random as can be, and
    means of smooth functions err less.  Source: Burley 2020.
    """
    s = _hash(np.asarray(seeds, np.uint32)[:, None] + np.uint32(1))
    index = _scramble(np.arange(count, dtype=np.uint32)[None], s)
    y = np.zeros_like(index)
    v = 1 << 31
    for bit in range(32):
        y ^= ((index >> np.uint32(bit)) & np.uint32(1)) * np.uint32(v)
        v ^= v >> 1
    x = _scramble(_reversed(index), _hash(s ^ np.uint32(0x68BC21EB)))
    y = _scramble(y, _hash(s ^ np.uint32(0x02E5BE93)))
    return (np.stack([x, y], -1) >> np.uint32(8)).astype(np.float32) * np.float32(2.0**-24)


def _reversed(x: NDArray[np.uint32]) -> NDArray[np.uint32]:
    """Bits in the opposite order."""
    for shift, mask in ((1, 0x55555555), (2, 0x33333333), (4, 0x0F0F0F0F), (8, 0x00FF00FF), (16, 0x0000FFFF)):
        by, of = np.uint32(shift), np.uint32(mask)
        x = ((x & of) << by) | ((x >> by) & of)
    return x


def _hash(x: NDArray[np.uint32]) -> NDArray[np.uint32]:
    x = (x ^ (x >> np.uint32(16))) * np.uint32(0x7FEB352D)
    x = (x ^ (x >> np.uint32(15))) * np.uint32(0x846CA68B)
    return x ^ (x >> np.uint32(16))


def _scramble(x: NDArray[np.uint32], seed: NDArray[np.uint32]) -> NDArray[np.uint32]:
    """Each bit flipped by a hash of the bits above it: Laine and Karras 2011, Burley 2020."""
    x = _reversed(x)
    x = x ^ (x * np.uint32(0x3D20ADEA))
    x = (x + seed) * ((seed >> np.uint32(16)) | np.uint32(1))
    x = x ^ (x * np.uint32(0x05526C56))
    return _reversed(x ^ (x * np.uint32(0x53A22864)))
