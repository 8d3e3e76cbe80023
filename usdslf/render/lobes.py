"""Points as their viewer sees them, the light columns they gather, and the kernels that draw from their lobes.

L_o = d [(1 - F0) X + (1 - F90) Y] + F0 A + F90 B + coat      (columns of usdslf/surfaces/reflectance.py)

phong, L_o = k_d X + k_s A, takes the same form with X in the place of Y, F90 = 0 and no coat.
"""

from __future__ import annotations

from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from usdslf.color import luminance
from usdslf.gpu.device import Device
from usdslf.lights.sources import dot
from usdslf.rays import RayTracer
from usdslf.render.guide import SHARE, LightGuide
from usdslf.render.wide_field import BLOCK
from usdslf.scene.records import F32, I32
from usdslf.surfaces.reflectance import model_of
from usdslf.surfaces.surface_points import SurfacePoints, turned_to_viewer

GROUP = 64  # work items of a group
COLUMNS = 5  # X, Y, A, B, coat
MIN_ALPHA = 4e-4  # sharper lobes drown in the rounding of half vectors
QUARTERED_ALPHA = 0.1  # sharper lobes may be seen by a part of a tile's samples


@dataclass(frozen=True)
class ShadingPoints:
    """n points as seen from somewhere, normals on the side of the viewer."""

    position: F32  # (n, 3)
    origin: F32  # (n, 3) off the surface, where rays start
    geometric_normal: F32  # (n, 3)
    normal: F32  # (n, 3)
    view: F32  # (n, 3) unit, towards the viewer
    lobes: F32  # (n, 4) alpha, alpha of the coat, chance of the specular lobe, chance of the coat
    coat: F32  # (n, 2) strength, F0
    colors: F32  # (n, 9) d, F0, F90
    emission: F32  # (n, 3)
    guide: I32  # (n,) element whose guide serves the point, -1: none

    def __len__(self) -> int:
        return len(self.position)

    def __getitem__(self, rows: Any) -> ShadingPoints:
        return ShadingPoints(**{f.name: getattr(self, f.name)[rows] for f in fields(self)})


def shading_points(
    surface: SurfacePoints, view: F32, tracer: RayTracer, guide: LightGuide | None = None,
    model: str = "preview_surface",
) -> ShadingPoints:  # fmt: skip
    """Turns surface points to their viewer.

    A shading normal that points away from the viewer is bent until it is seen just so, and the chance of each lobe
    is set by what it reflects.
    """
    reflectance = model_of(model)
    d, f0 = reflectance.held(surface.diffuse, surface.f0)
    surface = replace(surface, diffuse=d, f0=f0)
    if not reflectance.has_fresnel:
        surface = replace(surface, f90=0 * f0)
    if not reflectance.has_coat:
        surface = replace(surface, clearcoat=0 * surface.clearcoat)
    side = np.where(dot(surface.geometric_normal, view) < 0, np.float32(-1), np.float32(1))[:, None]
    geometric, normal = surface.geometric_normal * side, surface.normal * side
    normal = turned_to_viewer(normal, geometric, view)
    cosine = np.clip(dot(normal, view), 0, 1)
    f = ((1 - cosine) ** 5)[:, None]
    specular = luminance(surface.f0 + (surface.f90 - surface.f0) * f)
    diffuse = luminance(surface.diffuse)
    alpha = np.maximum(surface.roughness**2, MIN_ALPHA)
    # Chances in sixteenths: aligned runs of 16 points then hold every lobe as often as its chance says.  Sharp
    # reflections are filtered over parts of a tile: quarters, which the 4 rays of each sample hold.
    parts = np.where(alpha < QUARTERED_ALPHA, 4, 16)
    share = np.round(parts * specular / np.maximum(specular + diffuse, 1e-6)) / parts
    share = np.clip(share, np.where(parts == 4, 1 / 4, 3 / 16), np.where(parts == 4, 3 / 4, 14 / 16))
    share = np.where(diffuse > 1e-4 * specular, share, 1)
    coat_share = np.ceil(4 * surface.clearcoat) / 16
    specular_share = np.where(share < 1, np.round(16 * share * (1 - coat_share)) / 16, 1 - coat_share)
    coat_alpha = np.maximum(surface.clearcoat_roughness**2, MIN_ALPHA)
    lobes = np.stack([alpha, coat_alpha, specular_share, coat_share], -1)
    return ShadingPoints(
        position=surface.position,
        origin=tracer.offset_points(surface.position, geometric, surface.triangle),
        geometric_normal=geometric.astype(np.float32),
        normal=normal.astype(np.float32),
        view=np.ascontiguousarray(view, np.float32),
        lobes=lobes.astype(np.float32),
        coat=np.stack([surface.clearcoat, surface.coat_f0], -1).astype(np.float32),
        colors=np.concatenate([surface.diffuse, surface.f0, surface.f90], -1).astype(np.float32),
        emission=surface.emission,
        guide=np.full(len(view), -1, np.int32)
        if guide is None
        else guide.elements_of(surface.triangle, surface.barycentric, side[:, 0] > 0),
    )


