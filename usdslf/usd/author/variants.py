"""Alternatives that travel: explanations as variants of one Material, between which any USD program flips.

    gather_variants(layer, paths) -> Sdf.Path         Materials of a look, by name, as variants of the first
    flatten_variants(layer, material, chosen)         one of them, without the others
    variants_in(layer) -> {Material: names}           of a look
    variant_name(explanation) -> str                  "diffuse+glossiness" -> "diffuse_glossiness"

Variants are weaker than local opinions and than what is inherited, so they are nothing on a Material that the shot
itself authors, and nothing on one that inherits it.  They stand on a new Material that *specializes* the shot's, which
is the weakest arc: what a variant says wins over all that comes from there, be that authored in the shot, referenced,
or in an instance.  What shows the shot's Material is bound to the new one, by the look.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping

from pxr import Sdf, Vt

from usdslf.usd.layer.hand_edits import specs_of
from usdslf.usd.layer.opinions import targets_of
from usdslf.usd.layer.shown_paths import ALTERNATIVES
from usdslf.usd.layer.silent import below
from usdslf.usd.look_data import KEY, our_data

AS_IT_WAS = "as_in_the_shot"  # the variant without an opinion


def variant_name(explanation: str) -> str:
    """Returns the name of the variant of an explanation."""
    return re.sub(r"\W+", "_", explanation).strip("_") or AS_IT_WAS


def gather_variants(layer: Sdf.Layer, original: Sdf.Path, made: Mapping[str, Sdf.Path]) -> Sdf.Path:
    """Makes Materials of a look, each a whole explanation, variants of the first; the first is selected.

    Args:
        layer: the look; what binds one of them binds the first afterwards.
        original: the Material of the shot that they stand for.
        made: by name of the variant the path of its Material in the layer.

    Returns: the path of the Material that has the variants.
    """
    names = list(made)
    home = made[names[0]]
    spec = layer.GetPrimAtPath(home)
    group = Sdf.VariantSetSpec(spec, ALTERNATIVES)
    for name, path in made.items():
        Sdf.VariantSpec(group, name)
        _move_into(layer, path, home.AppendVariantSelection(ALTERNATIVES, name), home)
    Sdf.VariantSpec(group, AS_IT_WAS)
    spec.inheritPathList.ClearEdits()
    spec.specializesList.Prepend(original)
    spec.variantSetNameList.Prepend(ALTERNATIVES)
    spec.variantSelections[ALTERNATIVES] = names[0]
    for path in list(made.values())[1:]:
        gone = layer.GetPrimAtPath(path)
        del gone.nameParent.nameChildren[gone.name]
    others = set(made.values())
    for each in list(specs_of(layer)):
        if isinstance(each, Sdf.RelationshipSpec):
            targets = each.targetPathList.GetAddedOrExplicitItems()
            if others & set(targets):
                each.targetPathList.explicitItems = [home if t in others else t for t in targets]
        if isinstance(each, Sdf.PropertySpec):
            _retarget(each, {str(p) for p in others}, str(home))
    return home


def flatten_variants(layer: Sdf.Layer, material: Sdf.Path, chosen: str) -> None:
    """Leaves one of the variants of a Material of a look, as opinions of its own.

    Args:
        material: path in the layer.
        chosen: name of a variant.
    """
    spec = layer.GetPrimAtPath(material)
    source = layer.GetPrimAtPath(material.AppendVariantSelection(ALTERNATIVES, chosen))
    if data := dict(source.customData):
        spec.SetInfo("customData", {**spec.customData, **data})
    for prop in list(source.properties):
        Sdf.CopySpec(layer, prop.path, layer, material.AppendProperty(prop.name))
    for child in list(source.nameChildren):
        Sdf.CopySpec(layer, child.path, layer, material.AppendChild(child.name))
    del spec.variantSets[ALTERNATIVES]
    spec.variantSetNameList.RemoveItemEdits(ALTERNATIVES)
    del spec.variantSelections[ALTERNATIVES]


def variants_in(layer: Sdf.Layer) -> dict[Sdf.Path, list[str]]:
    """Returns the Materials of a look that have alternatives, by path in it, with the names, the selected one first."""
    found = {}
    for spec in specs_of(layer):
        if isinstance(spec, Sdf.PrimSpec) and ALTERNATIVES in spec.variantSets:
            chosen = spec.variantSelections.get(ALTERNATIVES, "")
            names = list(spec.variantSets[ALTERNATIVES].variants.keys())
            found[spec.path] = [*(n for n in names if n == chosen), *(n for n in names if n != chosen)]
    return found


def _move_into(layer: Sdf.Layer, source: Sdf.Path, variant: Sdf.Path, home: Sdf.Path) -> None:
    """Moves what is in a prim, and what it says of itself, into a variant."""
    spec, target = layer.GetPrimAtPath(source), layer.GetPrimAtPath(variant)
    if spec.customData:
        data = our_data(spec.customData)
        target.SetInfo("customData", {**spec.customData, KEY: data | {"material": str(home)}})
        spec.ClearInfo("customData")
    for prop in list(spec.properties):
        Sdf.CopySpec(layer, prop.path, layer, variant.AppendProperty(prop.name))
        spec.RemoveProperty(prop)
    for child in list(spec.nameChildren):
        Sdf.CopySpec(layer, child.path, layer, variant.AppendChild(child.name))
        del spec.nameChildren[child.name]
    for each in below(target):
        if isinstance(each, Sdf.AttributeSpec):
            paths = each.connectionPathList.GetAddedOrExplicitItems()
            if paths:
                each.connectionPathList.explicitItems = [_from(p, source, variant, home) for p in paths]
        elif isinstance(each, Sdf.PrimSpec):
            for arcs in (each.specializesList, each.inheritPathList):
                if paths := arcs.GetAddedOrExplicitItems():
                    arcs.ClearEdits()
                    for p in paths:
                        arcs.Append(_from(p, source, variant, home))


def _from(path: Sdf.Path, source: Sdf.Path, variant: Sdf.Path, home: Sdf.Path) -> Sdf.Path:
    """A path in a Material as it is in the one that has the variants."""
    for prefix in (variant, source):
        if path.HasPrefix(prefix):
            return path.ReplacePrefix(prefix, home)
    return path


def _retarget(spec: Sdf.PropertySpec, materials: Iterable[str], home: str) -> None:
    """Says of an opinion for one of some Materials that it is for another one."""
    names = targets_of(spec)
    new = [home + t[len(t.split(".")[0]) :] if t.split(".")[0] in materials else t for t in names]
    if tuple(new) != names:
        data = our_data(spec.customData)
        data["of"] = Vt.StringArray(list(dict.fromkeys(new)))
        spec.SetInfo("customData", {**spec.customData, KEY: data})
