"""UsdGeomMesh -> Polygons: topology, points and tags, checked."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray
from pxr import Usd, UsdGeom

from usdslf.geometry.shape import Polygons
from usdslf.runs import owners
from usdslf.scene.records import F64
from usdslf.usd.notes import Notes
from usdslf.usd.read.primvars import Primvars, numbers, read_normals, read_primvars
from usdslf.usd.read.skinning import Posed

I64 = NDArray[np.int64]


def read_polygons(
    mesh: UsdGeom.Mesh, time: Usd.TimeCode, posed: Posed | None, notes: Notes
) -> tuple[Polygons, Primvars] | None:
    """Reads a mesh; none where there is nothing that can be drawn, with a note that says why.

    Faces of fewer than three corners, and faces with a point that is not finite, are left out.
    """
    found = _topology(mesh, time, posed, notes)
    if found is None:
        return None
    points, counts, indices = found
    sizes = {
        "constant": 1,
        "uniform": len(counts),
        "vertex": len(points),
        "varying": len(points),
        "faceVarying": len(indices),
    }
    primvars = read_primvars(UsdGeom.PrimvarsAPI(mesh).FindPrimvarsWithInheritance(), time, sizes, notes)
    scheme = _scheme(mesh, time, counts, notes)
    normals = read_normals(mesh, time, sizes, notes) if scheme == "none" else None

    points, kept_faces, kept_corners = _drawable(mesh, points, counts, indices, notes)
    if not len(kept_faces):
        notes.add("the mesh {} has no face with three finite corners; left out", mesh.GetPath())
        return None
    if len(kept_faces) < len(counts):
        of = {"uniform": kept_faces, "faceVarying": kept_corners}
        primvars.varying = {
            n: v.of_elements(of[v.interpolation]) if v.interpolation in of else v
            for n, v in primvars.varying.items()
        }
        if normals is not None and normals.interpolation in of:
            normals = normals.of_elements(of[normals.interpolation])
    if normals is not None and posed is not None and posed.turn is not None:
        first = np.concatenate([[0], np.cumsum(counts)[:-1]]).astype(np.int64)
        normals = _turned(normals, posed.turn, indices[kept_corners], indices[first[kept_faces]])
    return Polygons(
        points=points,
        counts=counts[kept_faces],
        indices=indices[kept_corners],
        face=kept_faces,
        scheme=scheme,
        boundary=str(mesh.GetInterpolateBoundaryAttr().Get(time) or "edgeAndCorner"),
        face_varying_rule=str(mesh.GetFaceVaryingLinearInterpolationAttr().Get(time) or "cornersPlus1"),
        smooth_triangles=mesh.GetTriangleSubdivisionRuleAttr().Get(time) == "smooth",
        creases=_creases(mesh, time, len(points), notes),
        corners=_corners(mesh, time, len(points), notes),
        holes=_integers(mesh.GetHoleIndicesAttr().Get(time)),
        left_handed=mesh.GetOrientationAttr().Get(time) == "leftHanded",
        normals=normals,
        primvars=primvars.varying,
    ), primvars


def _topology(
    mesh: UsdGeom.Mesh, time: Usd.TimeCode, posed: Posed | None, notes: Notes
) -> tuple[F64, I64, I64] | None:
    """Points (V, 3), corners of each face (F,) and their points (C,); none where they do not fit each other."""
    path = mesh.GetPath()
    points = numbers(mesh.GetPointsAttr().Get(time)) if posed is None else posed.points
    counts = _integers(mesh.GetFaceVertexCountsAttr().Get(time))
    indices = _integers(mesh.GetFaceVertexIndicesAttr().Get(time))
    if points is None or points.shape[1:] != (3,) or not len(points) or not len(counts):
        notes.add("the mesh {} has no points or no faces at this frame; left out", path)
        return None
    if (counts < 0).any() or counts.sum() != len(indices):
        notes.add("faceVertexCounts and faceVertexIndices of {} disagree; left out", path)
        return None
    if len(indices) and (indices.min() < 0 or indices.max() >= len(points)):
        notes.add("the faces of {} name points that are not there; left out", path)
        return None
    return points, counts, indices


def _scheme(mesh: UsdGeom.Mesh, time: Usd.TimeCode, counts: I64, notes: Notes) -> str:
    """The subdivision scheme; `none` for one that is not known."""
    path = mesh.GetPath()
    scheme = str(mesh.GetSubdivisionSchemeAttr().Get(time) or "catmullClark")
    if scheme not in ("none", "catmullClark", "loop", "bilinear"):
        notes.add(f"the subdivision scheme {scheme} of {{}} is not known; it is read as polygons", path)
        scheme = "none"
    if scheme == "loop" and (counts != 3).any():
        notes.add("the mesh {} is subdivided by Loop's scheme but not made of triangles; it was split", path)
    return scheme


def _drawable(mesh: UsdGeom.Mesh, points: F64, counts: I64, indices: I64, notes: Notes) -> tuple[F64, I64, I64]:
    """Points with those that are not finite at zero, and the faces and corners that are drawn without these."""
    face_of_corner = owners(counts)
    finite: NDArray[np.bool_] = np.asarray(np.isfinite(points).all(1))
    bad: NDArray[np.bool_] = np.bincount(face_of_corner[~finite[indices]], minlength=len(counts)) > 0
    if bad.any():
        notes.add("the mesh {} has points that are nan or inf; the faces on them are left out", mesh.GetPath())
        points = np.where(finite[:, None], points, 0.0)
    keep: NDArray[np.bool_] = np.asarray(~bad & (counts >= 3))
    return points, np.flatnonzero(keep), np.flatnonzero(keep[face_of_corner])


def _turned(normals: Any, turn: F64, corner_points: I64, face_points: I64) -> Any:
    """Turns normals with the skin: those of corners and faces as the points that they stand at."""
    at = {"faceVarying": corner_points, "uniform": face_points}.get(normals.interpolation)
    turn = turn if at is None else turn[at]
    return type(normals)(normals.interpolation, np.einsum("nij,nj->ni", turn, normals.flat))


def _creases(mesh: UsdGeom.Mesh, time: Usd.TimeCode, count: int, notes: Notes) -> tuple[I64, F64] | None:
    """Creases as edges (K, 2) and their sharpness (K,)."""
    lengths = _integers(mesh.GetCreaseLengthsAttr().Get(time))
    indices = _integers(mesh.GetCreaseIndicesAttr().Get(time))
    sharp = numbers(mesh.GetCreaseSharpnessesAttr().Get(time))
    if not len(lengths) or sharp is None:
        return None
    edges = lengths - 1
    fits = (lengths >= 2).all() and lengths.sum() == len(indices)
    fits = fits and len(sharp) in (len(lengths), edges.sum())
    if not fits or indices.min() < 0 or indices.max() >= count:
        notes.add("the creases of {} do not fit its points; left out", mesh.GetPath())
        return None
    inner = np.ones(len(indices), bool)
    inner[np.cumsum(lengths) - 1] = False  # the last point of a crease starts no edge
    start = np.flatnonzero(inner)
    each = np.repeat(sharp[:, 0], edges) if len(sharp) == len(lengths) else sharp[:, 0]
    return np.stack([indices[start], indices[start + 1]], axis=1), _sharpness(each)


def _corners(mesh: UsdGeom.Mesh, time: Usd.TimeCode, count: int, notes: Notes) -> tuple[I64, F64] | None:
    """Sharp vertices (K,) and their sharpness (K,)."""
    indices = _integers(mesh.GetCornerIndicesAttr().Get(time))
    sharp = numbers(mesh.GetCornerSharpnessesAttr().Get(time))
    if not len(indices) or sharp is None:
        return None
    if len(sharp) != len(indices) or indices.min() < 0 or indices.max() >= count:
        notes.add("the corners of {} do not fit its points; left out", mesh.GetPath())
        return None
    return indices, _sharpness(sharp[:, 0])


def _sharpness(values: F64) -> F64:
    """Sharpness as subdivision takes it: 10 and more means for ever."""
    values = np.nan_to_num(values, nan=0.0, posinf=np.inf)
    return np.where(values >= UsdGeom.Mesh.SHARPNESS_INFINITE, np.inf, np.maximum(values, 0.0))


def _integers(value: Any) -> I64:
    return np.asarray(value if value is not None else [], np.int64)
