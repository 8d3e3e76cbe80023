"""Which gprims show what a look layer says, and in which final renders they do not.

    gprims_reached(review, layer) -> {spec path: gprims}         for each prim of the layer that shows somewhere
    changed_along(review, edits) -> list[str]                    sentences on materials that are not edited, but change
    read_by_others(stage, material) -> paths                     of nodes that other materials read
    final_renders(review, gprims) -> list[str]                   sentences on renders that do not see an edit
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Protocol

from pxr import Sdf, Usd, UsdShade

from usdslf.usd.binding import bound_relationship, final_material, gprims_of, parts_of, render_contexts
from usdslf.usd.notes import Notes


class Edit(Protocol):
    """An opinion of a look: where it is composed, and the gprims and GeomSubsets that show it."""

    @property
    def shown_at(self) -> str: ...
    @property
    def affects(self) -> tuple[str, ...]: ...


def gprims_reached(review: Usd.Stage, layer: Sdf.Layer) -> dict[Sdf.Path, list[str]]:
    """Returns for each prim spec of a layer the gprims and GeomSubsets that it is part of the look of."""
    said_by: dict[Sdf.Path, set[Sdf.Path]] = {}  # material -> specs of the layer
    found: dict[Sdf.Path, list[str]] = {}
    for gprim in gprims_of(review):
        for part in parts_of(gprim):
            specs = _specs(part, layer)
            material = review.GetPrimAtPath(bound_relationship(part)[0])
            if material:
                key = (material.GetPrimInPrototype() if material.IsInstanceProxy() else material).GetPath()
                if key not in said_by:
                    said_by[key] = {s for p in network_of(material) for s in _specs(p, layer)}
                specs = specs | said_by[key]
            for spec in specs:
                found.setdefault(spec, []).append(str(part.GetPath()))
    return found


def _specs(prim: Usd.Prim, layer: Sdf.Layer) -> set[Sdf.Path]:
    return {s.path for s in prim.GetPrimStack() if s.layer == layer}


def network_of(material: Usd.Prim) -> list[Usd.Prim]:
    """Returns the prims of a material and those that it is connected to elsewhere."""
    stage = material.GetStage()
    todo, seen = list(Usd.PrimRange(material, Usd.TraverseInstanceProxies())), {}
    while todo:
        prim = todo.pop()
        if not prim or prim.GetPath() in seen:
            continue
        seen[prim.GetPath()] = prim
        for attribute in prim.GetAuthoredAttributes():
            todo += [stage.GetPrimAtPath(c.GetPrimPath()) for c in attribute.GetConnections()]
    return list(seen.values())


def read_by_others(stage: Usd.Stage, material: Sdf.Path) -> set[Sdf.Path]:
    """Returns the paths of all prims that other materials read which gprims show: their own and borrowed ones."""
    found: dict[Sdf.Path, Usd.Prim] = {}
    for gprim in gprims_of(stage):
        for part in parts_of(gprim):
            path = bound_relationship(part)[0]
            if not path.isEmpty and path != material:
                found[path] = stage.GetPrimAtPath(path)
    return {p.GetPath() for prim in found.values() for p in network_of(prim)}


def changed_along(review: Usd.Stage, edits: Iterable[Edit]) -> list[str]:
    """Returns a sentence for each material that changes because it references or inherits one that is edited.

    So too for those that read a node which stands in no material.
    """
    notes = Notes()
    for edit in edits:
        at = Sdf.Path(edit.shown_at).GetPrimPath()
        if edit.affects and _is_node_of_none(review, at):
            shown_by = dict.fromkeys(bound_relationship(review.GetPrimAtPath(p))[0] for p in edit.affects)
            for shown in shown_by if len(shown_by) > 1 else ():
                notes.add(f"{{}} read the node {at}, and change together", shown)
        for path in edit.affects:
            shown = bound_relationship(review.GetPrimAtPath(path))[0]
            material = next((p for p in reversed(at.GetPrefixes()) if _is_material(review, p)), None)
            if material and not at.HasPrefix(shown) and not _inherits(review, shown, material):
                notes.add(f"{{}} take their values from {material} by reference, and change with it", shown)
    return notes.sentences()


def _is_node_of_none(stage: Usd.Stage, path: Sdf.Path) -> bool:
    is_node = bool(UsdShade.ConnectableAPI(stage.GetPrimAtPath(path)))
    return is_node and not any(_is_material(stage, p) for p in path.GetPrefixes())


def _is_material(stage: Usd.Stage, path: Sdf.Path) -> bool:
    prim = stage.GetPrimAtPath(path)
    return bool(prim) and prim.IsA(UsdShade.Material)


def _inherits(stage: Usd.Stage, shown: Sdf.Path, material: Sdf.Path) -> bool:
    """Whether a material is one that a look made of another."""
    return material in stage.GetPrimAtPath(shown).GetInherits().GetAllDirectInherits()


def final_renders(review: Usd.Stage, gprims: Iterable[str]) -> list[str]:
    """Returns a sentence for each kind of final render that does not see an edit of what gprims show."""
    notes = Notes()
    for path in gprims:
        prim = review.GetPrimAtPath(path)
        shown = bound_relationship(prim)[0]
        full = final_material(prim)
        if full and full.GetPath() != shown:
            where = ", ".join(render_contexts(full, connected=True)) or "any renderer"
            notes.add(
                f"final renders of {{}} by {where} show {full.GetPath()}, bound for purpose full, "
                "and do not see the edit", path,
            )  # fmt: skip
        elif full and (others := render_contexts(full, connected=True)):
            where = ", ".join(others)
            notes.add(
                f"final renders of {{}} by {where} use another surface of {shown} and do not see the edit", path
            )
    return notes.sentences()
