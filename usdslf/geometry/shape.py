"""Polygons as authored -> triangles with normals and primvars, in the space of their gprim.

The steps: refine (subdivision surfaces), normals, triangles.  A shape is what instances share; `place`
puts it into the world.
"""

from __future__ import annotations

import hashlib
from dataclasses import dataclass, field, fields, replace

import numpy as np
from numpy.typing import NDArray

from usdslf.geometry.normals import corner_normals, limit_normals
from usdslf.geometry.subdivision import (
    Net,
    face_varying_net,
    linear_stencil,
    make_net,
    refine_corner_values,
    refine_net,
    refined_faces,
)
from usdslf.geometry.triangulation import triangulate
from usdslf.runs import owners
from usdslf.scene.arrays import cross
from usdslf.scene.records import F32, F64, I32

I64 = NDArray[np.int64]

REFINED_FACES_MAX = 400_000  # a cage is refined no further than this


@dataclass(frozen=True)
class Values:
    """A primvar that is not constant: value of element e is values[indices[e]]."""

    interpolation: str  # uniform | vertex | varying | faceVarying
    values: F64  # (n, k)
    indices: I64 | None = None  # (elements,) ; none: one value each

    @property
    def flat(self) -> F64:
        """One value for each element."""
        return self.values if self.indices is None else self.values[self.indices]

    def of_elements(self, kept: I64) -> Values:
        """The values of some elements only."""
        return replace(self, indices=kept if self.indices is None else self.indices[kept])


@dataclass(frozen=True)
class Polygons:
    """A mesh as authored, checked.  F faces, C corners, V points."""

    points: F64  # (V, 3)
    counts: I64  # (F,) 3 and more
    indices: I64  # (C,)
    face: I64  # (F,) number of the face as authored
    scheme: str = "none"  # none | catmullClark | loop | bilinear
    boundary: str = "edgeAndCorner"
    face_varying_rule: str = "cornersPlus1"
    smooth_triangles: bool = False
    creases: tuple[I64, F64] | None = None  # vertex pairs (K, 2), sharpness (K,)
    corners: tuple[I64, F64] | None = None  # vertices (K,), sharpness (K,)
    holes: I64 | None = None  # faces as authored that are not there
    left_handed: bool = False
    normals: Values | None = None  # for scheme none
    primvars: dict[str, Values] = field(default_factory=dict)


@dataclass(frozen=True)
class Shape:
    """Triangles in the space of their gprim, counter-clockwise from outside.  V vertices, T triangles."""

    positions: F64  # (V, 3)
    triangles: I32  # (T, 3)
    corner_normals: F64  # (T, 3, 3)
    face: I32  # (T,) as authored
    within: I32  # (T,) number within the face
    primvars: dict[str, F32] = field(default_factory=dict)  # name -> (T, 3, k)
    levels: int = 0  # of subdivision


