"""The reflectance models in textbook form, and integrals over the hemisphere, in float64.

Directions are unit vectors of the local frame, the normal is +z.  Angles and tangents, where the program has
products of cosines: nothing here is the program's formula rewritten.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import ArrayLike, NDArray

F64 = NDArray[np.float64]


def ggx(alpha: float, h: F64) -> F64:
    """Distribution of half vectors.  Walter et al. 2007, Eq. 33."""
    c = np.clip(h[..., 2], 1e-12, 1)
    tan2 = (h[..., 0] ** 2 + h[..., 1] ** 2) / c**2
    return alpha**2 / (np.pi * c**4 * (alpha**2 + tan2) ** 2)


def smith_lambda(alpha: float, w: F64) -> F64:
    """Heitz 2014, Eq. 72."""
    c = np.maximum(w[..., 2], 1e-12)
    tan2 = (w[..., 0] ** 2 + w[..., 1] ** 2) / c**2
    return (np.sqrt(1 + alpha**2 * tan2) - 1) / 2


def half_vector(e: F64, l: F64) -> F64:
    """The unit vector between two directions."""
    h = e + l
    return h / np.linalg.norm(h, axis=-1, keepdims=True)


def microfacets(alpha: float, e: F64, l: F64) -> F64:
    """D G / (4 N.E N.L), height-correlated Smith G (Heitz 2014, Eq. 99), without Fresnel."""
    g = 1 / (1 + smith_lambda(alpha, e) + smith_lambda(alpha, l))
    return ggx(alpha, half_vector(e, l)) * g / (4 * e[..., 2] * np.maximum(l[..., 2], 1e-12))


def schlick(e: F64, l: F64) -> F64:
    """(1 - E.H)^5, from the angle between the two: E.H is the cosine of half of it."""
    angle = np.arctan2(np.linalg.norm(np.cross(e, l), axis=-1), np.sum(e * l, -1))
    return (1 - np.cos(angle / 2)) ** 5


def preview_surface(
    d: ArrayLike, f0: ArrayLike, f90: ArrayLike, roughness: float, e: ArrayLike, l: ArrayLike
) -> F64:
    """UsdPreviewSurface with Smith's G: BRDF (..., channels) for parameters (channels,).  1/sr."""
    e, l = (np.asarray(x, float) for x in (e, l))
    d, f0, f90 = (np.atleast_1d(np.asarray(x, float)) for x in (d, f0, f90))
    ramp = schlick(e, l)[..., None]
    fresnel = f0 + (f90 - f0) * ramp
    lobe = microfacets(max(roughness, 0.001) ** 2, e, l)[..., None]
    up = ((e[..., 2] > 0) & (l[..., 2] > 0))[..., None]
    return np.where(up, d / np.pi * (1 - fresnel) + fresnel * lobe, 0)


def phong(k_d: ArrayLike, k_s: ArrayLike, exponent: float, e: ArrayLike, l: ArrayLike) -> F64:
    """Lambert and a normalized Phong lobe (Lafortune and Willems 1994): BRDF (..., channels).  1/sr."""
    e, l = (np.asarray(x, float) for x in (e, l))
    k_d, k_s = (np.atleast_1d(np.asarray(x, float)) for x in (k_d, k_s))
    normal = np.array([0.0, 0.0, 1.0])
    mirrored = 2 * (e @ normal)[..., None] * normal - e
    angle = np.arctan2(np.linalg.norm(np.cross(mirrored, l), axis=-1), np.sum(mirrored * l, -1))
    cosine = np.cos(angle)
    lobe = (exponent + 2) / (2 * np.pi) * np.where(cosine > 0, np.maximum(cosine, 1e-300) ** exponent, 0)
    up = ((e[..., 2] > 0) & (l[..., 2] > 0))[..., None]
    return np.where(up, k_d / np.pi + k_s * lobe[..., None], 0)


def columns(model: str, roughness: float, e: ArrayLike, l: ArrayLike) -> F64:
    """Integrands (..., 4) of X, Y, A, B: what d(1-F0), d(1-F90), F0, F90 multiply, with the cosine.

    They are read off the models above by setting one parameter after the other.
    """
    l = np.asarray(l, float)
    cosine = np.maximum(l[..., 2:], 0)
    if model == "phong":
        f = phong([1, 0, 0, 0], [0, 0, 1, 0], exponent_of(roughness), e, l)
        return f * cosine
    # (d, F0, F90): (1, 0, 1) is X + B, (1, 1, 0) is Y + A, (0, 1, 0) is A, (0, 0, 1) is B
    f = preview_surface([1, 1, 0, 0], [0, 1, 1, 0], [1, 0, 0, 1], roughness, e, l)
    x_b, y_a, a, b = np.moveaxis(f, -1, 0)
    return np.stack([x_b - b, y_a - a, a, b], -1) * cosine


