"""Which UsdPreviewSurface inputs give a wanted reflectance: the metal workflow while it can say it.

    SurfaceInputs                                    diffuseColor, metallic, ior, specularColor, workflow
    reflectance_of(inputs) -> (d, F0)                what they mean
    inputs_for(before, d, F0, tolerance) -> SurfaceInputs    with the fewest inputs changed

Metal workflow, with R = (1 - ior) / (1 + ior) and m = metallic (previewSurface.glslfx of OpenUSD):

    S = mix(1, diffuseColor, m);   F0 = mix(R^2 S, S, m) = S (R^2 (1 - m) + m);   d = diffuseColor (1 - m)

so for a given m < 1 the wanted d fixes diffuseColor and S, and the wanted F0 must be a multiple of S in
[m, 1], which fixes the ior: one search over m says whether the metal workflow can say it.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from usdslf.scene.records import F64

MAX_IOR = 1000.0  # F0 = 0.996; above it a dielectric is a mirror
NATURAL_IOR = 3.0  # F0 = 0.25; no dielectric has more
_GRID = np.linspace(0, 1, 401)


@dataclass(frozen=True)
class SurfaceInputs:
    """Inputs of a UsdPreviewSurface that give its colours; the mean of what is textured."""

    diffuse_color: F64  # (3,)
    metallic: float = 0.0
    ior: float = 1.5
    specular_color: F64 | None = None  # (3,) of the specular workflow
    use_specular_workflow: bool = False


def reflectance_of(inputs: SurfaceInputs) -> tuple[F64, F64]:
    """Returns the diffuse reflectance d (3,) and the reflectance at normal incidence F0 (3,)."""
    color = np.asarray(inputs.diffuse_color, np.float64)
    if inputs.use_specular_workflow:
        return color, np.zeros(3) if inputs.specular_color is None else np.asarray(inputs.specular_color)
    m = inputs.metallic
    return color * (1 - m), (1 - m + m * color) * (normal_reflectance(inputs.ior) * (1 - m) + m)


def normal_reflectance(ior: float) -> float:
    """R^2 of a dielectric."""
    return ((1 - ior) / (1 + ior)) ** 2


def ior_for(reflectance: ArrayLike) -> F64:
    """The iors >= 1 whose R^2 are given, each in [0, 1)."""
    root = np.sqrt(np.maximum(reflectance, 0.0))  # rounding may pass the end by a hair
    return np.asarray((1 + root) / (1 - root))


def inputs_for(
    before: SurfaceInputs, d: F64, f0: F64, tolerance: float = 0.005, ior_is_free: bool = True,
    metallic_is_free: bool = True,
) -> SurfaceInputs:  # fmt: skip
    """Finds the inputs that give d and F0 with as few of them changed as can be.

    The specular workflow is taken only where no diffuseColor, metallic and ior give both.

    Args:
        before: the inputs as they are; what a texture drives is its mean.
        d, f0: wanted (3,), each in 0..1.
        tolerance: of each channel of d and F0, relative, and a tenth of it absolute for what is dark.
        ior_is_free: False where the ior also drives a clear coat that is seen.
        metallic_is_free: False where a map says what is metal, which has to keep its meaning.
    """
    d, f0 = np.asarray(d, np.float64), np.asarray(f0, np.float64)
    if before.use_specular_workflow:
        return replace(before, diffuse_color=d, specular_color=f0)
    for candidate in _metal_candidates(before, d, f0, ior_is_free):
        if not metallic_is_free and candidate.metallic != before.metallic:
            continue
        if error_of(candidate, d, f0) <= tolerance:
            return candidate
    return replace(before, diffuse_color=d, specular_color=f0, use_specular_workflow=True)


def error_of(inputs: SurfaceInputs, d: F64, f0: F64) -> float:
    """Largest relative error of d and F0 over the channels; inf where an input is out of its range."""
    ranges = np.array([*inputs.diffuse_color, inputs.metallic], np.float64)
    # float32 inputs and means of textures may pass the ends by a hair.
    if ranges.min() < -1e-6 or ranges.max() > 1 + 1e-6 or not 1 <= inputs.ior <= MAX_IOR:
        return np.inf
    got_d, got_f0 = reflectance_of(inputs)
    got, wanted = np.stack([got_d, got_f0]), np.stack([d, f0])
    dark = 0.1 * np.maximum(wanted.max(1, keepdims=True), 0.01)
    return float((np.abs(got - wanted) / (wanted + dark)).max())


def _metal_candidates(before: SurfaceInputs, d: F64, f0: F64, ior_is_free: bool) -> Iterator[SurfaceInputs]:
    """What to try, fewest changed inputs first."""
    c, m, r2 = np.asarray(before.diffuse_color, np.float64), before.metallic, normal_reflectance(before.ior)

    def color(m_: float) -> F64:
        # Of a metal only F0 tells the colour; d is zero whatever it is.
        return np.clip(d / (1 - m_), 0, 1) if m_ < 1 else np.clip(f0, 0, 1)

    def from_f0(m_: float) -> F64:
        k = r2 * (1 - m_) + m_
        return np.clip((f0 / k - (1 - m_)) / m_, 0, 1)

    def ior(m_: float, c_: F64) -> float:
        s = 1 - m_ + m_ * c_
        k = float(s @ f0) / max(float(s @ s), 1e-12)
        reflectance = float((k - m_) / (1 - m_)) if m_ < 1 else r2
        return float(ior_for(reflectance)) if -1e-9 < reflectance < 0.999 else np.inf

    def inputs(c_: F64, m_: float, ior_: float) -> SurfaceInputs:
        return replace(before, diffuse_color=c_, metallic=float(m_), ior=max(ior_, 1.0))

    def over_metallic(make: Callable[[float], SurfaceInputs]) -> SurfaceInputs:
        return _search(lambda m_: error_of(make(m_), d, f0), make, m)

    # what reflects like a metal is said as one, and by a high ior only where it also has a diffuse colour
    is_natural = lambda x: x.ior <= NATURAL_IOR  # noqa: E731
    new_ior = inputs(color(m), m, ior(m, color(m))) if ior_is_free and m < 1 else before

    yield before
    yield inputs(color(m), m, before.ior)
    if m > 0:
        yield inputs(from_f0(m), m, before.ior)
    if ior_is_free and m < 1:
        yield inputs(c, m, ior(m, c))
    yield over_metallic(lambda m_: inputs(c, m_, before.ior))
    if is_natural(new_ior):
        yield new_ior
    yield over_metallic(lambda m_: inputs(color(m_), m_, before.ior))
    yield new_ior
    if ior_is_free:
        yield over_metallic(lambda m_: inputs(c, m_, ior(m_, c)))
        yield over_metallic(lambda m_: inputs(color(m_), m_, ior(m_, color(m_))))
    # of what is nearly a metal only F0 tells the colour well: d / (1 - metallic) is two small numbers
    yield over_metallic(lambda m_: inputs(from_f0(m_) if m_ > 0 else c, m_, before.ior))


def _search(
    error: Callable[[float], float], make: Callable[[float], SurfaceInputs], near: float, rounds: int = 4
) -> SurfaceInputs:
    """The metallic of least error in 0..1, of equal ones the nearest to what it was: by ever finer grids."""
    grid = _GRID
    best = near
    for _ in range(rounds):
        errors = np.array([error(m) for m in grid])
        if not np.isfinite(errors).any():
            break
        least = np.flatnonzero(errors <= np.maximum(errors.min() * 1.0001, 1e-6))
        best = grid[least[np.abs(grid[least] - near).argmin()]]
        step = grid[1] - grid[0]
        grid = np.linspace(max(best - step, 0), min(best + step, 1), 41)
    return make(float(best))
