"""The implicit gprims: Sphere, Cube, Cylinder, Cone, Capsule, Plane, Cylinder_1, Capsule_1."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

from pxr import Usd, UsdGeom

from usdslf.geometry import tessellation as tessellate
from usdslf.geometry.shape import Polygons
from usdslf.usd.notes import Notes

SIZES: dict[str, tuple[str, ...]] = {
    "Sphere": ("radius",),
    "Cube": ("size",),
    "Cylinder": ("radius", "radius", "height"),
    "Cone": ("radius", "height"),
    "Capsule": ("radius", "radius", "height"),
    "Plane": ("width", "length"),
    "Cylinder_1": ("radiusBottom", "radiusTop", "height"),
    "Capsule_1": ("radiusBottom", "radiusTop", "height"),
}


def read_implicit(prim: Usd.Prim, time: Usd.TimeCode, notes: Notes) -> Polygons | None:
    """Tessellates an implicit gprim; none (and a note) where a size is not a positive number."""
    kind = str(prim.GetTypeName())

    def get(name: str) -> Any:
        return prim.GetAttribute(name).Get(time)

    values = [float(get(name)) for name in SIZES[kind]]
    if not all(math.isfinite(v) and v >= 0 for v in values) or max(values) == 0:
        notes.add(f"the size of the {kind} {{}} is not a positive number; left out", prim.GetPath())
        return None
    if kind == "Sphere":
        return tessellate.sphere(values[0])
    if kind == "Cube":
        return tessellate.cube(values[0])
    axis = str(get("axis") or UsdGeom.Tokens.z)
    if axis not in ("X", "Y", "Z"):
        notes.add(f"the axis {axis} of the {kind} {{}} is none: Z is taken", prim.GetPath())
        axis = "Z"
    if kind == "Plane":
        # Width lies along X (along Z where the axis is X), length along Y (along Z where the axis is Y).
        width, length = values
        if axis in ("X", "Y"):
            width, length = length, width
        return tessellate.along(tessellate.plane(width, length), axis)
    make: dict[str, Callable[..., Polygons]] = {
        "Cone": tessellate.cone,
        "Capsule": tessellate.capsule,
        "Capsule_1": tessellate.capsule,
    }
    return tessellate.along(make.get(kind, tessellate.cylinder)(*values), axis)
