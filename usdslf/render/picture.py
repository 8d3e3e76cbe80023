"""Pictures: direct and indirect light at full texture and normal-map detail.

    rays -> surfaces -> demodulated light (gather.py) -> filter over the tile -> colours -> pixels

Each pixel has `antialias`^2 samples.  Samples of a tile of 8 x 8 take different parts of one low-discrepancy set
(interleaved sampling), and the filter of filter.cl puts them together again where they see the same surface; what
is filtered is light without the surface's colours, so textures stay.  The picture is worked on in bands, with
a border that the filter needs, so memory does not grow with the picture.

Source: Keller and Heidrich 2001; Wald et al. 2002; Scherzer et al. 2012 (radiance caching).
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from usdslf.errors import InputError
from usdslf.light_field.light_field import LightField
from usdslf.lights.sources import LightSet, brightest
from usdslf.render.filter import NEAR_TILE, TILE, LightFilter, SampleGrid
from usdslf.render.gather import Gatherer
from usdslf.render.live.still import StillPicture
from usdslf.render.lobes import ShadingPoints, reflect, shading_points
from usdslf.render.settings import AOVS, BAND, LAYERS, LitScene, PictureOptions, Quality
from usdslf.scene.cameras import camera_rays, pixel_size
from usdslf.scene.records import F32, Camera
from usdslf.surfaces.surface_points import SurfacePoints, evaluate_surface

USUAL = PictureOptions()


def render(
    lit: LitScene, camera: Camera, size: tuple[int, int], aovs: Sequence[str] = ("color",),
    options: PictureOptions = USUAL,
) -> dict[str, F32]:  # fmt: skip
    """Renders a picture.

    Args:
        size: width and height [pixels].
        aovs: names of AOVS.

    Returns: name -> (height, width, channels), float32; `color` is always among them.

    Raises: InputError for a size, a number of samples or an AOV that cannot be.
    """
    *_, (_, pictures) = render_bands(lit, camera, size, aovs, options)
    return pictures


def render_bands(
    lit: LitScene, camera: Camera, size: tuple[int, int], aovs: Sequence[str] = ("color",),
    options: PictureOptions = USUAL,
) -> Iterator[tuple[float, dict[str, F32]]]:  # fmt: skip
    """As `render`, but yields after each band: the share that is done and the pictures so far."""
    width, height = size
    if width < 1 or height < 1:
        raise InputError(f"a picture of {width} x {height} pixels cannot be rendered; give a positive size")
    unknown = [a for a in aovs if a not in AOVS]
    if unknown:
        raise InputError(f"unknown AOV '{unknown[0]}'; choose from {', '.join(AOVS)}")
    view = _view(lit, camera, size, options)
    out = {name: np.zeros((height, width, AOVS[name]), np.float32) for name in dict.fromkeys(("color", *aovs))}
    a = view.quality.antialias
    rows = max(TILE, BAND // (width * a * a))
    for first in range(0, height, rows):
        last = min(first + rows, height)
        for name, part in view.render_band(first, last, tuple(out)).items():
            out[name][first:last] = part
        yield last / height, out


def _view(lit: LitScene, camera: Camera, size: tuple[int, int], options: PictureOptions) -> StillPicture | _View:
    """What renders the bands: kernels, but for plain path tracing and for what stands in for a light field."""
    is_real = lit.light_field is None or isinstance(lit.light_field, LightField)
    if is_real and np.isfinite(options.footprint) and len(lit.scene.triangles.mesh):
        return StillPicture(lit, camera, size, options)
    area = options.element_area
    if area is None:
        area = float(lit.scene.triangles.areas.sum()) / max(options.elements, 1)
    gatherer = Gatherer(
        lit.scene, lit.tracer, LightSet(lit.scene, lit.lights), lit.light_field, lit.device, area, options.depth,
        options.footprint,
    )  # fmt: skip
    return _View(camera, size, Quality.of(options.samples), gatherer, options.hide_lights, options.seed)


@dataclass(frozen=True)
class _Layer:
    """The first surface that samples see.  Arrays of rows of the band's grid of samples."""

    rows: NDArray[np.intp]
    surface: SurfacePoints
    points: ShadingPoints
    distance: F32


