"""The reflectance models and their parameters; host twin of kernels/reflectance.cl.

A model is a `Reflectance`; MODELS has them by name, and all that differs between them stands here and in the kernel.
All are linear in their colour parameters at a fixed roughness:

    L_o = d [(1 - F0) X + (1 - F90) Y] + F0 A + F90 B

with the columns X, Y (diffuse) and A, B (specular) of the light that arrives.  `preview_surface` is
UsdPreviewSurface with GGX, height-correlated Smith and OpenUSD's diffuse balance; `phong` is the paper's
model, normalized (Lafortune and Willems 1994), L_o = k_d X + k_s A with k_d = d and k_s = F0, held to
k_d + k_s <= 1; it has no Fresnel ramp, so Y = B = 0.

Source: Nguyen et al. 2013, 5.2; Walter et al. 2007; Heitz 2014; UsdPreviewSurface specification 2.5.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from usdslf.errors import InputError
from usdslf.surfaces.models import PHONG, PREVIEW_SURFACE

F64 = NDArray[np.float64]

LEVEL_COUNT = 20  # n_c of the paper
MIN_ROUGHNESS = 0.001  # UsdPreviewSurface clamps there
TIED, NO_DIFFUSE = 2e-3, 0.02  # of a metal: F90 is F0 as near as this, and the diffuse reflectance below that


def are_metal(diffuse: NDArray, f0: NDArray, f90: NDArray) -> NDArray[np.bool_]:
    """Tells which of n surfaces (n,) are metals: F90 goes with F0, and there is no diffuse reflection.

    Args:
        diffuse, f0, f90: (n, 3), 0..1.
    """
    metal: NDArray[np.bool_] = (np.abs(f90 - f0).max(1) < TIED) & (diffuse.max(1) < NO_DIFFUSE)
    return metal


def is_metal(diffuse: NDArray, f0: NDArray, f90: NDArray) -> bool:
    """Tells whether all of n surfaces (n, 3) are metals; none at all is none."""
    return bool(len(diffuse)) and bool(are_metal(diffuse, f0, f90).all())


@dataclass(frozen=True)
class Parameters:
    """The parameters of n surfaces that an edit may change, any float type."""

    diffuse: NDArray  # (n, 3) d
    f0: NDArray  # (n, 3)
    f90: NDArray  # (n, 3)
    roughness: NDArray  # (n,) the input, not alpha

    @staticmethod
    def of(surface: Any, rows: Any = slice(None)) -> Parameters:
        """Takes them from elements, surface points or a light field's surface: all, or some rows."""
        return Parameters(surface.diffuse[rows], surface.f0[rows], surface.f90[rows], surface.roughness[rows])

    def astype(self, dtype: Any) -> Parameters:
        """Returns them in another float type."""
        return Parameters(*(np.asarray(x).astype(dtype) for x in vars(self).values()))

    @property
    def packed(self) -> NDArray:
        """Rows (n, 7) of d, F0 and roughness, see COLUMNS."""
        return np.concatenate([self.diffuse, self.f0, self.roughness[:, None]], 1)


COLUMNS = {"diffuse": slice(0, 3), "specular": slice(3, 6), "glossiness": slice(6, 7)}  # of Parameters.packed


def roughness_levels() -> F64:
    """Returns the 20 roughness levels that the light field is pre-convolved for, in even steps of roughness.

    preview_surface is enumerated on them too.  Roughness is the square root of GGX's alpha, whose even steps look
    about even to artists (Burley 2012); in distinctness of gloss the steps grow from 0.0075 to 0.0975.
    """
    return np.arange(1, LEVEL_COUNT + 1) / LEVEL_COUNT


def distinctness_of_gloss(roughness: ArrayLike) -> F64:
    """Returns d = 1 - alpha, in which gloss is perceived uniformly.  Source: Pellacini et al. 2000.

    alpha is Ward's, the width of the half vectors' lobe, for which GGX's alpha = roughness^2 stands.
    """
    return 1 - np.asarray(roughness, np.float64) ** 2


