"""Which gprims a stage shows, and where: visibility, purpose, instances, PointInstancers.

A gprim is shown when it is visible, its purpose is default or render, and it is not below a PointInstancer,
which shows its prototypes itself.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field

import numpy as np
from pxr import Gf, Usd, UsdGeom

from usdslf.scene.records import F64
from usdslf.usd.notes import Notes
from usdslf.usd.read.primvars import read_primvars

_PURPOSES = ("default", "render")
_OF_INSTANCES = ("protoIndices", "positions", "orientations", "orientationsf", "scales", "velocities", "accelerations",
                 "angularVelocities")  # fmt: skip


@dataclass(frozen=True)
class Placed:
    """A gprim that is shown once."""

    prim: Usd.Prim
    path: str  # of the prim; with the instance number in brackets below a PointInstancer
    world_from_object: F64  # (4, 4), column vectors
    prototype: str = ""  # where an opinion on it has to be written, "" if on the prim itself
    primvars: dict[str, F64] = field(default_factory=dict)  # that a PointInstancer gives this instance
    is_moving: bool = False  # its transform may be another one at another time

    @property
    def is_placed_by_instancer(self) -> bool:
        """Whether a PointInstancer puts it where it is."""
        return self.path != str(self.prim.GetPath())


@dataclass(frozen=True)
class _Frame:
    """What holds for everything below a prim: the stage, or one instance of a prototype."""

    world_from_root: Gf.Matrix4d | None = None  # none: prims are placed by their own ancestors
    root: Usd.Prim | None = None
    suffix: str = ""
    primvars: dict[str, F64] = field(default_factory=dict)


class Placement:
    """Walks a stage at one time."""

    def __init__(self, stage: Usd.Stage, time: Usd.TimeCode, notes: Notes) -> None:
        self._stage, self._time, self._notes = stage, time, notes
        self._cache = UsdGeom.XformCache(time)
        self._predicate = Usd.TraverseInstanceProxies(
            Usd.PrimIsActive & Usd.PrimIsLoaded & Usd.PrimIsDefined & ~Usd.PrimIsAbstract
        )
        # Prototypes may stand below an `over` or in a class, so that they are not shown by themselves.
        self._below_prototype = Usd.TraverseInstanceProxies(Usd.PrimIsActive & Usd.PrimIsLoaded)

    def gprims(self) -> Iterator[Placed]:
        """Yields the gprims (and whatever else has an extent) in the order of the stage."""
        for child in self._stage.GetPseudoRoot().GetFilteredChildren(self._predicate):
            yield from self._walk(child, None, _Frame(), (), False)

    def _walk(
        self,
        prim: Usd.Prim,
        parent: UsdGeom.Imageable.PurposeInfo | None,
        frame: _Frame,
        inside: tuple[str, ...],
        is_moving: bool,
    ) -> Iterator[Placed]:
        purpose = parent
        if place := UsdGeom.Xformable(prim):
            is_moving = place.TransformMightBeTimeVarying() or (is_moving and not place.GetResetXformStack())
        imageable = UsdGeom.Imageable(prim)
        if imageable:
            if imageable.GetVisibilityAttr().Get(self._time) == "invisible":
                return
            purpose = imageable.ComputePurposeInfo(parent) if parent else imageable.ComputePurposeInfo()
            token = str(purpose.purpose)
            effective = prim.HasAPI(UsdGeom.VisibilityAPI) and token in _PURPOSES
            if effective and imageable.ComputeEffectiveVisibility(token, self._time) == "invisible":
                return
            if prim.IsA(UsdGeom.PointInstancer):
                if token in _PURPOSES:
                    yield from self._instances(UsdGeom.PointInstancer(prim), frame, inside, is_moving)
                return
            if prim.IsA(UsdGeom.Boundable) and token in _PURPOSES:
                yield Placed(
                    prim,
                    f"{prim.GetPath()}{frame.suffix}",
                    _columns(self._world(prim, frame)),
                    _writable(prim, frame),
                    frame.primvars,
                    is_moving,
                )
            if prim.IsModel() and self._draw_mode(prim) != "default":
                self._notes.add("the draw mode of {} is not honoured: its geometry is read", prim.GetPath())
        below = self._predicate if frame.root is None else self._below_prototype
        for child in prim.GetFilteredChildren(below):
            if frame.root is None or child.HasDefiningSpecifier():
                yield from self._walk(child, purpose, frame, inside, is_moving)

    def _draw_mode(self, prim: Usd.Prim) -> str:
        """How a model asks to be drawn; cards and boxes are for components, and where they are applied."""
        model = UsdGeom.ModelAPI(prim)
        mode = model.GetModelDrawModeAttr()
        if not mode or not mode.HasAuthoredValue():
            return "default"
        applies = Usd.ModelAPI(prim).GetKind() == "component" or model.GetModelApplyDrawModeAttr().Get()
        return str(mode.Get()) if applies and mode.Get() != "inherited" else "default"

    def _world(self, prim: Usd.Prim, frame: _Frame) -> Gf.Matrix4d:
        if frame.world_from_root is None or frame.root is None:
            return self._cache.GetLocalToWorldTransform(prim)
        if prim == frame.root:
            return frame.world_from_root
        return self._cache.ComputeRelativeTransform(prim, frame.root)[0] * frame.world_from_root

    def _instances(
        self, instancer: UsdGeom.PointInstancer, frame: _Frame, inside: tuple[str, ...], is_moving: bool
    ) -> Iterator[Placed]:
        """Yields what a PointInstancer shows: its prototypes, once for each visible instance."""
        prim, path = instancer.GetPrim(), str(instancer.GetPath())
        if path in inside:
            self._notes.add("the PointInstancer {} instances itself and was left out there", path)
            return
        stage = prim.GetStage()
        roots = [stage.GetPrimAtPath(p) for p in instancer.GetPrototypesRel().GetForwardedTargets()]
        which = np.asarray(instancer.GetProtoIndicesAttr().Get(self._time) or [], np.int64)
        # Without the prototypes' own transforms: with them USD gives nothing for one bad index.
        how = (instancer.ExcludeProtoXform, instancer.IgnoreMask)
        transforms = instancer.ComputeInstanceTransformsAtTime(self._time, self._time, *how)
        if not roots or len(transforms) != len(which):
            self._notes.add("the prototypes or positions of the PointInstancer {} do not fit; left out", path)
            return
        shown = np.asarray(instancer.ComputeMaskAtTime(self._time) or [True] * len(which), bool)
        valid = np.array([bool(r) for r in roots])
        good = (which >= 0) & (which < len(roots))
        good[good] = valid[which[good]]
        if not good[shown].all():
            self._notes.add("the PointInstancer {} names prototypes that are not there; left out", path)
        world_from_instancer = self._world(prim, frame)
        sizes = dict.fromkeys(("uniform", "vertex", "varying", "faceVarying"), len(which)) | {"constant": 1}
        authored = UsdGeom.PrimvarsAPI(prim).GetPrimvarsWithAuthoredValues()
        given = read_primvars(authored, self._time, sizes, self._notes)
        each = {name: v.flat for name, v in given.varying.items()}
        common = {**frame.primvars, **given.constant}
        is_moving = is_moving or any(prim.GetAttribute(name).ValueMightBeTimeVarying() for name in _OF_INSTANCES)
        for i in np.flatnonzero(shown & good):
            root = roots[which[i]]
            local = self._cache.GetLocalTransformation(root)[0]
            # A prototype elsewhere may serve several instancers: the brackets say which.
            own = root.GetPath().HasPrefix(prim.GetPath())
            yield from self._walk(
                root,
                None,
                _Frame(
                    local * transforms[int(i)] * world_from_instancer,
                    root,
                    f"{frame.suffix}[{i}]" if own else f"{frame.suffix}[{prim.GetName()}.{i}]",
                    {**common, **{name: v[i] for name, v in each.items()}},
                ),
                (*inside, path),
                is_moving,
            )


def _columns(rows: Gf.Matrix4d) -> F64:
    return np.array(rows, np.float64).T


def _writable(prim: Usd.Prim, frame: _Frame) -> str:
    """Where an opinion about a prim can be written: the root of its instance, or the prototype's prim."""
    if prim.IsInstanceProxy():
        at = prim
        while at.IsInstanceProxy():
            at = at.GetParent()
        return str(at.GetPath())
    return str(prim.GetPath()) if frame.suffix else ""
