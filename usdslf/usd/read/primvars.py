"""Primvars of gprims -> numbers, checked."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pxr import Usd, UsdGeom

from usdslf.geometry.shape import Values
from usdslf.scene.records import F64
from usdslf.usd.notes import Notes


@dataclass
class Primvars:
    """What a gprim carries: one value for all of it, or one for each element."""

    constant: dict[str, F64] = field(default_factory=dict)  # (k,)
    varying: dict[str, Values] = field(default_factory=dict)


def read_primvars(
    primvars: Iterable[UsdGeom.Primvar], time: Usd.TimeCode, sizes: dict[str, int], notes: Notes
) -> Primvars:
    """Reads the primvars that hold one to four numbers; texture coordinates are those with two.

    Args:
        sizes: how many values each interpolation wants.
    """
    out = Primvars()
    for primvar in primvars:
        name = str(primvar.GetPrimvarName())
        # Whatever its role, a reader of three floats takes it for a colour.
        if name == "normals" or name.startswith("skel:") or primvar.GetElementSize() != 1:
            continue
        values = numbers(primvar.GetAttr().Get(time))
        if values is None or values.shape[1] > 4:
            continue
        interpolation = str(primvar.GetInterpolation())
        prim = primvar.GetAttr().GetPath()
        if not np.isfinite(values).all():
            notes.add("the primvar {} holds nan or inf and was taken as 0 there", prim)
            values = np.nan_to_num(values, nan=0.0, posinf=0.0, neginf=0.0)
        indices = primvar.GetIndices(time) if primvar.IsIndexed() else None
        read = _checked(values, indices, interpolation, sizes)
        if read is None:
            notes.add("the primvar {} has a count or indices that do not fit its mesh; left out", prim)
        elif interpolation == "constant":
            out.constant[name] = read.flat[0]
            if len(read.flat) > 1:
                notes.add("the primvar {} is constant and has several values: the first is used", prim)
        else:
            out.varying[name] = read
    return out


def is_from_instancer(gprim: Usd.Prim, name: str) -> bool:
    """Whether a gprim of a PointInstancer has no primvar of a name of its own, nor from above within its prototype."""
    at = gprim
    while at and not at.IsPseudoRoot() and not at.IsA(UsdGeom.PointInstancer):
        if UsdGeom.PrimvarsAPI(at).GetPrimvar(name).HasAuthoredValue():
            return False
        at = at.GetParent()
    return True


def read_normals(
    mesh: UsdGeom.Mesh, time: Usd.TimeCode, sizes: dict[str, int], notes: Notes
) -> Values | None:
    """Reads authored normals; `primvars:normals` beats `normals`."""
    primvar = UsdGeom.PrimvarsAPI(mesh).GetPrimvar("normals")
    if primvar and primvar.HasAuthoredValue():
        raw, interpolation = primvar.GetAttr().Get(time), str(primvar.GetInterpolation())
        indices = primvar.GetIndices(time) if primvar.IsIndexed() else None
    else:
        raw, interpolation = mesh.GetNormalsAttr().Get(time), str(mesh.GetNormalsInterpolation())
        indices = None
    values = numbers(raw)
    if values is None or not len(values) or values.shape[1] != 3:
        return None
    read = _checked(values, indices, interpolation, sizes)
    if read is None:
        notes.add("the normals of {} do not fit its points and faces; it is shaded flat", mesh.GetPath())
        return None
    if interpolation == "constant":
        return Values("uniform", np.repeat(read.flat[:1], sizes["uniform"], axis=0))
    return read


def numbers(value: Any) -> F64 | None:
    """A USD value as numbers (n, k); none for anything else."""
    if value is None:
        return None
    array = np.asarray(value)
    if array.dtype.kind != "f" or array.ndim > 2 or type(value).__name__.startswith("Matrix"):
        return None
    if not hasattr(value, "__len__"):
        array = array.reshape(1, 1)
    elif array.ndim == 1:
        # A single vector, or an array of floats.
        array = array[None] if type(value).__name__.startswith("Vec") else array[:, None]
    return array.astype(np.float64)


def as_components(value: Any, size: int) -> F64:
    """A USD value of numbers as (n, size): a number is grey, of more components the first ones are taken."""
    values = numbers(value)
    assert values is not None, value
    return np.repeat(values, size, axis=1) if values.shape[1] == 1 else values[:, :size]


def _checked(values: F64, indices: Any, interpolation: str, sizes: dict[str, int]) -> Values | None:
    at: NDArray[np.int64] | None = None
    if indices is not None:
        at = np.asarray(indices, np.int64)
        if len(at) and (at.min() < 0 or at.max() >= len(values)):
            return None
    count = len(values) if at is None else len(at)
    want = sizes.get(interpolation)
    if want is None or (count < 1 if interpolation == "constant" else count != want):
        return None
    return Values(interpolation, values, at)