class Reflectance(ABC):
    """A reflectance model: how d, F0, F90 and roughness reflect light, at the points and for the fits."""

    name: str
    number: int  # MODEL of kernels/reflectance.cl
    has_fresnel = True  # reflects more at grazing angles: the columns Y and B, and F90
    has_coat = True  # may lie under a clear coat
    is_authored = True  # is what a look layer shows: UsdPreviewSurface

    @property
    def constants(self) -> dict[str, int]:
        """Build constants of the kernels that include reflectance.cl."""
        return {"MODEL": self.number}

    def gloss_levels(self) -> F64:
        """Returns the 20 roughness levels that glossiness is enumerated on, sharp ones first."""
        return roughness_levels()

    @abstractmethod
    def lobe_parameter(self, roughness: ArrayLike) -> F64:
        """Returns what the kernels take for the width of the lobe."""

    @abstractmethod
    def column_weights(self, diffuse: NDArray, f0: NDArray, f90: NDArray) -> NDArray:
        """Returns the weights (n, 4, 3) of the columns X, Y, A, B for parameters (n, 3): L_o is their sum."""

    def held(self, diffuse: NDArray, f0: NDArray) -> tuple[NDArray, NDArray]:
        """Returns d and F0 (n, 3) as they reflect: lowered where both would reflect more than arrives."""
        return diffuse, f0

    @abstractmethod
    def bilinear(self, columns: F64, d: F64, f0: F64, f90: F64, tied: bool) -> tuple[F64, F64, F64, F64]:
        """Returns P, U, V, W (n, ..., 3) of L = P + dd U + dF V - dd dF W about the present parameters (n, ..., 3).

        Args:
            columns: (n, ..., 4, 3) of X, Y, A, B.
            tied: F90 changes with F0, as in a metal of the metal workflow.
        """

    @abstractmethod
    def columns(self, parameter: NDArray, eye: F64, light: F64) -> F64:
        """Returns the integrands (..., 4) of X, Y, A, B for local unit directions (..., 3), see `columns`."""

    @abstractmethod
    def lobe_albedo(self, parameter: float, eye: F64) -> tuple[F64, F64]:
        """Returns the columns A and B (n,), integrated over the light, for eye directions (n, 3)."""


class PreviewSurface(Reflectance):
    """UsdPreviewSurface: GGX, height-correlated Smith, Schlick's ramp, OpenUSD's diffuse balance."""

    name, number = PREVIEW_SURFACE, 0

    def lobe_parameter(self, roughness: ArrayLike) -> F64:
        return np.maximum(np.asarray(roughness, np.float64), MIN_ROUGHNESS) ** 2

    def column_weights(self, diffuse: NDArray, f0: NDArray, f90: NDArray) -> NDArray:
        return np.stack([diffuse * (1 - f0), diffuse * (1 - f90), f0, f90], 1)

    def bilinear(self, columns: F64, d: F64, f0: F64, f90: F64, tied: bool) -> tuple[F64, F64, F64, F64]:
        x, y, a, b = (columns[..., k, :] for k in range(4))
        p = d * ((1 - f0) * x + (1 - f90) * y) + f0 * a + f90 * b
        u = (1 - f0) * x + (1 - f90) * y
        if tied:
            return p, u, a + b - d * (x + y), x + y
        return p, u, a - d * x, x

    def columns(self, parameter: NDArray, eye: F64, light: F64) -> F64:
        nl, ne = np.maximum(light[..., 2], 0), np.maximum(eye[..., 2], 1e-4)
        c = nl / np.pi
        a2 = parameter**2
        h = eye + light
        h = h / np.maximum(np.linalg.norm(h, axis=-1, keepdims=True), 1e-12)
        f = np.clip(1 - np.sum(eye * h, -1), 0, 1) ** 5
        nh = np.clip(h[..., 2], 0, 1)
        ggx = a2 / (np.pi * (nh * nh * a2 + (1 - nh) * (1 + nh)) ** 2)
        dvc = ggx * _smith(a2, nl, ne) * nl
        return np.stack([(1 - f) * c, f * c, (1 - f) * dvc, f * dvc], -1)

    def lobe_albedo(self, parameter: float, eye: F64) -> tuple[F64, F64]:
        u, phi, weight = _half_vectors()
        # half vectors distributed as D (N.H)
        ct2 = (1 - u) / (1 - u + parameter**2 * u)
        h = _about_axis(np.sqrt(ct2), np.sqrt(1 - ct2), phi)
        eh = np.einsum("nk,uvk->nuv", eye, h)
        light_z = 2 * eh * h[..., 2] - eye[:, 2, None, None]
        nl, ne = np.maximum(light_z, 0), np.maximum(eye[:, 2], 1e-4)[:, None, None]
        smith = _smith(parameter**2, nl, ne)
        value = np.where((eh > 0) & (light_z > 0), smith * nl * 4 * eh / h[..., 2], 0)
        f = np.clip(1 - eh, 0, 1) ** 5
        of = lambda share: np.einsum("nuv,uv->n", value * share, weight)  # noqa: E731
        return of(1 - f), of(f)