def build_shape(polygons: Polygons, refine: int = 1, faces_max: int = REFINED_FACES_MAX) -> Shape:
    """Refines, shades and triangulates.

    Subdivision surfaces get the normals of the limit surface, whatever is authored; plain polygons the
    authored ones, else those of their faces.  A cage is refined `refine` times, less often where that
    would pass `faces_max` faces (`Shape.levels` says how often).
    """
    if polygons.scheme == "loop" and (polygons.counts != 3).any():
        polygons = _only_triangles(polygons)
    face, primvars = polygons.face, dict(polygons.primvars)
    net, points, levels = _net(polygons), polygons.points, 0
    hidden: NDArray[np.bool_] | None = None
    smooth: dict[str, Net] = {}  # face-varying values that are smooth have a net of their own
    if polygons.scheme != "none":
        if polygons.boundary == "none" and polygons.scheme != "bilinear":
            hidden = _boundary_faces(net)
        while levels < refine and _refined_count(net, polygons.scheme) <= faces_max:
            if levels == 0:
                smooth = _smooth_nets(net, polygons)
            points, primvars, smooth, child = _refine(net, points, primvars, smooth, polygons)
            origin = refined_faces(net, polygons.scheme)
            face, net, levels = face[origin], child, levels + 1
            hidden = hidden[origin] if hidden is not None else None
    normals = _normals(polygons, net, points, levels)
    corners, net_face, _ = triangulate(points, net.counts, net.indices)
    authored = face[net_face]
    start = np.flatnonzero(np.diff(authored, prepend=-1))
    within = np.arange(len(authored)) - start[owners(np.diff(np.append(start, len(authored))))]
    keep = np.ones(len(corners), bool)
    if polygons.holes is not None:
        keep &= ~np.isin(authored, polygons.holes)
    if hidden is not None:
        keep &= ~hidden[net_face]
    triangles = net.indices[corners]
    keep &= has_area(points[triangles])
    corners, net_face = corners[keep], net_face[keep]
    if polygons.left_handed:
        corners = corners[:, [0, 2, 1]]
    triangles = net.indices[corners]
    p = points[triangles]
    flat = _unit(cross(p[:, 1] - p[:, 0], p[:, 2] - p[:, 0]))
    shading = np.broadcast_to(flat[:, None], (*corners.shape, 3)).copy()
    if normals is not None:
        told = normals[corners]
        square = np.einsum("tci,tci->tc", told, told)[..., None]
        shading = np.where(np.isfinite(square) & (square > 0), told, shading)
    return Shape(
        positions=points,
        triangles=triangles.astype(np.int32),
        corner_normals=shading,
        face=authored[keep].astype(np.int32),
        within=within[keep].astype(np.int32),
        primvars={n: _of_corners(v, net, corners, net_face, triangles) for n, v in primvars.items()},
        levels=levels,
    )


def fingerprint(polygons: Polygons) -> bytes:
    """Returns a digest of everything that a shape depends on: equal for equal polygons."""
    digest = hashlib.blake2b(digest_size=16)

    def add(value: object) -> None:
        if isinstance(value, np.ndarray):
            digest.update(repr((value.dtype, value.shape)).encode())
            digest.update(np.ascontiguousarray(value).data)
        elif isinstance(value, Polygons | Values):
            for part in fields(value):
                add(getattr(value, part.name))
        elif isinstance(value, dict | tuple):
            digest.update(repr(len(value)).encode())
            for item in value.items() if isinstance(value, dict) else value:
                add(item)
        else:
            digest.update(repr(value).encode())

    add(polygons)
    return digest.digest()


def place(shape: Shape, world_from_object: F64) -> tuple[F32, I32, F32, NDArray[np.bool_]]:
    """Puts a shape into the world.

    Returns positions (V, 3), triangles (T, 3) and corner normals (T, 3, 3); a mirrored shape is wound anew
    so that its triangles stay counter-clockwise from outside (the order of their corners is 0 2 1 then).
    The last is which triangles still have an area (T,).
    """
    linear = world_from_object[:3, :3]
    with np.errstate(over="ignore", invalid="ignore"):  # what is too far away for a float has no area
        positions = shape.positions @ linear.T + world_from_object[:3, 3]
        corners = positions.astype(np.float32)
    # Normals go with the cofactors: the inverse transposed times the determinant, finite for flat scales.
    cofactors = np.stack([cross(linear[(i + 1) % 3], linear[(i + 2) % 3]) for i in range(3)])
    mirrored = np.linalg.det(linear) < 0
    normals = _unit(shape.corner_normals @ cofactors.T) * (-1 if mirrored else 1)
    triangles = shape.triangles
    if mirrored:
        triangles, normals = triangles[:, [0, 2, 1]], normals[:, [0, 2, 1]]
    return corners, triangles, normals.astype(np.float32), has_area(corners[triangles].astype(np.float64))


def has_area(p: F64) -> NDArray[np.bool_]:
    """Whether triangles (T, 3, 3) are finite and higher than a ten millionth of their longest edge."""
    with np.errstate(invalid="ignore", over="ignore"):
        a, b = p[:, 1] - p[:, 0], p[:, 2] - p[:, 0]
        n = cross(a, b)
        longest = np.maximum(np.maximum(_square(a), _square(b)), _square(a - b))
        return np.asarray(_square(n) > (1e-7 * longest) ** 2)


def _net(polygons: Polygons) -> Net:
    return make_net(
        polygons.counts,
        polygons.indices,
        len(polygons.points),
        polygons.creases,
        polygons.corners,
        polygons.boundary,
    )


