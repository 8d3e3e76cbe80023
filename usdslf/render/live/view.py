"""What a camera sees, row by row: first hits, surfaces, and what belongs to which pixel.

The rows of the grid are the middles of the pixels of a window of the picture, the whole of it or a part.  Further rows,
each with its share of a pixel, are other places of pixels at edges, and what is behind surfaces that can be seen
through.  What is drawn for a row depends on the row's place in the picture alone, so that a part shows what the whole
does.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from usdslf.gpu.launch import GROUP, groups
from usdslf.gpu.shared import Shared
from usdslf.progress import tell
from usdslf.render.live import records as r
from usdslf.render.live.scene import Hits, LiveScene
from usdslf.scene.cameras import film_window, pixel_size
from usdslf.scene.records import Camera

_BIT = np.arange(r.TILE.bit_length() - 1)
_SPREAD = ((np.arange(r.TILE)[:, None] >> _BIT & 1) << 2 * _BIT).sum(1)
PLACES = (_SPREAD + 2 * _SPREAD[:, None]).astype(np.uint8)  # on the Z-order curve, by y and x in a tile
APART = 0x9E3779B1  # between the numbers of rows of one pixel
FEW = 16  # materials whose rows are found one material after another more quickly than by sorting


@dataclass(frozen=True)
class Window:
    """Pixels of a picture, of which (x, y) is the first."""

    x: int
    y: int
    width: int
    height: int

    @property
    def count(self) -> int:
        """Its pixels."""
        return self.width * self.height

    @property
    def axes(self) -> tuple[NDArray, NDArray]:
        """The x (1, width) and y (height, 1), in the picture, of its pixels."""
        return self.x + np.arange(self.width)[None], self.y + np.arange(self.height)[:, None]

    def with_border(self, border: int, size: tuple[int, int]) -> Window:
        """Returns it with so many pixels more on each side, within a picture of a size."""
        x, y = max(self.x - border, 0), max(self.y - border, 0)
        right, bottom = (min(a + n + border, m) for a, n, m in zip((self.x, self.y), (self.width, self.height), size))
        return Window(x, y, right - x, bottom - y)

    def rows_in(self, inner: Window) -> tuple[slice, slice]:
        """Returns where another window lies in arrays (height, width) of this one."""
        x, y = inner.x - self.x, inner.y - self.y
        return slice(y, y + inner.height), slice(x, x + inner.width)

    def places(self, pixel: NDArray) -> tuple[NDArray, NDArray]:
        """Returns x and y, in the picture, of pixels of the window (n,)."""
        y, x = np.divmod(pixel, self.width)
        return x + self.x, y + self.y


class Rows:
    """n rows and all that is known of them."""

    def __init__(
        self, scene: LiveScene, hits: Hits, window: Window, width: int, pixel: NDArray | None = None,
        nth: NDArray | int = 0, share: NDArray | float = 1.0,
    ) -> None:  # fmt: skip
        """Makes room for the surfaces of hits.

        Args:
            window: whose pixels they are.
            width: of the whole picture [pixels].
            pixel: (n,) of the window, of each row; None: the grid, all of them.
            nth: (n,) of each among those of its pixel, from 1.
            share: (n,) of its pixel that each is.
        """
        device = scene.geometry.device
        self.count, self.hits = window.count if pixel is None else len(pixel), hits
        n = max(self.count, 1)
        make = lambda shape, dtype=np.float32: Shared(device, shape, dtype, is_clean=False)  # noqa: E731
        self.surface, self.guide, self.soft = make((n, r.SURFACE)), make((n, r.GUIDE)), make((n, 3))
        self.alike = make((n, 4), np.int16)  # what the filter looks at about each
        self.pixel, self.share, self.place = make((n,), np.uint32), make((n,)), make((n,), np.uint8)
        self.all, self.identity = make((n,), np.uint32), make((n,), np.uint32)
        self.sharp_place = self.place  # of rays of the specular lobe
        self.radiance = make((n, 3))  # that each sends to the eye
        self.unshaded: list[NDArray[np.uint32]] = []  # rows of which that is not so any more
        self.pixel.host[: self.count] = np.arange(self.count, dtype=np.uint32) if pixel is None else pixel
        self.share.host[: self.count] = share
        x, y = window.axes if pixel is None else window.places(pixel)
        if pixel is None:  # whole rows at a time
            places = PLACES[:, x[0] % r.TILE][y[:, 0] % r.TILE]
        else:
            places = PLACES[y % r.TILE, x % r.TILE]
        self.place.host[: self.count] = places.reshape(-1) ^ np.asarray(np.asarray(nth) * 21 % r.SET, np.uint8)
        number = (y.astype(np.uint32) * np.uint32(width) + x.astype(np.uint32)).reshape(-1)
        self.identity.host[: self.count] = number + (np.asarray(nth, np.uint64) * APART & 0xFFFFFFFF).astype(np.uint32)
        self.all.host[:] = np.arange(n, dtype=np.uint32)
        for a in (self.pixel, self.share, self.place, self.all, self.identity):
            a.push()
        self._device, self._material_of = device, scene.geometry.scene.triangles.material

    @cached_property
    def there(self) -> NDArray[np.uint32]:
        """Rows that show something, in order."""
        return np.flatnonzero(self.hits.triangle.host[: self.count] >= 0).astype(np.uint32)

    @cached_property
    def _by_material(self) -> tuple[NDArray[np.uint32], NDArray]:
        """Rows that show something, by material, and where each material's begin."""
        there, triangle = self.there, self.hits.triangle.host[: self.count]
        material = self._material_of.take(triangle if len(there) == self.count else triangle[there])
        count = int(material.max(initial=-1)) + 1
        sortable = np.uint8 if count <= 1 << 8 else np.uint16 if count <= 1 << 16 else np.int64  # small ones by radix
        material = material.astype(sortable)
        if 0 < count <= FEW:
            order = np.concatenate([np.flatnonzero(material == m) for m in range(count)])
        else:
            order = np.argsort(material, kind="stable")
        return there[order], np.concatenate([[0], np.cumsum(np.bincount(material, minlength=count))])

    @property
    def shown(self) -> int:
        """How many rows show something."""
        return len(self.there)

    def of_material(self, material: int) -> NDArray[np.uint32]:
        """Returns the rows that show a material, in order."""
        rows, first = self._by_material
        return rows[first[material] : first[material + 1]] if material + 1 < len(first) else rows[:0]

    def listed(self, rows: NDArray) -> Shared:
        """Returns rows (m,), one at least, for kernels."""
        if len(rows) == self.count:
            return self.all
        out = Shared(self._device, rows.shape, np.uint32, is_clean=False)
        out.host[:] = rows
        out.push()
        return out


