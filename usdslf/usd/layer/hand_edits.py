"""What people added to a look layer by hand: told from what usdslf wrote, and kept when it is written anew.

    record_of(layer) -> list[str]                      what is in a layer, as a record of what usdslf wrote
    added_by_hand(earlier) -> Sdf.Layer                an earlier look without what its record lists
    put_under(by_hand, new) -> (layer, lost)           both in one; what a person wrote is stronger
    what_is_by_hand(by_hand) -> list[Sdf.Path]         prims and properties that a person said something about
    specs_of(layer) -> Iterator                        all prims and properties

The record is a line for each prim and property, `path field=digest ...`, in customLayerData.usdslf.written.
A property counts as one; a prim by its fields, and customData by its keys.  What was changed since it was
recorded is a person's.  A layer without a record is a person's as a whole.
"""

from __future__ import annotations

import hashlib
from collections.abc import Iterator
from typing import Any

import numpy as np
from pxr import Sdf

from usdslf.usd.layer.silent import SILENT, below
from usdslf.usd.look_data import our_data, texts

RECORD = "written"
_OURS = "usdslf"  # of customData
_KEY = f"customData:{_OURS}"
_STRUCTURE = ("specifier", "variantSetNames")  # of a prim: say nothing by themselves if it is an `over`


def record_of(layer: Sdf.Layer) -> list[str]:
    """Returns a line for each prim and property of a layer, sorted."""
    # Values are taken as they are read back: text rounds, and sorts dictionaries.
    copy = Sdf.Layer.CreateAnonymous(".usda")
    copy.ImportFromString(layer.ExportToString())
    found = {str(spec.path): _digests(spec) for spec in specs_of(copy)}
    return [
        " ".join([path, *(f"{k}={v}" for k, v in sorted(d.items()))]) for path, d in sorted(found.items())
    ]


def added_by_hand(earlier: Sdf.Layer) -> Sdf.Layer:
    """Returns an earlier look layer without what its record says that usdslf wrote."""
    layer = Sdf.Layer.CreateAnonymous(".usda")
    layer.TransferContent(earlier)
    data = dict(layer.customLayerData)
    record = texts(our_data(data).get(RECORD))
    ours = {line.split(" ")[0]: dict(f.rpartition("=")[::2] for f in line.split(" ")[1:]) for line in record}
    specs = list(specs_of(layer))
    with Sdf.ChangeBlock():
        for spec in [s for s in specs if isinstance(s, Sdf.PropertySpec)]:
            if _digests(spec) == ours.get(str(spec.path)):
                spec.owner.RemoveProperty(spec)
        prims = [s for s in specs if isinstance(s, Sdf.PrimSpec)]
        for spec in sorted(prims, key=lambda s: -s.path.pathElementCount):
            written = ours.get(str(spec.path))
            if written is None:
                continue
            unchanged = {k for k, v in _digests(spec).items() if written.get(k) == v}
            unchanged.discard("variantSetNames")  # goes with the last variant
            if any(p.name.startswith("material:binding") for p in spec.properties):
                unchanged.discard("apiSchemas")  # a binding that stays needs its schema
            _take_out(spec, unchanged)
            _drop_variants(spec, ours)
            if _is_bare(spec) and not spec.path.IsPrimVariantSelectionPath():
                siblings = spec.nameParent.nameChildren if spec.nameParent else layer.rootPrims
                del siblings[spec.name]
    return layer


def _drop_variants(spec: Sdf.PrimSpec, ours: dict[str, dict[str, str]]) -> None:
    """Takes out our variants that hold nothing any more, and sets without variants."""
    for name, group in list(spec.variantSets.items()):
        for variant in list(group.variants.values()):
            if str(variant.path) in ours and _is_bare(variant.primSpec):
                group.RemoveVariant(variant)
        if not len(group.variants):
            del spec.variantSets[name]
            spec.variantSetNameList.RemoveItemEdits(name)


def put_under(by_hand: Sdf.Layer, new: Sdf.Layer) -> tuple[Sdf.Layer, list[Sdf.Path]]:
    """Returns a layer with what usdslf writes now and what a person wrote, which is stronger.

    Also returns the properties of `new` that a person's are in the place of.
    """
    if by_hand.empty or not _tells(by_hand):
        return new, []
    layer, lost = Sdf.Layer.CreateAnonymous(".usda"), []
    layer.TransferContent(by_hand)
    for spec in list(specs_of(new)):
        there = layer.GetObjectAtPath(spec.path)
        if there is None:
            _copy_alone(new, spec, layer)
        elif isinstance(spec, Sdf.PropertySpec):
            lost.append(spec.path)
        else:
            _fill(spec, there)
    for name in new.pseudoRoot.ListInfoKeys():
        if name != "customLayerData":
            layer.pseudoRoot.SetInfo(name, new.pseudoRoot.GetInfo(name))
    layer.customLayerData = dict(layer.customLayerData) | dict(new.customLayerData)
    return layer, lost


