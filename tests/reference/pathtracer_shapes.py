"""Gprims of a stage as shapes of Mitsuba 3.

Catmull-Clark cages are refined once (without creases; face-varying coordinates linearly), other subdivision
surfaces are shown as their cage, both with smooth normals.  Instances are copies.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import mitsuba as mi
import numpy as np
from numpy.typing import NDArray
from pxr import Usd, UsdGeom, UsdShade
from reference.catmull_clark import refine, refine_corners
from reference.pathtracer_materials import MaterialReader, names_of_primvars

PLANE_AXES = {
    "Z": np.eye(3),
    "Y": np.array([[1, 0, 0], [0, 0, 1], [0, -1, 0.0]]),
    "X": np.array([[0, 0, 1], [0, 1, 0], [-1, 0, 0.0]]),
}


@dataclass(frozen=True)
class Polygons:
    """A mesh as it is shown, in its own space."""

    points: NDArray  # (V, 3)
    indices: NDArray  # (C,)
    counts: NDArray  # (F,)
    parent: NDArray  # (F,) face of the mesh as it is written
    is_smooth: bool  # normals are the means of the faces around
    refined: tuple[NDArray, NDArray] | None  # indices and counts of the cage that was refined


class ShapeReader:
    """Collects shapes, the prim of each, and the bounds of all."""

    def __init__(self, time: Usd.TimeCode, model: str, warnings: list[str]) -> None:
        self.time, self.warnings = time, warnings
        self.shapes: list[Any] = []
        self.prims: list[str] = []  # prim of each shape
        self.materials: list[str] = []  # path of the material of each shape, "" where none is bound
        self.low, self.high = np.full(3, np.inf), np.full(3, -np.inf)
        self._materials = MaterialReader(model, warnings)
        self._bsdfs: dict[Any, tuple[Any, Any, str]] = {}
        self._shown: dict[str, Polygons] = {}  # by prim, of an instance the one in its prototype

    def bounding_sphere(self) -> tuple[NDArray, float]:
        """Centre (3,) and radius of a sphere around all shapes."""
        if not np.isfinite(self.low).all():
            return np.zeros(3), 1.0
        return (self.low + self.high) / 2, max(float(np.linalg.norm(self.high - self.low)) / 2, 1e-3)

    def read(self, prim: Usd.Prim, world: NDArray) -> None:
        """Adds a gprim."""
        (self.mesh if prim.GetTypeName() == "Mesh" else self.gprim)(prim, world)

    def mesh(self, prim: Usd.Prim, world: NDArray) -> None:
        """Adds a Mesh: one shape for each material that its faces use."""
        mesh, api = UsdGeom.Mesh(prim), UsdGeom.PrimvarsAPI(prim)
        shown = self._polygons(mesh)
        corner, face = triangulate(shown.counts)
        is_left_handed = mesh.GetOrientationAttr().Get() == "leftHanded"
        if is_left_handed != (np.linalg.det(world[:3, :3]) < 0):
            corner = corner[:, ::-1]
        vertex = shown.indices[corner]
        positions = (shown.points @ world[:3, :3].T + world[:3, 3])[vertex]
        self._grow(positions)
        normals = self._normals(mesh, api, world, shown, corner, face, positions)
        counts, face = np.asarray(mesh.GetFaceVertexCountsAttr().Get(self.time)), shown.parent[face]
        left_over = np.ones(len(counts), bool)
        groups = []
        for subset in UsdShade.MaterialBindingAPI(prim).GetMaterialBindSubsets():
            chosen = np.zeros(len(counts), bool)
            chosen[np.asarray(subset.GetIndicesAttr().Get(self.time))] = True
            left_over &= ~chosen
            groups.append((subset.GetPrim(), chosen))
        for owner, chosen in [*groups, (prim, left_over)]:
            take = chosen[face]
            if not take.any():
                continue
            bsdf, emitter, uv_name = self._material(owner)
            uvs = self._coordinates(api.FindPrimvarWithInheritance(uv_name), shown, corner, face)
            uvs = None if uvs is None else uvs[take]
            shading = None if normals is None else normals[take]
            self._add(_mesh_shape(prim.GetName(), positions[take], shading, uvs, bsdf, emitter), prim, owner)

    def gprim(self, prim: Usd.Prim, world: NDArray) -> None:
        """Adds a Sphere, Cube or Plane."""
        kind = str(prim.GetTypeName())
        if kind not in ("Sphere", "Cube", "Plane"):
            self.warnings.append(f"{kind} {prim.GetPath()}")
            return
        bsdf, emitter, _ = self._material(prim)
        to_world = mi.ScalarTransform4f
        if kind == "Sphere":
            radius = float(UsdGeom.Sphere(prim).GetRadiusAttr().Get(self.time))
            scales = np.linalg.svd(world[:3, :3])[1]
            if scales.max() / scales.min() > 1.0001:
                self.warnings.append(f"non-uniform scale on {prim.GetPath()}")
            reach = radius * scales.max()
            self._grow(world[:3, 3] + np.array([[-reach] * 3, [reach] * 3]))
            shape = {"type": "sphere", "to_world": to_world(world) @ to_world().scale(radius)}
        elif kind == "Cube":
            half = float(UsdGeom.Cube(prim).GetSizeAttr().Get(self.time)) / 2
            self._grow(_box_corners(half, half, half) @ world[:3, :3].T + world[:3, 3])
            shape = {"type": "cube", "to_world": to_world(world) @ to_world().scale(half)}
        else:
            plane = UsdGeom.Plane(prim)
            axis = str(plane.GetAxisAttr().Get())
            width, length = plane.GetWidthAttr().Get(self.time), plane.GetLengthAttr().Get(self.time)
            x, y = (length, width) if axis == "X" else (width, length)
            turn = np.eye(4)
            turn[:3, :3] = PLANE_AXES[axis]
            corners = _box_corners(x / 2, y / 2, 0) @ PLANE_AXES[axis].T
            self._grow(corners @ world[:3, :3].T + world[:3, 3])
            scale = to_world().scale([x / 2, y / 2, 1])
            shape = {"type": "rectangle", "to_world": to_world(world @ turn) @ scale}
        shape["bsdf"] = bsdf
        if emitter:
            shape["emitter"] = emitter
        self._add(shape, prim, prim)

    def _add(self, shape: Any, prim: Usd.Prim, bound: Usd.Prim) -> None:
        material = UsdShade.MaterialBindingAPI(bound).ComputeBoundMaterial("full")[0]
        self.shapes.append(shape)
        self.prims.append(str(prim.GetPath()))
        self.materials.append(str(material.GetPath()) if material else "")

    def _grow(self, points: NDArray) -> None:
        flat = points.reshape(-1, 3)
        self.low, self.high = np.minimum(self.low, flat.min(0)), np.maximum(self.high, flat.max(0))

    def _material(self, prim: Usd.Prim) -> tuple[Any, Any, str]:
        material = UsdShade.MaterialBindingAPI(prim).ComputeBoundMaterial("full")[0]
        display: tuple[float, ...] = (0.18, 0.18, 0.18)
        primvars: dict[str, Any] = {}
        key: Any = None
        if material:
            own = material.GetPrim()
            own = own.GetPrimInPrototype() if own.IsInstanceProxy() else own
            primvars = self._constants(prim, names_of_primvars(material))
            key = str(own.GetPath()), str(primvars)
        else:
            gprim = UsdGeom.Gprim(prim)
            color = gprim.GetDisplayColorAttr().Get(self.time) if gprim else None
            if color and len(color) == 1:
                display = tuple(float(x) for x in color[0])
            elif color:
                self.warnings.append(f"varying displayColor on {prim.GetPath()}")
            key = ("display", display)
        if key not in self._bsdfs:
            bsdf, emitter, uv_name = self._materials.read(material, display, primvars)
            self._bsdfs[key] = (mi.load_dict(bsdf), emitter, uv_name)
        return self._bsdfs[key]

    def _constants(self, prim: Usd.Prim, names: list[str]) -> dict[str, Any]:
        """Returns the primvars of a prim that have one value."""
        found = {}
        for name in names:
            primvar = UsdGeom.PrimvarsAPI(prim).FindPrimvarWithInheritance(name)
            value = primvar.ComputeFlattened(self.time) if primvar and primvar.HasValue() else None
            if value is None:
                continue
            rows = np.asarray(value, float)
            if rows.ndim and len(rows) > 1 and primvar.GetInterpolation() != "constant":
                self.warnings.append(f"varying primvar {name} on {prim.GetPath()}: its mean")
            row = rows.reshape(len(rows), -1).mean(0) if rows.ndim else rows
            found[name] = tuple(row.tolist()) if row.size > 1 else float(row.reshape(-1)[0])
        return found

    def _polygons(self, mesh: UsdGeom.Mesh) -> Polygons:
        prim = mesh.GetPrim()
        key = str((prim.GetPrimInPrototype() if prim.IsInstanceProxy() else prim).GetPath())
        if key in self._shown:
            return self._shown[key]
        points = np.asarray(mesh.GetPointsAttr().Get(self.time), np.float64)
        indices = np.asarray(mesh.GetFaceVertexIndicesAttr().Get(self.time)).astype(int)
        counts = np.asarray(mesh.GetFaceVertexCountsAttr().Get(self.time)).astype(int)
        scheme = mesh.GetSubdivisionSchemeAttr().Get()
        shown = Polygons(points, indices, counts, np.arange(len(counts)), scheme != "none", None)
        if scheme == "catmullClark":
            if any(a.Get(self.time) for a in (mesh.GetCreaseIndicesAttr(), mesh.GetCornerIndicesAttr())):
                self.warnings.append(f"creases of {prim.GetPath()}: ignored")
            fine = refine(points, indices, counts)
            fours = np.full(len(fine.indices), 4)
            shown = Polygons(
                fine.values, fine.indices.ravel(), fours, fine.parent, True, (indices, counts)
            )
        elif scheme != "none":
            self.warnings.append(f"subdivisionScheme {scheme} on {prim.GetPath()}: control cage, smooth normals")
        self._shown[key] = shown
        return shown

    def _coordinates(
        self, primvar: UsdGeom.Primvar, shown: Polygons, corner: NDArray, parent: NDArray
    ) -> NDArray | None:
        """Texture coordinates (T, 3, 2) of the triangles."""
        if not primvar or not primvar.HasValue():
            return None
        values = np.asarray(primvar.ComputeFlattened(self.time), np.float64)
        interpolation = primvar.GetInterpolation()
        if shown.refined and interpolation in ("vertex", "varying"):
            values = refine(values, *shown.refined).values
        elif shown.refined and interpolation == "faceVarying":
            values = refine_corners(values, shown.refined[1])
        return corner_values((values, interpolation), corner, shown.indices[corner], parent)

    def _normals(
        self,
        mesh: UsdGeom.Mesh,
        api: UsdGeom.PrimvarsAPI,
        world: NDArray,
        shown: Polygons,
        corner: NDArray,
        face: NDArray,
        positions: NDArray,
    ) -> NDArray | None:
        """Unit shading normals (T, 3, 3), or None for flat faces."""
        vertex = shown.indices[corner]
        if shown.is_smooth:
            face_normals = np.cross(positions[:, 1] - positions[:, 0], positions[:, 2] - positions[:, 0])
            sums = np.zeros((len(shown.points), 3))
            for k in range(3):
                np.add.at(sums, vertex[:, k], face_normals)
            normals = sums[vertex]
        else:
            primvar = api.GetPrimvar("normals")
            if primvar and primvar.HasValue():
                values = (primvar.ComputeFlattened(self.time), primvar.GetInterpolation())
            elif mesh.GetNormalsAttr().Get(self.time):
                values = (mesh.GetNormalsAttr().Get(self.time), mesh.GetNormalsInterpolation())
            else:
                return None
            local = corner_values(values, corner, vertex, face).astype(np.float64)
            normals = local @ np.linalg.inv(world[:3, :3])
        return normals / np.maximum(np.linalg.norm(normals, axis=-1, keepdims=True), 1e-20)


def triangulate(counts: NDArray) -> tuple[NDArray, NDArray]:
    """Returns fans of triangles (T, 3) as indices into the face-vertex list, and the face (T,) of each."""
    first = np.concatenate([[0], np.cumsum(counts)[:-1]]).astype(int)
    triangles, faces = [np.zeros((0, 3), int)], [np.zeros(0, int)]
    for n in np.unique(counts):
        of_size = np.nonzero(counts == n)[0]
        for k in range(1, n - 1):
            triangles.append(np.stack([first[of_size], first[of_size] + k, first[of_size] + k + 1], -1))
            faces.append(of_size)
    return np.concatenate(triangles), np.concatenate(faces)


def corner_values(primvar: tuple[Any, str], corner: NDArray, vertex: NDArray, face: NDArray) -> NDArray:
    """Returns the values (T, 3, c) of a primvar, given as (flattened values, interpolation)."""
    values, interpolation = np.asarray(primvar[0]), primvar[1]
    if interpolation in ("vertex", "varying"):
        return values[vertex]
    if interpolation == "faceVarying":
        return values[corner]
    if interpolation == "uniform":
        return np.repeat(values[face][:, None], 3, 1)
    return np.broadcast_to(values.reshape(1, 1, -1), (*vertex.shape, values.size))


def _box_corners(x: float, y: float, z: float) -> NDArray:
    return np.array([[a, b, c] for a in (-x, x) for b in (-y, y) for c in (-z, z)])


def _copied(description: Any) -> Any:
    """A dictionary with tensors of its own: loading one takes them away."""
    if isinstance(description, dict):
        return {key: _copied(value) for key, value in description.items()}
    return mi.TensorXf(np.array(description)) if isinstance(description, mi.TensorXf) else description


def _mesh_shape(
    name: str, positions: NDArray, normals: NDArray | None, uvs: NDArray | None, bsdf: Any, emitter: Any
) -> Any:
    """A Mitsuba mesh of separate triangles."""
    props = mi.Properties()
    props["mesh_bsdf"] = bsdf
    if emitter is not None:
        props["mesh_emitter"] = mi.load_dict(_copied(emitter))
    if normals is None:
        props["face_normals"] = True
    count = len(positions) * 3
    mesh = mi.Mesh(
        name,
        count,
        len(positions),
        props=props,
        has_vertex_normals=normals is not None,
        has_vertex_texcoords=uvs is not None,
    )
    parameters = mi.traverse(mesh)
    parameters["vertex_positions"] = mi.Float(positions.reshape(-1).astype(np.float32))
    if normals is not None:
        parameters["vertex_normals"] = mi.Float(normals.reshape(-1).astype(np.float32))
    if uvs is not None:
        uv = uvs.reshape(-1, 2).astype(np.float32)
        uv = np.stack([uv[:, 0], 1 - uv[:, 1]], -1)
        parameters["vertex_texcoords"] = mi.Float(uv.reshape(-1))
    parameters["faces"] = mi.UInt32(np.arange(count, dtype=np.uint32))
    parameters.update()
    return mesh