def reflect(colors: F32, columns: F32) -> F32:
    """Returns the radiance (n, 3) that surfaces of colours (n, 9) make of light columns (n, 5, 3)."""
    d, f0, f90 = colors[:, :3], colors[:, 3:6], colors[:, 6:]
    x, y, a, b, coat = (columns[:, i] for i in range(COLUMNS))
    return d * ((1 - f0) * x + (1 - f90) * y) + f0 * a + f90 * b + coat


class Lobes:
    """The lobes of surfaces on the device: directions drawn from them, and the weights of directions."""

    def __init__(self, device: Device, guide: LightGuide, model: str = "preview_surface") -> None:
        self._device, self._guide = device, guide
        constants = {"BLOCK": BLOCK, **model_of(model).constants}
        self._sequence = device.kernel("lobes", "sequence_points", **constants)
        self._sample = device.kernel("lobes", "sample_lobes", **constants)
        self._evaluate = device.kernel("lobes", "evaluate_lobes", **constants)

    def sequence(self, index: NDArray[np.uint32], seed: int) -> F32:
        """Returns points (n, 2) of the unit square."""
        d, n = self._device, len(index)
        if n == 0:
            return np.zeros((0, 2), np.float32)
        out = d.empty((n, 2), np.float32)
        self._sequence((_up(n),), (GROUP,), np.uint32(n), np.uint32(seed), d.upload(index.astype(np.uint32)), out)
        return d.download(out)

    def sample(self, p: ShadingPoints, index: NDArray[np.uint32], k: int, seed: int) -> tuple[F32, F32, F32, F32]:
        """Draws k directions at each point.

        Returns: direction (n, k, 3), pdf (n, k), pdf of the lobes alone (n, k), weight over pdf (n, k, 5).
        """
        d, n = self._device, len(p)
        shapes = (n, k, 3), (n, k), (n, k), (n, k, COLUMNS)
        if n == 0:
            direction, pdf, lobe_pdf, weight = (np.zeros(s, np.float32) for s in shapes)
            return direction, pdf, lobe_pdf, weight
        out = [d.empty(s, np.float32) for s in shapes]
        up = [d.upload(a) for a in (index.astype(np.uint32), p.normal, p.view, p.lobes, p.coat, p.guide)]
        sizes = np.uint32(n), np.uint32(k), np.uint32(seed)
        self._sample((_up(n * k),), (GROUP,), *sizes, *up, *self._guiding, *out)
        direction, pdf, lobe_pdf, weight = (d.download(a) for a in out)
        return direction, pdf, lobe_pdf, weight

    def evaluate(self, p: ShadingPoints, rows: NDArray[np.intp], direction: F32) -> tuple[F32, F32]:
        """Returns pdf (m,) and weights (m, 5) of one direction for each of some points."""
        d, n = self._device, len(rows)
        if n == 0:
            return np.zeros(0, np.float32), np.zeros((0, COLUMNS), np.float32)
        pdf, weight = d.empty((n,), np.float32), d.empty((n, COLUMNS), np.float32)
        up = [d.upload(np.take(a, rows, 0)) for a in (p.normal, p.view, p.lobes, p.coat, p.guide)]
        self._evaluate((_up(n),), (GROUP,), np.uint32(n), *up, *self._guiding, d.upload(direction), pdf, weight)
        return d.download(pdf), d.download(weight)

    @property
    def _guiding(self) -> tuple[Any, Any, np.float32]:
        return self._guide.cumulative_d, self._guide.frames_d, np.float32(SHARE)


def _up(n: int) -> int:
    return -(-n // GROUP) * GROUP
