"""LivePicture: what a camera sees, at once and then better, and what it sees after a material changed.

    rows of a view -> columns of light, frame by frame -> filter -> colours -> pixels

Light is kept without the surface's colours, so a change of diffuse or specular reflectance costs no ray.  A change of
roughness gathers the rows of that material anew.  Frames add up to what the final picture (render/picture.py)
estimates: sources and lobes are drawn as there, rays that the light field answers badly are followed as there.  What is
there at once and is not gathered, the diffuse light of the elements, loses its weight frame by frame.

Source: Nguyen et al. 2013, 6.4; Keller and Heidrich 2001 (interleaved sampling); Veach and Guibas 1995.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from usdslf.errors import InputError
from usdslf.gpu.launch import GROUP, groups
from usdslf.gpu.shared import Shared
from usdslf.light_field.light_field import LightField
from usdslf.lights.sources import LightSet, SurfaceEmission
from usdslf.progress import tell
from usdslf.render.live import records as r
from usdslf.render.live.closer import look_closer
from usdslf.render.live.gather import BATCH, ColumnAdder, Draw, GatherRoom, gather_batch
from usdslf.render.live.gathered import BORDER, Gathered, Group, Share, fewest_frames
from usdslf.render.live.materials import MaterialTable
from usdslf.render.live.scene import Geometry, LiveScene, SentLight
from usdslf.render.live.view import View, Window, look
from usdslf.render.settings import LitScene
from usdslf.scene.records import F32, Camera, Material

JUDGED = 20_000  # rows that the estimate of the error is made of, about
Region = tuple[int, int, int, int]
"""Left, top, right, bottom of a part of a picture [pixels], right and bottom excluded."""


@dataclass(frozen=True)
class LiveFrame:
    """A picture so far.

    Attributes:
        picture: (height, width, 3), scene-linear.
        number: of frames that all of it has.
        share: of the frames that were asked for, 0..1.
        error: estimate of its mean relative error by noise; it says nothing of what all frames have in common.
    """

    picture: F32
    number: int
    share: float
    error: float


@dataclass(frozen=True)
class _Framed:
    """What a picture is of."""

    camera: Camera
    size: tuple[int, int]
    region: Region | None = None

    def window(self) -> Window:
        """The region.

        Raises: InputError where it cannot be.
        """
        width, height = self.size
        if min(self.size) < 1:
            raise InputError(f"a picture of {width} x {height} pixels cannot be rendered; give a positive size")
        left, top, right, bottom = self.region or (0, 0, width, height)
        if not (0 <= left < right <= width and 0 <= top < bottom <= height):
            raise InputError(
                f"region {left} {top} {right} {bottom} is no part of a picture of {width} x {height} pixels; "
                "give left, top, right, bottom"
            )
        return Window(left, top, right - left, bottom - top)


@dataclass(frozen=True, eq=False)
class LivePicture:
    """A picture of a scene that gets better frame by frame.  Never changes but for that.

    Attributes:
        scene: with its materials and its light.
        view: what the camera sees.
        is_begun_anew: `with_materials` could not keep what was gathered: what can be seen through, or what shines, is
            another.  The light of other surfaces is that of `scene.light` all the same.
    """

    scene: LiveScene
    view: View
    _region: Window
    _room: GatherRoom = field(repr=False)
    _gathered: Gathered = field(repr=False)
    _shares: Mapping[int, Share] = field(repr=False)
    _hides_lights: bool = False
    is_begun_anew: bool = False

    @staticmethod
    def of(
        lit: LitScene, lights: LightSet, camera: Camera, size: tuple[int, int], hide_lights: bool = False,
        region: Region | None = None,
    ) -> LivePicture:  # fmt: skip
        """Looks at a lit scene.

        Args:
            lit: a scene that has a light field.
            lights: all that shines in it.
            camera: that sees it.
            size: width and height [pixels].
            hide_lights: lights and domes are not seen by the camera.
            region: left, top, right, bottom [pixels], of which the picture is; None: the whole.

        Returns: the picture, without a frame yet.

        Raises: InputError for a size or a region that cannot be.
        """
        assert lit.light_field is not None
        geometry = Geometry.of(lit.device, lit.scene, lit.tracer, lights, lit.light_field)
        materials = MaterialTable.of(geometry.pool, lit.scene.materials)
        scene = LiveScene(geometry, materials, SentLight.of(geometry, lit.light_field, None, lit.keep_sums))
        return LivePicture._start(scene, _Framed(camera, size, region), GatherRoom(geometry), hide_lights)

    @staticmethod
    def _start(scene: LiveScene, seen: _Framed, room: GatherRoom, hide_lights: bool) -> LivePicture:
        region = seen.window()
        with room.lock:
            view = look(scene, seen.camera, seen.size, region.with_border(BORDER, seen.size), hide_lights)
        shares = {m: Share() for m in range(len(scene.materials.materials))}
        return LivePicture(scene, view, region, room, Gathered(scene), shares, hide_lights)

    # ── other pictures ─────────────────────────────────────────────────────────────────────────

    def seen_by(
        self, camera: Camera, size: tuple[int, int] | None = None, region: Region | None = None
    ) -> LivePicture:  # fmt: skip
        """Returns the picture of another camera, of another size or of a part; what is on the device is shared.

        Args:
            camera: that sees the scene.
            size: width and height of the whole [pixels]; None: as this one.
            region: left, top, right, bottom [pixels], of which the picture is; None: the whole.

        Raises: InputError for a size or a region that cannot be.
        """
        seen = _Framed(camera, size or self.view.size, region)
        return LivePicture._start(self.scene, seen, self._room, self._hides_lights)

    def with_materials(self, materials: Sequence[Material], light: LightField | None = None) -> LivePicture:
        """Returns the picture under other materials.

        Where only colours differ nothing is gathered anew; where roughness, coat or normals do, the rows of these
        materials are.  Where opacity or what shines differs, everything is looked at and gathered anew
        (`is_begun_anew`).  Others follow when the light field is given: their diffuse light at once, reflections frame
        by frame, from what was shown before.

        Args:
            materials: as many as the scene has; those that are unchanged should be the same objects.
            light: the light field under them; None: as it is.
        """
        scene = self.scene
        before, table = scene.materials, MaterialTable.of(scene.geometry.pool, materials)
        geometry = scene.geometry
        is_anew = before.opacity != table.opacity or before.emission != table.emission
        if is_anew:
            geometry = geometry.under(materials)
        if light is None and scene.light.field is not None and before.emission != table.emission:
            light = scene.light.field.with_emission(emission_of(geometry, scene.light.field))
        sent = scene.light if light is None else SentLight.of(geometry, light)
        other = LiveScene(geometry, table, sent)
        if is_anew:
            left, top = self._region.x, self._region.y
            seen = _Framed(
                self.view.camera, self.view.size, (left, top, left + self._region.width, top + self._region.height)
            )
            room = self._room if geometry.sources.streams == scene.geometry.sources.streams else GatherRoom(geometry)
            begun = LivePicture._start(other, seen, room, self._hides_lights)
            return replace(begun, is_begun_anew=True)
        shares = {m: share for m, share in self._shares.items() if before.gloss[m] == table.gloss[m]}
        gathered = self._gathered
        if light is not None:
            with self._room.lock:
                self._show()
                gathered.average(self.view)
                gathered, shares = Gathered(other, gathered.kept_as_former(shares, self.view)), {}
        shares = {m: shares.get(m) or Share() for m in self._shares}
        return replace(self, scene=other, _gathered=gathered, _shares=shares, is_begun_anew=False)

    def seen(self) -> dict[str, NDArray]:
        """Returns what the middles of pixels show, layers (height, width): `material` and `mesh`, indices of the scene,
        -1 where nothing is seen, and `distance` from the eye [stage units], inf there; for picking.
        """
        hits, window = self.view.grid.hits, self.view.window
        triangle, distance = hits.triangle.host, hits.distance.host
        table, is_there = self.scene.geometry.scene.triangles, triangle >= 0
        of = lambda ids: np.where(is_there, ids[np.where(is_there, triangle, 0)], -1)  # noqa: E731
        layers = {
            "material": of(table.material), "mesh": of(table.mesh),
            "distance": np.where(is_there, distance, np.float32(np.inf)),
        }  # fmt: skip
        inner = window.rows_in(self._region)
        return {name: values.reshape(window.height, window.width)[inner] for name, values in layers.items()}

    # ── frames ─────────────────────────────────────────────────────────────────────────────────

    def frames(self, count: int = r.SET, region: Region | None = None) -> Iterator[LiveFrame]:
        """Yields the picture after each frame, until all of it has `count`; tells how far it is between batches.

        Closing the generator, or a listener that raises, ends it after a batch; what was gathered stays.

        Args:
            count: frames.
            region: left, top, right, bottom [pixels] of the picture, all that is asked for now; None: the whole.
        """
        while True:
            done = self.gather_frame(count, region)
            yield self.now(count, region)
            if done:
                return

    def gather_frame(self, count: int = r.SET, region: Region | None = None) -> bool:
        """Adds a frame where there are fewest, below `count`; returns whether all that is asked for has `count`.

        Args:
            count: frames.
            region: as of `frames`.
        """
        with self._room.lock:
            self._show()
            asked = self._asked(region)
            if 0 < (fewest_frames(asked) or 0) < count and not self.view.is_close:
                look_closer(self.scene, self.view, self._hides_lights)
                self._show()
                asked = self._asked(region)
            fewest = fewest_frames(asked)
            if fewest is None:
                return True
            if fewest < count:
                self._gather([g for g in asked if g.frames == fewest])
            return (fewest_frames(asked) or 0) >= count

    def _show(self) -> None:
        """Makes the view and its columns those of this picture."""
        self._room.queue.follow(self._room)  # of a frame that was cancelled
        if self.view.scene is not self.scene:
            self.view.show(self.scene)
        self._gathered.take(self._shares, self.view)
        groups_ = [g for share in self._shares.values() for g in share.groups]
        if fewest_frames(g for g in groups_ if not g.part):  # rows that came later get a first frame
            self._gather([g for g in groups_ if g.part and not g.frames])

    def _asked(self, region: Region | None) -> list[Group]:
        """The groups of a region of the picture."""
        if region is None:
            for share in self._shares.values():
                share.join()
            return [g for share in self._shares.values() for g in share.groups]
        window = _Framed(self.view.camera, self.view.size, region).window().with_border(BORDER, self.view.size)
        self._gathered.is_split = True
        return [g for share in self._shares.values() for g in share.split(window, self.view)]

    def _gather(self, chosen: list[Group]) -> None:
        """Adds a frame to groups that have as many, in batches over them."""
        for group in chosen:
            self._gathered.stale[group.part].append(group.rows)
        for p, part in enumerate(self.view.parts):
            waiting = deque(g for g in chosen if g.part == p)
            while waiting:
                batch: list[tuple[Group, int]] = []
                space = BATCH
                for group in waiting:
                    count = min(space, len(group.rows) - group.begun)
                    batch.append((group, count))
                    space -= count
                    if not space:
                        break
                rows = np.concatenate([g.rows[g.begun : g.begun + n] for g, n in batch])
                draw = Draw.of_live(batch[0][0].frames, self.scene.geometry.sources.has_even_dome)
                columns = self._gathered.columns[p]
                adder = ColumnAdder(self.scene, part, columns, draw.sends_diffuse)
                gather_batch(self.scene, self._room, part, rows, draw, adder)
                for group, count in batch:
                    group.begun += count
                    if group.begun == len(group.rows):
                        group.frames, group.begun = group.frames + 1, 0
                        waiting.popleft()
                if waiting:
                    tell()
        self._room.queue.follow(self._room)

    # ── the picture ────────────────────────────────────────────────────────────────────────────

    def now(self, count: int = r.SET, region: Region | None = None) -> LiveFrame:
        """Returns the picture as it is, under its materials.

        Args:
            count: frames of which it says the share.
            region: of the picture, whose frames it counts; None: the whole.
        """
        window = self.view.window
        out = Shared(self.scene.geometry.device, (window.height, window.width, 3), np.float32, is_clean=False)
        with self._room.lock:
            self._show()
            self._gathered.average(self.view)
            self._gathered.shade(self.view)
            self._combine(out)
            out.pull()
            number = fewest_frames(g for g in self._asked(region) if not g.part) or 0
        inner = window.rows_in(self._region)
        return LiveFrame(out.host[inner], number, min(number / max(count, 1), 1.0), self._error())

    def _combine(self, out: Shared) -> None:
        g, view = self.scene.geometry, self.view
        n, more = view.window.count, view.more or view.grid
        g.kernel("live_combine", "combine")(
            groups(n), (GROUP,), np.uint32(n), view.grid.radiance, view.grid.share, view.backdrop,
            np.int32(view.more is not None), view.first_more or view.grid.pixel, more.radiance, more.share, out,
        )  # fmt: skip

    def _error(self) -> float:
        """Mean relative error of the picture by what its frames differ in, unfiltered."""
        part, step = self.view.grid, max(1, self.view.grid.count // JUDGED)
        rows = np.arange(0, part.count, step)
        self._gathered.columns[0].sums.pull()
        frames = self._gathered.columns[0].sums.host[rows, r.FRAMES]
        rows, frames = rows[frames > 1], frames[frames > 1]
        if not len(rows):
            return float("inf")
        moments = self._gathered.columns[0].moments
        moments.pull()
        mean, square = (moments.host[rows] / frames[:, None]).T
        error = np.sqrt(np.maximum(square - mean * mean, 0) / (frames - 1))
        usual = mean.mean()
        return float((error / np.maximum(mean, 0.02 * usual + 1e-12)).mean())


def emission_of(geometry: Geometry, field: LightField) -> F32:
    """Returns what the elements (N,) of a light field emit under the materials of a geometry (N, 3)."""
    e = field.elements
    return np.asarray(SurfaceEmission(geometry.scene)(e.triangle, e.barycentric), np.float32)