class _View:
    """One picture in the making."""

    def __init__(
        self, camera: Camera, size: tuple[int, int], quality: Quality, gatherer: Gatherer, hide_lights: bool, seed: int
    ) -> None:
        self.camera, self.size, self.quality = camera, size, quality
        self.gatherer, self.scene, self.tracer = gatherer, gatherer.scene, gatherer.tracer
        self.hide_lights, self.seed = hide_lights, seed

    def render_band(self, first: int, last: int, names: tuple[str, ...]) -> dict[str, F32]:
        """Renders rows of pixels first..last-1."""
        a = self.quality.antialias
        border = -(-(TILE // 2 + 1) // a)
        low, high = max(first - border, 0), min(last + border, self.size[1])
        grid_width, grid_height = self.size[0] * a, (high - low) * a
        y, x = np.divmod(np.arange(grid_width * grid_height), grid_width)
        y += low * a
        # the samples of a pixel are rooks: no two share a row or a column; edges come out alike in all pixels
        at_x, at_y = x + (y % a + 0.5) / a, y + (a - 1 - x % a + 0.5) / a
        at = np.stack([at_x / grid_width, at_y / (self.size[1] * a)], -1)
        rays = camera_rays(self.camera, at, self.size[0] / self.size[1])

        n = len(x)
        sums = {k: np.zeros((n, AOVS[k]), np.float32) for k in names}
        for k in ("depth", "material", "mesh"):
            if k in sums:
                sums[k][:] = np.inf if k == "depth" else -1
        through = np.ones((n, 1), np.float32)  # what is seen of the next layer
        origin, travelled = rays.origin.copy(), np.zeros(n, np.float32)
        rows = np.arange(n)
        for layer in range(LAYERS):
            seen = self._look(rows, origin, rays.direction, rays.limit - travelled, through, sums)
            if seen is None:
                break
            self._add_layer(seen, layer, through, low * a, (grid_width, grid_height), sums, travelled + rays.near)
            opacity = seen.surface.opacity
            open_ = np.flatnonzero(opacity < 1 - 1e-3)
            rows = seen.rows[open_]
            if not len(rows):
                break
            through[seen.rows] *= 1 - opacity[:, None]
            travelled[rows] += seen.distance[open_]
            q = seen.points[open_]
            origin[rows] = self.tracer.offset_points(q.position, -q.geometric_normal, seen.surface.triangle[open_])
        return self._to_pixels(sums, grid_width, grid_height, (first - low) * a, (last - low) * a)

    def _look(
        self, rows: NDArray, origin: F32, direction: F32, limit: F32, through: F32, sums: dict[str, F32]
    ) -> _Layer | None:
        """Finds what camera rays see next; adds lights and domes that are in view."""
        o, d, far = origin[rows], direction[rows], limit[rows]
        met = self.tracer.intersect(o, d, stop_at_translucent=True)
        hit = (met.triangle >= 0) & (met.distance < far)
        distance = np.where(hit, met.distance, np.inf).astype(np.float32)
        lights = self.gatherer.lights
        if not self.hide_lights:
            _, radiance = lights.seen(o, d, np.minimum(distance, far))
            in_light = brightest(radiance) > 0
            hit &= ~in_light
            escaped = np.flatnonzero(~hit & ~in_light)
            radiance[escaped] += lights.background(d[escaped])
            sums["color"][rows] += radiance * through[rows]
            for k in ("direct", "emission"):
                if k in sums:
                    sums[k][rows] += radiance * through[rows]
            through[rows[in_light]] = 0
        at = np.flatnonzero(hit)
        if not len(at):
            return None
        surface = evaluate_surface(self.scene, met.triangle[at], met.barycentric[at])
        points = shading_points(surface, -d[at], self.tracer, self.gatherer.guide, self.gatherer.model)
        return _Layer(rows[at], surface, points, distance[at])

    def _add_layer(
        self,
        seen: _Layer,
        layer: int,
        through: F32,
        first_row: int,
        grid: tuple[int, int],
        sums: dict[str, F32],
        travelled: F32,
    ) -> None:
        """Lights one layer of surfaces and adds it to the sums."""
        q, s = self.quality, seen.surface
        pixel = pixel_size(self.camera, seen.distance + travelled[seen.rows], self.size)
        samples = SampleGrid(*grid, seen.rows, q.antialias, first_row)
        light_filter = LightFilter(
            self.gatherer.device, samples, seen.points, s.material, pixel, self.gatherer.center, q.rays
        )
        place = light_filter.place
        light = self.gatherer.gather(seen.points, place, light_filter.near_place, q.rays, q.light_samples, self.seed)
        rest = light.exact + reflect(seen.points.colors, light.sampled) + s.emission
        times, uncertain = light_filter.uncertain_points(light.direct + light.indirect, rest)
        if len(uncertain):
            more = self.gatherer.gather_more(
                seen.points[uncertain], place[uncertain], q.rays, q.light_samples, times, self.seed + 5000
            )
            for total, part in zip((light.direct, light.indirect), more):
                total[uncertain] += np.float32(times / (times + 1)) * (part - total[uncertain])
            light_filter.set_weight(uncertain, times + 1)
        direct = light_filter.radiance(light.direct, TILE) + light.exact
        direct += light_filter.radiance(light.sampled, NEAR_TILE)
        indirect = light_filter.radiance(light.indirect, TILE)
        share = through[seen.rows] * s.presence[:, None]
        sums["color"][seen.rows] += share * (direct + indirect + s.emission)
        cover = through[seen.rows] * s.opacity[:, None]
        values: dict[str, tuple[F32, NDArray]] = {
            "direct": (share, direct), "indirect": (share, indirect), "emission": (share, s.emission),
            "albedo": (cover, s.diffuse), "specular": (cover, s.f0), "roughness": (cover, s.roughness[:, None]),
            "alpha": (cover, np.ones_like(cover)),
        }  # fmt: skip
        for name, (weight, part) in values.items():
            if name in sums:
                sums[name][seen.rows] += weight * part
        if layer == 0:
            axis = -self.camera.world_from_camera[:3, 2]
            depth = (s.position - self.camera.world_from_camera[:3, 3]) @ axis
            firsts: dict[str, NDArray] = {
                "normal": seen.points.normal, "position": s.position, "depth": depth[:, None],
                "material": s.material[:, None], "mesh": s.mesh[:, None],
            }  # fmt: skip
            for name, first in firsts.items():
                if name in sums:
                    sums[name][seen.rows] = first

    def _to_pixels(self, sums: dict[str, F32], width: int, height: int, first: int, last: int) -> dict[str, F32]:
        """Averages the samples of each pixel, dropping the border; of indices and depths the first is taken."""
        a = self.quality.antialias
        out = {}
        for name, value in sums.items():
            grid = value.reshape(height, width, -1)[first:last]
            cells = grid.reshape((last - first) // a, a, width // a, a, -1)
            if name in ("depth", "material", "mesh"):
                out[name] = cells[:, a // 2, :, a // 2]
            else:
                out[name] = cells.mean((1, 3))
            if name == "normal":
                length = np.linalg.norm(out[name], axis=-1, keepdims=True)
                out[name] = (out[name] / np.where(length > 0, length, 1)).astype(np.float32)
        return out
