"""Propagation: a change that is known at painted places -> everything that is similar to them.

Similarity of two places is a sum of three terms, each bounded and without a scale of its own:

    s(x, y) = [ w_s / (1 + |x - y|^2 / l^2) + w_n <n_x, n_y>+^4 + w_r / (1 + |r_x - r_y|^2 / r^2) ] / (w_s + w_n + w_r)

with l the reach of the painted places and r a reflectance step that is clearly seen.  The paper's terms are not
bounded (1 / |x - y|): one of them, near a painted place, would outvote the others whatever their weights.  The change
of a place is

    dr(x) = gate(max_y s) * sum_y s^4 dr(y) / sum_y s^4,       y over the painted places

a mean over the painted places, not over all surfaces, which would dilute an edit to nothing; the power lets near
places decide among many.  The gate closes where nothing painted is similar.

Source: Nguyen et al. 2013, 4.3.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from usdslf.errors import InputError
from usdslf.scene.records import F64, Scene
from usdslf.surfaces.reflectance import Parameters
from usdslf.surfaces.surface_points import SurfacePoints, evaluate_surface

REFLECTANCE_STEP = 0.08  # of d, F0 and roughness together, that is clearly seen
GATE = (0.45, 0.7)  # similarity at which the gate opens, and is open
BLOCK = 1 << 14  # times 16 pairs of places at a time: they stay in the cache


@dataclass(frozen=True)
class Weights:
    """How much position, normal and reflectance count; only their ratios do."""

    position: float = 1.0
    normal: float = 0.5
    reflectance: float = 2.0

    def __post_init__(self) -> None:
        values = (self.position, self.normal, self.reflectance)
        if not np.isfinite(values).all() or min(values) < 0 or sum(values) <= 0:
            raise InputError(f"similarity weights {values} are not three numbers of 0 or more, one above 0")


@dataclass(frozen=True)
class Places:
    """n places on surfaces."""

    position: NDArray  # (n, 3)
    normal: NDArray  # (n, 3) unit
    reflectance: NDArray  # (n, 7) d, F0, roughness
    base_color: NDArray | None = None  # (n, 3) diffuseColor, where it was looked at
    metallic: NDArray | None = None  # (n,)

    def __len__(self) -> int:
        return len(self.position)

    def rows(self, rows: NDArray | slice) -> Places:
        """Returns some of the places."""
        inputs = (None if x is None else x[rows] for x in (self.base_color, self.metallic))
        return Places(self.position[rows], self.normal[rows], self.reflectance[rows], *inputs)


def places_of(surface: SurfacePoints) -> Places:
    """Takes what similarity looks at from points on surfaces."""
    reflectance = Parameters.of(surface).packed
    return Places(surface.position, surface.geometric_normal, reflectance, surface.base_color, surface.metallic)


def places_at(scene: Scene, triangle: NDArray, barycentric: NDArray) -> Places:
    """Evaluates places at points of triangles (n,), (n, 2)."""
    return places_of(evaluate_surface(scene, triangle, barycentric, normal_maps=False))


def similarity(x: Places, y: Places, reach: ArrayLike, weights: Weights | None = None) -> F64:
    """Returns s (n, m) of each place of x to each of y, 0..1.

    Args:
        reach: l, one for all or (n,) [stage units].
    """
    w = weights or Weights()
    # products about the origin would lose what is far from it
    middle = y.position.sum(0, dtype=np.float64) / max(len(y), 1)
    s = _squares(x.position - middle, y.position - middle)
    s /= np.square(np.asarray(reach, np.float64)).reshape(-1, 1)
    s += 1
    np.divide(w.position, s, out=s)
    other = _squares(x.reflectance, y.reflectance)
    other /= REFLECTANCE_STEP**2
    other += 1
    s += np.divide(w.reflectance, other, out=other)
    turned = np.maximum(x.normal.astype(np.float64) @ y.normal.astype(np.float64).T, 0)
    s += w.normal * np.square(np.square(turned))
    s /= w.position + w.normal + w.reflectance
    return s


def _squares(a: NDArray, b: NDArray) -> F64:
    """Squared distances (n, m) of points (n, k) and (m, k)."""
    a, b = a.astype(np.float64), b.astype(np.float64)
    d = a @ (-2 * b.T)
    d += (a * a).sum(1)[:, None]
    d += (b * b).sum(1)
    return np.maximum(d, 0, out=d)


def most_similar(x: Places, painted: Places, reach: float, weights: Weights | None = None) -> F64:
    """Returns the similarity (n,) of each place to the painted one that is most like it; 0 where none is painted."""
    out = np.zeros(len(x))
    for rows in blocks(len(x), len(painted)):
        out[rows] = similarity(x.rows(rows), painted, reach, weights).max(1)
    return out


def shares(x: Places, painted: Places, reach: ArrayLike, weights: Weights | None = None) -> tuple[F64, F64]:
    """Returns how much each painted place has to say of each place (n, m), and how far the gate is open there (n,).

    A change that is known at the painted places (m, C) goes on as `shares @ change`, times the gate where nothing
    else says how far it goes.
    """
    s = similarity(x, painted, reach, weights)
    k = np.square(np.square(s))
    return k / np.maximum(k.sum(1, keepdims=True), 1e-30), gate(s.max(1, initial=0.0))


def gate(s: ArrayLike) -> F64:
    """Returns how far the gate is open (n,), 0..1, at a similarity."""
    t = np.clip((np.asarray(s, np.float64) - GATE[0]) / (GATE[1] - GATE[0]), 0, 1)
    return t * t * (3 - 2 * t)


def reach_of(position: NDArray, least: float) -> float:
    """Returns the reach of painted places (m, 3): the middle one of their distances to their nearest neighbours.

    Args:
        least: [stage units], say the width of the brush.
    """
    if len(position) < 2:
        return least
    p = position.astype(np.float64)
    apart = np.linalg.norm(p[:, None] - p[None], axis=-1)
    np.fill_diagonal(apart, np.inf)
    return max(float(np.median(apart.min(1))), least)


def blocks(n: int, m: int) -> list[slice]:
    """Returns slices of n places, so many at a time as pair with m places within the cache."""
    if not m:
        return []
    step = max(BLOCK * 16 // m, 1)
    return [slice(a, min(a + step, n)) for a in range(0, n, step)]
