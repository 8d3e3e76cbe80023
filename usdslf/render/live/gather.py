"""Light columns of the rows of a view, frame by frame: the host's part of kernels/live_gather.cl."""

from __future__ import annotations

import threading
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from usdslf.elements.lookup import BLEND
from usdslf.gpu.launch import GROUP, groups
from usdslf.gpu.shared import Shared
from usdslf.render.guide import SHARE
from usdslf.render.live import records as r
from usdslf.render.live.closer import counting
from usdslf.render.live.scene import Geometry, Hits, LiveScene, Shadows
from usdslf.render.live.view import Rows
from usdslf.render.settings import MAX_DEPTH
from usdslf.sampling.low_discrepancy import random_shifts, scrambled_points, sobol_points

SHARED_FRAMES = 4  # in which all tiles draw the same numbers, so that filtered light has no noise
CHOICES = 16  # sets of numbers of specular lobes, of which one is taken
SHARED_SIZES = (16, 32, 64, 128, 256, 512)  # numbers that the samples of a tile may share
BATCH = 1 << 16  # rows that are gathered at once


class Columns:
    """Sums of the light columns of some rows, on the device."""

    def __init__(self, geometry: Geometry, count: int) -> None:
        device = geometry.device
        self.sums = Shared(device, (max(count, 1), r.COLUMNS), np.float32)
        self.moments = Shared(device, (max(count, 1), 2), np.float32)


class PathRoom:
    """Room for 2 * BATCH rays, and for following some of them."""

    def __init__(self, geometry: Geometry) -> None:
        device = geometry.device
        self.lock = threading.RLock()  # of all that works with it
        make = lambda shape, dtype=np.float32: Shared(device, shape, dtype)  # noqa: E731
        self.lobes, self.paths = Hits(device, 2 * BATCH), Hits(device, 2 * BATCH)
        self.path_shadows = Shadows(device, 2 * BATCH)
        self.arrived, self.surface = make((2 * BATCH, 8)), make((2 * BATCH, r.SURFACE))
        self.state, self.path_state = make((2 * BATCH, r.PATH)), make((2 * BATCH, r.PATH))
        self.more_paths, self.more_state = Hits(device, 2 * BATCH), make((2 * BATCH, r.PATH))
        self.entry, self.weight = make((2 * BATCH,), np.uint32), make((2 * BATCH, BLEND))
        self.elements = make((2 * BATCH, BLEND), np.uint32)
        self.followed, self.who = make((2 * BATCH,), np.uint8), make((2 * BATCH,), np.int32)
        self.all = counting(device, 2 * BATCH)


class GatherRoom(PathRoom):
    """Room for gathering a batch of rows, and the numbers that frames are drawn by."""

    def __init__(self, geometry: Geometry) -> None:
        """Makes room for BATCH rows and their rays."""
        super().__init__(geometry)
        device, streams = geometry.device, geometry.sources.streams
        self._device, self._streams = device, streams
        make = lambda shape, dtype=np.float32: Shared(device, shape, dtype)  # noqa: E731
        self.to_sources = Shadows(device, max(streams, 1) * BATCH)
        self.shone, self.drawn = make((max(streams, 1) * BATCH, 8)), make((2 * BATCH, r.DRAWN_RAY))
        self.rows = make((BATCH,), np.uint32)
        self._numbers: tuple[tuple[int, int, bool], Any] = ((-1, 0, False), None)

    def numbers(self, draw: Draw) -> Any:
        """Returns numbers (streams + 2, draw.count, 4) of [0, 1)."""
        key = draw.turn, draw.count, draw.is_scrambled
        if self._numbers[0] != key:
            rng, streams = np.random.default_rng((20130, draw.turn)), self._streams + 2
            shifts = random_shifts(2 * streams, rng)
            shifts[2 * self._streams] = _even_tailed(draw)  # of the specular lobe
            u = scrambled_points(draw.count, shifts[:, 0]) if draw.is_scrambled else sobol_points(0, draw.count, shifts)
            u = u.reshape(streams, 2, draw.count, 2)
            # the second pair in another order than the first, so that the two have nothing in common
            u[:, 1] = np.stack([pair[rng.permutation(draw.count)] for pair in u[:, 1]])
            both = np.concatenate([u[:, 0], u[:, 1]], -1).astype(np.float32)
            self._numbers = key, self._device.upload(np.minimum(both, np.float32(1 - 2**-24)))
        return self._numbers[1]


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
    scene: LiveScene, room: GatherRoom, part: Rows, rows: NDArray[np.uint32], draw: Draw, add: Callable[[int], None]
) -> None:
    """Gathers one ray towards each source, and one of each lobe, for some rows of a part.

    Args:
        rows: (n,) of the part, BATCH at most; they stand in the room's.
        draw: which numbers they take.
        add: what is done with what has come to the room, of the first n.
    """
    g = scene.geometry
    count, streams = len(rows), g.sources.streams
    room.rows.host[:count] = rows
    room.rows.push()
    sends_diffuse = np.int32(draw.sends_diffuse)
    shared, field = scene.arguments(), scene.field_arguments()
    lobes, n = room.lobes, np.uint32(count)
    g.kernel("live_gather", "draw_first")(
        groups(count), (GROUP,), n, room.rows, np.uint32(draw.count), np.uint32(draw.stride), np.uint32(draw.shift),
        np.uint32(draw.flip), np.uint32(draw.near_mask), np.uint32(draw.turn % r.ROUNDS), np.int32(draw.is_shared),
        sends_diffuse, part.surface, part.place, part.sharp_place, part.identity, room.numbers(draw),
        *shared, scene.light.guide_d, g.tables.frames_d, np.float32(SHARE), *room.to_sources.arguments, room.shone,
        lobes.origin, lobes.direction, lobes.length, room.drawn,
    )  # fmt: skip
    if streams:
        room.to_sources.trace(g.tracer, streams * count)
    sent = 2 * count if draw.sends_diffuse else count
    lobes.trace(g.tracer, sent)
    _find_elements(scene, room, sent, draw.depth > 0)
    g.kernel("live_gather", "arrive_first")(
        groups(sent), (GROUP,), np.uint32(sent), np.int32(draw.depth > 0), *shared, *field, lobes.origin,
        lobes.direction, lobes.length, lobes.triangle, lobes.u, lobes.v, lobes.distance, room.drawn,
        room.entry, room.elements, room.weight, n, room.rows, part.identity, room.arrived, room.state, room.followed,
    )  # fmt: skip
    follow(scene, room, sent, draw.depth, draw.seed)
    add(count)
    g.device.finish()  # before the room is written to again


