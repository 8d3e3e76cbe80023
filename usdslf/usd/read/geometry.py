"""Gprims of a stage at one time -> Mesh records: triangles in world space.

Read are meshes (polygons and subdivision surfaces), implicit gprims, instances, PointInstancers and
skinned meshes, with their primvars and GeomSubsets.  A shape is built once for all instances of it.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from pxr import Usd, UsdGeom

from usdslf.geometry.shape import REFINED_FACES_MAX, Polygons, Shape, build_shape, fingerprint, place
from usdslf.progress import tell, tell_during
from usdslf.runs import distinct
from usdslf.scene.records import F32, F64, I32, Mesh
from usdslf.usd.binding import bound_material
from usdslf.usd.notes import Notes
from usdslf.usd.read.implicit import SIZES, read_implicit
from usdslf.usd.read.origin import HERE, Origin, moved_to
from usdslf.usd.read.placement import Placed, Placement
from usdslf.usd.read.polygons import read_polygons
from usdslf.usd.read.primvars import read_primvars
from usdslf.usd.read.skinning import Skins

TRIANGLES_MAX = 30_000_000  # of a stage, after instancing
PRIMS = 256  # that are read between two words of progress
LARGE = 4000  # corners of a gprim that is built by itself between two words
REFINED_TRIANGLES_MAX = 3_000_000  # of a stage; cages are refined less rather than pass it

_CONSTANT = {"constant": 1}
MaterialIndex = Callable[[Usd.Prim, Mapping[str, F64]], int]
"""Index into the material table of what a gprim or GeomSubset shows, with the primvars that an instancer gives it."""


def read_meshes(
    stage: Usd.Stage,
    time: Usd.TimeCode,
    material_index: MaterialIndex,
    refine: int = 1,
    warnings: list[str] | None = None,
    origin: Origin = HERE,
) -> list[Mesh]:
    """Reads every gprim that is shown: visible, purpose default or render.

    Args:
        material_index: index into the material table of what a gprim or GeomSubset is bound to.
        refine: levels of subdivision; 0 leaves cages as they are, with smooth normals.
        origin: that positions are relative to.
        warnings: takes a sentence, naming prims, for everything that could not be read.
    """
    notes = Notes()
    everything = list(Placement(stage, time, notes).gprims())
    reader = _Reader(time, _affordable(everything, refine, time, notes), notes)
    meshes: list[Mesh] = []
    total = 0
    for number, placed in enumerate(everything):
        if number % PRIMS == 0:
            tell(number / len(everything))
        read = reader.shape(placed.prim)
        if read is None:
            continue
        if total + len(read.shape.triangles) > TRIANGLES_MAX:
            reason = f"the stage has more than {TRIANGLES_MAX} triangles: {{}} and what follows is left out"
            notes.add(reason, placed.path)
            break
        mesh = _mesh(placed, read, material_index, time, notes, origin)
        if mesh is not None:
            meshes.append(mesh)
            total += len(mesh.triangles)
    if warnings is not None:
        warnings += [s for s in notes.sentences() if s not in warnings]
    return meshes


def _affordable(everything: list[Placed], refine: int, time: Usd.TimeCode, notes: Notes) -> int:
    """Returns how often cages are refined: less than asked where many instances would make it too much."""
    corners: dict[Any, int] = {}  # of a cage; 0 for what is not refined
    total = 0
    for placed in everything:
        own = _own(placed.prim)
        key = own.GetPath()
        if key not in corners:
            mesh = UsdGeom.Mesh(own)
            cage = mesh and mesh.GetSubdivisionSchemeAttr().Get(time) != "none"
            corners[key] = len(mesh.GetFaceVertexIndicesAttr().Get(time) or ()) if cage else 0
        count = corners[key]
        total += count if count <= REFINED_FACES_MAX else 0
    # A corner becomes a quad, two triangles, and each further level four times as many.
    levels = refine
    while levels > 0 and total * 2 * 4 ** (levels - 1) > REFINED_TRIANGLES_MAX:
        levels -= 1
    if levels < refine:
        root = everything[0].prim.GetStage().GetRootLayer().identifier
        times = f"refined {levels} times" if levels else "not refined"
        notes.add(f"the cages of {{}} are {times}: more would pass {REFINED_TRIANGLES_MAX} triangles", root)
    return levels


def _own(prim: Usd.Prim) -> Usd.Prim:
    """The prim that instances share, or the prim itself."""
    return prim.GetPrimInPrototype() if prim.IsInstanceProxy() else prim


@dataclass(frozen=True)
class _Read:
    """A shape with what belongs to its gprim."""

    shape: Shape
    constant: dict[str, F64]
    world_from_points: F64 | None = None  # of what is skinned, where it stands in the stage by itself
    object_from_world: F64 | None = None  # of the gprim itself there: PointInstancers put it elsewhere
    is_animated: bool = False  # the shape


class _Reader:
    """Builds the shape of each gprim, once for all its instances."""

    def __init__(self, time: Usd.TimeCode, refine: int, notes: Notes) -> None:
        self._time, self._refine, self._notes = time, refine, notes
        self._skins = Skins(time, notes)
        self._shared: dict[Any, _Read | None] = {}
        self._shapes: dict[bytes, Shape] = {}

    def shape(self, prim: Usd.Prim) -> _Read | None:
        """Returns the shape of a gprim, or none (with a note) where it is not read."""
        query = self._skins.query(prim) if prim.IsA(UsdGeom.Mesh) or str(prim.GetTypeName()) in SIZES else None
        if query is not None:
            key = prim.GetPath()
            if key not in self._shared:
                self._shared[key] = self._read(prim, query)
            return self._shared[key]
        key = _own(prim).GetPath()
        if key not in self._shared:
            self._shared[key] = self._read(prim, None)
        read = self._shared[key]
        if read is not None and prim.IsInstanceProxy():
            # Constant primvars come down from the prims above as well.
            inherited = UsdGeom.PrimvarsAPI(prim).FindPrimvarsWithInheritance()
            constant = read_primvars(inherited, self._time, _CONSTANT, Notes()).constant
            return _Read(read.shape, constant, is_animated=read.is_animated)
        return read

    def _read(self, prim: Usd.Prim, query: Any) -> _Read | None:
        kind, path = str(prim.GetTypeName()), prim.GetPath()
        posed = None
        if prim.IsA(UsdGeom.Mesh):
            mesh = UsdGeom.Mesh(prim)
            if query is not None:
                points = mesh.GetPointsAttr().Get(self._time)
                posed = self._skins.pose(prim, query, points) if points else None
            read = read_polygons(mesh, self._time, posed, self._notes)
            if read is None:
                return None
            polygons, primvars = read
        elif kind in SIZES:
            implicit = read_implicit(prim, self._time, self._notes)
            if implicit is None:
                return None
            found = UsdGeom.PrimvarsAPI(prim).FindPrimvarsWithInheritance()
            polygons, primvars = implicit, read_primvars(found, self._time, _CONSTANT, self._notes)
        else:
            if prim.IsA(UsdGeom.Gprim) or kind in ("TetMesh", "Volume"):
                self._notes.add(f"{kind} is not read and was left out: {{}}", path)
            return None

        key = fingerprint(polygons)  # references without instancing bring the same mesh many times
        if key not in self._shapes:
            self._shapes[key] = self._built(polygons)
        shape = self._shapes[key]
        if polygons.scheme != "none" and shape.levels < self._refine:
            times = "not refined" if shape.levels == 0 else f"refined {shape.levels} times only"
            self._notes.add(f"the cage {{}} is {times}: more than {REFINED_FACES_MAX} faces", path)
        if not len(shape.triangles):
            self._notes.add("the gprim {} has no triangle with an area; left out", path)
            return None
        world = posed.world_from_points if posed else None
        if query is not None and kind in SIZES:
            world = self._skins.place(prim, query)
        shaped_by = SIZES.get(kind, ("points", "faceVertexCounts", "faceVertexIndices"))
        varies = any(prim.GetAttribute(name).ValueMightBeTimeVarying() for name in shaped_by)
        own = self._skins.object_from_world(prim) if world is not None else None
        return _Read(shape, primvars.constant, world, own, varies or query is not None)

    def _built(self, polygons: Polygons) -> Shape:
        """Triangles of polygons; of many, said meanwhile."""
        if len(polygons.indices) < LARGE:
            return build_shape(polygons, self._refine)
        tell()
        return tell_during(lambda: build_shape(polygons, self._refine))


def _mesh(
    placed: Placed,
    read: _Read,
    material_index: MaterialIndex,
    time: Usd.TimeCode,
    notes: Notes,
    origin: Origin,
) -> Mesh | None:
    """Puts a shape into the world and binds its materials."""
    shape, prim = read.shape, placed.prim
    world = placed.world_from_object if read.world_from_points is None else read.world_from_points
    if read.world_from_points is not None and read.object_from_world is not None and placed.is_placed_by_instancer:
        world = placed.world_from_object @ read.object_from_world @ read.world_from_points
    if not np.isfinite(world).all():
        notes.add("the transform of {} is not finite; left out", prim.GetPath())
        return None
    positions, triangles, normals, good = place(shape, moved_to(world, origin))
    mirrored = len(triangles) and not np.array_equal(triangles[0], shape.triangles[0])
    if not good.any():
        notes.add("the gprim {} has no area in the world (a scale of 0?); left out", prim.GetPath())
        return None
    keep = slice(None) if good.all() else good

    corner_values: dict[str, F32] = {}
    for name, value in {**placed.primvars, **read.constant}.items():
        corner_values[name] = np.broadcast_to(value.astype(np.float32), (int(good.sum()), 3, len(value)))
    for name, values in shape.primvars.items():
        corner_values[name] = (values[:, [0, 2, 1]] if mirrored else values)[keep]
    face = shape.face[keep]
    material, subset, subsets = _materials(placed, face, material_index, time, notes)
    return Mesh(
        path=placed.path,
        positions=positions,
        triangles=triangles[keep],
        corner_normals=normals[keep],
        face_of_triangle=face,
        triangle_in_face=shape.within[keep],
        material_of_triangle=material,
        uvs={n: v for n, v in corner_values.items() if v.shape[2] == 2},
        primvars={n: v for n, v in corner_values.items() if v.shape[2] != 2},
        subset_of_triangle=subset,
        subsets=subsets,
        double_sided=bool(UsdGeom.Gprim(prim).GetDoubleSidedAttr().Get(time)),
        prototype=placed.prototype,
        has_points=prim.IsA(UsdGeom.Mesh) and read.world_from_points is None,
        is_animated=placed.is_moving or read.is_animated,
    )


def _materials(
    placed: Placed,
    face: I32,
    material_index: MaterialIndex,
    time: Usd.TimeCode,
    notes: Notes,
) -> tuple[I32, I32 | None, tuple[str, ...]]:
    """Material (T,) and subset (T,) of each triangle, and the paths of the subsets that bind."""
    prim, given = placed.prim, placed.primvars
    binding = [s for s in UsdGeom.Subset.GetAllGeomSubsets(UsdGeom.Imageable(prim)) if _binds(s)]
    if not binding:
        return np.full(len(face), material_index(prim, given), np.int32), None, ()
    count = int(face.max(initial=0)) + 1
    faces_of = []
    for subset in binding:
        indices = np.asarray(subset.GetIndicesAttr().Get(time) or [], np.int64)
        if len(indices) and indices.min() < 0:
            notes.add("the GeomSubset {} has negative indices; they are passed over", subset.GetPath())
        faces_of.append(distinct(indices[(indices >= 0) & (indices < count)]))
    order = list(range(len(binding)))
    if np.bincount(np.concatenate(faces_of), minlength=1).max() > 1:
        # Where subsets overlap the first one wins, but for those that bind nothing of their own.
        shown, whole = [bound_material(s.GetPrim()).GetPath() for s in binding], bound_material(prim).GetPath()
        order.sort(key=lambda i: shown[i] == whole)
        say = "GeomSubsets of {} overlap: a face shows the first one that binds a material of its own"
        notes.add(say, prim.GetPath())
    of_face = np.full(count, -1, np.int32)
    for i in reversed(order):
        of_face[faces_of[i]] = i
    subset_of = of_face[face]
    # The gprim's own material is asked for only where it shows.
    table = [material_index(s.GetPrim(), given) for s in binding]
    table.append(material_index(prim, given) if (subset_of < 0).any() else 0)
    return np.array(table, np.int32)[subset_of], subset_of, tuple(str(s.GetPath()) for s in binding)


def _binds(subset: UsdGeom.Subset) -> bool:
    """Whether a subset binds a material: by its family, or because it has a binding of its own."""
    if subset.GetElementTypeAttr().Get() != UsdGeom.Tokens.face:
        return False
    if subset.GetFamilyNameAttr().Get() == "materialBind":
        return True
    relationships = subset.GetPrim().GetAuthoredRelationships()
    return any(r.GetName().startswith("material:binding") for r in relationships)
