"""Where the values of a primvar come from that a material reads: gprims, prims above them, and PointInstancers.

    primvar_places(stage, gprims, name, time) -> (list[Place], some have none)
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

from pxr import Sdf, Usd, UsdGeom

from usdslf.usd.notes import Notes
from usdslf.usd.read.primvars import is_from_instancer, read_primvars

PER_INSTANCE = ("uniform", "vertex", "varying", "faceVarying")


@dataclass(frozen=True)
class Place:
    """A prim that an own primvar goes on, and the primvar that it takes the place of."""

    prim: Usd.Prim
    primvar: UsdGeom.Primvar
    values: Any  # at the time that was asked for


def primvar_places(
    stage: Usd.Stage, gprims: Iterable[Usd.Prim], name: str, time: Usd.TimeCode
) -> tuple[list[Place], bool]:
    """Returns where a primvar is read from, and whether a gprim has none (or one whose count does not fit).

    Args:
        gprims: that read it.
        name: without `primvars:`.
    """
    found: dict[Sdf.Path, Place] = {}
    instancers = None
    lacks = False
    for gprim in gprims:
        primvar = UsdGeom.PrimvarsAPI(gprim).FindPrimvarWithInheritance(name)
        at: list[tuple[Usd.Prim, UsdGeom.Primvar]] = []
        if primvar and primvar.HasValue() and _fits(primvar, _sizes(gprim, time), time):
            at = [(gprim, primvar)]
        if not at or is_from_instancer(gprim, name):
            instancers = instancers if instancers is not None else _instancers(stage)
            given = [(i, UsdGeom.PrimvarsAPI(i).GetPrimvar(name)) for i in _showing(instancers, gprim)]
            given = [(i, p) for i, p in given if p and p.HasValue() and _fits(p, _sizes(i, time), time)]
            # A constant of an instancer above the prototype in namespace comes down as any other.
            at = [(i, p) for i, p in given if not (at and p.GetInterpolation() == "constant")] or at
        lacks |= not at
        found |= {prim.GetPath(): Place(prim, p, p.Get(time)) for prim, p in at}
    return list(found.values()), lacks


def _instancers(stage: Usd.Stage) -> list[tuple[Usd.Prim, list[Sdf.Path]]]:
    anywhere = Usd.TraverseInstanceProxies(Usd.PrimIsActive & Usd.PrimIsLoaded)
    out = []
    for prim in Usd.PrimRange(stage.GetPseudoRoot(), anywhere):
        if prim.IsA(UsdGeom.PointInstancer):
            out.append((prim, UsdGeom.PointInstancer(prim).GetPrototypesRel().GetForwardedTargets()))
    return out


def _showing(instancers: list[tuple[Usd.Prim, list[Sdf.Path]]], gprim: Usd.Prim) -> list[Usd.Prim]:
    return [i for i, roots in instancers if any(gprim.GetPath().HasPrefix(r) for r in roots)]


def _fits(primvar: UsdGeom.Primvar, sizes: dict[str, int], time: Usd.TimeCode) -> bool:
    """Whether the reader takes the values of a primvar."""
    read = read_primvars([primvar], time, sizes, Notes())
    values = [*read.constant.values(), *(v.flat[0] for v in read.varying.values() if len(v.flat))]
    return any(len(v) != 2 for v in values)  # two numbers are texture coordinates, and no colour


def _sizes(prim: Usd.Prim, time: Usd.TimeCode) -> dict[str, int]:
    """How many values each interpolation wants."""
    if prim.IsA(UsdGeom.PointInstancer):
        count = len(UsdGeom.PointInstancer(prim).GetProtoIndicesAttr().Get(time) or ())
        return dict.fromkeys(PER_INSTANCE, count) | {"constant": 1}
    if not prim.IsA(UsdGeom.Mesh):
        return {"constant": 1}
    mesh = UsdGeom.Mesh(prim)
    points = len(mesh.GetPointsAttr().Get(time) or ())
    faces = len(mesh.GetFaceVertexCountsAttr().Get(time) or ())
    corners = len(mesh.GetFaceVertexIndicesAttr().Get(time) or ())
    return {"constant": 1, "uniform": faces, "vertex": points, "varying": points, "faceVarying": corners}
