"""Scope mask: what of the picture a stroke would change by the scope that it is given, before that is accepted."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from usdslf import Camera, Shot, Stroke, camera_rays, similarity_to

SIMILAR = 0.5  # similarity from which on a place changes visibly


def scope_mask(
    shot: Shot, stroke: Stroke, scope: str, material: str, camera: Camera, size: tuple[int, int]
) -> NDArray[np.float32]:
    """Returns how much of the change each pixel would show (h, w), 0..1.

    Args:
        shot: that the stroke is on.
        stroke: whose scope is asked about.
        scope: stroke | prim | material | similar.
        material: path of what changes.
        camera: relative to `Scene.origin`.
        size: width and height [pixels].

    Raises: StrokeError for a stroke that lies on no surface, where scope is `similar`.
    """
    w, h = size
    x, y = np.meshgrid((np.arange(w) + 0.5) / w, (np.arange(h) + 0.5) / h)
    rays = camera_rays(camera, np.stack([x, y], -1).reshape(-1, 2), w / h)
    hits = shot.tracer.intersect(rays.origin, rays.direction)
    is_seen = (hits.triangle >= 0) & (hits.distance <= rays.limit)
    table, triangle = shot.scene.triangles, np.maximum(hits.triangle, 0)
    paths = [m.path for m in shot.scene.materials]
    shows = is_seen & np.array([p == material for p in paths])[table.material[triangle]]
    if scope in ("prim", "stroke"):
        named = np.array([m.path in stroke.surfaces for m in shot.scene.meshes])
        shows &= named[table.mesh[triangle]]
    found = shows.astype(np.float32)
    if scope == "stroke":
        points = rays.origin + rays.direction * np.where(shows, hits.distance, 0)[:, None]
        found *= _near(stroke.seen_from(shot.scene.origin), points, shows)
    if scope == "similar":
        like = similarity_to(shot, stroke, camera, size).reshape(-1)
        found = np.maximum(found, np.where(like >= SIMILAR, like, 0)).astype(np.float32)
    return found.reshape(h, w)


def _near(stroke: Stroke, points: NDArray, asked: NDArray[np.bool_]) -> NDArray[np.float32]:
    """Whether points (n, 3) lie under the brush of a stroke."""
    found = np.zeros(len(points), np.float32)
    rows = np.flatnonzero(asked)
    for first in range(0, len(rows), 4096):
        some = rows[first : first + 4096]
        gap = np.linalg.norm(points[some, None] - stroke.points[None], axis=2)
        found[some] = (gap < 0.5 * stroke.widths).any(1)
    return found