class Phong(Reflectance):
    """The paper's model, normalized (Lafortune and Willems 1994): k_d = d, k_s = F0, no Fresnel ramp, no coat."""

    name, number = PHONG, 1
    has_fresnel = has_coat = is_authored = False

    def gloss_levels(self) -> F64:
        """Even steps of distinctness from a mirror (roughness 0.05) to 0, which are even steps of perceived gloss.

        As long as the contrast c stays, distance^2 = (change of c)^2 + (1.78 change of d)^2.

        Source: Nguyen et al. 2013, 5.3; Pellacini, Ferwerda and Greenberg 2000.
        """
        return np.sqrt(1 - np.linspace(distinctness_of_gloss(roughness_levels()[0]), 0, LEVEL_COUNT))

    def lobe_parameter(self, roughness: ArrayLike) -> F64:
        return phong_exponent(roughness)

    def column_weights(self, diffuse: NDArray, f0: NDArray, f90: NDArray) -> NDArray:
        """phong keeps k_d and lowers k_s where both would reflect more than arrives."""
        k_d, k_s = self.held(diffuse, f0)
        return np.stack([k_d, 0 * k_d, k_s, 0 * k_d], 1)

    def held(self, diffuse: NDArray, f0: NDArray) -> tuple[NDArray, NDArray]:
        k_d = np.minimum(diffuse, 1)
        return k_d, np.minimum(f0, 1 - k_d)

    def bilinear(self, columns: F64, d: F64, f0: F64, f90: F64, tied: bool) -> tuple[F64, F64, F64, F64]:
        x, _, a, _ = (columns[..., k, :] for k in range(4))
        return d * x + f0 * a, x, a, np.zeros_like(x)

    def columns(self, parameter: NDArray, eye: F64, light: F64) -> F64:
        nl = np.maximum(light[..., 2], 0)
        c = nl / np.pi
        mirrored = eye[..., 2] * light[..., 2] - eye[..., 0] * light[..., 0] - eye[..., 1] * light[..., 1]
        a = (parameter + 2) / (2 * np.pi) * np.maximum(mirrored, 0) ** parameter * nl
        return np.stack([c, 0 * c, a, 0 * c], -1)

    def lobe_albedo(self, parameter: float, eye: F64) -> tuple[F64, F64]:
        u, phi, weight = _half_vectors()
        # light about the mirror direction, cos^n distributed
        n = parameter
        ct = (1 - u) ** (1 / (n + 1))
        local = _about_axis(ct, np.sqrt(1 - ct * ct), phi)
        z = eye * [-1, -1, 1]
        x = np.stack([z[:, 2], 0 * z[:, 0], -z[:, 0]], -1)
        cosine = local[..., 0] * x[:, 2, None, None] + local[..., 2] * z[:, 2, None, None]
        value = np.maximum(cosine, 0) * (n + 2) / (n + 1)
        return np.einsum("nuv,uv->n", value, weight), np.zeros(len(eye))


MODELS: Mapping[str, Reflectance] = {m.name: m for m in (PreviewSurface(), Phong())}


def model_of(name: str) -> Reflectance:
    """Returns the reflectance model of a name.

    Raises: InputError where there is none.
    """
    if name not in MODELS:
        raise InputError(f"unknown reflectance model '{name}'; choose one of {', '.join(MODELS)}")
    return MODELS[name]


def gloss_levels(model: str) -> F64:
    """Returns the 20 roughness levels that a model's glossiness is enumerated on, sharp ones first."""
    return model_of(model).gloss_levels()


