"""What a camera sees, row by row: first hits, surfaces, and what belongs to which pixel.

The rows of the grid are the middles of all pixels.  Further rows, each with its share of a pixel, are other places of
pixels at edges, and what is behind surfaces that can be seen through.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from usdslf.gpu.device import Device
from usdslf.gpu.shared import Shared
from usdslf.progress import tell
from usdslf.render.filter import morton_place
from usdslf.render.live import records as r
from usdslf.render.live.scene import GROUP, Hits, LiveScene, groups
from usdslf.scene.cameras import film_window, pixel_size
from usdslf.scene.records import Camera

TILE = 8  # pixels on a side that share a set of numbers


class Rows:
    """n rows and all that is known of them."""

    def __init__(self, device: Device, hits: Hits, pixel: NDArray, share: NDArray, width: int) -> None:
        """Makes room for the surfaces of hits.

        Args:
            pixel: (n,) of each row.
            share: (n,) of its pixel that it is.
            width: of the picture [pixels].
        """
        self.count, self.hits = len(pixel), hits
        n = max(self.count, 1)
        make = lambda shape, dtype=np.float32: Shared(device, shape, dtype)  # noqa: E731
        self.surface, self.guide = make((n, r.SURFACE)), make((n, r.GUIDE))
        self.soft_d = device.zeros((n, 3), np.float32)
        self.pixel, self.share, self.place = make((n,), np.uint32), make((n,)), make((n,), np.uint8)
        self.all = make((n,), np.uint32)
        self.pixel.host[: self.count], self.share.host[: self.count] = pixel, share
        self.place.host[: self.count] = morton_place(pixel % width % TILE, pixel // width % TILE)
        self.all.host[:] = np.arange(n)
        for a in (self.pixel, self.share, self.place, self.all):
            a.push()
        self._device = device

    def of_materials(self, materials: NDArray) -> Shared | None:
        """Returns the rows that show some materials (m,), None where there are none."""
        shown = self.surface.host[: self.count, r.MATERIAL]
        rows = np.flatnonzero(np.isin(shown, materials)).astype(np.uint32)
        return self.listed(rows)

    def listed(self, rows: NDArray) -> Shared | None:
        """Returns rows (m,) for kernels."""
        if not len(rows):
            return None
        out = Shared(self._device, rows.shape, np.uint32)
        out.host[:] = rows
        out.push()
        return out


@dataclass
class View:
    """What a camera sees.  What depends on materials and light is that of `scene`, which `show` changes."""

    scene: LiveScene
    camera: Camera
    size: tuple[int, int]
    grid: Rows
    backdrop: Shared  # (pixels, 3)
    pixel_size: float  # for a unit of distance; negative: everywhere
    more: Rows | None = None
    first_more: Shared | None = None  # (pixels + 1,)
    is_close: bool = False  # further rows were looked for

    @property
    def parts(self) -> list[Rows]:
        """The grid, and the further rows."""
        return [self.grid] + ([self.more] if self.more else [])

    def show(self, scene: LiveScene) -> None:
        """Makes surfaces and the elements' light those of another scene of the same geometry."""
        before, now = self.scene.materials, scene.materials
        changed = [m for m, (a, b) in enumerate(zip(before.whole, now.whole)) if a != b]
        for part in self.parts:
            rows = part.of_materials(np.array(changed)) if changed else None
            if rows is not None:
                scene.evaluate(part.hits, rows, len(rows.host), part.surface)
            if self.scene.light is not scene.light:
                fill_soft(scene, part)
        scene.geometry.device.finish()
        self.scene = scene


def look(scene: LiveScene, camera: Camera, size: tuple[int, int], hide_lights: bool = False) -> View:
    """Finds what a camera sees at the middles of pixels; `look_closer` adds the rest."""
    g = scene.geometry
    device, n = g.device, size[0] * size[1]
    hits = Hits(device, n)
    send_rays(scene, camera, size, hits, n)
    hits.trace(g.tracer, n, stop_at_translucent=True)
    backdrop = Shared(device, (n, 3), np.float32) if hide_lights else see_lights(scene, hits, n)
    grid = Rows(device, hits, np.arange(n), np.ones(n, np.float32), size[0])
    of_distance = float(pixel_size(camera, np.ones(1), size)[0]) * (1 if camera.perspective else -1)
    view = View(scene, camera, size, grid, backdrop, of_distance)
    fill_rows(scene, view, grid)
    tell()
    return view


def fill_rows(scene: LiveScene, view: View, rows: Rows) -> None:
    """Makes surfaces, guides and the elements' light of rows."""
    g = scene.geometry
    n = rows.count
    scene.evaluate(rows.hits, rows.all, n, rows.surface)
    g.kernel("live_combine", "guide_rows")(
        groups(n), (GROUP,), np.uint32(n), rows.surface, rows.hits.distance, np.float32(view.pixel_size), rows.guide
    )
    fill_soft(scene, rows)


def fill_soft(scene: LiveScene, rows: Rows) -> None:
    """Takes the diffuse light of rows from the elements about them."""
    g, t, h, n = scene.geometry, scene.geometry.tables, rows.hits, rows.count
    g.kernel("live_surfaces", "soft_light")(
        groups(n), (GROUP,), np.uint32(n), h.triangle, h.u, h.v, h.direction, t.corners_d, t.face_normal_d,
        t.cells_of_triangle_d, t.entry_of_cell_d, t.cell_count, t.elements_of_entry_d, t.position_d,
        scene.light.soft_d, rows.soft_d,
    )  # fmt: skip


def send_rays(
    scene: LiveScene, camera: Camera, size: tuple[int, int], hits: Hits, count: int, at: Shared | None = None
) -> None:
    """Makes rays through the middles of pixels, or through places (count, 2)."""
    m = camera.world_from_camera
    values = np.zeros(24, np.float32)
    values[:3] = m[:3, 3]
    values[3:12] = m[:3, :3].T.ravel()
    values[12:16] = film_window(camera, size[0] / size[1])
    values[16] = camera.focal_length if camera.perspective else 0
    values[17:19] = max(camera.near, 0.0), min(max(camera.far, 0.0), 1e37)
    values[19:21] = size
    scene.geometry.kernel("live_camera", "camera_rays")(
        groups(count), (GROUP,), np.uint32(count), scene.geometry.device.upload(values), np.int32(at is not None),
        hits.length if at is None else at, hits.origin, hits.direction, hits.length,
    )  # fmt: skip


def see_lights(scene: LiveScene, hits: Hits, count: int) -> Shared:
    """Returns what rays see of lights and domes (count, 3); hits that are hidden by a light are taken away."""
    backdrop = Shared(scene.geometry.device, (count, 3), np.float32)
    scene.geometry.kernel("live_camera", "lights_in_view")(
        groups(count), (GROUP,), np.uint32(count), *scene.arguments(), hits.origin, hits.direction, hits.length,
        hits.triangle, hits.distance, backdrop,
    )  # fmt: skip
    hits.triangle.pull()
    backdrop.pull()
    return backdrop
