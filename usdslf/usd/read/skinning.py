"""UsdSkel: points and normals of skinned meshes, and places of other skinned gprims, at a frame.

Blend shapes (with inbetweens), then linear or dual quaternion skinning by UsdSkel itself.  Normals follow
the blended joint matrices; normal offsets of blend shapes are not applied.  Gprims without points (spheres,
cubes, ...) follow their joints rigidly, as UsdSkel.BakeSkinning has it.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
from pxr import Usd, UsdGeom, Vt

from usdslf.scene.records import F64
from usdslf.usd.notes import Notes

if TYPE_CHECKING:
    from pxr import UsdSkel


@dataclass(frozen=True)
class Posed:
    """A mesh in its pose."""

    points: F64  # (V, 3) in skeleton space if `world_from_points` is given, else the gprim's own
    world_from_points: F64 | None  # (4, 4)
    turn: F64 | None  # (V, 3, 3) that turns normals (not unit), column vectors


class Skins:
    """Finds the skeletons of a stage, when first asked for, and poses meshes."""

    def __init__(self, time: Usd.TimeCode, notes: Notes) -> None:
        self._time, self._notes = time, notes
        self._xforms = UsdGeom.XformCache(time)
        self._roots: dict[Any, bool] = {}
        self._is_below: dict[Any, bool] = {}  # a SkelRoot, by path

    @cached_property
    def _cache(self) -> UsdSkel.Cache:
        from pxr import UsdSkel  # late: few stages have skeletons, and it takes as long to load as 100 other modules

        return UsdSkel.Cache()

    def _is_in_root(self, prim: Usd.Prim) -> bool:
        """Tells whether a prim is a SkelRoot or stands below one."""
        if not prim:
            return False
        path = prim.GetPath()
        if path not in self._is_below:
            self._is_below[path] = str(prim.GetTypeName()) == "SkelRoot" or self._is_in_root(prim.GetParent())
        return self._is_below[path]

    def query(self, prim: Usd.Prim) -> UsdSkel.SkinningQuery | None:
        """Returns how a prim is skinned, or none."""
        if not self._is_in_root(prim):
            return None
        from pxr import UsdSkel

        root = UsdSkel.Root.Find(prim)
        if root.GetPath() not in self._roots:
            self._roots[root.GetPath()] = True
            at = root.GetPrim()
            is_shown = at.IsDefined() and not at.IsAbstract()  # prototypes may stand below an `over` or in a class
            found = Usd.PrimDefaultPredicate if is_shown else Usd.PrimIsActive & Usd.PrimIsLoaded
            self._cache.Populate(root, Usd.TraverseInstanceProxies(found))
        query = self._cache.GetSkinningQuery(prim)
        return query if query and (query.HasJointInfluences() or query.HasBlendShapes()) else None

    def _skeleton(self, prim: Usd.Prim) -> UsdSkel.SkeletonQuery | None:
        """The skeleton that a prim follows; none, and a note, where it cannot be read."""
        from pxr import UsdSkel

        skeleton = UsdSkel.BindingAPI(prim).GetInheritedSkeleton()
        skel = self._cache.GetSkelQuery(skeleton) if skeleton else None
        if not skel:
            self._notes.add("the skeleton of {} cannot be read; it is shown in its rest pose", prim.GetPath())
        return skel or None

    def place(self, prim: Usd.Prim, query: UsdSkel.SkinningQuery) -> F64 | None:
        """Returns world_from_object (4, 4) of a skinned gprim without points; none where it cannot follow."""
        skel = self._skeleton(prim)
        if skel is None:
            return None
        if not query.IsRigidlyDeformed():
            self._notes.add("{} has no points and no constant joint weights; it is not skinned", prim.GetPath())
            return None
        joints = skel.ComputeSkinningTransforms(self._time)
        moved = None if joints is None else query.ComputeSkinnedTransform(joints, self._time)
        if moved is None:
            self._notes.add("the joints of {} do not fit it; it is shown in its rest pose", prim.GetPath())
            return None
        return np.array(moved * self._xforms.GetLocalToWorldTransform(skel.GetPrim()), np.float64).T

    def object_from_world(self, prim: Usd.Prim) -> F64 | None:
        """Returns the inverse (4, 4) of a prim's own place in the stage; none where it has none (a scale of 0)."""
        world = np.array(self._xforms.GetLocalToWorldTransform(prim), np.float64).T
        if not np.isfinite(world).all() or np.linalg.det(world[:3, :3]) == 0:
            return None
        return np.asarray(np.linalg.inv(world), np.float64)

    def pose(self, prim: Usd.Prim, query: UsdSkel.SkinningQuery, points: Any) -> Posed | None:
        """Deforms points (a Vt.Vec3fArray) of a skinned prim; none where its skeleton cannot be read."""
        skel = self._skeleton(prim)
        if skel is None:
            return None
        points = Vt.Vec3fArray(points)
        if query.HasBlendShapes():
            points = self._blended(prim, query, skel, points)
        if not query.HasJointInfluences():
            return Posed(np.asarray(points, np.float64), None, None)
        joints = skel.ComputeSkinningTransforms(self._time)
        if joints is None or not query.ComputeSkinnedPoints(joints, points, self._time):
            self._notes.add("the joints of {} do not fit it; it is shown in its rest pose", prim.GetPath())
            return None
        world = np.array(self._xforms.GetLocalToWorldTransform(skel.GetPrim()), np.float64).T
        return Posed(np.asarray(points, np.float64), world, self._turn(query, joints, len(points)))

    def _blended(self, prim: Usd.Prim, query: Any, skel: Any, points: Any) -> Any:
        animation = skel.GetAnimQuery()
        weights = animation.ComputeBlendShapeWeights(self._time) if animation else None
        mapper = query.GetBlendShapeMapper()
        if weights is None or mapper is None:
            return points
        weights = mapper.Remap(weights)
        if weights is None:
            return points
        from pxr import UsdSkel

        shapes = UsdSkel.BlendShapeQuery(UsdSkel.BindingAPI(prim))
        found = shapes.ComputeSubShapeWeights(weights)
        if not found:
            return points
        sub_weights, shape_indices, sub_indices = found
        shapes.ComputeDeformedPoints(
            sub_weights,
            shape_indices,
            sub_indices,
            shapes.ComputeBlendShapePointIndices(),
            shapes.ComputeSubShapePointOffsets(),
            points,
        )
        return points

    def _turn(self, query: Any, joints: Any, count: int) -> F64 | None:
        """Cofactors (V, 3, 3) of the blended joint matrices: what normals are turned by."""
        mapper = query.GetJointMapper()
        if mapper is not None and not mapper.IsNull():
            joints = mapper.RemapTransforms(joints, Vt.Matrix4dArray(len(mapper)))
        influences = query.ComputeVaryingJointInfluences(count, self._time)
        if joints is None or not influences:
            return None
        per_point = query.GetNumInfluencesPerComponent()
        indices = np.asarray(influences[0], np.int64).reshape(count, per_point)
        weights = np.asarray(influences[1], np.float64).reshape(count, per_point)
        bind = np.array(query.GetGeomBindTransform(self._time), np.float64)[:3, :3]
        rows = np.array([np.array(m)[:3, :3] for m in joints], np.float64)
        rows = bind @ np.einsum("vi,vijk->vjk", weights, rows[np.clip(indices, 0, len(rows) - 1)])
        m = rows.transpose(0, 2, 1)
        return np.stack([np.cross(m[:, (i + 1) % 3], m[:, (i + 2) % 3]) for i in range(3)], axis=1)
