"""UsdPreviewSurface materials for gprims that show none, so that they can be edited.

    without_preview(stage) -> list[Usd.Prim]                   gprims and GeomSubsets, instance proxies too
    make_preview(stage, ocio, prims=None) -> PreviewMaterials        a layer to put over the shot
    write_made(look, made, materials) -> None                  those that a look layer edits, into it

A new material shows what the material of another renderer (mtlx, ri, arnold) shows that the gprim is bound to, as
near as a UsdPreviewSurface can: preview_look.py.  Where there is none that can be read, it shows displayColor and
displayOpacity, constant or by a primvar reader, on the fallbacks of UsdPreviewSurface.  Gprims share one that show
the same and are bound to the same.
Where a material of another context (mtlx, ri, ...) is bound, the new binding is for purpose preview only:
final renders keep theirs, and do not see the edits.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from pxr import Sdf, Usd, UsdGeom, UsdShade

from usdslf.color import USD_DEFAULT_SPACE, Color, color_of
from usdslf.usd.binding import bound_material, gprims_of, named_material, parts_of, preview_surface
from usdslf.usd.border import quiet_usd
from usdslf.usd.layer.look_layer import SCOPE, LookLayer
from usdslf.usd.notes import Notes
from usdslf.usd.preview.driven import Driven, constant
from usdslf.usd.preview.preview_look import Look, look_of
from usdslf.usd.preview.preview_nodes import write_preview
from usdslf.usd.shot_metadata import copy_shot_metadata, default_prim_name

GREY = (0.18, 0.18, 0.18)  # of UsdPreviewSurface
_DISPLAY = {"displayColor": ("diffuseColor", GREY), "displayOpacity": ("opacity", (1.0,))}


@dataclass(frozen=True)
class _Made:
    """A gprim or GeomSubset and what it gets."""

    prim: Sdf.Path
    material: Sdf.Path
    shows: Look
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


def make_preview(
    stage: Usd.Stage, ocio: str | None, prims: Iterable[Usd.Prim] | None = None
) -> PreviewMaterials:
    """Makes and binds UsdPreviewSurface materials for gprims and GeomSubsets that have none.

    Args:
        ocio: OpenColorIO config that knows the colour spaces of what they show; None: $OCIO, else the built-in one.
        prims: to be given materials; None: all that have none.
    """
    with quiet_usd():
        return _make_preview(stage, color_of(ocio, USD_DEFAULT_SPACE), prims)


def _make_preview(stage: Usd.Stage, color: Color, prims: Iterable[Usd.Prim] | None) -> PreviewMaterials:
    look, notes = LookLayer(stage), Notes()
    paths: dict[Any, Sdf.Path] = {}
    looks: dict[Any, Look | None] = {}
    made = []
    for prim in without_preview(stage) if prims is None else prims:
        gprim = prim.GetParent() if prim.IsA(UsdGeom.Subset) else prim
        bound = named_material(prim)
        shows = _shown(stage, color, prim, gprim, bound, looks, notes)
        key = (tuple(sorted(shows.items())), bound)
        if key not in paths:
            paths[key] = _free_path(look, gprim, set(paths.values()))
        relationship = "material:binding"
        if not bound.isEmpty:
            relationship = "material:binding:preview"
            if stage.GetPrimAtPath(bound):
                others = _contexts(stage, bound)
                notes.add(
                    f"final renders of {{}} keep {bound} ({others}) and do not show edits", prim.GetPath()
                )
            else:
                reason = "final renders of {} keep materials that this build cannot read and do not show edits"
                notes.add(reason, f"{prim.GetPath()} (bound to {bound})")
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


def write_made(
    look: LookLayer, made: Iterable[_Made], bound: set[Sdf.Path], inherited: Any = (), folder: Path | None = None
) -> None:
    """Writes new materials, and the bindings of those in `bound`; what the layer says already stays.

    Files are named from the folder, or from the root.
    """
    defined: set[Sdf.Path] = set()
    for each in made:
        if each.material not in bound and each.material not in inherited:
            continue
        if each.material not in defined:
            write_preview(look, each.material, each.shows, folder)
            defined.add(each.material)
        place = look.place(each.prim)
        has_own = look.layer.GetRelationshipAtPath(place.AppendProperty(each.relationship))
        if each.material in bound and not has_own:
            look.bind(each.prim, each.relationship, each.material)


def _bound(gprim: Usd.Prim) -> UsdShade.Shader | None:
    material = bound_material(gprim)
    return preview_surface(material) if material else None


def _contexts(stage: Usd.Stage, material: Sdf.Path) -> str:
    prim = stage.GetPrimAtPath(material)
    if not prim.IsA(UsdShade.Material):
        return f"a {prim.GetTypeName() or 'prim'}"
    outputs = [o for o in UsdShade.Material(prim).GetSurfaceOutputs() if o.HasConnectedSource()]
    return ", ".join(o.GetBaseName().rpartition(":")[0] or "universal" for o in outputs) or "no surface"


def _shown(
    stage: Usd.Stage, color: Color, prim: Usd.Prim, gprim: Usd.Prim, bound: Sdf.Path,
    looks: dict[Any, Look | None], notes: Notes,
) -> Look:  # fmt: skip
    """What a gprim shows: the look of the material that it is bound to, else its displayColor."""
    plain = _display(gprim)
    if bound.isEmpty:
        return plain
    display = UsdGeom.PrimvarsAPI(gprim).FindPrimvarWithInheritance("displayColor")
    shown = plain["diffuseColor"].number or () if display and display.HasValue() else ()
    if (bound, shown) not in looks:
        looks[bound, shown] = look_of(stage, color, bound, notes, shown)
    found = looks[bound, shown]
    if found is None and stage.GetPrimAtPath(bound):
        notes.add(f"{bound} ({_contexts(stage, bound)}) has no surface that can be shown: {{}} keeps its displayColor",
                  prim.GetPath())  # fmt: skip
    return found if found is not None else plain


def _display(gprim: Usd.Prim) -> Look:
    """displayColor and displayOpacity: a number, or the primvar where it varies."""
    look: Look = {}
    for name, (port, fallback) in _DISPLAY.items():
        primvar = UsdGeom.PrimvarsAPI(gprim).FindPrimvarWithInheritance(name)
        value = primvar.Get(Usd.TimeCode.EarliestTime()) if primvar else None
        if value is None or len(value) == 0:
            look[port] = constant(*fallback)
        elif len(value) > 1 or primvar.ValueMightBeTimeVarying():
            size = len(fallback)
            look[port] = Driven((1.0,) * size, (0.0,) * size, name, "rgb"[:size], fallback)
        else:
            look[port] = constant(*np.ravel(value[0]))
    if look["opacity"] == constant(1.0):
        del look["opacity"]
    return look


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
