"""Light columns of the rows of a view, frame by frame: the host's part of kernels/live_draw.cl and live_gather.cl."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from usdslf.gpu.launch import GROUP, groups
from usdslf.gpu.shared import Shared
from usdslf.render.guide import SHARE
from usdslf.render.live import records as r
from usdslf.render.live.paths import BATCH, Adder, PathQueue, PathRoom, Sent
from usdslf.render.live.scene import Geometry, LiveScene, Shadows
from usdslf.render.live.view import Rows
from usdslf.render.settings import MAX_DEPTH
from usdslf.sampling.low_discrepancy import random_shifts, scrambled_points, sobol_points

SHARED_FRAMES = 4  # in which all tiles draw the same numbers, so that filtered light has no noise
KEPT_SETS = 8  # of numbers, that bands of a picture ask for again
CHOICES = 16  # sets of numbers of specular lobes, of which one is taken
SHARED_SIZES = (16, 32, 64, 128, 256, 512)  # numbers that the samples of a tile may share


class Columns:
    """Sums of the light columns of some rows, on the device; of anything, until they are forgotten."""

    def __init__(self, geometry: Geometry, count: int) -> None:
        device = geometry.device
        make = lambda *shape: Shared(device, (max(count, 1), *shape), np.float32, is_clean=False)  # noqa: E731
        self.sums, self.moments = make(r.COLUMNS), make(2)
        self.latest = make()  # luminance of the last frame


class GatherRoom(PathRoom):
    """Room for gathering a batch of rows, and the numbers that frames are drawn by."""

    def __init__(self, geometry: Geometry) -> None:
        """Makes room for BATCH rows and their rays."""
        super().__init__(geometry)
        device, streams = geometry.device, geometry.sources.streams
        self._device, self._streams = device, streams
        make = lambda shape, dtype=np.float32: Shared(device, shape, dtype)  # noqa: E731
        self.to_sources = Shadows(device, max(streams, 1) * BATCH)
        self.shone, self.drawn = make((8, max(streams, 1) * BATCH)), make((r.DRAWN_RAY, 2 * BATCH))
        self.rows, self._rows_before = make((BATCH,), np.uint32), make((BATCH,), np.uint32)
        self.queue = PathQueue.of(geometry)
        self._numbers: dict[tuple[int, int, bool], Any] = {}

    def list_rows(self, rows: NDArray[np.uint32]) -> None:
        """Lists a batch's rows in `rows`; those of the last batch stay, for kernels that may still read them."""
        self.rows, self._rows_before = self._rows_before, self.rows
        self.rows.host[: len(rows)] = rows
        self.rows.push()

    def numbers(self, draw: Draw) -> Any:
        """Returns numbers (streams + 2, draw.count, 4) of [0, 1)."""
        key = draw.turn, draw.count, draw.is_scrambled
        if key not in self._numbers:
            rng, streams = np.random.default_rng((20130, draw.turn)), self._streams + 2
            shifts = random_shifts(2 * streams, rng)
            shifts[2 * self._streams] = _even_tailed(draw)  # of the specular lobe
            u = scrambled_points(draw.count, shifts[:, 0]) if draw.is_scrambled else sobol_points(0, draw.count, shifts)
            u = u.reshape(streams, 2, draw.count, 2)
            # the second pair in another order than the first, so that the two have nothing in common
            u[:, 1] = np.stack([pair[rng.permutation(draw.count)] for pair in u[:, 1]])
            both = np.concatenate([u[:, 0], u[:, 1]], -1).astype(np.float32)
            while len(self._numbers) >= KEPT_SETS:
                self._numbers.pop(next(iter(self._numbers)))
            self._numbers[key] = self._device.upload(np.minimum(both, np.float32(1 - 2**-24)))
        return self._numbers[key]


class FrameAdder(Adder, Protocol):
    """Adds frames, and what paths bring to them later."""

    def add_frame(self, room: GatherRoom, count: int) -> None:
        """Adds what the rays of the first `count` rows in a room met."""


