"""The composition arcs that an opinion comes through: variants that hold it, classes that all instances inherit.

    variants_of(prim, name="") -> [(composed prim, variant set, variant)]    outermost first, () for none
    in_variants(path, variants) -> Sdf.Path                                  the same place inside them
    class_of(material) -> (composed prim, class) or None                     where all instances can be changed

Prims of instances are looked up in the prototype, whose prim index is that of one of its instances: only the
names below matter, so that paths are mapped by how deep they lie.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from pxr import Pcp, Sdf, Usd

Variants = tuple[tuple[Sdf.Path, str, str], ...]


def variants_of(prim: Usd.Prim, name: str = "") -> Variants:
    """Returns the variants that the strongest opinion on a property lies in.

    Without a name, or without any opinion on it, those that the prim is defined in.  What a variant holds is
    to be overridden in this variant only: another one means something else.
    """
    node = next(_nodes_with(prim, name), None) if name else None
    node = node or next(_nodes_with(prim, ""), None)
    found: dict[tuple[Sdf.Path, str], str] = {}
    while node:
        for prefix in node.path.GetPrefixes():
            if prefix.IsPrimVariantSelectionPath():
                group, chosen = prefix.GetVariantSelection()
                below = _depth(node.path) - _depth(prefix)
                found.setdefault((_above(prim.GetPath(), below), group), chosen)
        node = node.parent
    sets = sorted(found.items(), key=lambda item: item[0][0].pathElementCount)
    return tuple((path, group, chosen) for (path, group), chosen in sets)


def in_variants(path: Sdf.Path, variants: Variants) -> Sdf.Path:
    """Returns a prim path with the selections of the variants that its ancestors or itself have."""
    out = Sdf.Path.absoluteRootPath
    for prefix in path.GetPrefixes():
        out = out.AppendChild(prefix.name)
        for at, group, chosen in variants:
            if at == prefix:
                out = out.AppendVariantSelection(group, chosen)
    return out


def class_of(material: Usd.Prim) -> tuple[Sdf.Path, Sdf.Path] | None:
    """Returns the nearest prim above a material, else itself, that inherits a class, and this class.

    The class is one that the shot's own layers can say something about: of the shot, or implied by an asset.
    """
    above = [p for p in reversed(material.GetPath().GetPrefixes())]
    for path in [*above[1:], above[0]]:
        prim = material.GetStage().GetPrimAtPath(path)
        index = _own(prim).ComputeExpandedPrimIndex()
        for node in _in_order(index.rootNode):
            is_class = node.arcType == Pcp.ArcTypeInherit and not node.IsDueToAncestor()
            if is_class and node.layerStack == index.rootNode.layerStack and not node.path.HasPrefix(path):
                return path, node.path.StripAllVariantSelections()
    return None


def inherited_classes(stage: Usd.Stage) -> dict[Sdf.Path, Sdf.Path]:
    """Returns for each class that the shot's own layers speak of a prim that inherits it."""
    found: dict[Sdf.Path, Sdf.Path] = {}
    for prim in Usd.PrimRange(stage.GetPseudoRoot(), Usd.TraverseInstanceProxies()):
        index = _own(prim).GetPrimIndex()
        for node in _in_order(index.rootNode):
            if node.arcType == Pcp.ArcTypeInherit and node.layerStack == index.rootNode.layerStack:
                below = _depth(node.path) - _depth(node.GetPathAtIntroduction())
                user = _above(prim.GetPath(), below)
                found.setdefault(_above(node.path.StripAllVariantSelections(), below), user)
    return found


def _own(prim: Usd.Prim) -> Usd.Prim:
    return prim.GetPrimInPrototype() if prim.IsInstanceProxy() else prim


def _in_order(node: Pcp.NodeRef) -> Iterator[Pcp.NodeRef]:
    """Nodes from the strongest to the weakest."""
    yield node
    for child in node.children:
        yield from _in_order(child)


def _nodes_with(prim: Usd.Prim, name: str) -> Iterator[Pcp.NodeRef]:
    """Nodes with an opinion on a property, or those that define the prim."""
    for node in _in_order(_own(prim).GetPrimIndex().rootNode):
        for layer in node.layerStack.layers if node.hasSpecs else ():
            spec = layer.GetObjectAtPath(node.path.AppendProperty(name) if name else node.path)
            if spec and _says(spec):
                yield node
                break


def _says(spec: Sdf.Spec) -> bool:
    """Whether a spec is more than a declaration."""
    if isinstance(spec, Sdf.PrimSpec):
        return bool(spec.specifier != Sdf.SpecifierOver)
    return any(spec.HasInfo(name) for name in ("default", "timeSamples", "connectionPaths", "targetPaths"))


def _depth(path: Sdf.Path) -> int:
    return int(path.StripAllVariantSelections().pathElementCount)


def _above(path: Sdf.Path, steps: int) -> Sdf.Path:
    prefixes: Sequence[Sdf.Path] = path.GetPrefixes()
    return prefixes[len(prefixes) - 1 - steps]
