"""The further rows of a view: other places of pixels at edges, and what is behind what can be seen through."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from usdslf.gpu.device import Device
from usdslf.gpu.launch import GROUP, groups
from usdslf.gpu.shared import Shared
from usdslf.rays import points_at
from usdslf.render.live import records as r
from usdslf.render.live.scene import Hits, LiveScene
from usdslf.render.live.view import Rows, View, fill_rows, fill_soft, find_alike, see_lights, send_rays
from usdslf.render.settings import LAYERS
from usdslf.scene.records import F32

PLACES = ((0.375, 0.125), (0.875, 0.375), (0.125, 0.625), (0.625, 0.875))
"""Where pixels at edges are looked at beside their middles: rooks, no two in one row or column."""


@dataclass
class _Found:
    """Rows that were found: pixel, share of it, and hits (triangle, u, v, distance, direction)."""

    pixel: list[NDArray] = field(default_factory=list)
    share: list[F32] = field(default_factory=list)
    hits: list[tuple[NDArray, ...]] = field(default_factory=list)

    def add(self, hits: Hits, rows: NDArray, pixel: NDArray, share: NDArray) -> None:
        """Takes some rows of hits; pixel and share are of these."""
        self.pixel.append(pixel)
        self.share.append(share.astype(np.float32))
        arrays = hits.triangle, hits.u, hits.v, hits.distance, hits.direction
        self.hits.append(tuple(a.host[rows].copy() for a in arrays))


@dataclass
class _Layer:
    """Surfaces that rays met, of m rays."""

    hits: Hits
    surface: Shared
    pixel: NDArray  # (m,)
    through: F32  # (m,) share of its pixel that is seen of each


def look_closer(scene: LiveScene, view: View, hide_lights: bool = False) -> None:
    """Adds the further rows to a view; where it is cancelled, the view is as it was."""
    view.backdrop.pull()
    share, backdrop = view.grid.share.host.copy(), view.backdrop.host.copy()
    try:
        _look_closer(scene, view, hide_lights)
    except BaseException:
        view.grid.share.host[:], view.backdrop.host[:] = share, backdrop
        raise
    finally:
        view.grid.share.push()
        view.backdrop.push()
    view.is_close = True


def _look_closer(scene: LiveScene, view: View, hide_lights: bool) -> None:
    g, n = scene.geometry, view.window.count
    edge = Shared(g.device, (n,), np.uint8)
    g.kernel("live_combine", "find_edges")(
        groups(n), (GROUP,), np.uint32(n), np.int32(view.window.width), np.int32(view.window.height), view.grid.guide,
        edge,
    )  # fmt: skip
    for a in (edge, view.grid.surface):
        a.pull()
    found = _Found()
    grid = _Layer(view.grid.hits, view.grid.surface, np.arange(n), np.ones(n, np.float32))
    view.grid.share.host[:] = _look_behind(scene, view, grid, found, hide_lights)
    at = np.flatnonzero(edge.host)
    if len(at):
        _look_at_edges(scene, view, at, found, hide_lights)
    if found.pixel:
        _add(scene, view, found)


def _look_behind(scene: LiveScene, view: View, layer: _Layer, found: _Found, hide_lights: bool) -> F32:
    """Returns the shares of a layer's rows, and adds what is behind them to what was found and to the backdrop."""
    g, first = scene.geometry, None
    if all(m.is_opaque for m in scene.materials.materials):
        return layer.through
    for _ in range(LAYERS):
        cover = layer.surface.host[: len(layer.pixel), r.COVER]
        is_there = layer.surface.host[: len(layer.pixel), r.MATERIAL] >= 0
        opacity = np.abs(cover)
        share = np.where(np.signbit(cover), layer.through * opacity, layer.through)
        if first is None:
            first = share
        else:
            at = np.flatnonzero(is_there)
            found.add(layer.hits, at, layer.pixel[at], share[at])
        rows = np.flatnonzero(is_there & (opacity < 1 - 1e-3))
        if not len(rows):
            break
        through = (layer.through * (1 - opacity))[rows]
        hits, pixel = _onwards(scene, layer.hits, rows), layer.pixel[rows]
        hits.trace(g.tracer, len(rows), stop_at_translucent=True)
        if not hide_lights:
            seen = see_lights(scene, hits, len(rows))
            np.add.at(view.backdrop.host, pixel, through[:, None] * seen.host)
        hits.distance.host[:] += layer.hits.distance.host[rows]
        hits.distance.push()
        layer = _Layer(hits, _surfaces(scene, hits, len(rows)), pixel, through)
    assert first is not None
    return first.astype(np.float32)