def _refined_count(net: Net, scheme: str) -> int:
    return 4 * len(net.counts) if scheme == "loop" else len(net.indices)


def _boundary_faces(net: Net) -> NDArray[np.bool_]:
    """Faces (F,) that touch a boundary: they support their neighbours and are not drawn."""
    at_boundary = np.zeros(net.vertex_count, bool)
    at_boundary[net.links.ends[net.links.faces_of_edge == 1].ravel()] = True
    return np.asarray(np.logical_or.reduceat(at_boundary[net.indices], net.links.first))


def _smooth_nets(net: Net, polygons: Polygons) -> dict[str, Net]:
    rule = polygons.face_varying_rule
    if rule == "all" or polygons.scheme == "bilinear":
        return {}
    return {
        name: face_varying_net(net, v.indices, len(v.values), rule)
        for name, v in polygons.primvars.items()
        if v.interpolation == "faceVarying" and v.indices is not None
    }


def _refine(
    net: Net, points: F64, primvars: dict[str, Values], smooth: dict[str, Net], polygons: Polygons
) -> tuple[F64, dict[str, Values], dict[str, Net], Net]:
    """Refines points and primvars by one level."""
    scheme = polygons.scheme
    child, stencil = refine_net(net, scheme, polygons.smooth_triangles)
    linear = None
    out: dict[str, Values] = {}
    nets: dict[str, Net] = {}
    for name, v in primvars.items():
        if v.interpolation == "vertex":
            out[name] = Values("vertex", stencil @ v.flat)
        elif v.interpolation == "varying":
            linear = linear_stencil(net, scheme) if linear is None else linear
            out[name] = Values("varying", linear @ v.flat)
        elif v.interpolation == "uniform":
            out[name] = Values("uniform", v.flat[refined_faces(net, scheme)])
        elif name in smooth:
            nets[name], rows = refine_net(smooth[name], scheme, polygons.smooth_triangles)
            out[name] = Values("faceVarying", rows @ v.values, nets[name].indices)
        else:
            out[name] = Values("faceVarying", refine_corner_values(net, scheme, v.flat))
    return stencil @ points, out, nets, child


def _normals(polygons: Polygons, net: Net, points: F64, levels: int) -> F64 | None:
    """Shading normals of corners (C, 3); none where triangles are flat."""
    if polygons.scheme != "none":
        outside = -1.0 if polygons.left_handed else 1.0
        if levels or polygons.scheme == "bilinear":
            return outside * limit_normals(net, points, polygons.scheme)
        return outside * corner_normals(net, points)
    if polygons.normals is None:
        return None
    v = polygons.normals
    if v.interpolation == "uniform":
        at = net.links.face
    else:
        at = net.indices if v.interpolation in ("vertex", "varying") else np.arange(len(net.indices))
    return _unit(v.flat[at])


def _of_corners(v: Values, net: Net, corners: I64, face: I64, triangles: I64) -> F32:
    """Values of triangle corners (T, 3, k)."""
    if v.interpolation == "uniform":
        of_face = v.flat[face][:, None]
        out = np.broadcast_to(of_face, (len(face), 3, *of_face.shape[2:]))
    elif v.interpolation == "faceVarying":
        out = v.flat[corners]
    else:
        out = v.flat[triangles]
    return out.astype(np.float32, order="C")


def _only_triangles(polygons: Polygons) -> Polygons:
    """The same cage as triangles, which Loop's scheme asks for."""
    corners, face, _ = triangulate(polygons.points, polygons.counts, polygons.indices)
    flat = corners.ravel()
    of = {"uniform": face, "faceVarying": flat}
    return replace(
        polygons,
        counts=np.full(len(corners), 3),
        indices=polygons.indices[flat],
        face=polygons.face[face],
        primvars={
            n: v.of_elements(of[v.interpolation]) if v.interpolation in of else v
            for n, v in polygons.primvars.items()
        },
    )


def _square(v: F64) -> F64:
    return np.asarray(np.einsum("...i,...i->...", v, v))


def _unit(v: F64) -> F64:
    length = np.sqrt(_square(v))[..., None]
    with np.errstate(invalid="ignore"):  # of points that are not finite
        return np.asarray(v / np.where(length > 0, length, 1))