def exponent_of(roughness: float) -> float:
    """Phong's exponent of GGX's roughness: (2 / alpha^2 - 2) / 4.

    Half vectors turn half as far as mirrored directions: (cos t / 2)^m is about (cos t)^(m / 4), and m of alpha is
    that of Walter et al. 2007, section 5.2.  1e6 at most, and above 0, where cos^n has no limit at the rim of the lobe.
    """
    return min(max((2 / max(roughness, 0.01) ** 4 - 2) / 4, 1e-3), 1e6)


def contrast_gloss(k_d: float, k_s: float) -> float:
    """Pellacini et al. 2000."""
    return float((k_s + k_d / 2) ** (1 / 3) - (k_d / 2) ** (1 / 3))


def mirror(e: ArrayLike) -> F64:
    """The direction of perfect reflection."""
    return np.asarray(e, float) * [-1, -1, 1]


def eye_at(cosine: ArrayLike, azimuth: ArrayLike = 0.0) -> F64:
    """Directions (..., 3) of given cosines."""
    c, a = np.broadcast_arrays(np.asarray(cosine, float), np.asarray(azimuth, float))
    s = np.sqrt(np.maximum(1 - c * c, 0))
    return np.stack([s * np.cos(a), s * np.sin(a), c], -1)


def frame_about(axis: ArrayLike) -> F64:
    """Two unit vectors across an axis, and the axis: rows (3, 3)."""
    axis = np.asarray(axis, float)
    x = np.cross(axis, np.eye(3)[np.argmin(np.abs(axis))])
    x /= np.linalg.norm(x)
    return np.stack([x, np.cross(axis, x), axis])


def polar_grid(axis: ArrayLike, width: float, rings: int = 240, sectors: int = 240) -> tuple[F64, F64]:
    """Directions (n, 3) all around, in rings about an axis, denser within `width`, and their solid angles.

    theta = width sinh(t) up to a right angle and even beyond it, midpoints in both and in the azimuth.
    """
    beyond = rings // 4
    last = np.arcsinh(np.pi / 2 / width)
    t = (np.arange(rings - beyond) + 0.5) / (rings - beyond) * last
    theta = np.concatenate([width * np.sinh(t), np.pi / 2 * (1 + (np.arange(beyond) + 0.5) / beyond)])
    step = np.concatenate([width * np.cosh(t) * last / (rings - beyond), np.full(beyond, np.pi / 2 / beyond)])
    weight = np.sin(theta) * step * (2 * np.pi / sectors)
    phi = 2 * np.pi * (np.arange(sectors) + 0.5) / sectors
    theta, phi = theta[:, None], phi[None]
    local = np.stack(
        np.broadcast_arrays(np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta)), -1
    )
    return local.reshape(-1, 3) @ frame_about(axis), np.repeat(weight, sectors)


def lobe_width(model: str, roughness: float, cosine: float) -> float:
    """Where a lobe's rings have to be dense: its width, for GGX that across the plane of incidence."""
    return 0.5 * max(roughness, 0.01) ** 2 * (max(cosine, 0.02) if model == "preview_surface" else 1)


def integrate_columns(
    model: str,
    roughness: float,
    e: ArrayLike,
    light: Callable[[F64], ArrayLike] | None = None,
    rings: int = 160,
) -> F64:
    """Integrals X, Y, A, B (4,) of the light (n,) from directions (n, 3), radiance 1 by default."""
    e = np.asarray(e, float)
    l, weight = polar_grid(mirror(e), lobe_width(model, roughness, e[2]), rings, rings)
    l, weight = l[l[:, 2] > 0], weight[l[:, 2] > 0]
    if light is not None:
        weight = weight * np.asarray(light(l), float)
    return weight @ columns(model, roughness, e, l)


def albedo(model: str, roughness: float, cosine: ArrayLike, rings: int = 160) -> F64:
    """Integrals X, Y, A, B (n, 4) under radiance 1 for eyes of given cosines (n,)."""
    eyes = eye_at(np.atleast_1d(cosine))
    return np.array([integrate_columns(model, roughness, e, rings=rings) for e in eyes])


def visible_normal_density(alpha: float, e: F64, l: F64) -> F64:
    """Density [1/sr] of lights from sampling visible normals: D_v(h) / (4 e.h).  Heitz 2018, Eq. 17."""
    h = half_vector(e, l)
    g1 = 1 / (1 + smith_lambda(alpha, e))
    eh = np.maximum(np.sum(e * h, -1), 1e-12)
    visible = g1 * eh * ggx(alpha, h) / e[..., 2]
    return np.where(l[..., 2] > 0, visible / (4 * eh), 0)
