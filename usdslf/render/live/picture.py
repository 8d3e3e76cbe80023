"""LivePicture: what a camera sees, at once and then better, and what it sees after a material changed.

    rows of a view -> columns of light, frame by frame -> filter -> colours -> pixels

Light is kept without the surface's colours, so a change of diffuse or specular reflectance costs no ray.  A change of
roughness gathers the rows of that material anew.  Frames add up to what the final picture (render/picture.py)
estimates: sources and lobes are drawn as there, rays that the light field answers badly are followed as there.  What is
there at once and is not gathered, the diffuse light of the elements, loses its weight frame by frame.

Source: Nguyen et al. 2013, 6.4; Keller and Heidrich 2001 (interleaved sampling); Veach and Guibas 1995.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from usdslf.errors import InputError
from usdslf.gpu.shared import Shared
from usdslf.light_field.light_field import LightField
from usdslf.lights.sources import LightSet
from usdslf.progress import tell
from usdslf.render.live import records as r
from usdslf.render.live.closer import look_closer
from usdslf.render.live.gather import BATCH, Columns, GatherRoom, gather_batch
from usdslf.render.live.materials import MaterialTable
from usdslf.render.live.scene import GROUP, Geometry, LiveScene, SentLight, fresnel_shares, groups
from usdslf.render.live.view import Rows, View, look
from usdslf.render.picture import LitScene
from usdslf.scene.records import F32, Camera, Material

WINDOW = 8  # pixels on a side that the filter looks at: those that share a set of numbers


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


@dataclass
class _Group:
    """Rows of a part of a view that have the same number of frames."""

    part: int
    rows: Shared
    frames: int = 0
    begun: int = 0  # rows that have had the next frame already


@dataclass
class _Gathered:
    """What was gathered for a view under some lobes; pictures that differ in colours alone share it."""

    columns: list[Columns]
    groups: list[_Group]
    light: list[tuple[Shared, Shared, Shared]]  # of each part: mean, filtered along rows, filtered
    stale: list[tuple[int, Shared]]  # parts and rows of them whose light has changed since it was averaged

    def frames(self) -> int:
        """Frames that all rows have."""
        return min((g.frames for g in self.groups), default=0)


@dataclass(frozen=True, eq=False)
class LivePicture:
    """A picture of a scene that gets better frame by frame.  Never changes but for that.

    Attributes:
        scene: with its materials and its light.
        view: what the camera sees.
    """

    scene: LiveScene
    view: View
    _room: GatherRoom = field(repr=False)
    _gathered: _Gathered = field(repr=False)
    _hides_lights: bool = False

    @staticmethod
    def of(
        lit: LitScene, lights: LightSet, camera: Camera, size: tuple[int, int], hide_lights: bool = False
    ) -> LivePicture:
        """Looks at a lit scene.

        Args:
            lit: a scene that has a light field.
            lights: all that shines in it.
            camera: that sees it.
            size: width and height [pixels].
            hide_lights: lights and domes are not seen by the camera.

        Returns: the picture, without a frame yet.

        Raises: InputError for a size that cannot be.
        """
        assert isinstance(lit.light_field, LightField)
        geometry = Geometry.of(lit.device, lit.scene, lit.tracer, lights, lit.light_field)
        materials = MaterialTable.of(geometry.pool, lit.scene.materials)
        scene = LiveScene(geometry, materials, SentLight.of(geometry, lit.light_field))
        return LivePicture._start(scene, camera, size, GatherRoom(geometry), hide_lights)

    @staticmethod
    def _start(
        scene: LiveScene, camera: Camera, size: tuple[int, int], room: GatherRoom, hide_lights: bool
    ) -> LivePicture:
        if min(size) < 1:
            raise InputError(f"a picture of {size[0]} x {size[1]} pixels cannot be rendered; give a positive size")
        view = look(scene, camera, size, hide_lights)
        return LivePicture(scene, view, room, _all_new(scene, [view.grid]), hide_lights)

    # ── other pictures ─────────────────────────────────────────────────────────────────────────

    def seen_by(self, camera: Camera, size: tuple[int, int] | None = None) -> LivePicture:
        """Returns the picture of another camera, or of another size; what is on the device is shared.

        Args:
            camera: that sees the scene.
            size: width and height [pixels]; None: as this one.
        """
        return LivePicture._start(self.scene, camera, size or self.view.size, self._room, self._hides_lights)

    def with_materials(self, materials: Sequence[Material], light: LightField | None = None) -> LivePicture:
        """Returns the picture under other materials.

        Where only colours differ nothing is gathered anew; where roughness, coat or normals do, the rows of these
        materials are.  Others see the change in their reflections when the light field is given.  A surface shows what
        it emits now; as a source of light it stays what it was.

        Args:
            materials: as many as the scene has; those that are unchanged should be the same objects.
            light: the light field under them; None: as it is.

        Raises: InputError where what can be seen through differs.
        """
        scene = self.scene
        table = MaterialTable.of(scene.geometry.pool, materials)
        sent = scene.light if light is None else SentLight.of(scene.geometry, light)
        other = LiveScene(scene.geometry, table, sent)
        if scene.materials.opacity != table.opacity:
            raise InputError("a live picture cannot change what is seen through; begin another one of the edited shot")
        gathered = self._gathered
        glossy = [m for m, (a, b) in enumerate(zip(scene.materials.gloss, table.gloss)) if a != b]
        with self._room.lock:
            if light is not None:
                gathered = _all_new(other, self.view.parts)
            elif glossy:
                gathered = self._without(np.array(glossy))
        return replace(self, scene=other, _gathered=gathered)

    def _without(self, materials: NDArray) -> _Gathered:
        """What was gathered, but for the rows of some materials."""
        device, out, old = self.scene.geometry.device, _all_new(self.scene, self.view.parts), self._gathered
        out.groups.clear()
        out.stale[:] = old.stale
        for p, part in enumerate(self.view.parts):
            part.surface.pull()
            shown = part.surface.host[: part.count, r.MATERIAL]
            changed = np.isin(shown, materials)
            device.copy(out.columns[p].sums_d, old.columns[p].sums_d)
            old.columns[p].moments.pull()
            out.columns[p].moments.host[:] = old.columns[p].moments.host
            out.columns[p].moments.push()
            for new, known in zip(out.light[p], old.light[p]):
                device.copy(new, known)
            rows = part.listed(np.flatnonzero(changed).astype(np.uint32))
            if rows is not None:
                self.scene.geometry.kernel("live_combine", "forget_rows")(
                    groups(len(rows.host)), (GROUP,), np.uint32(len(rows.host)), rows, out.columns[p].sums_d,
                    out.columns[p].moments,
                )  # fmt: skip
                out.groups.append(_Group(p, rows))
                out.stale.append((p, rows))
            for group in old.groups:
                if group.part == p:
                    kept = part.listed(group.rows.host[~changed[group.rows.host]])
                    if kept is not None:
                        out.groups.append(_Group(p, kept, group.frames))
        return out

    def seen(self) -> dict[str, NDArray]:
        """Returns what the middles of pixels show, layers (height, width): `material` and `mesh`, indices of the scene,
        -1 where nothing is seen, and `distance` from the eye [stage units], inf there; for picking.
        """
        grid, (width, height) = self.view.grid, self.view.size
        triangle, distance = grid.hits.triangle.host, grid.hits.distance.host
        table, is_there = self.scene.geometry.scene.triangles, triangle >= 0
        of = lambda ids: np.where(is_there, ids[np.where(is_there, triangle, 0)], -1)  # noqa: E731
        layers = {
            "material": of(table.material), "mesh": of(table.mesh),
            "distance": np.where(is_there, distance, np.float32(np.inf)),
        }  # fmt: skip
        return {name: values.reshape(height, width) for name, values in layers.items()}

    # ── frames ─────────────────────────────────────────────────────────────────────────────────

    def frames(self, count: int = r.SET) -> Iterator[LiveFrame]:
        """Yields the picture after each frame, until all of it has `count`; tells how far it is between batches.

        Closing the generator, or a listener that raises, ends it after a batch; what was gathered stays.
        """
        while True:
            done = self.gather_frame(count)
            yield self.now(count)
            if done:
                return

    def gather_frame(self, count: int = r.SET) -> bool:
        """Adds a frame where there are fewest, below `count`; returns whether all of the picture has `count`.

        Args:
            count: frames.
        """
        with self._room.lock:
            self._show()
            self._complete()
            if 0 < self._gathered.frames() < count and not self.view.is_close:
                look_closer(self.scene, self.view, self._hides_lights)
                self._complete()
            fewest = self._gathered.frames()
            if fewest < count:
                for group in [g for g in self._gathered.groups if g.frames == fewest]:
                    self._gather(group)
            return self._gathered.frames() >= count

    def _show(self) -> None:
        if self.view.scene is not self.scene:
            self.view.show(self.scene)

    def _complete(self) -> None:
        """Gives the rows that were added to the view a first frame."""
        if self.view.more is None or len(self._gathered.columns) > 1:
            return
        more = _all_new(self.scene, [self.view.more])
        self._gathered.columns += more.columns
        self._gathered.light += more.light
        self._gathered.stale.append((1, self.view.more.all))
        group = replace(more.groups[0], part=1)
        self._gathered.groups.append(group)
        self._gather(group)

    def _gather(self, group: _Group) -> None:
        part, columns = self.view.parts[group.part], self._gathered.columns[group.part]
        self._gathered.stale.append((group.part, group.rows))
        total = len(group.rows.host)
        while group.begun < total:
            gather_batch(self.scene, self._room, part, columns, group.rows, group.begun, group.frames)
            group.begun += BATCH
            if group.begun < total:
                tell()
        group.frames, group.begun = group.frames + 1, 0

    # ── the picture ────────────────────────────────────────────────────────────────────────────

    def now(self, count: int = r.SET) -> LiveFrame:
        """Returns the picture as it is, under its materials.

        Args:
            count: frames of which it says the share.
        """
        width, height = self.view.size
        out = Shared(self.scene.geometry.device, (height, width, 3), np.float32)
        with self._room.lock:
            self._show()
            self._complete()
            self._average()
            self._combine(out)
            out.pull()
        number = self._gathered.frames()
        return LiveFrame(out.host, number, min(number / max(count, 1), 1.0), self._error())

    def _average(self) -> None:
        """Light of all frames so far, filtered while they are few."""
        g, (width, height) = self.scene.geometry, self.view.size
        light, stale = self._gathered.light, _distinct(self._gathered.stale, self.view.parts)
        if not stale:
            return
        fresnel_d = g.device.upload(fresnel_shares(g.model))
        for p, rows in stale:
            part, n = self.view.parts[p], len(rows.host)
            g.kernel("live_combine", "mean_columns")(
                groups(n), (GROUP,), np.uint32(n), rows, part.surface, self._gathered.columns[p].sums_d, part.soft_d,
                fresnel_d, light[p][0],
            )  # fmt: skip
        sizes, grid_guide = (np.int32(width), np.int32(height)), self.view.grid.guide
        for step in (0, 1):  # along rows, which only the grid has, then along columns
            for p, rows in stale if step else [(p, rows) for p, rows in stale if p == 0]:
                part, n = self.view.parts[p], len(rows.host)
                g.kernel("live_combine", "filter_light")(
                    groups(n), (GROUP,), np.uint32(n), rows, *sizes, np.int32(1 - step), np.int32(step),
                    np.int32(WINDOW), np.int32(p == 0), np.int32(step), part.pixel, part.guide, light[p][0],
                    grid_guide, light[0][step], light[p][step + 1],
                )  # fmt: skip
        g.device.finish()
        self._gathered.stale.clear()

    def _combine(self, out: Shared) -> None:
        g, view, light = self.scene.geometry, self.view, self._gathered.light
        n = view.size[0] * view.size[1]
        more, first, more_light = (view.grid, view.grid.pixel, light[0][2])
        if view.more is not None and view.first_more is not None:
            more, first, more_light = view.more, view.first_more, light[1][2]
        g.kernel("live_combine", "combine")(
            groups(n), (GROUP,), np.uint32(n), view.grid.surface, light[0][2], view.grid.share, view.backdrop,
            np.int32(view.more is not None), first, more.surface, more_light, more.share, out,
        )  # fmt: skip

    def _error(self) -> float:
        """Mean relative error of the picture by what its frames differ in, unfiltered."""
        moments, part = self._gathered.columns[0].moments, self.view.grid
        frames = self._gathered.frames()
        if frames < 2:
            return float("inf")
        moments.pull()
        mean, square = (moments.host[: part.count] / frames).T
        error = np.sqrt(np.maximum(square - mean * mean, 0) / (frames - 1))
        usual = mean.mean()
        return float((error / np.maximum(mean, 0.02 * usual + 1e-12)).mean())


def _all_new(scene: LiveScene, parts: list[Rows]) -> _Gathered:
    """Nothing gathered yet."""
    device = scene.geometry.device
    room = [tuple(Shared(device, (max(p.count, 1), r.LIGHT), np.float32) for _ in range(3)) for p in parts]
    return _Gathered(
        [Columns(scene.geometry, p.count) for p in parts],
        [_Group(k, p.all) for k, p in enumerate(parts)],
        [(a, b, c) for a, b, c in room],
        [(k, p.all) for k, p in enumerate(parts)],
    )


def _distinct(stale: list[tuple[int, Shared]], parts: list[Rows]) -> list[tuple[int, Shared]]:
    """Each rows once; of a part of which all are, these alone."""
    whole = {p for p, rows in stale if rows is parts[p].all}
    some = {(p, id(rows)): (p, rows) for p, rows in stale if p not in whole}
    return [(p, parts[p].all) for p in sorted(whole)] + list(some.values())
