"""The reflectance models and their parameters; host twin of kernels/reflectance.cl.

Both models are linear in their colour parameters at a fixed roughness:

    L_o = d [(1 - F0) X + (1 - F90) Y] + F0 A + F90 B

with the columns X, Y (diffuse) and A, B (specular) of the light that arrives.  `preview_surface` is
UsdPreviewSurface with GGX, height-correlated Smith and OpenUSD's diffuse balance; `phong` is the paper's
model, normalized (Lafortune and Willems 1994), L_o = k_d X + k_s A with k_d = d and k_s = F0, held to
k_d + k_s <= 1; it has no Fresnel ramp, so Y = B = 0.

Source: Nguyen et al. 2013, 5.2; Walter et al. 2007; Heitz 2014; UsdPreviewSurface specification 2.5.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from usdslf.errors import InputError

F64 = NDArray[np.float64]

MODELS = ("preview_surface", "phong")
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


def gloss_levels(model: str) -> F64:
    """Returns the 20 roughness levels that glossiness is enumerated on, sharp ones first.

    phong: even steps of distinctness from a mirror (roughness 0.05) to 0, which are even steps of perceived gloss, as
    long as the contrast c stays: distance^2 = (change of c)^2 + (1.78 change of d)^2.

    Source: Nguyen et al. 2013, 5.3; Pellacini, Ferwerda and Greenberg 2000.
    """
    sharpest = roughness_levels()[0]
    if model == "phong":
        return np.sqrt(1 - np.linspace(distinctness_of_gloss(sharpest), 0, LEVEL_COUNT))
    return roughness_levels()


def phong_exponent(roughness: ArrayLike) -> F64:
    """Returns the exponent whose lobe has the width of GGX's at the same roughness: n = (2 / alpha^2 - 2) / 4.

    2 / alpha^2 - 2 is the exponent of half vectors (Walter et al. 2007); the mirrored direction turns twice as far,
    which makes it a quarter.  Never zero: 0^0 would light what lies behind the lobe.
    """
    alpha = np.maximum(np.asarray(roughness, np.float64), 0.01) ** 2
    return np.clip((2 / alpha**2 - 2) / 4, 1e-3, 1e6)


def lobe_parameter(model: str, roughness: ArrayLike) -> F64:
    """Returns what the kernels take for the width of the lobe: alpha, or the Phong exponent."""
    if model == "phong":
        return phong_exponent(roughness)
    if model == "preview_surface":
        return np.maximum(np.asarray(roughness, np.float64), MIN_ROUGHNESS) ** 2
    raise InputError(f"unknown reflectance model '{model}'; choose one of {', '.join(MODELS)}")


def column_weights(model: str, diffuse: NDArray, f0: NDArray, f90: NDArray) -> NDArray:
    """Returns the weights (n, 4, 3) of the columns X, Y, A, B for parameters (n, 3): L_o is their sum.

    phong keeps k_d and lowers k_s where both would reflect more than arrives.
    """
    if model == "phong":
        k_d = np.minimum(diffuse, 1)
        return np.stack([k_d, 0 * k_d, np.minimum(f0, 1 - k_d), 0 * k_d], 1)
    return np.stack([diffuse * (1 - f0), diffuse * (1 - f90), f0, f90], 1)


def columns(model: str, parameter: ArrayLike, eye: NDArray, light: NDArray) -> F64:
    """Evaluates the integrands of X, Y, A, B for local unit directions.

    Args:
        model: a name of MODELS.
        parameter: `lobe_parameter`, broadcast against the directions.
        eye, light: (..., 3), towards the viewer and the light.

    Returns: (..., 4) [1/sr], the cosine of the light included.
    """
    eye, light = np.broadcast_arrays(np.asarray(eye, np.float64), np.asarray(light, np.float64))
    nl, ne = np.maximum(light[..., 2], 0), np.maximum(eye[..., 2], 1e-4)
    c = nl / np.pi
    if model == "phong":
        n = np.asarray(parameter, np.float64)
        mirrored = eye[..., 2] * light[..., 2] - eye[..., 0] * light[..., 0] - eye[..., 1] * light[..., 1]
        a = (n + 2) / (2 * np.pi) * np.maximum(mirrored, 0) ** n * nl
        return np.stack([c, 0 * c, a, 0 * c], -1)
    a2 = np.asarray(parameter, np.float64) ** 2
    h = eye + light
    h = h / np.maximum(np.linalg.norm(h, axis=-1, keepdims=True), 1e-12)
    f = np.clip(1 - np.sum(eye * h, -1), 0, 1) ** 5
    nh = np.clip(h[..., 2], 0, 1)
    ggx = a2 / (np.pi * (nh * nh * a2 + (1 - nh) * (1 + nh)) ** 2)
    smith = 0.5 / np.maximum(
        nl * np.sqrt(a2 + (1 - a2) * ne * ne) + ne * np.sqrt(a2 + (1 - a2) * nl * nl), 1e-9
    )
    dvc = ggx * smith * nl
    return np.stack([(1 - f) * c, f * c, (1 - f) * dvc, f * dvc], -1)


@cache
def _half_vectors(count: int = 48) -> tuple[F64, F64, F64]:
    """Midpoints in u (tan^2 theta = alpha^2 u / (1 - u)) and cosines of phi, with the weight of each."""
    node, weight = np.polynomial.legendre.leggauss(count)
    u, phi = (node + 1) / 2, (node + 1) / 2 * np.pi
    return u, phi, np.outer(weight / 2, weight / 2)


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
    s, c = np.sqrt(u), np.sqrt(1 - u)
    light = np.stack(np.broadcast_arrays(s[:, None] * np.cos(phi), s[:, None] * np.sin(phi), c[:, None]), -1)
    value = columns(model, parameter, eye[:, None, None], light) / (light[..., 2] / np.pi)[..., None]
    out = np.einsum("nuvk,uv->nk", value, weight)
    if model == "phong":
        n = parameter  # light about the mirror direction, cos^n distributed
        ct = (1 - u) ** (1 / (n + 1))
        st = np.sqrt(1 - ct * ct)
        local = np.stack(np.broadcast_arrays(st[:, None] * np.cos(phi), st[:, None] * np.sin(phi), ct[:, None]), -1)
        z = eye * [-1, -1, 1]
        x = np.stack([z[:, 2], 0 * mu, -z[:, 0]], -1)
        cosine_l = local[..., 0] * x[:, 2, None, None] + local[..., 2] * z[:, 2, None, None]
        out[:, 2] = np.einsum("nuv,uv->n", np.maximum(cosine_l, 0) * (n + 2) / (n + 1), weight)
        out[:, 3] = 0
        return out
    # specular columns: half vectors distributed as D (N.H)
    ct2 = (1 - u) / (1 - u + parameter**2 * u)
    st, ct = np.sqrt(1 - ct2), np.sqrt(ct2)
    h = np.stack(np.broadcast_arrays(st[:, None] * np.cos(phi), st[:, None] * np.sin(phi), ct[:, None]), -1)
    eh = np.einsum("nk,uvk->nuv", eye, h)
    light_z = 2 * eh * h[..., 2] - eye[:, 2, None, None]
    nl, ne = np.maximum(light_z, 0), np.maximum(mu, 1e-4)[:, None, None]
    a2 = parameter**2
    smith = 0.5 / np.maximum(
        nl * np.sqrt(a2 + (1 - a2) * ne * ne) + ne * np.sqrt(a2 + (1 - a2) * nl * nl), 1e-9
    )
    value_s = np.where((eh > 0) & (light_z > 0), smith * nl * 4 * eh / h[..., 2], 0)
    f = np.clip(1 - eh, 0, 1) ** 5
    out[:, 2] = np.einsum("nuv,uv->n", value_s * (1 - f), weight)
    out[:, 3] = np.einsum("nuv,uv->n", value_s * f, weight)
    return out
