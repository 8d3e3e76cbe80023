"""Rays that the light field has no good answer for, followed from surface to surface: the host's part of live_paths.cl.

Few rays of a batch are followed, and fewer from each surface on.  Those of many batches wait in a queue, so that there
are few steps, in which all processors have something to do.
"""

from __future__ import annotations

import threading
from dataclasses import dataclass, field
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from usdslf.elements.lookup import BLEND
from usdslf.gpu.launch import GROUP, groups
from usdslf.gpu.shared import Shared
from usdslf.render.live import records as r
from usdslf.render.live.closer import counting
from usdslf.render.live.scene import Geometry, Hits, LiveScene, Shadows

BATCH = 1 << 16  # rows that are gathered at once, and paths that are followed at once


class Adder(Protocol):
    """Adds what rays have brought to what rows have gathered.  It holds no room, which may hold it."""

    def add_paths(self, queued: Shared, first: int, count: int) -> None:
        """Adds to a frame what `count` queued paths brought, no two of which are of one row."""


@dataclass(frozen=True)
class Sent:
    """The rays of a batch that stand in a room.

    Attributes:
        rays: how many: one or two of each row.
        count: of rows.
        rows: (count,) their numbers.
        identity: (rows of the part,) numbers that tell them apart.
        drawn: (rays, DRAWN_RAY).
        most: surfaces that each is followed to.
        seed: of what they draw there.
        adder: of the batch's frame.
    """

    rays: int
    count: int
    rows: Shared
    identity: Shared
    drawn: Shared
    most: int
    seed: int
    adder: Adder


class PathRoom:
    """Room for 2 * BATCH rays, and for following BATCH of them."""

    def __init__(self, geometry: Geometry) -> None:
        device = geometry.device
        self.lock = threading.RLock()  # of all that works with it
        make = lambda shape, dtype=np.float32: Shared(device, shape, dtype)  # noqa: E731
        self.lobes = Hits(device, 2 * BATCH)
        self.arrived, self.state = make((2 * BATCH, 8)), make((2 * BATCH, r.PATH))
        self.followed, self.who = make((2 * BATCH,), np.uint8), make((2 * BATCH,), np.int32)
        self.entry, self.weight = make((2 * BATCH,), np.uint32), make((BLEND, 2 * BATCH))
        self.elements = make((BLEND, 2 * BATCH), np.uint32)
        self.paths, self.more_paths = Hits(device, BATCH), Hits(device, BATCH)
        self.path_shadows, self.surface = Shadows(device, BATCH), make((BATCH, r.SURFACE))
        self.path_state, self.more_state = make((BATCH, r.PATH)), make((BATCH, r.PATH))
        self.all = counting(device, BATCH)


@dataclass(frozen=True)
class Brought:
    """Where it is put what paths bring: rows of `width` floats, of which the light of surfaces is the second three."""

    rows: Shared
    width: int


@dataclass(frozen=True)
class _Waiting:
    """Some paths of a queue: of one lobe of one batch, so that no two are of one row."""

    first: int
    count: int
    adder: Adder


