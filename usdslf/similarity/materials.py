"""Alike: what of a shot is similar to what a stroke was painted on, as a picture and as materials.

    painted_places(scene, strokes) -> Places, reach          the dabs
    similarity_picture(scene, tracer, camera, size, painted, reach, weights) -> (h, w, 1); similarity_of strokes
    alike_materials(...)                                     for strokes of scope `similar`

Source: Nguyen et al. 2013, 4.3 and figure 7.
"""

from __future__ import annotations

from collections.abc import Container, Sequence
from typing import TYPE_CHECKING

import numpy as np

from usdslf.elements.elements import Elements
from usdslf.errors import InputError, StrokeError
from usdslf.scene.cameras import camera_rays
from usdslf.scene.records import F32, Camera, Scene
from usdslf.similarity.similarity import Places, Weights, gate, most_similar, places_at, reach_of
from usdslf.strokes.anchors import locate_stroke
from usdslf.strokes.stroke import Stroke, dab_rows
from usdslf.surfaces.reflectance import Parameters

if TYPE_CHECKING:
    from usdslf.rays import RayTracer

OF_MATERIALS = Weights(position=0.25, normal=0.25, reflectance=2.0)  # another object of the same paint is alike
MOST, ALL, SOME = 0.5, 0.95, 0.02  # of a material's area that is similar enough: for all of it or parts to change


def painted_places(
    scene: Scene, strokes: Sequence[Stroke], warnings: list[str] | None = None
) -> tuple[Places, float]:
    """Returns the places of the dabs of strokes, normals towards the eye, and their reach [stage units].

    Raises: StrokeError for a stroke that lies on no surface.
    """
    parts, widths = [], []
    for s in (stroke.seen_from(scene.origin) for stroke in strokes):
        found = locate_stroke(scene, s, warnings)
        keep = np.isin(found.row, dab_rows(s))
        row, p = found.row[keep], places_at(scene, found.triangle[keep], found.barycentric[keep])
        parts.append(_facing(p, s.eye[row] - p.position))
        widths.append(s.widths[row])
    joined = Places(*(np.concatenate([getattr(p, k) for p in parts]) for k in ("position", "normal", "reflectance")))
    return joined, reach_of(joined.position, 0.5 * float(np.concatenate(widths).mean()))


def similarity_of(
    strokes: Sequence[Stroke], scene: Scene, tracer: RayTracer, camera: Camera, size: tuple[int, int],
    weights: Weights | None = None, warnings: list[str] | None = None,
) -> F32:  # fmt: skip
    """Returns the picture (h, w, 1) of `similarity_picture` for what strokes were painted on.

    Raises: StrokeError for a stroke that lies on no surface, or where there is none.
    """
    if not strokes:
        raise StrokeError("similarity is to paint, and there is no stroke; paint one with: usdslf stroke")
    painted, reach = painted_places(scene, strokes, warnings)
    return similarity_picture(scene, tracer, camera, size, painted, reach, weights)


def similarity_picture(
    scene: Scene, tracer: RayTracer, camera: Camera, size: tuple[int, int], painted: Places, reach: float,
    weights: Weights | None = None,
) -> F32:  # fmt: skip
    """Returns the similarity (h, w, 1) of what the middle of each pixel shows to what was painted; 0 where it is void.

    Args:
        size: width and height [pixels].
        reach: [stage units].

    Raises: InputError for a size that is not positive.
    """
    width, height = size
    if width < 1 or height < 1:
        raise InputError(f"a picture of {width} x {height} pixels cannot be rendered; give a positive size")
    x, y = np.meshgrid((np.arange(width) + 0.5) / width, (np.arange(height) + 0.5) / height)
    rays = camera_rays(camera, np.stack([x.ravel(), y.ravel()], 1), width / height)
    hits = tracer.intersect(rays.origin, rays.direction)
    seen = np.flatnonzero((hits.triangle >= 0) & (hits.distance < rays.limit))
    shown = _facing(places_at(scene, hits.triangle[seen], hits.barycentric[seen]), -rays.direction[seen])
    picture = np.zeros(width * height, np.float32)
    picture[seen] = most_similar(shown, painted, reach, weights)
    return picture.reshape(height, width, 1)


def alike_materials(
    scene: Scene, elements: Elements, painted: Places, reach: float, leave: Container[int],
    weights: Weights | None = None,
) -> dict[int, float]:  # fmt: skip
    """Returns the editable materials that are similar enough to what was painted, and the share of their area that is.

    Args:
        leave: materials that stay as they are, or have a stroke of their own.
        weights: default OF_MATERIALS.
    """
    places = Places(elements.position, elements.geometric_normal, Parameters.of(elements).packed)
    is_alike = gate(most_similar(places, painted, reach, weights or OF_MATERIALS)) > 0.5
    found = {}
    for m in np.unique(elements.material):
        rows = elements.material == m
        area = elements.area[rows]
        if m < 0 or int(m) in leave or scene.materials[m].why_not_editable:
            continue
        share = float((area * is_alike[rows]).sum() / area.sum())
        if share > SOME:
            found[int(m)] = share
    return found


def _facing(p: Places, towards: F32) -> Places:
    """The places with normals on the side of directions (n, 3)."""
    away = np.einsum("ni,ni->n", p.normal, towards) < 0
    return Places(p.position, np.where(away[:, None], -p.normal, p.normal), p.reflectance)