@dataclass(frozen=True)
class Draw:
    """What a frame draws: a row takes number (place * stride + shift) ^ flip of a set of `count`."""

    turn: int  # which set
    count: int
    stride: int
    shift: int
    flip: int
    near_mask: int  # of places in the tile of lights that have a place
    is_scrambled: bool  # the set is, beyond a random shift
    is_shared: bool  # all tiles take the same numbers
    sends_diffuse: bool
    depth: int  # surfaces that rays are followed to which the light field has no good answer for
    seed: int

    @staticmethod
    def of_live(frame: int, has_even_dome: bool) -> Draw:
        """Of a frame of the live picture: all of a set by SET frames, and by the rows of each tile.

        The first frame follows no rays, and sends none of the diffuse lobe where nothing needs it.
        """
        return Draw(
            frame // r.SET, r.SET, 1, 0, frame % r.SET, r.SET - 1, False, frame < SHARED_FRAMES,
            frame > 0 or has_even_dome, MAX_DEPTH if frame else 0, frame,
        )  # fmt: skip


def _even_tailed(draw: Draw) -> NDArray[np.uint32]:
    """Returns the one of some shifts (2,) whose set of numbers, and whose beginnings, hold their share of the tail.

    All tiles take the same numbers, and the lobes of mirrors have long tails: one number too near the end of its axis
    sends a thirtieth of all that a picture's mirrors show to where nothing is.
    """
    shifts = random_shifts(CHOICES, np.random.default_rng((20131, draw.turn)))
    u = scrambled_points(draw.count, shifts[:, 0]) if draw.is_scrambled else sobol_points(0, draw.count, shifts)
    sizes = [n for n in SHARED_SIZES if n <= draw.count]
    tail = np.stack([-np.log1p(-np.minimum(u[:, :n, 1], 1 - 2**-24)).mean(1) for n in sizes], 1)
    chosen: NDArray[np.uint32] = shifts[np.abs((tail - 1) * sizes).max(1).argmin()]
    return chosen


def gather_batch(
    scene: LiveScene, room: GatherRoom, part: Rows, rows: NDArray[np.uint32], draw: Draw, adder: FrameAdder
) -> None:
    """Gathers one ray towards each source, and one of each lobe, for some rows of a part.

    What rays bring that have to be followed is missing until the room's queue is asked to follow them.

    Args:
        rows: (n,) of the part, BATCH at most; they stand in the room's.
        draw: which numbers they take.
        adder: of what has come to the room.
    """
    g = scene.geometry
    count, streams = len(rows), g.sources.streams
    room.list_rows(rows)
    lobes = room.lobes
    _draw(scene, room, part, count, draw)
    if streams:
        room.to_sources.trace(g.tracer, streams * count)
    sent = 2 * count if draw.sends_diffuse else count
    lobes.trace(g.tracer, sent)
    _find_elements(scene, room, (sent, 2 * count), draw.depth > 0)
    g.kernel("live_gather", "arrive_first")(
        groups(sent), (GROUP,), np.uint32(sent), np.uint32(2 * count), np.int32(draw.depth > 0), *scene.arguments(),
        *scene.field_arguments(), lobes.origin, lobes.direction, lobes.length, lobes.triangle, lobes.u, lobes.v,
        lobes.distance, room.drawn, room.entry, room.elements, room.weight, room.arrived, room.followed,
    )  # fmt: skip
    if draw.depth:
        batch = Sent(sent, count, room.rows, part.identity, room.drawn, draw.depth, draw.seed, adder)
        room.queue.take(scene, room, batch)
    adder.add_frame(room, count)  # goes on while the next batch is made ready, which waits for it before it traces rays