@dataclass
class PathQueue:
    """Rays that wait to be followed, of one scene."""

    rays: Hits
    state: Shared
    queued: Shared
    count: int = 0
    scene: LiveScene | None = None
    most: int = 0
    waiting: list[_Waiting] = field(default_factory=list)

    @staticmethod
    def of(geometry: Geometry) -> PathQueue:
        """Makes room for all the rays of a batch at least."""
        make = lambda *shape: Shared(geometry.device, shape, np.float32, is_clean=False)  # noqa: E731
        return PathQueue(Hits(geometry.device, 2 * BATCH), make(2 * BATCH, r.PATH), make(2 * BATCH, r.QUEUED))

    def take(self, scene: LiveScene, room: PathRoom, sent: Sent) -> None:
        """Takes those rays of a room that are to be followed; without space for them, follows others first."""
        g, rows = scene.geometry, sent.count
        room.followed.pull()
        who = np.flatnonzero(room.followed.host[: sent.rays])
        if self.count + len(who) > len(self.queued.host) or (self.scene, self.most) != (scene, sent.most):
            self.follow(room)
        n, first, lobes = len(who), self.count, room.lobes
        if not n:
            return
        room.who.host[:n] = who
        room.who.push()
        to = self.rays
        g.kernel("live_paths", "queue_paths")(
            groups(n), (GROUP,), np.uint32(n), room.who, np.uint32(first), np.uint32(sent.seed % 2**32),
            np.uint32(rows), sent.rows, sent.identity, sent.drawn, lobes.direction, lobes.triangle, lobes.u, lobes.v,
            to.direction, to.triangle, to.u, to.v, self.state, self.queued,
        )  # fmt: skip
        specular = int(np.searchsorted(who, rows))
        parts = (first, specular), (first + specular, n - specular)
        self.waiting += [_Waiting(*part, sent.adder) for part in parts if part[1]]
        self.scene, self.most, self.count = scene, sent.most, first + n

    def follow(self, room: PathRoom) -> None:
        """Follows all that wait, in a room, and adds what they bring.  If it is cancelled, they wait on."""
        if self.scene is None:
            return
        self.scene.geometry.device.finish()  # with the room that is written to
        who = np.arange(self.count, dtype=np.int32)
        follow(self.scene, room, (self.rays, self.state), who, Brought(self.queued, r.QUEUED), self.most)
        for paths in self.waiting:
            paths.adder.add_paths(self.queued, paths.first, paths.count)
        self.scene.geometry.device.finish()  # before the queue is written to again
        self.waiting.clear()
        self.scene, self.count = None, 0


def follow(
    scene: LiveScene, room: PathRoom, rays: tuple[Hits, Shared], who: NDArray, brought: Brought, most: int
) -> None:  # fmt: skip
    """Follows rays that the light field has no good answer for.

    Args:
        rays: that have met something, and their states.
        who: (n,) which of them are followed.
        brought: where it is put what they bring.
        most: surfaces that each is followed to.
    """
    for first in range(0, len(who), BATCH):
        _follow_some(scene, room, rays, who[first : first + BATCH], brought, most)


def _follow_some(
    scene: LiveScene, room: PathRoom, rays: tuple[Hits, Shared], who: NDArray, brought: Brought, most: int
) -> None:  # fmt: skip
    """Follows BATCH rays at most."""
    g = scene.geometry
    shared, of_field, shadows = scene.arguments(), scene.field_arguments(), room.path_shadows
    ways = (room.paths, room.path_state), (room.more_paths, room.more_state)
    (source, state), count = rays, len(who)
    for depth in range(1, most + 1):
        if depth > 1:
            room.followed.pull()
            who = np.flatnonzero(room.followed.host[:count])
            count = len(who)
        if not count:
            return
        met, met_state = ways[depth % 2]
        room.who.host[:count] = who
        room.who.push()
        n = np.uint32(count)
        g.kernel("live_paths", "gather_paths")(
            groups(count), (GROUP,), n, room.who, source.direction, source.triangle, source.u, source.v, state,
            met.direction, met.triangle, met.u, met.v, met_state, met.least_roughness,
        )  # fmt: skip
        scene.evaluate(met, room.all, count, room.surface)
        g.kernel("live_paths", "scatter")(
            groups(count), (GROUP,), n, np.uint32(depth), room.surface, *shared, met_state, *shadows.arguments,
            met.origin, met.direction, met.length,
        )  # fmt: skip
        shadows.trace(g.tracer, count)
        met.trace(g.tracer, count)
        g.kernel("live_paths", "arrive_on_path")(
            groups(count), (GROUP,), n, np.int32(depth < most), np.int32(depth == 1), np.uint32(brought.width),
            *shared, *of_field, met.origin, met.direction, met.length, met.triangle, met.u, met.v, met.distance,
            shadows.length, shadows.blocked, met_state, brought.rows, room.followed,
        )  # fmt: skip
        source, state = met, met_state