@dataclass
class View:
    """What a camera sees.  What depends on materials and light is that of `scene`, which `show` changes."""

    scene: LiveScene
    camera: Camera
    size: tuple[int, int]  # of the whole picture
    window: Window
    grid: Rows
    backdrop: Shared  # (pixels, 3)
    pixel_size: float  # for a unit of distance; negative: everywhere
    more: Rows | None = None
    first_more: Shared | None = None  # (pixels + 1,)
    is_close: bool = False  # further rows were looked for
    lit_by: object = None  # what the light of the rows' radiance is of

    @property
    def parts(self) -> list[Rows]:
        """The grid, and the further rows."""
        return [self.grid] + ([self.more] if self.more else [])

    def show(self, scene: LiveScene) -> None:
        """Makes surfaces and the elements' light those of another scene of the same geometry."""
        before, now = self.scene.materials, scene.materials
        changed = [m for m, (a, b) in enumerate(zip(before.whole, now.whole)) if a != b]
        for part in self.parts:
            for m in changed:
                rows = part.of_material(m)
                if not len(rows):
                    continue
                if before.gloss[m] != now.gloss[m] or before.opacity[m] != now.opacity[m] or now.on_host[m]:
                    scene.evaluate(part.hits, part.listed(rows), len(rows), part.surface)
                else:
                    scene.recolor(part.hits, part.listed(rows), len(rows), part.surface)
                part.unshaded.append(rows)
            if self.scene.light is not scene.light:
                fill_soft(scene, part)
        scene.geometry.device.finish()
        self.scene = scene


