"""A Material of a look that is to show on some of its gprims only.

    narrow(layer, below, material, kept, users) -> None

One that the look made loses its bindings on the others.  One that it overrides becomes a new Material that inherits the
shot's and has the opinions, bound to those that keep it: the shot's own is then as it was.
"""

from __future__ import annotations

from collections.abc import Sequence

from pxr import Sdf, Usd, Vt

from usdslf.errors import InputError
from usdslf.usd.binding import bound_relationship
from usdslf.usd.layer.hand_edits import specs_of
from usdslf.usd.layer.look_layer import SCOPE, LookLayer
from usdslf.usd.layer.opinions import note_opinion, targets_of
from usdslf.usd.layer.shown_paths import ShownPaths
from usdslf.usd.layer.silent import below as all_below
from usdslf.usd.layer.silent import prune
from usdslf.usd.look_data import KEY, our_data


def narrow(
    layer: Sdf.Layer, below: Usd.Stage, material: str, kept: Sequence[str], users: Sequence[str]
) -> None:
    """Leaves a Material of a look to some of the gprims that show it.

    Args:
        layer: the look.
        below: the shot without it.
        material: composed path.
        kept: gprims and GeomSubsets that keep it, of `users`.
        users: all that show it.

    Raises: InputError where its opinions do not stand in it, or one binding is for gprims of both kinds.
    """
    shown = ShownPaths(below, layer)
    bindings = [
        s
        for s in specs_of(layer)
        if isinstance(s, Sdf.RelationshipSpec) and material in map(str, s.targetPathList.GetAddedOrExplicitItems())
    ]
    if bindings:
        _unbind(layer, shown, bindings, set(kept), users)
        return
    home = next(
        (s for s in specs_of(layer) if isinstance(s, Sdf.PrimSpec) and str(shown(s.path)) == material), None
    )
    mine = [
        s
        for s in specs_of(layer)
        if isinstance(s, Sdf.PropertySpec) and any(t.split(".")[0] == material for t in targets_of(s))
    ]
    if home is None or any(not s.path.HasPrefix(home.path) for s in mine):
        raise InputError(
            f"{material} cannot be accepted for some of its gprims: its opinions stand elsewhere too; accept or reject "
            "it as a whole, or solve with --scope prim"
        )
    _as_new(layer, below, home, material, kept)


def _unbind(
    layer: Sdf.Layer, shown: ShownPaths, bindings: list[Sdf.RelationshipSpec], kept: set[str], users: Sequence[str]
) -> None:
    gone = []
    for spec in bindings:
        at = shown(spec.path).GetPrimPath()
        bound = {u for u in users if Sdf.Path(u).HasPrefix(at)}
        if bound & kept and bound - kept:
            raise InputError(f"{spec.path} binds all of {at}: accept or reject all gprims below it")
        if not bound & kept:
            gone.append(spec)
    paths = [s.path.GetPrimPath() for s in gone]
    for spec in gone:
        spec.owner.RemoveProperty(spec)
    prune(layer, paths)


def _as_new(
    layer: Sdf.Layer, below: Usd.Stage, home: Sdf.PrimSpec, material: str, kept: Sequence[str]
) -> None:
    look = LookLayer(below)
    look.layer = layer
    original, source = Sdf.Path(material), home.path
    root = below.GetPrimAtPath(original)
    while root.IsInstanceProxy():
        root = root.GetParent()
    scope = root.GetPath().GetParentPath().AppendChild(SCOPE)
    if not below.GetPrimAtPath(scope) and not layer.GetPrimAtPath(scope):
        look.define(scope, "Scope")
    path = look.free_path(scope.AppendChild(f"{original.name}_accepted"))
    look.define(path, "Material")
    place = look.place(path)
    Sdf.CopySpec(layer, source, layer, place)
    made = layer.GetPrimAtPath(place)
    made.specifier, made.typeName = Sdf.SpecifierDef, "Material"
    made.inheritPathList.Prepend(original)
    data = our_data(made.customData)
    made.SetInfo("customData", {**made.customData, KEY: data | {"material": str(path)}})
    for spec in all_below(made):
        if isinstance(spec, Sdf.PropertySpec):
            own = our_data(spec.customData)
            own["of"] = Vt.StringArray([t.replace(material, str(path), 1) for t in targets_of(spec)])
            spec.SetInfo("customData", {**spec.customData, KEY: own})
    old = layer.GetPrimAtPath(source)
    for prop in list(old.properties):
        old.RemoveProperty(prop)
    for child in list(old.nameChildren):
        del old.nameChildren[child.name]
    prune(layer, [source])
    for user in kept:
        prim = below.GetPrimAtPath(user)
        relationship = bound_relationship(prim)[1]
        look.bind(prim.GetPath(), relationship, path)
        bound = layer.GetPrimAtPath(look.over(prim.GetPath(), relationship).path)
        note_opinion(bound.relationships[relationship], str(path))
