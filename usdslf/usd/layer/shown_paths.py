"""Where the opinions of a look layer are composed: those in a class show on what inherits it.

    ShownPaths(stage, layer)(path) -> Sdf.Path      composed path of a spec's; .users: class -> what inherits it
                           .is_selected(path)       whether it is in no variant that is not selected
    is_there(stage, path) -> bool                   whether a stage has a prim, defined or abstract
    shot_attribute(shot, layer, shown, path)        the shot's attribute that an opinion stands in for
    is_chosen(layer, path) -> bool                  whether the layer itself selects the alternative that a path is in
"""

from __future__ import annotations

from pxr import Sdf, Usd

from usdslf.usd.arcs import inherited_classes
from usdslf.usd.layer.silent import SILENT

ALTERNATIVES = "slfAlternatives"  # the variant set that a look's alternatives are in


class ShownPaths:
    """The composed paths of what a layer says."""

    def __init__(self, stage: Usd.Stage, layer: Sdf.Layer) -> None:
        self._stage, self._layer = stage, layer
        self.users: dict[Sdf.Path, Sdf.Path] = {}  # class -> what inherits it, in this layer or in the shot
        self._find_classes(layer.pseudoRoot)
        undefined = [s.path for s in layer.rootPrims if s.name != SILENT and not is_there(stage, self(s.path))]
        if undefined:  # perhaps the class of an asset, which only instances show
            classes = inherited_classes(stage)
            self.users |= {base: user for base, user in classes.items() if base.GetPrefixes()[0] in undefined}

    def _find_classes(self, spec: Sdf.PrimSpec) -> None:
        for child in spec.nameChildren:
            for base in child.inheritPathList.GetAddedOrExplicitItems():
                if base.IsRootPrimPath() and self._layer.GetPrimAtPath(base):
                    self.users[base] = child.path
            self._find_classes(child)
            for group in child.variantSets.values():
                for variant in group.variants.values():
                    self._find_classes(variant.primSpec)

    def is_selected(self, path: Sdf.Path) -> bool:
        """Whether what is written at a path is in no alternative, or in the one that is selected."""
        for prefix in path.GetPrefixes():
            if prefix.IsPrimVariantSelectionPath():
                group, chosen = prefix.GetVariantSelection()
                prim = self._stage.GetPrimAtPath(self(prefix))
                if group == ALTERNATIVES and prim and prim.GetVariantSet(group).GetVariantSelection() != chosen:
                    return False
        return True

    def __call__(self, path: Sdf.Path) -> Sdf.Path:
        """Returns the composed path of what is written at a path."""
        path = path.StripAllVariantSelections()
        while base := next((p for p in path.GetPrefixes() if p in self.users), None):
            path = path.ReplacePrefix(base, self.users[base])
        return path


def is_there(stage: Usd.Stage, path: Sdf.Path) -> bool:
    """Whether a stage has a prim at a path, defined or abstract."""
    prim = stage.GetPrimAtPath(path)
    return bool(prim) and (prim.IsDefined() or prim.IsAbstract())


def shot_attribute(shot: Usd.Stage, layer: Sdf.Layer, shown: ShownPaths, path: Sdf.Path) -> Usd.Attribute:
    """Returns the attribute of a shot that an opinion of a look stands in for; an invalid one where there is none.

    Args:
        shot: without the look.
        layer: the look.
        shown: its composed paths.
        path: of the opinion in the layer; in a Material of the look it is that of the Material which that comes from.
    """
    path = path.StripAllVariantSelections()
    if found := shot.GetAttributeAtPath(shown(path)):
        return found
    for prefix in path.GetPrimPath().GetPrefixes()[::-1]:
        if spec := layer.GetPrimAtPath(prefix):
            arcs = spec.specializesList, spec.inheritPathList
            for base in (x for arc in arcs for x in arc.GetAddedOrExplicitItems()):
                if found := shot.GetAttributeAtPath(shown(path.ReplacePrefix(prefix, base))):
                    return found
    return Usd.Attribute()


def is_chosen(layer: Sdf.Layer, path: Sdf.Path) -> bool:
    """Whether what is written at a path is in no alternative, or in the one that the layer itself selects."""
    for prefix in path.GetPrefixes():
        if prefix.IsPrimVariantSelectionPath() and prefix.GetVariantSelection()[0] == ALTERNATIVES:
            spec = layer.GetPrimAtPath(prefix.GetPrimPath())
            if spec and spec.variantSelections.get(ALTERNATIVES) != prefix.GetVariantSelection()[1]:
                return False
    return True
