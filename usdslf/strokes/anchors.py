"""Anchors: where a stroke lies on the surfaces of a scene, also after they have moved.

    locate_stroke(scene, stroke, warnings) -> Located   the stroke's points on the scene's triangles
    find_overlaps(scene, stroke, located) -> [sentence]   where much of it lies on materials that it does not change
    painted_faces(scene, stroke, located) -> {gprim: faces}     all that the brush touches
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from usdslf.errors import StrokeError
from usdslf.geometry.closest_point import nearest_on_triangles, triangles_within
from usdslf.scene.records import F32, F64, I32, Scene
from usdslf.strokes.remarks import About, Remark

if TYPE_CHECKING:
    from usdslf.strokes.stroke import Stroke


SPILT = 0.15  # share of a stroke's points on other materials that a painter may not have meant


@dataclass(frozen=True)
class Located:
    """Where a stroke lies on the triangles of a scene.  n points; those off every surface are left out."""

    row: NDArray[np.int64]  # (n,) of the stroke's points
    triangle: I32  # (n,) into Scene.triangles
    barycentric: F32  # (n, 2)
    position: F32  # (n, 3)
    normal: F32  # (n, 3) unit shading normal, towards the eye
    moved: bool  # the surface is not where it was when it was painted


def locate_stroke(scene: Scene, stroke: Stroke, warnings: list[str] | None = None) -> Located:
    """Finds the stroke's points on the scene's triangles, by their anchors, or by projection without them.

    A point that still lies on its face, wherever on it, is where it was.  A point that does not has moved
    with its face, and follows its anchor; so does every point of an animated surface at another frame than the
    stroke's, which may have slid along itself.  Points whose surface is gone are projected onto the nearest one.

    Args:
        warnings: takes a sentence for each thing that is odd.

    Raises:
        StrokeError: none of its surfaces is in the scene, or every point is far off all of them.
    """
    said = warnings if warnings is not None else []
    stroke, n = stroke.seen_from(scene.origin), len(stroke.points)
    tolerance = np.maximum(0.05 * stroke.widths, 1e-4 * scene.diagonal)
    reach = np.maximum(0.5 * stroke.widths, 0.01 * scene.diagonal)
    triangle = np.full(n, -1, np.int64)
    uv = np.zeros((n, 2))
    projected = np.ones(n, bool)
    moved = np.zeros(n, bool)
    if stroke.surfaces:
        meshes = [_meshes_of(scene, path) for path in stroke.surfaces]
        gone = [p for p, m in zip(stroke.surfaces, meshes) if not m]
        if len(gone) == len(meshes):
            raise StrokeError(
                f"stroke {stroke.path} was painted on {gone[0]}, which {scene.stage} does not show: use "
                "strokes of this stage, or clear slf:surfaces to project them onto it"
            )
        said += [Remark((stroke.path,), f"{p} is not in the stage; what is near is used", About.PLACE) for p in gone]
        if stroke.has_anchors:
            triangle, uv, moved = _follow_anchors(scene, stroke, meshes, tolerance)
            projected = triangle < 0
    if projected.any():
        found = nearest_on_triangles(scene.triangles.positions, stroke.points[projected])
        near = found.distance <= reach[projected]
        rows = np.flatnonzero(projected)
        triangle[rows] = np.where(near, found.triangle, -1)
        uv[rows] = found.barycentric
        if not (triangle >= 0).any():
            raise StrokeError(
                f"stroke {stroke.path} lies off every surface of {scene.stage}: use strokes of this stage"
            )
        if not near.all():
            off = int((~near).sum())
            said.append(Remark((stroke.path,), f"{off} points lie off every surface and are left out", About.PLACE))
    row = np.flatnonzero(triangle >= 0)
    on, at = triangle[row].astype(np.int32), uv[row].astype(np.float32)
    position, normal = points_on_triangles(scene, on, at)
    way = np.linalg.norm(position - stroke.points[row], axis=1)
    moved = moved[row] & (way > tolerance[row])
    if moved.any():
        far = float(way.max())
        said.append(Remark((stroke.path,), f"its surface moved by up to {far:.4g} units; it follows", About.PLACE))
    normal = turned_towards(normal, scene.triangles.face_normals[on], stroke.eye[row] - position)
    return Located(row, on, at, position, normal, bool(moved.any()))


def find_overlaps(scene: Scene, stroke: Stroke, located: Located) -> list[str]:
    """Returns a sentence where a good part of a direct stroke lies on other materials than most of it.

    A stroke changes one material, that with most dabs.  What is fixated is held whatever the material.
    """
    if stroke.mode == "indirect" or stroke.tool == "fixate" or not len(located.triangle):
        return []
    values, counts = np.unique(scene.triangles.material[located.triangle], return_counts=True)
    share = 1 - counts.max() / counts.sum()
    if share <= SPILT:
        return []
    found = [scene.materials[m].path or "surfaces without a material" for m in values]
    most = found.pop(int(counts.argmax()))
    names = ", ".join(found[:3]) + (f" and {len(found) - 3} more" if len(found) > 3 else "")
    what = (
        f"{share:.0%} of it lies on {names}, which it does not change, as most lies on {most}: "
        "paint each material with a stroke of its own"
    )
    return [Remark((stroke.path,), what, About.PLACE)]


def painted_faces(scene: Scene, stroke: Stroke, located: Located) -> dict[str, tuple[int, ...]]:
    """Returns the faces of each painted gprim that the brush touches, on the side that was painted.

    The brush is a ball of the stroke's width about each of its points.
    """
    faces: dict[str, tuple[int, ...]] = {}
    table = scene.triangles
    for m in np.unique(table.mesh[located.triangle]):
        own = np.arange(table.first_of_mesh[m], table.first_of_mesh[m + 1])
        on = np.flatnonzero(table.mesh[located.triangle] == m)
        reach = 0.5 * stroke.widths[located.row[on]]
        point, near = triangles_within(table.positions[own], located.position[on], reach)
        # What lies behind a thin wall was not painted: sides are told by the face that the point is on.
        side = table.face_normals[located.triangle[on][point]] * table.face_normals[own[near]]
        touched = near[side.sum(1) > 0]
        path = scene.meshes[m].path
        found = np.unique(table.face[own[touched]]).tolist()
        faces[path] = tuple(sorted({*faces.get(path, ()), *found}))
    return faces


def _follow_anchors(
    scene: Scene, stroke: Stroke, meshes: list[list[int]], tolerance: F64
) -> tuple[NDArray, NDArray, NDArray]:
    """Returns triangle (n,) (-1: unknown anchor), barycentric (n, 2) and whether each point moved (n,)."""
    n = len(stroke.points)
    triangle, uv, moved = np.full(n, -1, np.int64), np.zeros((n, 2)), np.zeros(n, bool)
    best = np.full(n, np.inf)
    first = scene.triangles.first_of_mesh
    is_other_frame = not np.array_equal(scene.frame, stroke.frame, equal_nan=True)
    for surface, indices in enumerate(meshes):
        rows = np.flatnonzero(stroke.surface_index == surface)
        for m in indices if len(rows) else []:
            mesh = scene.meshes[m]
            # Where the point lies on its own face now: the face may be cut into other triangles than before.
            order = np.argsort(mesh.face_of_triangle, kind="stable")
            faces = mesh.face_of_triangle[order]
            low = np.searchsorted(faces, stroke.face[rows], "left")
            high = np.searchsorted(faces, stroke.face[rows], "right")
            known = high > low
            if not known.any():
                continue
            at, low, count = rows[known], low[known], (high - low)[known]
            pair = np.repeat(np.arange(len(at)), count)
            each = np.arange(len(pair)) - np.repeat(np.cumsum(count) - count, count)
            candidate = order[low[pair] + each]
            corners = mesh.positions[mesh.triangles[candidate]]
            on_face = nearest_on_triangles(corners, stroke.points[at], pair)
            still = (on_face.distance <= tolerance[at]) & (not (is_other_frame and mesh.is_animated))
            # Else the anchor as it was painted, on the triangle it names (or the last one of a coarser cut).
            t = np.floor(stroke.barycentric[at, 0]).astype(int)
            named = order[low + np.clip(t, 0, count - 1)]
            anchor = np.clip(stroke.barycentric[at] - np.stack([t, np.zeros_like(t)], -1), 0, 1)
            chosen = np.where(still, candidate[on_face.triangle], named)
            where = np.where(still[:, None], on_face.barycentric, anchor)
            better = on_face.distance < best[at]
            at, chosen, where, still = at[better], chosen[better], where[better], still[better]
            best[at] = on_face.distance[better]
            triangle[at], uv[at], moved[at] = first[m] + chosen, where, ~still
    return triangle, uv, moved


def _meshes_of(scene: Scene, path: str) -> list[int]:
    """Indices of the meshes of a prim, all copies of it below a PointInstancer."""
    exact = [i for i, m in enumerate(scene.meshes) if m.path == path]
    return exact or [i for i, m in enumerate(scene.meshes) if m.path.split("[")[0] == path.split("[")[0]]


def points_on_triangles(scene: Scene, triangle: NDArray, uv: NDArray) -> tuple[F32, F32]:
    """Positions and unit shading normals (n, 3) at barycentrics of triangles."""
    weights = np.stack([1 - uv[:, 0] - uv[:, 1], uv[:, 0], uv[:, 1]], -1)[..., None].astype(np.float64)
    t = scene.triangles
    position = (t.positions[triangle] * weights).sum(1).astype(np.float32)
    return position, unit((t.normals[triangle] * weights).sum(1))


def turned_towards(normals: F32, face_normals: F32, to_eye: NDArray) -> F32:
    """Normals on the side of the surface that is seen: surfaces reflect on both."""
    seen = (face_normals * to_eye).sum(1) * (face_normals * normals).sum(1)
    return np.where((seen < 0)[:, None], -normals, normals).astype(np.float32)


def unit(vectors: NDArray) -> F32:
    """Vectors (n, 3) of length one; zero stays zero."""
    length = np.linalg.norm(vectors, axis=1, keepdims=True)
    return (vectors / np.where(length > 0, length, 1)).astype(np.float32)