def look(
    scene: LiveScene, camera: Camera, size: tuple[int, int], window: Window, hide_lights: bool = False
) -> View:  # fmt: skip
    """Finds what a camera sees at the middles of a window's pixels; `look_closer` adds the rest."""
    g = scene.geometry
    device, n = g.device, window.count
    hits = Hits(device, n)
    send_rays(scene, camera, size, hits, n, window)
    grid = Rows(scene, hits, window, size[0])  # numbered while rays are made
    hits.trace(g.tracer, n, stop_at_translucent=True)
    if hide_lights:
        hits.triangle.pull()
    backdrop = Shared(device, (n, 3), np.float32) if hide_lights else see_lights(scene, hits, n)
    of_distance = float(pixel_size(camera, np.ones(1), size)[0]) * (1 if camera.perspective else -1)
    view = View(scene, camera, size, window, grid, backdrop, of_distance)
    fill_rows(scene, grid, of_distance)
    find_alike(scene, grid, grid, window)
    fill_soft(scene, grid)
    tell()
    return view


def fill_rows(scene: LiveScene, rows: Rows, pixel_size: float) -> None:
    """Makes surfaces and guides of rows.

    Args:
        pixel_size: for a unit of distance; negative: everywhere.
    """
    g = scene.geometry
    n = rows.count
    scene.evaluate(rows.hits, rows.all, n, rows.surface)
    g.kernel("live_combine", "guide_rows")(
        groups(n), (GROUP,), np.uint32(n), rows.surface, rows.hits.distance, np.float32(pixel_size), rows.guide,
        rows.radiance,
    )  # fmt: skip


def find_alike(scene: LiveScene, rows: Rows, grid: Rows, window: Window) -> None:
    """Finds which neighbours on the grid show the same as each of some rows, which may be the grid's own."""
    n = rows.count
    scene.geometry.kernel("live_combine", "find_alike")(
        groups(n), (GROUP,), np.uint32(n), np.int32(window.width), np.int32(window.height), np.int32(rows is grid),
        rows.pixel, rows.guide, grid.guide, rows.alike,
    )  # fmt: skip


def fill_soft(scene: LiveScene, rows: Rows) -> None:
    """Takes the diffuse light of rows from the elements about them."""
    g, t, h, n = scene.geometry, scene.geometry.tables, rows.hits, rows.count
    g.kernel("live_surfaces", "soft_light")(
        groups(n), (GROUP,), np.uint32(n), h.triangle, h.u, h.v, h.direction, t.corners_d, t.face_normal_d,
        t.cells_of_triangle_d, t.entry_of_cell_d, t.cell_count, t.elements_of_entry_d, t.position_d,
        scene.light.soft_d, rows.soft,
    )  # fmt: skip


def send_rays(
    scene: LiveScene, camera: Camera, size: tuple[int, int], hits: Hits, count: int, at: Shared | Window,
    antialias: int = 1,
) -> None:  # fmt: skip
    """Makes rays through a window's pixels, or through places (count, 2) of the picture.

    With `antialias` > 1 pixels are samples, so many on a side of what is seen: rooks, no two of which share a row or a
    column, so that edges come out alike everywhere; else their middles.
    """
    m = camera.world_from_camera
    values = np.zeros(25, np.float32)
    values[:3] = m[:3, 3]
    values[3:12] = m[:3, :3].T.ravel()
    values[12:16] = film_window(camera, size[0] / size[1])
    values[16] = camera.focal_length if camera.perspective else 0
    values[17:19] = max(camera.near, 0.0), min(max(camera.far, 0.0), 1e37)
    values[19:21] = size
    if isinstance(at, Window):
        values[21:] = at.x, at.y, at.width, antialias
    scene.geometry.kernel("live_camera", "camera_rays")(
        groups(count), (GROUP,), np.uint32(count), scene.geometry.device.upload(values),
        np.int32(isinstance(at, Shared)), at if isinstance(at, Shared) else hits.length, hits.origin, hits.direction,
        hits.length,
    )  # fmt: skip


def see_lights(scene: LiveScene, hits: Hits, count: int) -> Shared:
    """Returns what rays see of lights and domes (count, 3); hits that are hidden by a light are taken away."""
    backdrop = Shared(scene.geometry.device, (count, 3), np.float32, is_clean=False)
    scene.geometry.kernel("live_camera", "lights_in_view")(
        groups(count), (GROUP,), np.uint32(count), *scene.arguments(), hits.origin, hits.direction, hits.length,
        hits.triangle, hits.distance, backdrop,
    )  # fmt: skip
    hits.triangle.pull()
    backdrop.pull()
    return backdrop