def _draw(scene: LiveScene, room: GatherRoom, part: Rows, count: int, draw: Draw) -> None:
    """Draws directions towards each source and of each lobe, for the first rows in the room."""
    g, streams = scene.geometry, np.int32(scene.geometry.sources.streams)
    size, lobes = groups(count), room.lobes
    rows = (
        np.uint32(count), room.rows, np.uint32(draw.count), np.uint32(draw.stride), np.uint32(draw.shift),
        np.uint32(draw.flip), np.uint32(draw.near_mask), np.uint32(draw.turn % r.ROUNDS), np.int32(draw.is_shared),
        np.int32(draw.sends_diffuse), part.surface, part.place, part.sharp_place, part.identity, room.numbers(draw),
        scene.light.guide_d, g.tables.frames_d, np.float32(SHARE),
    )  # fmt: skip
    _, _, sources, _, _, drawn, *_ = g.sources.arrays
    for k, name in enumerate(g.sources.drawn_by):
        stream = np.int32(k)
        taken = {
            "draw_flat_light": (streams, stream, sources), "draw_dome": (streams, stream, sources, drawn),
            "draw_any_source": (stream, *scene.arguments()),
        }  # fmt: skip
        g.kernel("live_draw", name)(size, (GROUP,), *rows, *taken[name], *room.to_sources.arguments, room.shone)
    rays = lobes.origin, lobes.direction, lobes.length, room.drawn
    g.kernel("live_draw", "draw_specular")(size, (GROUP,), *rows, streams, *rays)
    if draw.sends_diffuse:
        g.kernel("live_draw", "draw_diffuse")(size, (GROUP,), *rows, streams, *rays)


def _find_elements(scene: LiveScene, room: GatherRoom, rays: tuple[int, int], may_follow: bool) -> None:
    """Names the elements that rays of the lobes meet, where the light field answers them.

    Args:
        rays: how many were sent, of how many that there is room for.
    """
    g, lobes, (sent, most), t = scene.geometry, room.lobes, rays, scene.geometry.tables
    n = np.uint32(sent)
    g.kernel("live_entries", "entries_of_rays")(
        groups(sent), (GROUP,), n, np.uint32(most), np.int32(may_follow), np.float32(scene.light.footprint),
        lobes.direction, lobes.length, lobes.triangle, lobes.u, lobes.v, lobes.distance, room.drawn, t.face_normal_d,
        t.cells_of_triangle_d, t.entry_of_cell_d, t.cell_count, room.entry,
    )  # fmt: skip
    g.kernel("live_entries", "blends_of_rays")(
        groups(sent), (GROUP,), n, np.uint32(most), room.entry, lobes.origin, lobes.direction, lobes.distance,
        t.elements_of_entry_d, t.position_d, room.elements, room.weight,
    )  # fmt: skip


@dataclass(frozen=True)
class ColumnAdder:
    """Adds a frame to the columns of some rows of a part."""

    scene: LiveScene
    part: Rows
    columns: Columns
    sends_diffuse: bool

    def add_frame(self, room: GatherRoom, count: int) -> None:
        """Adds what the rays of the first `count` rows in a room met."""
        g, lobes, to = self.scene.geometry, room.lobes, self.columns
        g.kernel("live_gather", "add_frame")(
            groups(count), (GROUP,), np.uint32(count), room.rows, np.int32(g.sources.streams),
            np.int32(self.sends_diffuse), self.part.surface, room.to_sources.length, room.to_sources.blocked,
            room.shone, lobes.length, room.drawn, room.arrived, self.scene.light.arriving_d, to.sums, to.moments,
            to.latest,
        )  # fmt: skip

    def add_paths(self, queued: Shared, first: int, count: int) -> None:
        """Adds to the same frame what `count` queued paths brought."""
        g, to = self.scene.geometry, self.columns
        g.kernel("live_gather", "add_paths")(
            groups(count), (GROUP,), np.uint32(count), np.uint32(first), queued, self.part.surface,
            self.scene.light.arriving_d, to.sums, to.moments, to.latest,
        )  # fmt: skip