def _onwards(scene: LiveScene, hits: Hits, rows: NDArray) -> Hits:
    """Rays onwards from behind what some rays hit."""
    g, t = scene.geometry, scene.geometry.scene.triangles
    triangle, direction = hits.triangle.host[rows], hits.direction.host[rows]
    met = points_at(t.positions, triangle, np.stack([hits.u.host[rows], hits.v.host[rows]], 1))
    normal = t.face_normals[triangle]
    ahead = np.where((normal * direction).sum(1, keepdims=True) < 0, -normal, normal)
    out = Hits(g.device, len(rows))
    out.origin.host[:] = g.tracer.offset_points(met, ahead, triangle)
    out.direction.host[:], out.length.host[:] = direction, 1e37
    for a in (out.origin, out.direction, out.length):
        a.push()
    return out


def _surfaces(scene: LiveScene, hits: Hits, count: int) -> Shared:
    surface = Shared(scene.geometry.device, (count, r.SURFACE), np.float32)
    scene.evaluate(hits, counting(scene.geometry.device, count), count, surface)
    surface.pull()
    return surface


def counting(device: Device, count: int) -> Shared:
    """Returns the rows 0 .. count - 1, for kernels."""
    rows = Shared(device, (count,), np.uint32)
    rows.host[:] = np.arange(count)
    rows.push()
    return rows


def _look_at_edges(scene: LiveScene, view: View, at: NDArray, found: _Found, hide_lights: bool) -> None:
    """Looks at more places of some pixels (m,)."""
    g, k = scene.geometry, len(PLACES)
    share, pixel, m = np.float32(1 / (k + 1)), np.repeat(at, k), k * len(at)
    view.grid.share.host[at] *= share
    view.backdrop.host[at] *= share
    is_edge = np.zeros(view.window.count, bool)
    is_edge[at] = True
    for shares, pixels in zip(found.share, found.pixel):
        shares[is_edge[pixels]] *= share
    places = Shared(g.device, (m, 2), np.float32)
    places.host[:] = np.stack(view.window.places(pixel), -1) + np.tile(PLACES, (len(at), 1))
    places.push()
    hits = Hits(g.device, m)
    send_rays(scene, view.camera, view.size, hits, m, places)
    hits.trace(g.tracer, m, stop_at_translucent=True)
    if not hide_lights:
        seen = see_lights(scene, hits, m)
        np.add.at(view.backdrop.host, pixel, share * seen.host)
    layer = _Layer(hits, _surfaces(scene, hits, m), pixel, np.full(m, share, np.float32))
    shares = _look_behind(scene, view, layer, found, hide_lights)
    rows = np.flatnonzero(hits.triangle.host >= 0)
    found.add(hits, rows, pixel[rows], shares[rows])


def _add(scene: LiveScene, view: View, found: _Found) -> None:
    """Makes the further rows of a view of what was found."""
    device = scene.geometry.device
    pixel = np.concatenate(found.pixel)
    if not len(pixel):
        return
    order = np.argsort(pixel, kind="stable")
    pixel = pixel[order]
    hits = Hits(device, len(pixel))
    rooms = hits.triangle, hits.u, hits.v, hits.distance, hits.direction
    for room, values in zip(rooms, zip(*found.hits)):
        room.host[:] = np.concatenate(values)[order]
        room.push()
    nth = np.arange(len(pixel)) - np.searchsorted(pixel, pixel) + 1
    rows = Rows(scene, hits, view.window, view.size[0], pixel, nth, np.concatenate(found.share)[order])
    fill_rows(scene, rows, view.pixel_size)
    find_alike(scene, rows, view.grid, view.window)
    fill_soft(scene, rows)
    first = Shared(device, (view.window.count + 1,), np.uint32, is_clean=False)
    first.host[:] = np.searchsorted(pixel, np.arange(len(first.host)))
    first.push()
    view.more, view.first_more = rows, first