def _find_elements(scene: LiveScene, room: GatherRoom, sent: int, may_follow: bool) -> None:
    """Names the elements that the first rays of the lobes meet, where the light field answers them."""
    g, lobes, n, t = scene.geometry, room.lobes, np.uint32(sent), scene.geometry.tables
    g.kernel("live_entries", "entries_of_rays")(
        groups(sent), (GROUP,), n, np.int32(may_follow), np.float32(scene.light.footprint), lobes.direction,
        lobes.length, lobes.triangle, lobes.u, lobes.v, lobes.distance, room.drawn, t.face_normal_d,
        t.cells_of_triangle_d, t.entry_of_cell_d, t.cell_count, room.entry,
    )  # fmt: skip
    g.kernel("live_entries", "blends_of_rays")(
        groups(sent), (GROUP,), n, room.entry, lobes.origin, lobes.direction, lobes.distance, t.elements_of_entry_d,
        t.position_d, room.elements, room.weight,
    )  # fmt: skip


def add_frame(
    scene: LiveScene, room: GatherRoom, part: Rows, columns: Columns, sends_diffuse: bool
) -> Callable[[int], None]:
    """Returns what adds a frame to the columns of the rows that stand in the room."""
    g, lobes = scene.geometry, room.lobes

    def add(count: int) -> None:
        g.kernel("live_gather", "add_frame")(
            groups(count), (GROUP,), np.uint32(count), room.rows, np.int32(g.sources.streams), np.int32(sends_diffuse),
            part.surface, room.to_sources.length, room.to_sources.blocked, room.shone, lobes.length, room.drawn,
            room.arrived, scene.light.arriving_d, columns.sums, columns.moments,
        )  # fmt: skip

    return add


def follow(scene: LiveScene, room: PathRoom, sent: int, most: int, seed: int) -> None:
    """Follows rays that the light field has no good answer for, and adds what they bring to what has arrived.

    Args:
        room: its first `sent` rays have met something, and it says which of them are followed.
        most: surfaces that each is followed to.
        seed: of what they draw.
    """
    g = scene.geometry
    shared, field = scene.arguments(), scene.field_arguments()
    source, state, count = room.lobes, room.state, sent
    spare, spare_state = room.paths, room.path_state
    for depth in range(1, most + 1):
        room.followed.pull()
        who = np.flatnonzero(room.followed.host[:count])
        count = len(who)
        if not count:
            return
        room.who.host[:count] = who
        room.who.push()
        n = np.uint32(count)
        g.kernel("live_gather", "gather_paths")(
            groups(count), (GROUP,), n, room.who, source.direction, source.triangle, source.u, source.v, state,
            spare.direction, spare.triangle, spare.u, spare.v, spare_state, spare.least_roughness,
        )  # fmt: skip
        scene.evaluate(spare, room.all, count, room.surface)
        shadows = room.path_shadows
        g.kernel("live_gather", "scatter")(
            groups(count), (GROUP,), n, np.uint32((seed * 8 + depth) * 7919 % 2**32), room.surface, *shared,
            spare_state, *shadows.arguments, spare.origin, spare.direction, spare.length,
        )  # fmt: skip
        shadows.trace(g.tracer, count)
        spare.trace(g.tracer, count)
        g.kernel("live_gather", "arrive_on_path")(
            groups(count), (GROUP,), n, np.int32(depth < most), *shared, *field, spare.origin, spare.direction,
            spare.length, spare.triangle, spare.u, spare.v, spare.distance, shadows.length, shadows.blocked,
            spare_state, room.arrived, room.followed,
        )  # fmt: skip
        if depth == 1:  # the rays of the first surfaces are done with; their lengths and weights are kept apart
            source, state, spare, spare_state = spare, spare_state, room.more_paths, room.more_state
        else:
            source, state, spare, spare_state = spare, spare_state, source, state
