"""UsdPreviewSurface materials for gprims that show none, so that they can be edited.

    without_preview(stage) -> list[Usd.Prim]                   gprims, instance proxies too
    make_preview(stage, gprims=None) -> PreviewMaterials       a layer to put over the shot

A new material reproduces what the gprim shows without one: its displayColor and displayOpacity, constant or
by a primvar reader, on the fallbacks of UsdPreviewSurface.  Gprims that show the same share a material.
Where a material of another context (mtlx, ri, ...) is bound, the new binding is for purpose preview only:
final renders keep theirs, and do not see the edits.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np
from pxr import Gf, Sdf, Usd, UsdGeom, UsdShade

from usdslf.usd.change_writer import SCOPE
from usdslf.usd.look_layer import LookLayer, bound_relationship, preview_surface
from usdslf.usd.notes import Notes
from usdslf.usd.shot_metadata import copy_shot_metadata, default_prim_name

Names = Sdf.ValueTypeNames
GREY = (0.18, 0.18, 0.18)  # of UsdPreviewSurface
# primvar: input, type of the input, id and type of the reader
_DISPLAY = {
    "displayColor": ("diffuseColor", Names.Color3f, "UsdPrimvarReader_float3", Names.Float3),
    "displayOpacity": ("opacity", Names.Float, "UsdPrimvarReader_float", Names.Float),
}


@dataclass(frozen=True)
class PreviewMaterials:
    """New materials, in a layer that is in no stage yet."""

    layer: Sdf.Layer
    material_of: dict[str, str]  # gprim -> new material
    warnings: tuple[str, ...]


def without_preview(stage: Usd.Stage) -> list[Usd.Prim]:
    """Returns the gprims that show no UsdPreviewSurface."""
    prims = Usd.PrimRange(stage.GetPseudoRoot(), Usd.TraverseInstanceProxies())
    return [p for p in prims if p.IsA(UsdGeom.Gprim) and _bound(p) is None]


def make_preview(stage: Usd.Stage, gprims: Iterable[Usd.Prim] | None = None) -> PreviewMaterials:
    """Makes and binds UsdPreviewSurface materials for gprims that have none."""
    look, notes = LookLayer(stage), Notes()
    made: dict[Any, Sdf.Path] = {}
    material_of = {}
    for gprim in without_preview(stage) if gprims is None else gprims:
        shows = {name: _display(gprim, name) for name in _DISPLAY}
        key = tuple(shows.values())
        if key not in made:
            made[key] = _define(look, gprim, shows)
        bound = bound_relationship(gprim)
        purpose = "material:binding"
        if not bound[0].isEmpty:
            purpose = "material:binding:preview"
            others = _contexts(stage, bound[0])
            notes.add(
                f"final renders of {{}} keep {bound[0]} ({others}) and do not show edits", gprim.GetPath()
            )
        look.bind(gprim.GetPath(), purpose, made[key])
        material_of[str(gprim.GetPath())] = str(made[key])
    copy_shot_metadata(stage, look.layer)
    if name := default_prim_name(stage):
        look.layer.defaultPrim = name
    return PreviewMaterials(look.layer, material_of, tuple(notes.sentences()))


def _bound(gprim: Usd.Prim) -> UsdShade.Shader | None:
    prim = gprim.GetStage().GetPrimAtPath(bound_relationship(gprim)[0])
    return preview_surface(UsdShade.Material(prim)) if prim else None


def _contexts(stage: Usd.Stage, material: Sdf.Path) -> str:
    outputs = UsdShade.Material(stage.GetPrimAtPath(material)).GetSurfaceOutputs()
    return ", ".join(o.GetBaseName().rpartition(":")[0] or "universal" for o in outputs) or "no surface"


def _display(gprim: Usd.Prim, name: str) -> tuple[float, ...] | str:
    """The one value of a display primvar, its name where it varies, or () where there is none."""
    primvar = UsdGeom.PrimvarsAPI(gprim).FindPrimvarWithInheritance(name)
    value = primvar.Get(Usd.TimeCode.EarliestTime()) if primvar else None
    if value is None or len(value) == 0:
        return ()
    varies = len(value) > 1 or primvar.ValueMightBeTimeVarying()
    return name if varies else tuple(float(x) for x in np.ravel(value[0]))


def _define(look: LookLayer, gprim: Usd.Prim, shows: dict[str, tuple[float, ...] | str]) -> Sdf.Path:
    """Defines a material outside of all instances; returns its path."""
    root = Sdf.Path.absoluteRootPath.AppendChild(gprim.GetPath().GetPrefixes()[0].name)
    if look.stage.GetPrimAtPath(root).IsInstance() or root == gprim.GetPath():
        root = Sdf.Path.absoluteRootPath
    scope = root.AppendChild(SCOPE)
    if not look.stage.GetPrimAtPath(scope):
        look.define(scope, "Scope")
    path = look.free_path(scope.AppendChild(f"preview_{gprim.GetName()}"))
    material = look.define(path, "Material")
    shader = look.define(path.AppendChild("surface"), "Shader")
    _say_id(shader, "UsdPreviewSurface")
    Sdf.AttributeSpec(shader, "outputs:surface", Names.Token, declaresCustom=False)
    _connect(material, "outputs:surface", Names.Token, shader.path.AppendProperty("outputs:surface"))
    for name, (port, kind, reader_id, reader_type) in _DISPLAY.items():
        value = shows[name]
        if isinstance(value, str):
            reader = look.define(path.AppendChild(name), "Shader")
            _say_id(reader, reader_id)
            look.put(reader, "inputs:varname", Names.String, name)
            fallback = Gf.Vec3f(*GREY) if port == "diffuseColor" else 1.0
            look.put(reader, "inputs:fallback", reader_type, fallback)
            Sdf.AttributeSpec(reader, "outputs:result", reader_type, declaresCustom=False)
            _connect(shader, f"inputs:{port}", kind, reader.path.AppendProperty("outputs:result"))
        elif port == "diffuseColor":
            look.put(shader, "inputs:diffuseColor", kind, Gf.Vec3f(*(value or GREY)))
        elif value and value != (1.0,):
            look.put(shader, "inputs:opacity", kind, value[0])
    return path


def _say_id(spec: Sdf.PrimSpec, name: str) -> None:
    attribute = Sdf.AttributeSpec(spec, "info:id", Names.Token, Sdf.VariabilityUniform, declaresCustom=False)
    attribute.default = name


def _connect(spec: Sdf.PrimSpec, name: str, kind: Sdf.ValueTypeName, source: Sdf.Path) -> None:
    attribute = Sdf.AttributeSpec(spec, name, kind, declaresCustom=False)
    attribute.connectionPathList.ClearEditsAndMakeExplicit()
    attribute.connectionPathList.explicitItems = [source]
