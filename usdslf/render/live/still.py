"""The final picture, band by band, by the kernels of the live one.

    samples of a band -> surfaces, layer by layer -> sums of light (live_still.cl) -> filter -> radiance -> pixels

A pixel has antialias^2 samples.  Samples of a tile of 8 x 8 take different parts of one low-discrepancy set
(interleaved sampling), lights that have a place those of a tile of 4 x 4, so that shadows stay sharp, and sharp
reflections in flat surfaces a tile within their lobe.  A filter of the tile's size puts them together again where
samples see the same surface; what is filtered is light without the surface's colours, so textures stay.  The picture is
worked on in bands with a border that the filter needs, so memory does not grow with the picture.

Source: Keller and Heidrich 2001; Wald et al. 2002; Scherzer et al. 2012 (radiance caching).
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from usdslf.gpu.launch import GROUP, groups
from usdslf.gpu.shared import Shared
from usdslf.lights.sources import LightSet
from usdslf.progress import tell
from usdslf.rays import points_at
from usdslf.render.live import records as r
from usdslf.render.live.gather import BATCH, Draw, GatherRoom, gather_batch
from usdslf.render.live.materials import MaterialTable
from usdslf.render.live.noise import Noise
from usdslf.render.live.scene import Geometry, Hits, LiveScene, SentLight
from usdslf.render.live.view import Rows, Window, fill_rows, find_alike, see_lights, send_rays
from usdslf.render.settings import AOVS, LAYERS, LitScene, PictureOptions, Quality
from usdslf.scene.cameras import pixel_size
from usdslf.scene.records import F32, Camera
from usdslf.surfaces.surface_points import evaluate_surface

NEAR_TILE = 4  # samples on a side that share numbers of lights that have a place: shadows are blurred by no more
SMALLEST_SET = 16  # points of a sequence: fewer do not hold every lobe as often as its chance says
EACH = 16  # sources up to this number get a ray each
MOST_FRAMES = 64  # of one set of numbers
RAYS = 2  # of each lobe, and towards each source, for one that is asked for: few of them would be wrong alike in large


@dataclass(frozen=True)
class _Layer:
    """What the samples of a band see next."""

    rows: Rows
    through: F32  # (n,) how much of it is seen
    limit: F32  # (n,) of distances from the eye, as those of the hits are

    @property
    def there(self) -> NDArray[np.uint32]:
        """Rows that show something."""
        return np.flatnonzero(self.rows.hits.triangle.host >= 0).astype(np.uint32)


@dataclass(frozen=True)
class _Sums:
    """Sums of light (rows, LIGHT), see live_still.cl; some are in one array where they need not be told apart."""

    near: Shared
    far: Shared
    bounced: Shared
    exact: Shared  # (rows, 3)
    sent: Shared  # (rows,) of the last frame

    @staticmethod
    def of(g: Geometry, n: int, is_apart: bool) -> _Sums:
        """Makes room for n rows."""
        make = lambda *shape: Shared(g.device, shape, np.float32, is_clean=False)  # noqa: E731
        far = make(n, r.LIGHT)
        has_near = bool(g.lights.placed or len(g.lights.emissive.triangle))
        near, bounced = make(n, r.LIGHT) if has_near else far, make(n, r.LIGHT) if is_apart else far
        return _Sums(near, far, bounced, make(n, 3), Shared(g.device, (n,), np.float32))

    @property
    def arrays(self) -> tuple[Shared, ...]:
        """As kernels take them."""
        return self.near, self.far, self.bounced, self.exact


@dataclass(frozen=True)
class SumAdder:
    """Adds a frame to sums of light."""

    scene: LiveScene
    part: Rows
    sums: _Sums
    is_first: bool

    def add_frame(self, room: GatherRoom, count: int) -> None:
        """Adds what the rays of the first `count` rows in a room met."""
        g, sums = self.scene.geometry, self.sums
        g.kernel("live_still", "add_samples")(
            groups(count), (GROUP,), np.uint32(count), room.rows, *g.sources.arrays[:3], np.int32(self.is_first),
            self.part.surface, room.to_sources.length, room.to_sources.blocked, room.shone, room.lobes.length,
            room.drawn, room.arrived, self.scene.light.arriving_d, *sums.arrays, sums.sent,
        )  # fmt: skip

    def add_paths(self, queued: Shared, first: int, count: int) -> None:
        """Adds to the same frame what `count` queued paths brought."""
        g, sums = self.scene.geometry, self.sums
        g.kernel("live_still", "add_paths_to_sums")(
            groups(count), (GROUP,), np.uint32(count), np.uint32(first), queued, self.part.surface,
            self.scene.light.arriving_d, sums.bounced, sums.sent,
        )  # fmt: skip


class StillPicture:
    """A final picture in the making."""

    def __init__(self, lit: LitScene, camera: Camera, size: tuple[int, int], options: PictureOptions) -> None:
        """Uploads what all bands need.

        Args:
            lit: with a light field, or without.
            size: width and height [pixels].
        """
        field, area = lit.light_field, float(lit.scene.triangles.areas.sum()) / max(options.elements, 1)
        geometry = Geometry.of(lit.device, lit.scene, lit.tracer, LightSet(lit.scene, lit.lights), field, EACH)
        self.camera, self.size, self.options, self.quality = camera, size, options, Quality.of(options.samples)
        a = self.quality.antialias
        self.samples = size[0] * a, size[1] * a
        light = SentLight.of(geometry, field, options.footprint * area, lit.keep_sums)
        self.scene = LiveScene(geometry, MaterialTable.of(geometry.pool, lit.scene.materials), light)
        self._room, self._frames = GatherRoom(geometry), RAYS * self.quality.rays
        materials = lit.scene.materials
        glow = [not isinstance(m.emissive_color, np.ndarray) or m.emissive_color.max() > 0 for m in materials]
        self._is_plain = all(m.is_opaque for m in materials) and not any(glow)  # light is all that there is

    def render_band(self, first: int, last: int, names: tuple[str, ...]) -> dict[str, F32]:
        """Renders layers `names` of rows of pixels first..last-1: name -> (rows, width, channels)."""
        a = self.quality.antialias
        whole = Window(0, first * a, self.samples[0], (last - first) * a)
        window = whole.with_border(-(-(r.TILE // 2 + 1) // a) * a, self.samples)
        sums = {k: np.zeros((window.count, AOVS[k]), np.float32) for k in names}
        for k in ("depth", "material", "mesh"):
            if k in sums:
                sums[k][:] = np.inf if k == "depth" else -1
        hits = Hits(self.scene.geometry.device, window.count)
        send_rays(self.scene, self.camera, self.samples, hits, window.count, window, a)
        through, travelled = np.ones(window.count, np.float32), np.zeros(window.count, np.float32)
        for number in range(LAYERS):
            layer = self._look(hits, through, travelled, window, sums)
            there = layer.there
            if not len(there):
                break
            self._add_layer(layer, there, number == 0, window, sums)
            onwards = self._behind(layer, there)
            if onwards is None:
                break
            hits, through, travelled = onwards
        return self._to_pixels(sums, window, whole)

    # ── what is seen ───────────────────────────────────────────────────────────────────────────

    def _look(
        self, hits: Hits, through: F32, travelled: F32, window: Window, sums: dict[str, F32]
    ) -> _Layer:  # fmt: skip
        """Finds what rays see next; adds lights and domes that are in view."""
        g, n = self.scene.geometry, window.count
        rows = Rows(self.scene, hits, window, self.samples[0])
        hits.length.pull()
        sent = hits.length.host > 0
        hits.trace(g.tracer, n, stop_at_translucent=True)
        if self.options.hide_lights:
            hits.triangle.pull()
        else:
            seen = see_lights(self.scene, hits, n).host * (through * sent)[:, None]
            for k in ("color", "direct", "emission"):
                if k in sums:
                    sums[k] += seen
        limit = hits.length.host + travelled
        hits.distance.host[:] += travelled
        hits.distance.push()
        per_distance = float(pixel_size(self.camera, np.ones(1), self.size)[0])
        fill_rows(self.scene, rows, per_distance if self.camera.perspective else -per_distance)
        least = max(self.quality.antialias, 2 ** int(np.ceil(np.log2(SMALLEST_SET / self._frames) / 2)))
        rows.sharp_place = Shared(g.device, (n,), np.uint8, is_clean=False)
        g.kernel("live_still", "tile_rows")(
            groups(n), (GROUP,), np.uint32(n), np.int32(window.width), np.int32(window.height),
            np.int32(min(least, r.TILE)), rows.guide, rows.place, rows.sharp_place,
        )  # fmt: skip
        find_alike(self.scene, rows, rows, window)
        tell()
        return _Layer(rows, through, limit)

    def _behind(self, layer: _Layer, there: NDArray) -> tuple[Hits, F32, F32] | None:
        """Rays onwards from behind what a layer shows, how much they see and from how far; None: they see nothing."""
        g, t = self.scene.geometry, self.scene.geometry.scene.triangles
        if all(m.is_opaque for m in self.scene.materials.materials):
            return None
        hits, n = layer.rows.hits, layer.rows.count
        layer.rows.surface.pull()
        opacity = np.abs(layer.rows.surface.host[there, r.COVER])
        rows, opacity = there[opacity < 1 - 1e-3], opacity[opacity < 1 - 1e-3]
        if not len(rows):
            return None
        triangle, direction = hits.triangle.host[rows], hits.direction.host[rows]
        met = points_at(t.positions, triangle, np.stack([hits.u.host[rows], hits.v.host[rows]], 1))
        normal = t.face_normals[triangle]
        ahead = np.where((normal * direction).sum(1, keepdims=True) < 0, -normal, normal)
        out, through, travelled = Hits(g.device, n), np.zeros(n, np.float32), np.zeros(n, np.float32)
        out.length.host[:], out.direction.host[:], out.origin.host[:] = 0, hits.direction.host, hits.origin.host
        out.origin.host[rows] = g.tracer.offset_points(met, ahead, triangle)
        travelled[rows] = hits.distance.host[rows]
        out.length.host[rows] = np.maximum(layer.limit[rows] - travelled[rows], 0)
        through[rows] = layer.through[rows] * (1 - opacity)
        for a in (out.origin, out.direction, out.length):
            a.push()
        return out, through, travelled

    # ── light ──────────────────────────────────────────────────────────────────────────────────

    def _add_layer(
        self, layer: _Layer, there: NDArray[np.uint32], is_first: bool, window: Window, sums: dict[str, F32]
    ) -> None:
        """Lights one layer of surfaces and adds it to the sums."""
        is_apart = "direct" in sums or "indirect" in sums
        direct, indirect = self._light(layer.rows, there, window, is_apart)
        if self._is_plain and set(sums) == {"color"}:
            sums["color"][there] += direct
            return
        layer.rows.surface.pull()
        s, through = layer.rows.surface.host[there], layer.through[there, None]
        cover = np.abs(s[:, r.COVER, None])
        share = np.where(np.signbit(s[:, r.COVER, None]), cover, 1) * through
        emission = s[:, r.EMISSION : r.EMISSION + 3]
        sums["color"][there] += share * (direct + indirect + emission)
        values: dict[str, tuple[F32, NDArray]] = {
            "direct": (share, direct), "indirect": (share, indirect), "emission": (share, emission),
            "alpha": (cover * through, np.ones_like(cover)),
        }  # fmt: skip
        if {"albedo", "specular", "roughness"} & set(sums):
            found, hits = self.scene.geometry.scene, layer.rows.hits
            barycentric = np.stack([hits.u.host[there], hits.v.host[there]], 1)
            is_of = evaluate_surface(found, hits.triangle.host[there], barycentric)
            values["albedo"] = (cover * through, is_of.diffuse)
            values["specular"] = (cover * through, is_of.f0)
            values["roughness"] = (cover * through, is_of.roughness[:, None])
        for name, (weight, part) in values.items():
            if name in sums:
                sums[name][there] += weight * part
        if is_first:
            self._add_first(layer.rows.hits.triangle.host[there], s, there, sums)

    def _add_first(self, triangle: NDArray, surface: F32, there: NDArray, sums: dict[str, F32]) -> None:
        """Says where the nearest surface is, and which."""
        eye, axis = self.camera.world_from_camera[:3, 3], -self.camera.world_from_camera[:3, 2]
        position, table = surface[:, r.POSITION : r.POSITION + 3], self.scene.geometry.scene.triangles
        firsts: dict[str, NDArray] = {
            "normal": surface[:, r.NORMAL : r.NORMAL + 3], "position": position,
            "depth": ((position - eye) @ axis)[:, None], "material": table.material[triangle][:, None],
            "mesh": table.mesh[triangle][:, None],
        }  # fmt: skip
        for name, first in firsts.items():
            if name in sums:
                sums[name][there] = first

    def _light(self, rows: Rows, there: NDArray[np.uint32], window: Window, is_apart: bool) -> tuple[F32, F32]:
        """Returns the radiance (m, 3) of rows by direct and by indirect light; if not apart all is in the first."""
        g, count = self.scene.geometry, self._frames
        sums = _Sums.of(g, rows.count, is_apart)
        frames = self._gather(rows, there, sums, count, 0)
        noise = Noise(g, window, rows, there, count)
        for _ in frames:
            self._room.queue.follow(self._room)
            noise.add(sums.sent)
        times, chosen = noise.uncertain()
        if len(chosen):
            more = there[chosen]
            for _ in self._gather(rows, more, sums, times * count, 500):
                pass
            listed = rows.listed(more)
            g.kernel("live_still", "scale_sums")(
                groups(len(more)), (GROUP,), np.uint32(len(more)), listed, np.float32(1 / (1 + times)), *sums.arrays
            )
        listed = rows.listed(there)
        of_direct = [] if sums.near is sums.far else [self._filtered(sums.near, NEAR_TILE, rows, listed, window)]
        of_direct.append(self._filtered(sums.far, r.TILE, rows, listed, window))
        direct = self._radiance(of_direct, rows, listed)
        sums.exact.pull()
        direct += sums.exact.host[there] / np.float32(count)
        apart = [self._filtered(sums.bounced, r.TILE, rows, listed, window)] if is_apart else []
        return direct, self._radiance(apart, rows, listed)

    def _gather(
        self, rows: Rows, there: NDArray[np.uint32], sums: _Sums, count: int, turn: int
    ) -> Iterator[None]:  # fmt: skip
        """Adds frames to the sums of some rows, one by one; what rays that are followed bring is there at the end.

        Args:
            turn: which numbers they draw; 0: the sums' first.
        """
        room = self._room
        for frame in range(count):
            further, step = divmod(frame, MOST_FRAMES)
            of_turn, seed = min(MOST_FRAMES, count - further * MOST_FRAMES), turn + 1000 * self.options.seed
            draw = Draw(
                further + 1000 + seed, r.SET * of_turn, of_turn, step, 0, NEAR_TILE**2 - 1, True, True, True,
                self.options.depth, frame + 1 + seed,
            )  # fmt: skip
            adder = SumAdder(self.scene, rows, sums, frame == 0 and turn == 0)
            for first in range(0, len(there), BATCH):
                gather_batch(self.scene, room, rows, there[first : first + BATCH], draw, adder)
                tell()
            yield
        room.queue.follow(room)

    def _filtered(self, light: Shared, width: int, rows: Rows, listed: Shared, window: Window) -> Shared:
        """Averages light over a window, along rows and then along columns."""
        g, n = self.scene.geometry, len(listed.host)
        along, out = (Shared(g.device, light.host.shape, np.float32, is_clean=False) for _ in range(2))
        for step, (of, to) in enumerate(((light, along), (along, out))):
            g.kernel("live_combine", "filter_light")(
                groups(n), (GROUP,), np.uint32(n), listed, np.int32(window.width), np.int32(step), np.int32(width),
                np.int32(1), np.int32(0), rows.pixel, rows.alike, of, of, to,
            )  # fmt: skip
        return out

    def _radiance(self, lights: list[Shared], rows: Rows, listed: Shared) -> F32:
        """What rows make of light: (m, 3)."""
        g, n = self.scene.geometry, len(listed.host)
        out = Shared(g.device, (rows.count, 3), np.float32)
        for light in lights:
            g.kernel("live_still", "add_radiance")(
                groups(n), (GROUP,), np.uint32(n), listed, rows.surface, light, np.float32(1 / self._frames), out
            )
        out.pull()
        return out.host[listed.host]

    def _to_pixels(self, sums: dict[str, F32], window: Window, whole: Window) -> dict[str, F32]:
        """Averages the samples of each pixel, dropping the border; of indices and depths one is taken."""
        a, out = self.quality.antialias, {}
        for name, value in sums.items():
            grid = value.reshape(window.height, window.width, -1)[window.rows_in(whole)]
            if name in ("depth", "material", "mesh"):
                out[name] = grid[a // 2 :: a, a // 2 :: a]
                continue
            parts = [grid[y::a, x::a] for y in range(a) for x in range(a)]
            out[name] = sum(parts[1:], parts[0]) / np.float32(a * a)
            if name == "normal":
                length = np.linalg.norm(out[name], axis=-1, keepdims=True)
                out[name] = (out[name] / np.where(length > 0, length, 1)).astype(np.float32)
        return out
