"""Which material shows on a prim: asked of USD here and nowhere else.

    bound_relationship(prim) -> (material, relationship)   that shows; what a binding has to use to replace it
    shown_by(prim) -> relationship                         that shows it, as it is composed
    named_material(prim) -> path                           also one that is not there, or that this build cannot read
    preview_surface(material) -> Shader | None             its UsdPreviewSurface
    render_contexts(material) -> list[str]                 those that it has a surface output for, but the universal one
    parts_of(gprim), gprims_of(stage), users_of(stage, material) -> prims

Purpose preview, which falls back to all-purpose, where its material has a UsdPreviewSurface; else purpose full
where that one has; else what is bound for preview, else for full.  UsdShade resolves strengths, collections and
GeomSubsets.
"""

from __future__ import annotations

from collections.abc import Iterator

from pxr import Sdf, Usd, UsdGeom, UsdShade

BINDING = "material:binding"
PREVIEW = "UsdPreviewSurface"
_PURPOSES = (UsdShade.Tokens.preview, UsdShade.Tokens.allPurpose, UsdShade.Tokens.full)


def bound_material(prim: Usd.Prim) -> UsdShade.Material:
    """Returns the material that shows on a gprim or GeomSubset, an invalid one where nothing is bound."""
    return _bound(prim)[0]


def shown_by(prim: Usd.Prim) -> Usd.Relationship | None:
    """Returns the relationship by which the material of a gprim or GeomSubset shows: a binding, or a collection's."""
    material, relationship = _bound(prim)
    return relationship if material and relationship else None


def bound_relationship(prim: Usd.Prim) -> tuple[Sdf.Path, str]:
    """Returns the path of the material that shows on a prim, empty for none, and the relationship to replace it by."""
    material, relationship = _bound(prim)
    if not material or not relationship:
        return Sdf.Path.emptyPath, BINDING
    kinds = relationship.GetName().split(":")[2:]  # [purpose], or collection, [purpose,] name
    purpose = kinds[1 if kinds[0] == "collection" else 0] if len(kinds) in (1, 3) else ""
    return material.GetPath(), f"{BINDING}:{purpose}" if purpose in ("preview", "full") else BINDING


def _bound(prim: Usd.Prim) -> tuple[UsdShade.Material, Usd.Relationship]:
    api = UsdShade.MaterialBindingAPI(prim)
    preview = api.ComputeBoundMaterial(UsdShade.Tokens.preview)  # falls back to all-purpose
    if preview[0] and preview_surface(preview[0]):
        return preview
    full = api.ComputeBoundMaterial(UsdShade.Tokens.full)
    return full if full[0] and (not preview[0] or preview_surface(full[0])) else preview


def final_material(prim: Usd.Prim) -> UsdShade.Material:
    """Returns the material of purpose full, which final renders show; an invalid one where nothing is bound."""
    return UsdShade.MaterialBindingAPI(prim).ComputeBoundMaterial(UsdShade.Tokens.full)[0]


def named_material(prim: Usd.Prim) -> Sdf.Path:
    """Returns the material that shows, or that the nearest prim names directly, be it one that does not exist."""
    found = bound_relationship(prim)[0]
    while found.isEmpty and prim and not prim.IsPseudoRoot():
        api = UsdShade.MaterialBindingAPI(prim)
        named = (api.GetDirectBinding(purpose).GetMaterialPath() for purpose in _PURPOSES)
        found = next((path for path in named if not path.isEmpty), found)
        prim = prim.GetParent()
    return found


def preview_surface(material: UsdShade.Material) -> UsdShade.Shader | None:
    """Returns the UsdPreviewSurface of a material: of the universal context, else of any."""
    for context in ["", *render_contexts(material)]:
        shader = material.ComputeSurfaceSource(context)[0]
        if shader and shader.GetIdAttr().Get() == PREVIEW:
            return shader
    return None


def render_contexts(material: UsdShade.Material, connected: bool = False) -> list[str]:
    """Returns the render contexts, but the universal one, that a material has a surface output for.

    Connected: only those whose output leads somewhere.
    """
    outputs = [o for o in material.GetSurfaceOutputs() if not connected or o.HasConnectedSource()]
    names = [output.GetBaseName().rpartition(":")[0] for output in outputs]
    return [n for n in names if n]


def parts_of(gprim: Usd.Prim) -> list[Usd.Prim]:
    """Returns a gprim and its GeomSubsets that bind materials."""
    return [gprim, *(s.GetPrim() for s in UsdShade.MaterialBindingAPI(gprim).GetMaterialBindSubsets())]


def gprims_of(stage: Usd.Stage) -> Iterator[Usd.Prim]:
    """Yields all gprims: instance proxies too, and prototypes of PointInstancers below an `over` or a class."""
    seen: set[Sdf.Path] = set()
    anywhere = Usd.TraverseInstanceProxies(Usd.PrimIsActive & Usd.PrimIsLoaded)
    todo = [(stage.GetPseudoRoot(), Usd.TraverseInstanceProxies())]
    while todo:
        root, predicate = todo.pop()
        for prim in Usd.PrimRange(root, predicate) if root else ():
            if prim.IsA(UsdGeom.Gprim) and prim.GetPath() not in seen:
                seen.add(prim.GetPath())
                yield prim
            elif prim.IsA(UsdGeom.PointInstancer) and prim.GetPath() not in seen:
                seen.add(prim.GetPath())
                targets = UsdGeom.PointInstancer(prim).GetPrototypesRel().GetForwardedTargets()
                todo += [(stage.GetPrimAtPath(t), anywhere) for t in targets]


def users_of(stage: Usd.Stage, material: Sdf.Path) -> list[Usd.Prim]:
    """Returns the gprims and GeomSubsets that show a material; instance proxies too."""
    return [p for gprim in gprims_of(stage) for p in parts_of(gprim) if bound_relationship(p)[0] == material]
