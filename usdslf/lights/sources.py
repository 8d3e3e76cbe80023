"""All that shines in a scene: lights, domes, emissive surfaces, and what pictures draw and weigh them by.

kernels/live_sources.cl samples them and meets them with rays.  Lights do not hide what is behind them, except from the
camera.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from copy import copy
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from usdslf.color import luminance
from usdslf.lights.dome import Dome
from usdslf.lights.sampling import intersect_light, is_delta
from usdslf.progress import in_blocks
from usdslf.scene.records import F32, I32, Light, Scene
from usdslf.surfaces.surface_points import evaluate_surface

DIRECTIONS = 1 << 14  # that are looked up at once: they and what they give stay in the cache

Emission = Callable[[I32, F32], F32]
"""triangle (n,), barycentric (n, 2) -> emitted radiance (n, 3)."""


class Source(Protocol):
    """Something that shines."""

    diffuse: float
    specular: float
    is_delta: bool
    is_met_only: bool  # rays of the lobes find it as well as can be: an even dome is not sampled
    is_split: bool  # diffuse and specular receive different shares: rays of the lobes cannot tell, so only sampled


def brightest(color: NDArray) -> NDArray:
    """Returns the largest channel of (n, 3)."""
    return np.maximum(np.maximum(color[:, 0], color[:, 1]), color[:, 2])


def dot(a: NDArray, b: NDArray) -> NDArray:
    """Returns the products of rows of (n, 3)."""
    return np.einsum("nk,nk->n", a, b)


class LightSource:
    """A UsdLux light with a place or a direction."""

    is_met_only = False

    def __init__(self, light: Light) -> None:
        self.light = light
        self.diffuse, self.specular = light.diffuse, light.specular
        self.is_split = light.diffuse != light.specular
        self.is_delta = is_delta(light)
        m = light.world_from_light
        self._center = m[:3, 3].astype(np.float32)
        power, area = float(luminance(np.asarray(light.radiance))), light_area(light)
        # power, and what is added to the squared distance; below 0: it is the same everywhere
        self.guess = (power * area, area)
        if light.kind == "distant":
            self.guess = (power * distant_angle(light), -1.0)
        self._towards = (m[:3, 2] / np.linalg.norm(m[:3, 2])).astype(np.float32)
        self._cosine = np.float32(np.cos(min(light.angle / 2, np.pi)) - 1e-5)
        extent = {
            "rect": np.hypot(light.width, light.height) / 2,
            "cylinder": np.hypot(light.length / 2, light.radius),
        }.get(light.kind, light.radius)
        self.reach = np.float32(1.001 * extent * np.linalg.norm(m[:3, :3], 2) + 1e-20)

    def intersect(self, origins: F32, directions: F32) -> tuple[F32, F32]:
        """Returns distance (n,) and radiance (n, 3) of the light along rays: inf and 0 where missed."""
        n = len(origins)
        distance, radiance = np.full(n, np.inf, np.float32), np.zeros((n, 3), np.float32)
        if self.light.kind == "distant":
            near = np.flatnonzero(directions @ self._towards >= self._cosine)
        else:  # most rays pass the bounding sphere
            to = self._center - origins
            along = dot(to, directions)
            off = dot(to, to) - along * along
            near = np.flatnonzero((along > -self.reach) & (off <= self.reach**2))
        if len(near):
            distance[near], radiance[near], _ = intersect_light(self.light, origins[near], directions[near])
        return distance, radiance


class DomeSource:
    """A dome."""

    is_delta = False

    def __init__(self, light: Light) -> None:
        self.dome = Dome.from_light(light)
        self.diffuse, self.specular = light.diffuse, light.specular
        self.is_split = light.diffuse != light.specular
        self.is_met_only = not light.texture and not self.is_split
        grid = (np.arange(4096) + 0.5) / 4096  # Fibonacci's sphere
        z, phi = 1 - 2 * grid, np.pi * (1 + 5**0.5) * np.arange(4096)
        s = np.sqrt(1 - z * z)
        all_around = np.stack([s * np.cos(phi), s * np.sin(phi), z], -1).astype(np.float32)
        self.irradiance = float(luminance(self.dome.radiance(all_around, None)).mean() * np.pi)


class EmissiveSurfaces:
    """All triangles whose material emits; they shine to both sides."""

    is_delta = is_split = is_met_only = False
    diffuse = specular = 1.0

    def __init__(self, scene: Scene, emission: Emission) -> None:
        t = scene.triangles
        may_emit = np.array(
            [not isinstance(m.emissive_color, np.ndarray) or bool(m.emissive_color.max() > 0) for m in scene.materials],
            bool,
        )
        chosen = np.flatnonzero(may_emit[t.material] & (t.areas > 0)) if len(t.material) else np.zeros(0, int)
        power = np.zeros(len(chosen))
        for corner in ((1 / 3, 1 / 3), (0.1, 0.1), (0.8, 0.1), (0.1, 0.8)):
            at = np.broadcast_to(np.array(corner, np.float32), (len(chosen), 2))
            if len(chosen):
                power += luminance(emission(chosen.astype(np.int32), at)) / 4
        power = np.maximum(power * t.areas[chosen], 0)
        keep = power > 0
        self.triangle = chosen[keep].astype(np.int32)
        power = power[keep]
        self.flux = float(power.sum())
        chance = power / max(self.flux, 1e-30)
        self.cumulative = np.cumsum(chance)
        self.pdf_area = np.zeros(len(t.material), np.float32)  # per triangle [1 / area]
        self.pdf_area[self.triangle] = chance / t.areas[self.triangle]
        self.emits = self.pdf_area > 0  # (T,)
        if len(self.triangle):
            corners = t.positions[self.triangle].reshape(-1, 3)
            self.center = ((corners.min(0) + corners.max(0)) / 2).astype(np.float32)
            self.size2 = float(t.areas[self.triangle].sum())


class SurfaceEmission:
    """What surfaces emit; a table look-up where no texture says it."""

    def __init__(self, scene: Scene) -> None:
        self._scene = scene
        constants = [m.emissive_color for m in scene.materials]
        self._is_constant = np.array([isinstance(c, np.ndarray) for c in constants], bool)
        self._table = np.array(
            [np.broadcast_to(c, 3) if isinstance(c, np.ndarray) else np.zeros(3) for c in constants], np.float32
        ).reshape(-1, 3)

    def __call__(self, triangle: I32, barycentric: F32) -> F32:
        material = self._scene.triangles.material[triangle]
        out = self._table[material]
        read = np.flatnonzero(~self._is_constant[material])
        if len(read):
            surface = evaluate_surface(self._scene, triangle[read], barycentric[read], normal_maps=False)
            out[read] = surface.emission
        return out


class LightSet:
    """All sources of a scene."""

    def __init__(self, scene: Scene, lights: Sequence[Light]) -> None:
        """Gathers the sources.

        Args:
            scene: whose emissive surfaces shine.
            lights: UsdLux lights, or the default ones.
        """
        lit = [light for light in lights if max(light.radiance) > 0]
        self.placed = [LightSource(light) for light in lit if light.kind != "dome"]
        self.domes = [DomeSource(light) for light in lit if light.kind == "dome"]
        self._set_emissive(scene)

    def _set_emissive(self, scene: Scene) -> None:
        self.emissive = EmissiveSurfaces(scene, SurfaceEmission(scene))
        self.sources: list[Source] = [*self.placed, *self.domes]
        if len(self.emissive.triangle):
            self.sources.append(self.emissive)

    def under(self, scene: Scene) -> LightSet:
        """Returns the same lights, with what the surfaces of another scene emit."""
        other = copy(self)
        other._set_emissive(scene)
        return other

    def background(self, directions: F32, solid_angle: float | None = None) -> F32:
        """Returns the radiance (n, 3) of all domes in directions where rays escape."""
        out = np.zeros((len(directions), 3), np.float32)
        for rows in in_blocks(len(directions) if self.domes else 0, DIRECTIONS):
            for source in self.domes:
                out[rows] += source.dome.radiance(directions[rows], solid_angle)
        return out

    def seen(self, origins: F32, directions: F32, limit: F32) -> tuple[F32, F32]:
        """Returns distance (n,) and radiance (n, 3) of the nearest light before `limit`, inf and 0 where none is."""
        nearest = np.full(len(origins), np.inf, np.float32)
        radiance = np.zeros((len(origins), 3), np.float32)
        for source in self.placed:
            if source.is_delta:
                continue
            distance, shone = source.intersect(origins, directions)
            wins = (distance < limit) & (distance < nearest)
            if source.light.kind == "distant":  # infinitely far: where nothing else is met
                wins = (brightest(shone) > 0) & ~np.isfinite(limit) & ~np.isfinite(nearest)
            nearest = np.where(wins, distance, nearest)
            radiance = np.where(wins[:, None], shone, radiance)
        return nearest, radiance

def distant_angle(light: Light) -> float:
    """Returns the solid angle of a distant light [sr]; 1 for parallel rays, whose radiance is their irradiance."""
    return float(2 * np.pi * (1 - np.cos(min(light.angle / 2, np.pi / 2)))) if light.angle > 0 else 1.0


def light_area(light: Light) -> float:
    """Returns the area of a light that can be seen at once, scale included [stage units squared]."""
    m = light.world_from_light[:3, :3]
    if light.kind in ("rect", "disk"):
        scale = float(np.linalg.norm(np.cross(m[:, 0], m[:, 1])))
        return scale * (light.width * light.height if light.kind == "rect" else np.pi * light.radius**2)
    scale = float(abs(np.linalg.det(m))) ** (2 / 3)
    if light.kind == "sphere":
        return scale * np.pi * light.radius**2
    if light.kind == "cylinder":
        return scale * 2 * light.radius * light.length
    return 1.0
