"""Surfaces at hits by the host's rules, for materials that kernels do not know; twin of kernels/live_surfaces.cl."""

from __future__ import annotations

from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from usdslf.gpu.shared import Shared
from usdslf.lights.sources import dot
from usdslf.render.live import records as r
from usdslf.scene.records import F32, Scene
from usdslf.surfaces.reflectance import model_of
from usdslf.surfaces.surface_points import evaluate_surface, turned_to_viewer


class Met(Protocol):
    """What is needed of rays and what they met."""

    triangle: Shared
    u: Shared
    v: Shared
    direction: Shared
    least_roughness: Shared


def rows_by_host(scene: Scene, model: str, hits: Met, chosen: NDArray, rows: F32) -> F32:
    """Returns surfaces (n, SURFACE), records.py, as seen along the rays that met them.

    A shading normal that points away from the viewer is bent until it is seen just so.

    Args:
        scene: with its materials.
        model: of reflectance.
        hits: of rays.
        chosen: (n,) of them.
        rows: (n, SURFACE) of the kernel's, which say the rest.
    """
    barycentric = np.stack([hits.u.host[chosen], hits.v.host[chosen]], 1)
    p = evaluate_surface(scene, hits.triangle.host[chosen], barycentric)
    view = -hits.direction.host[chosen]
    reflectance = model_of(model)
    d, f0 = reflectance.held(p.diffuse, p.f0)
    side = np.where(dot(p.geometric_normal, view) < 0, np.float32(-1), np.float32(1))[:, None]
    geometric = p.geometric_normal * side
    out = rows.copy()

    def put(at: int, values: NDArray) -> None:
        out[:, at : at + values.shape[-1]] = values

    put(r.POSITION, p.position)
    put(r.NORMAL, turned_to_viewer(p.normal * side, geometric, view))
    put(r.GEOMETRIC, geometric)
    put(r.DIFFUSE, d)
    put(r.F_ZERO, f0)
    put(r.F_NINETY, p.f90 if reflectance.has_fresnel else 0 * f0)
    put(r.EMISSION, p.emission)
    roughness = np.maximum(p.roughness, hits.least_roughness.host[chosen])
    out[:, r.ALPHA] = np.maximum(roughness**2, r.MIN_ALPHA)
    out[:, r.COAT_ALPHA] = np.maximum(p.clearcoat_roughness**2, r.MIN_ALPHA)
    out[:, r.COAT] = p.clearcoat if reflectance.has_coat else 0
    out[:, r.COAT_F_ZERO] = p.coat_f0
    scales = (p.presence < 1) | (p.presence == p.opacity)
    out[:, r.COVER] = np.where(scales & (p.opacity < 1), -p.opacity, p.opacity)
    return out
