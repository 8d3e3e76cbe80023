"""The reflection operator K of one roughness level, as weights between bins.

The exact matrices are the same for every element, since they depend on the local frame alone.  Sharp levels
keep the largest weights of each row; from roughness 0.45 on, bins are averaged two by two on both sides.  Both
are scaled to the exact albedo of their row, so a white furnace stays white.  Errors of both against the
exact matrices are measured in tests/light_field/test_preconvolution.py.

Source: Nguyen et al. 2013, 6.2 (whose box-filtered MIP maps are 10 to 15 % off at middle roughness).
"""

from __future__ import annotations

import functools
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from usdslf import cache
from usdslf.gpu.device import Device
from usdslf.gpu.source import kernel_source
from usdslf.sampling.hemisphere import SIDE, D, bin_directions
from usdslf.surfaces.reflectance import directional_albedo, lobe_parameter, model_of

COARSE_FROM = 0.45  # roughness from which 16 x 16 bins are enough
KEPT_MASS = 0.93  # of each row of a sharp level
COARSE_D = D // 4
WEIGHTS_VERSION = 1  # raise it when this module, the bins or the albedo of a model compute other weights


@dataclass(frozen=True)
class LevelKernel:
    """Weights of the columns A and B at one level; rows are outgoing bins.

    Sharp: `first` (D + 1,), `tap` (n,) incoming bins, `a`, `b` (n,).  Coarse: `first` and `tap` are None,
    `a`, `b` are (D / 4, D / 4), and `fine_scale` (D, 2) takes a coarse bin's A and B to the albedo of each of its
    four bins.
    """

    a: NDArray[np.float32]
    b: NDArray[np.float32]
    first: NDArray[np.int32] | None = None
    tap: NDArray[np.uint16] | None = None
    fine_scale: NDArray[np.float32] | None = None

    @property
    def coarse(self) -> bool:
        """True where the weights join bins of the 16 x 16 map."""
        return self.fine_scale is not None