def moved_roughness(roughness: NDArray, shift: NDArray | float, mean: float) -> NDArray:
    """Returns roughness, held to .001 .. 1, whose mean moved by a shift: times a factor where it varies, else plus it.

    A term would make a mirror of the smooth parts of a packed map, and a scale is what a look writes.

    Args:
        mean: of what varies; 0: nothing does.
    """
    moved = roughness * (1 + shift / mean) if mean > 0 else roughness + shift
    return np.clip(moved, 0.001, 1)


def phong_exponent(roughness: ArrayLike) -> F64:
    """Returns the exponent whose lobe has the width of GGX's at the same roughness: n = (2 / alpha^2 - 2) / 4.

    2 / alpha^2 - 2 is the exponent of half vectors (Walter et al. 2007); the mirrored direction turns twice as far,
    which makes it a quarter.  Never zero: 0^0 would light what lies behind the lobe.
    """
    alpha = np.maximum(np.asarray(roughness, np.float64), 0.01) ** 2
    return np.clip((2 / alpha**2 - 2) / 4, 1e-3, 1e6)


def lobe_parameter(model: str, roughness: ArrayLike) -> F64:
    """Returns what the kernels take for the width of the lobe: alpha, or the Phong exponent."""
    return model_of(model).lobe_parameter(roughness)


def column_weights(model: str, diffuse: NDArray, f0: NDArray, f90: NDArray) -> NDArray:
    """Returns the weights (n, 4, 3) of the columns X, Y, A, B for parameters (n, 3): L_o is their sum."""
    return model_of(model).column_weights(diffuse, f0, f90)


def columns(model: str, parameter: ArrayLike, eye: NDArray, light: NDArray) -> F64:
    """Evaluates the integrands of X, Y, A, B for local unit directions.

    Args:
        model: a name of MODELS.
        parameter: `lobe_parameter`, broadcast against the directions.
        eye, light: (..., 3), towards the viewer and the light.

    Returns: (..., 4) [1/sr], the cosine of the light included.
    """
    eye, light = np.broadcast_arrays(np.asarray(eye, np.float64), np.asarray(light, np.float64))
    return model_of(model).columns(np.asarray(parameter, np.float64), eye, light)


def _smith(a2: Any, nl: F64, ne: F64) -> F64:
    """G / (4 N.L N.E) of a squared alpha, height-correlated.  Source: Heitz 2014, Eq. 99."""
    visible: F64 = 0.5 / np.maximum(
        nl * np.sqrt(a2 + (1 - a2) * ne * ne) + ne * np.sqrt(a2 + (1 - a2) * nl * nl), 1e-9
    )
    return visible


@cache
def _half_vectors(count: int = 48) -> tuple[F64, F64, F64]:
    """Midpoints in u (tan^2 theta = alpha^2 u / (1 - u)) and cosines of phi, with the weight of each."""
    node, weight = np.polynomial.legendre.leggauss(count)
    u, phi = (node + 1) / 2, (node + 1) / 2 * np.pi
    return u, phi, np.outer(weight / 2, weight / 2)


def _about_axis(cosine: F64, sine: F64, phi: F64) -> F64:
    """Unit vectors (u, v, 3) at angles (u,) off the axis and phi (v,) about it."""
    s, c = sine[:, None], cosine[:, None]
    return np.stack(np.broadcast_arrays(s * np.cos(phi), s * np.sin(phi), c), -1)


def directional_albedo(model: str, parameter: float, cosine: ArrayLike) -> F64:
    """Integrates the four columns over the hemisphere of light.

    Args:
        parameter: `lobe_parameter` of one level.
        cosine: (n,) of the eye direction.

    Returns: (n, 4): X, Y, A, B under unit radiance; X + Y = 1.
    """
    mu = np.atleast_1d(np.asarray(cosine, np.float64))
    eye = np.stack([np.sqrt(np.maximum(1 - mu * mu, 0)), 0 * mu, mu], -1)
    u, phi, weight = _half_vectors()
    # diffuse columns: cosine-distributed light
    light = _about_axis(np.sqrt(1 - u), np.sqrt(u), phi)
    value = columns(model, parameter, eye[:, None, None], light) / (light[..., 2] / np.pi)[..., None]
    out = np.einsum("nuvk,uv->nk", value, weight)
    out[:, 2], out[:, 3] = model_of(model).lobe_albedo(parameter, eye)
    return out
