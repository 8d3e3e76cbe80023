"""Flat coordinates: texture coordinates that a texture can be painted in, each place in a texel of its own.

    common_sets(scene, triangles) -> names       coordinates that all meshes of some triangles have
    lies_flat(scene, triangles, uv_set, ...) -> bool         whether no triangle lies upon another there
"""

from __future__ import annotations

from collections import deque
from weakref import ReferenceType, ref

import numpy as np
from numpy.typing import NDArray

from usdslf.scene.records import F64, Scene, Texture
from usdslf.textures.rasterize import texel_points

GRID = 128  # texels on a side that tell whether triangles lie upon each other
OVERLAP = 0.02  # of the covered ones


def common_sets(scene: Scene, triangles: NDArray) -> list[str]:
    """Returns the texture coordinates that all meshes of the triangles have, `st` first."""
    meshes = [scene.meshes[i] for i in np.unique(scene.triangles.mesh[triangles])]
    common = set.intersection(*(set(m.uvs) for m in meshes)) if meshes else set()
    return sorted(common, key=lambda name: (name != "st", name))


def lies_flat(scene: Scene, triangles: NDArray, uv_set: str, texture: Texture | None = None) -> bool:
    """Whether triangles lie within 0..1 of their texture coordinates, each beside the others and none without area.

    Over a tiled set: each within one of its tiles.

    Args:
        texture: whose transform and wrap modes bring them to their texels; None: a new one.
    """
    asked = triangles.tobytes(), uv_set
    for known, known_asked, of_texture, answer in tuple(_KNOWN):
        if known() is scene and known_asked == asked and of_texture is texture:
            return answer
    found = _lies_flat(scene, triangles, uv_set, texture)
    _KNOWN.append((ref(scene), asked, texture, found))
    return found


_KNOWN: deque[tuple[ReferenceType[Scene], tuple[bytes, str], Texture | None, bool]] = deque(maxlen=8)
"""What was asked last: every change of a material that is weighed asks the same."""


def _lies_flat(scene: Scene, triangles: NDArray, uv_set: str, texture: Texture | None) -> bool:
    uv = scene.corner_uvs(uv_set)[triangles].astype(np.float64)
    area = scene.triangles.areas[triangles]
    if texture is not None and texture.tiles:
        return _lies_in_tiles(uv, texture, area)
    if not np.isfinite(uv).all() or uv.min() < -1e-3 or uv.max() > 1 + 1e-3:
        return False
    wraps = ("clamp", "clamp")
    if texture is not None:
        m = np.asarray(texture.st_from_uv, np.float64)
        uv, wraps = uv @ m[:2, :2].T + m[:2, 2], (texture.wrap_s, texture.wrap_t)
        ends = [uv[..., i] for i in (0, 1) if wraps[i] not in ("repeat", "mirror")]
        if any(x.min() < -1e-3 or x.max() > 1 + 1e-3 for x in ends):
            return False
    return _lies_beside(uv, wraps, area)


def _lies_in_tiles(uv: F64, texture: Texture, area: F64) -> bool:
    if not np.isfinite(uv).all():
        return False
    m = np.asarray(texture.st_from_uv, np.float64)
    uv = uv @ m[:2, :2].T + m[:2, 2]
    cell = np.floor(uv.mean(1))
    uv = uv - cell[:, None]
    numbers = 1001 + cell[:, 0] + 10 * cell[:, 1]
    if uv.min() < -1e-3 or uv.max() > 1 + 1e-3 or not np.isin(numbers, [n for n, _ in texture.tiles]).all():
        return False
    in_tile = (numbers == n for n in np.unique(numbers))
    return all(_lies_beside(uv[rows], ("clamp", "clamp"), area[rows]) for rows in in_tile)


def _lies_beside(uv: F64, wraps: tuple[str, str], area: F64) -> bool:
    a, b = uv[:, 1] - uv[:, 0], uv[:, 2] - uv[:, 0]
    twice = np.abs(a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0])
    if twice.sum() > 2 * (1 + OVERLAP):  # more than one image has room for
        return False
    hits = np.zeros(GRID * GRID, np.int64)
    for points in texel_points(uv, GRID, GRID, *wraps):
        np.add.at(hits, points.y * GRID + points.x, 1)
    collapsed = area[twice < 1e-10].sum()
    return bool(collapsed <= OVERLAP * area.sum() and (hits > 1).sum() < OVERLAP * max((hits > 0).sum(), 1))