def what_is_by_hand(by_hand: Sdf.Layer) -> list[Sdf.Path]:
    """Returns the prims and properties that a person said something about."""
    specs = list(specs_of(by_hand))
    empty = [s for s in specs if s.path.IsPrimVariantSelectionPath() and _is_bare(s)]
    return [s.path for s in specs if isinstance(s, Sdf.PropertySpec) or _says(s) or s in empty]


def specs_of(layer: Sdf.Layer) -> Iterator[Sdf.PrimSpec | Sdf.PropertySpec]:
    """Yields prims before what is in them, in the order of the layer; variants as prims of their own.

    Without what is silent.
    """
    for root in list(layer.rootPrims):
        if root.name != SILENT:
            yield from below(root)


def _digests(spec: Sdf.PrimSpec | Sdf.PropertySpec) -> dict[str, str]:
    """A digest of each field of a prim; of a property one of all fields."""
    fields = {name: spec.GetInfo(name) for name in spec.ListInfoKeys()}
    if isinstance(spec, Sdf.PropertySpec):
        return {"all": _digest(sorted((name, _text(value)) for name, value in fields.items()))}
    custom = fields.pop("customData", {})
    if _OURS in custom:
        fields[_KEY] = custom[_OURS]
    return {name: _digest(_text(value)) for name, value in fields.items()}


def _text(value: Any) -> str:
    if isinstance(value, dict):
        return str(sorted((k, _text(v)) for k, v in value.items()))
    if hasattr(value, "__len__") and not isinstance(value, str) and len(value) > 64:
        array = np.asarray(value)
        if array.dtype != object:
            return f"{array.dtype} {array.shape} {hashlib.sha256(array.tobytes()).hexdigest()}"
    text = repr(value)
    return str(value) if " object at 0x" in text else text  # lists of edits show their address


def _digest(value: Any) -> str:
    return hashlib.sha256(str(value).encode()).hexdigest()[:12]


def _take_out(spec: Sdf.PrimSpec, names: set[str]) -> None:
    for name in names:
        if name == _KEY:
            rest = {k: v for k, v in spec.customData.items() if k != _OURS}
            spec.SetInfo("customData", rest) if rest else spec.ClearInfo("customData")
        elif name == "specifier":
            spec.specifier = Sdf.SpecifierOver
        else:
            spec.ClearInfo(name)


def _says(spec: Sdf.PrimSpec) -> bool:
    """Whether a prim spec is more than a place for what is in it."""
    return spec.specifier != Sdf.SpecifierOver or bool(set(spec.ListInfoKeys()) - set(_STRUCTURE))


def _is_bare(spec: Sdf.PrimSpec) -> bool:
    return not (_says(spec) or len(spec.properties) or len(spec.nameChildren) or len(spec.variantSets))


def _tells(layer: Sdf.Layer) -> bool:
    """Whether a person left anything: opinions, sublayers, or metadata that usdslf does not write itself."""
    root = set(layer.pseudoRoot.ListInfoKeys()) & {"comment", "documentation", "subLayers", "relocates"}
    return bool(root) or bool(set(layer.customLayerData) - {_OURS}) or bool(len(layer.rootPrims))


def _copy_alone(source: Sdf.Layer, spec: Sdf.PrimSpec | Sdf.PropertySpec, target: Sdf.Layer) -> None:
    """Copies a spec; a prim without what is in it, which follows."""
    if isinstance(spec, Sdf.PropertySpec):
        Sdf.CopySpec(source, spec.path, target, spec.path)
    else:
        _fill(spec, Sdf.CreatePrimInLayer(target, spec.path))


def _fill(spec: Sdf.PrimSpec, there: Sdf.PrimSpec) -> None:
    """Gives a prim the fields that it does not have."""
    known = set(there.ListInfoKeys())
    for name in spec.ListInfoKeys():
        if name == "customData":
            there.SetInfo(name, dict(spec.customData) | dict(there.customData))
        elif name == "specifier":
            if there.specifier == Sdf.SpecifierOver:
                there.specifier = spec.specifier
        elif name != "variantSetNames" and name not in known:  # said where a variant is made
            there.SetInfo(name, spec.GetInfo(name))