def coarse_of_bin() -> NDArray[np.int64]:
    """Returns (D,) the 16 x 16 bin that holds each bin."""
    y, x = np.divmod(np.arange(D), SIDE)
    return (y // 2) * (SIDE // 2) + x // 2


@functools.cache
def _symmetry(side: int) -> tuple[NDArray, NDArray, NDArray]:
    """The eight symmetries of the square, which are symmetries of K.

    Returns: distinct rows (R,) bins, `row_of_bin` (D,) into them, `moved` (D, D) uint16: the bin that each incoming
    bin becomes under the symmetry that takes an outgoing bin to its distinct row, K[w, d] = K[row, moved[w, d]].
    """
    y, x = np.divmod(np.arange(side * side), side)
    moves = []
    for flip_x in (False, True):
        for flip_y in (False, True):
            mx, my = side - 1 - x if flip_x else x, side - 1 - y if flip_y else y
            moves += [my * side + mx, mx * side + my]
    stack = np.stack(moves)  # (8, D)
    best = stack.argmin(0)
    rows, row_of_bin = np.unique(stack.min(0), return_inverse=True)
    return rows, row_of_bin, stack[best].astype(np.uint16)


def integrate_rows(device: Device, model: str, roughness: float, rows: NDArray, side: int = SIDE) -> list[NDArray]:
    """Integrates A, B and Y (R, side^2) from the centres of outgoing bins `rows` over each incoming bin."""
    parameter = float(lobe_parameter(model, roughness))
    fine = 24 if roughness < 0.12 else 12 if roughness < 0.3 else 4
    n = side * side
    matrices_d = [device.empty((len(rows), n), np.float32) for _ in range(3)]
    kernel = device.kernel(
        "preconvolution", "exact_matrix", SIDE=side, COARSE=2, FINE=fine, **model_of(model).constants
    )
    near = np.cos(0.15 + 2 * float(lobe_parameter("preview_surface", roughness)))
    kernel(
        (n, len(rows)), (min(n, 64), 1), device.upload(rows.astype(np.int32)), np.int32(len(rows)),
        np.float32(parameter), np.float32(near), *matrices_d,
    )  # fmt: skip
    return [device.download(m).astype(np.float64) for m in matrices_d]


def build_level(device: Device, model: str, roughness: float) -> LevelKernel:
    """Builds the weights of one level, or reads them from the user's cache."""
    return _cached("level", model, roughness, lambda: _compute_level(device, model, roughness))


def _compute_level(device: Device, model: str, roughness: float) -> LevelKernel:
    parameter = float(lobe_parameter(model, roughness))
    rows, row_of_bin, moved = _symmetry(SIDE)
    albedo = directional_albedo(model, parameter, bin_directions()[rows, 2])
    a, b, _ = integrate_rows(device, model, roughness, rows)
    a *= (albedo[:, 2] / np.maximum(a.sum(1), 1e-30))[:, None]
    b *= (albedo[:, 3] / np.maximum(b.sum(1), 1e-30))[:, None]
    if roughness < COARSE_FROM - 1e-6:
        a, b = _keep_largest(a, b, albedo)
    pick = (row_of_bin[:, None], moved)
    a, b, albedo = a[pick], b[pick], albedo[row_of_bin]
    if roughness >= COARSE_FROM - 1e-6:
        coarse_a, coarse_b = _coarsen(a).astype(np.float32), _coarsen(b).astype(np.float32)
        scale = np.stack([_fine_scale(albedo[:, 2], coarse_a), _fine_scale(albedo[:, 3], coarse_b)], 1)
        return LevelKernel(coarse_a, coarse_b, fine_scale=scale)
    row, tap = np.nonzero(a + b)
    return LevelKernel(
        a[row, tap].astype(np.float32),
        b[row, tap].astype(np.float32),
        np.searchsorted(row, np.arange(D + 1)).astype(np.int32),
        tap.astype(np.uint16),
    )


def _keep_largest(a: NDArray, b: NDArray, albedo: NDArray) -> tuple[NDArray, NDArray]:
    """Sets all but the largest weights of each row to zero and scales the rest to the albedo."""
    mass = a + b
    order = np.argsort(-mass, axis=1, kind="stable")
    cumulated = np.cumsum(np.take_along_axis(mass, order, 1), 1)
    kept = 1 + (cumulated < KEPT_MASS * cumulated[:, -1:]).sum(1)
    rank = np.argsort(order, axis=1, kind="stable")
    a, b = np.where(rank < kept[:, None], a, 0), np.where(rank < kept[:, None], b, 0)
    a *= (albedo[:, 2] / np.maximum(a.sum(1), 1e-30))[:, None]
    b *= (albedo[:, 3] / np.maximum(b.sum(1), 1e-30))[:, None]
    return a, b


def fresnel_diffuse(device: Device, model: str) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """What Fresnel's ramp takes from the diffuse reflection: the column Y (D / 4, D / 4), and its scale (D,)."""
    if not model_of(model).has_fresnel:
        return np.zeros((COARSE_D, COARSE_D), np.float32), np.ones(D, np.float32)

    def compute() -> LevelKernel:
        rows, row_of_bin, moved = _symmetry(SIDE)
        y = integrate_rows(device, model, 1.0, rows)[2]
        exact = directional_albedo(model, 1.0, bin_directions()[rows, 2])[:, 1]
        y *= (exact / y.sum(1))[:, None]
        coarse = _coarsen(y[row_of_bin[:, None], moved]).astype(np.float32)
        scale = _fine_scale(exact[row_of_bin], coarse)
        return LevelKernel(coarse, coarse, fine_scale=np.stack([scale, scale], 1))

    kernel = _cached("fresnel", model, 1.0, compute)
    assert kernel.fine_scale is not None
    return kernel.a, np.ascontiguousarray(kernel.fine_scale[:, 0])


def _fine_scale(albedo: NDArray, coarse: NDArray) -> NDArray[np.float32]:
    """Ratio (D,) of each bin's exact albedo to that of its coarse bin."""
    return (albedo / np.maximum(coarse.sum(1), 1e-30)[coarse_of_bin()]).astype(np.float32)


def _coarsen(matrix: NDArray) -> NDArray:
    """Means over outgoing and sums over incoming blocks of two by two bins: (D, D) -> (D / 4, D / 4)."""
    h = SIDE // 2
    blocks = matrix.reshape(h, 2, h, 2, h, 2, h, 2)
    return blocks.sum((5, 7)).mean((1, 3)).reshape(h * h, h * h)


def _cached(what: str, model: str, roughness: float, compute: Callable[[], LevelKernel]) -> LevelKernel:
    """Weights from the user's cache, named by the kernel's text, this code's version and the parameters."""
    name = cache.address(what, WEIGHTS_VERSION, kernel_source("preconvolution"), model, f"{roughness:.6f}")

    def arrays() -> dict[str, NDArray]:
        return {key: value for key, value in vars(compute()).items() if value is not None}

    return LevelKernel(**cache.arrays(name, arrays))
