"""UsdPreviewSurface materials for gprims that show none, so that they can be edited.

    without_preview(stage) -> list[Usd.Prim]                   gprims and GeomSubsets, instance proxies too
    make_preview(stage, prims=None) -> PreviewMaterials        a layer to put over the shot
    write_made(look, made, materials) -> None                  those that a look layer edits, into it

A new material reproduces what the gprim shows without one: its displayColor and displayOpacity, constant or
by a primvar reader, on the fallbacks of UsdPreviewSurface.  Gprims share one that show the same and are
bound to the same.
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
from usdslf.usd.look_layer import LookLayer, bound_relationship, gprims_of, parts_of, preview_surface
from usdslf.usd.notes import Notes
from usdslf.usd.shot_metadata import copy_shot_metadata, default_prim_name

Names = Sdf.ValueTypeNames
GREY = (0.18, 0.18, 0.18)  # of UsdPreviewSurface
# primvar: input, type of the input, id and type of the reader
_DISPLAY = {
    "displayColor": ("diffuseColor", Names.Color3f, "UsdPrimvarReader_float3", Names.Float3),
    "displayOpacity": ("opacity", Names.Float, "UsdPrimvarReader_float", Names.Float),
}


Shows = dict[str, tuple[float, ...] | str]


@dataclass(frozen=True)
class _Made:
    """A gprim or GeomSubset and what it gets."""

    prim: Sdf.Path
    material: Sdf.Path
    shows: Shows
    relationship: str


@dataclass(frozen=True)
class PreviewMaterials:
    """New materials, in a layer that is in no stage yet."""

    layer: Sdf.Layer
    material_of: dict[str, str]  # gprim or GeomSubset -> new material
    warnings: tuple[str, ...]
    made: tuple[_Made, ...]


def without_preview(stage: Usd.Stage) -> list[Usd.Prim]:
    """Returns the gprims and GeomSubsets that show no UsdPreviewSurface."""
    return [p for gprim in gprims_of(stage) for p in parts_of(gprim) if _bound(p) is None]


def make_preview(stage: Usd.Stage, prims: Iterable[Usd.Prim] | None = None) -> PreviewMaterials:
    """Makes and binds UsdPreviewSurface materials for gprims and GeomSubsets that have none."""
    look, notes = LookLayer(stage), Notes()
    paths: dict[Any, Sdf.Path] = {}
    made = []
    for prim in without_preview(stage) if prims is None else prims:
        gprim = prim.GetParent() if prim.IsA(UsdGeom.Subset) else prim
        shows = {name: _display(gprim, name) for name in _DISPLAY}
        bound = _named_material(prim)
        key = (*shows.values(), bound)
        if key not in paths:
            paths[key] = _free_path(look, gprim, set(paths.values()))
        relationship = "material:binding"
        if not bound.isEmpty:
            relationship = "material:binding:preview"
            others = _contexts(stage, bound)
            notes.add(f"final renders of {{}} keep {bound} ({others}) and do not show edits", prim.GetPath())
        made.append(_Made(prim.GetPath(), paths[key], shows, relationship))
    write_made(look, made, set(paths.values()))
    copy_shot_metadata(stage, look.layer)
    if name := default_prim_name(stage):
        look.layer.defaultPrim = name
    material_of = {str(m.prim): str(m.material) for m in made}
    return PreviewMaterials(look.layer, material_of, tuple(notes.sentences()), tuple(made))


def edited_ones(made: PreviewMaterials, look: Sdf.Layer) -> tuple[set[Sdf.Path], set[Sdf.Path]]:
    """Returns which new materials a look layer has opinions on, and which it inherits only."""
    bases: set[Sdf.Path] = set()

    def visit(path: Sdf.Path) -> None:
        if path.IsPrimPath():
            bases.update(look.GetPrimAtPath(path).inheritPathList.GetAddedOrExplicitItems())

    look.Traverse(Sdf.Path.absoluteRootPath, visit)
    materials = {m.material for m in made.made}
    edited = {m for m in materials if look.GetPrimAtPath(m)}
    return edited, (materials & bases) - edited


def write_made(look: LookLayer, made: Iterable[_Made], bound: set[Sdf.Path], inherited: Any = ()) -> None:
    """Writes new materials, and the bindings of those in `bound`; what the layer says already stays."""
    defined: set[Sdf.Path] = set()
    for each in made:
        if each.material not in bound and each.material not in inherited:
            continue
        if each.material not in defined:
            _define(look, each.material, each.shows)
            defined.add(each.material)
        place = look.place(each.prim)
        has_own = look.layer.GetRelationshipAtPath(place.AppendProperty(each.relationship))
        if each.material in bound and not has_own:
            look.bind(each.prim, each.relationship, each.material)


def _bound(gprim: Usd.Prim) -> UsdShade.Shader | None:
    prim = gprim.GetStage().GetPrimAtPath(bound_relationship(gprim)[0])
    return preview_surface(UsdShade.Material(prim)) if prim else None


def _contexts(stage: Usd.Stage, material: Sdf.Path) -> str:
    prim = stage.GetPrimAtPath(material)
    if not prim or not prim.IsA(UsdShade.Material):
        return "which this build cannot read"
    outputs = UsdShade.Material(prim).GetSurfaceOutputs()
    return ", ".join(o.GetBaseName().rpartition(":")[0] or "universal" for o in outputs) or "no surface"


def _display(gprim: Usd.Prim, name: str) -> tuple[float, ...] | str:
    """The one value of a display primvar, its name where it varies, or () where there is none."""
    primvar = UsdGeom.PrimvarsAPI(gprim).FindPrimvarWithInheritance(name)
    value = primvar.Get(Usd.TimeCode.EarliestTime()) if primvar else None
    if value is None or len(value) == 0:
        return ()
    varies = len(value) > 1 or primvar.ValueMightBeTimeVarying()
    return name if varies else tuple(float(x) for x in np.ravel(value[0]))


def _named_material(prim: Usd.Prim) -> Sdf.Path:
    """The material that a prim is bound to, be it one that this build cannot read; empty for none."""
    found = bound_relationship(prim)[0]
    while found.isEmpty and prim and not prim.IsPseudoRoot():
        for purpose in (UsdShade.Tokens.preview, UsdShade.Tokens.allPurpose, UsdShade.Tokens.full):
            path = UsdShade.MaterialBindingAPI(prim).GetDirectBinding(purpose).GetMaterialPath()
            found = path if found.isEmpty else found
        prim = prim.GetParent()
    return found


def _free_path(look: LookLayer, gprim: Usd.Prim, taken: set[Sdf.Path]) -> Sdf.Path:
    """The path of a new material, outside of all instances."""
    root = Sdf.Path.absoluteRootPath.AppendChild(gprim.GetPath().GetPrefixes()[0].name)
    if look.stage.GetPrimAtPath(root).IsInstance() or root == gprim.GetPath():
        root = Sdf.Path.absoluteRootPath
    path, number = root.AppendChild(SCOPE).AppendChild(f"preview_{gprim.GetName()}"), 1
    free = look.free_path(path)
    while free in taken:
        number += 1
        free = look.free_path(path.ReplaceName(f"{path.name}_{number}"))
    return free


def _define(look: LookLayer, path: Sdf.Path, shows: Shows) -> None:
    """Defines a material that shows what a gprim shows without one."""
    if not look.stage.GetPrimAtPath(path.GetParentPath()):
        look.define(path.GetParentPath(), "Scope")
    material = look.define(path, "Material")
    shader = look.define(path.AppendChild("surface"), "Shader")
    _say_id(shader, "UsdPreviewSurface")
    output = shader.path.AppendProperty("outputs:surface")
    if not look.layer.GetAttributeAtPath(output):
        Sdf.AttributeSpec(shader, "outputs:surface", Names.Token, declaresCustom=False)
    _connect(material, "outputs:surface", Names.Token, output)
    for name, (port, kind, reader_id, reader_type) in _DISPLAY.items():
        value = shows[name]
        if isinstance(value, str):
            reader = look.define(path.AppendChild(name), "Shader")
            _say_id(reader, reader_id)
            fallback = Gf.Vec3f(*GREY) if port == "diffuseColor" else 1.0
            _put_new(look, reader, "inputs:varname", Names.String, name)
            _put_new(look, reader, "inputs:fallback", reader_type, fallback)
            if "outputs:result" not in reader.attributes:
                Sdf.AttributeSpec(reader, "outputs:result", reader_type, declaresCustom=False)
            _connect(shader, f"inputs:{port}", kind, reader.path.AppendProperty("outputs:result"))
        elif port == "diffuseColor":
            _put_new(look, shader, "inputs:diffuseColor", kind, Gf.Vec3f(*(value or GREY)))
        elif value and value != (1.0,):
            _put_new(look, shader, "inputs:opacity", kind, value[0])


def _put_new(look: LookLayer, spec: Sdf.PrimSpec, name: str, kind: Sdf.ValueTypeName, value: Any) -> None:
    if name not in spec.attributes:
        look.put(spec, name, kind, value)


def _say_id(spec: Sdf.PrimSpec, name: str) -> None:
    if "info:id" in spec.attributes:
        return
    attribute = Sdf.AttributeSpec(spec, "info:id", Names.Token, Sdf.VariabilityUniform, declaresCustom=False)
    attribute.default = name


def _connect(spec: Sdf.PrimSpec, name: str, kind: Sdf.ValueTypeName, source: Sdf.Path) -> None:
    if name in spec.attributes:
        return
    attribute = Sdf.AttributeSpec(spec, name, kind, declaresCustom=False)
    attribute.connectionPathList.ClearEditsAndMakeExplicit()
    attribute.connectionPathList.explicitItems = [source]
