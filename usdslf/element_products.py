"""Products of what each roughness level makes of the light at each element: all that least squares need.

    L_o = d [(1 - F0) X + (1 - F90) Y] + F0 A + F90 B

is linear in the columns X, Y (diffuse), A, B (specular, of a roughness), so the misfit of any parameters to a wanted
light T is a quadratic form in the products of the five, summed over the bins.  They are taken once under the light
that arrives now, for all 20 levels and between neighbouring ones; no parameter needs another look at the light.

Source: Nguyen et al. 2013, 5.3 (C = A'A, d = A'b); kernels: element_fit.cl.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from usdslf.directions import D
from usdslf.light_field import CHUNK_BLOCKS, LANES, NEAR, LightField, levels_of
from usdslf.reflectance import LEVEL_COUNT
from usdslf.scene import F64

PARTS = 8  # sums of each product, added on the host
FIXED, OF_LEVEL = 6, 13  # products, in the order of element_fit.cl
X, Y, A, B, T = range(5)


@dataclass(frozen=True)
class Products:
    """Sums over the bins of products, for N elements and three channels."""

    fixed: F64  # (N, 3, 6) X.X X.Y Y.Y X.T Y.T T.T
    level: F64  # (N, 20, 3, 13) A.A A.B B.B X.A X.B Y.A Y.B A.T B.T, and A.A' A.B' B.A' B.B' with the level before

    def at(self, roughness: NDArray) -> F64:
        """Returns the symmetric products (N, 3, 5, 5) of X, Y, A, B, T at one roughness (N,) for each element."""
        low, share = levels_of(roughness)
        n = np.arange(len(low))
        under, over = self.level[n, low], self.level[n, low + 1]
        p, q = (1 - share)[:, None], share[:, None]
        g = np.empty((len(low), 3, 5, 5))
        for k, (i, j) in enumerate(((X, X), (X, Y), (Y, Y), (X, T), (Y, T), (T, T))):
            g[..., i, j] = self.fixed[..., k]
        for k, (i, j) in enumerate(((X, A), (X, B), (Y, A), (Y, B), (A, T), (B, T)), 3):
            g[..., i, j] = p * under[..., k] + q * over[..., k]
        both = p * q
        g[..., A, A] = p * p * under[..., 0] + 2 * both * over[..., 9] + q * q * over[..., 0]
        g[..., A, B] = p * p * under[..., 1] + both * (over[..., 10] + over[..., 11]) + q * q * over[..., 1]
        g[..., B, B] = p * p * under[..., 2] + 2 * both * over[..., 12] + q * q * over[..., 2]
        row, column = np.tril_indices(5, -1)
        g[..., row, column] = g[..., column, row]
        return g


def take_products(field: LightField, wanted_d: Any) -> Iterator[Products | float]:
    """Multiplies the columns under the light of now with a wanted light; yields shares done, and Products at the end.

    Args:
        wanted_d: device array (N, D, 3): T, without emission and clear coat.
    """
    device, n = field.device, len(field.elements)
    kernel = lambda name: device.kernel("element_fit", name)  # noqa: E731
    light_kernel = lambda name: device.kernel("light_field", name, NEAR=NEAR, LOBE=0)  # noqa: E731
    chunk = CHUNK_BLOCKS
    block = (chunk, D, 3, LANES)
    light_d, wanted_block_d = device.empty(block, np.float32), device.empty(block, np.float32)
    coarse_d = device.empty((chunk, D // 4, 3, LANES), np.float32)
    e_pi_d = device.empty((chunk, 3, LANES), np.float32)
    xy_d, ab_d, before_d = (device.empty((2, *block), np.float32) for _ in range(3))
    fixed_d = device.empty((chunk, PARTS, 3, FIXED, LANES), np.float32)
    level_d = device.empty((chunk, PARTS, 3, OF_LEVEL, LANES), np.float32)

    fixed, level = np.zeros((n, 3, FIXED)), np.zeros((n, LEVEL_COUNT, 3, OF_LEVEL))
    blocks = -(-n // LANES)
    order = np.full(blocks * LANES, -1, np.int32)
    order[:n] = np.arange(n)
    order_d = device.upload(order)
    for first in range(0, blocks, chunk):
        count, at = min(chunk, blocks - first), np.int32(first)
        rows = slice(first * LANES, min((first + count) * LANES, n))

        def summed(sums_d: Any, count: int = count, rows: slice = rows) -> F64:
            sums = device.download(sums_d)[:count].sum(1, dtype=np.float64)  # (blocks, 3, products, 16)
            return np.moveaxis(sums, -1, 1).reshape(-1, *sums.shape[1:-1])[: rows.stop - rows.start]

        light_kernel("gather")(
            (D, count), (64, 1), order_d, field.hit_d, field.fixed_d, field.outgoing_d, at, light_d
        )
        light_kernel("coarsen")((D // 4, count), (64, 1), light_d, coarse_d)
        light_kernel("irradiance")((3, count), None, light_d, field.cosine_d, e_pi_d)
        kernel("gather_wanted")((D, count), (64, 1), order_d, wanted_d, at, wanted_block_d)
        size = np.int32(chunk)
        kernel("diffuse_columns")((D // 4, count), (64, 1), coarse_d, e_pi_d, field.y_d, field.y_scale_d, size, xy_d)
        kernel("fixed_products")((3, PARTS, count), None, xy_d, wanted_block_d, size, fixed_d)
        fixed[rows] = summed(fixed_d)
        for j in range(LEVEL_COUNT):
            weights, w = field.level(j)
            if weights.coarse:
                kernel("coarse_columns")(
                    (D // 4, count), (64, 1), coarse_d, w["a"], w["b"], w["fine_scale"], size, ab_d
                )
            else:
                kernel("sharp_columns")(
                    (D, count), (64, 1), light_d, w["first"], w["tap"], w["a"], w["b"], size, ab_d
                )
            kernel("level_products")(
                (3, PARTS, count), None, xy_d, ab_d, before_d if j else ab_d, wanted_block_d, size, level_d
            )
            level[rows, j] = summed(level_d)
            ab_d, before_d = before_d, ab_d
        yield rows.stop / n
    yield Products(fixed, level)
