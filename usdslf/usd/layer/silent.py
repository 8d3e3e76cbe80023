"""Opinions that a look keeps and that no program shows: in an inactive prim at the root of the layer.

    SILENT                                      its name; below it the silent opinions at the paths that they had
    silent_specs(layer) -> (path that it had, spec)
    silence(layer, properties) -> None          moves properties there, and what is left of prims that held nothing else
    restore(layer, properties) -> None          moves them back: the layer says then what it said, byte for byte
    restore_all(layer) -> list[Sdf.Path]        moves all of them back; returns which they were

Why there.  USD composes nothing below an inactive prim, in any program, whatever arcs lead to the layer.  A variant
that is not selected would be silent too, but it adds a variant set to prims of the shot, and whoever selects it gets
opinions that are weaker than local ones: other pictures.  A layer of its own beside the look gets lost when the look is
published.  Here the textures that silent opinions name stay named, so they travel.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator

from pxr import Sdf, Vt

from usdslf.usd.look_data import KEY, our_data, texts

SILENT = "SlfSilent"
_ROOT = Sdf.Path.absoluteRootPath
_HOME = _ROOT.AppendChild(SILENT)
_STRUCTURE = {  # metadata that goes with what is in a prim
    "specifier", "typeName", "apiSchemas", "inheritPaths", "specializes", "customData", "variantSetNames",
}  # fmt: skip


def silent_specs(layer: Sdf.Layer) -> Iterator[tuple[Sdf.Path, Sdf.PrimSpec | Sdf.PropertySpec]]:
    """Yields the prims and properties that are silent, each with the path that it had."""
    home = layer.GetPrimAtPath(_HOME)
    for spec in list(below(home))[1:] if home else ():
        yield spec.path.ReplacePrefix(_HOME, _ROOT), spec


def silence(layer: Sdf.Layer, properties: Iterable[Sdf.Path]) -> None:
    """Moves properties of a layer out of sight, and prims that hold nothing else."""
    paths = list(properties)
    if not paths:
        return
    order = [str(s.path) for root in _roots(layer) for s in below(root) if isinstance(s, Sdf.PrimSpec)]
    home = layer.GetPrimAtPath(_HOME)
    if not home:
        home = Sdf.PrimSpec(layer, SILENT, Sdf.SpecifierOver)
        home.SetInfo("active", False)
    known = texts(our_data(home.customData).get("order"))
    home.SetInfo("customData", {KEY: {"order": Vt.StringArray(_merged(known, order))}})
    for path in paths:
        _move(layer, path, _away(path))

    def keep(spec: Sdf.PrimSpec) -> None:
        _copy_metadata(spec, Sdf.CreatePrimInLayer(layer, _away(spec.path)))

    prune(layer, [p.GetPrimPath() for p in paths], keep)


def restore(layer: Sdf.Layer, properties: Iterable[Sdf.Path]) -> None:
    """Moves silent properties back to the paths that they had, with the prims that they were in."""
    home = layer.GetPrimAtPath(_HOME)
    paths = list(properties)
    if not home or not paths:
        return
    order = {p: i for i, p in enumerate(texts(our_data(home.customData).get("order")))}
    classes: set[Sdf.Path] = set()
    for path in paths:
        classes.add(_put_prims_back(layer, path.GetPrimPath()))
        _move(layer, _away(path), path)
    for at, spec in list(silent_specs(layer)):  # an instance that inherits a class which is there again
        if isinstance(spec, Sdf.PrimSpec) and set(spec.inheritPathList.GetAddedOrExplicitItems()) & classes:
            _put_prims_back(layer, at)
    back = [spec for at, spec in silent_specs(layer) if isinstance(spec, Sdf.PrimSpec)]
    for spec in sorted(back, key=lambda s: -s.path.pathElementCount):
        if is_bare(spec) and layer.GetPrimAtPath(spec.path.ReplacePrefix(_HOME, _ROOT)):
            remove(layer, spec)
    if is_bare(home):
        del layer.rootPrims[SILENT]
    _put_in_order(layer, order)


def restore_all(layer: Sdf.Layer) -> list[Sdf.Path]:
    """Moves all silent properties back; returns the paths that they have."""
    paths = [path for path, spec in silent_specs(layer) if isinstance(spec, Sdf.PropertySpec)]
    restore(layer, paths)
    return paths


def prune(
    layer: Sdf.Layer, prims: Iterable[Sdf.Path], keep: Callable[[Sdf.PrimSpec], None] = lambda spec: None
) -> None:
    """Takes prims out of a layer that hold nothing any more, with those above them that then hold nothing either.

    Prims that say more than how their contents are composed stay, and the default prim.

    Args:
        prims: paths that opinions were taken from; with them, instances that inherit a class which goes.
        keep: called with each prim before it goes.
    """
    todo = {q for p in prims for q in p.GetPrefixes()}
    while todo:
        path = max(todo, key=lambda p: p.pathElementCount)
        todo.discard(path)
        spec = layer.GetPrimAtPath(path)
        if not spec or not is_bare(spec) or set(spec.ListInfoKeys()) - _STRUCTURE:
            continue
        if path == _ROOT.AppendChild(layer.defaultPrim) if layer.defaultPrim else False:
            continue
        users: list[Sdf.PrimSpec] = []
        if path.IsRootPrimPath():
            inherits = [s for r in _roots(layer) for s in below(r) if isinstance(s, Sdf.PrimSpec)]
            users = [s for s in inherits if path in s.inheritPathList.GetAddedOrExplicitItems()]
        keep(spec)
        remove(layer, spec)
        for user in users:
            if is_bare(user):
                todo |= set(user.path.GetPrefixes())
            else:
                user.inheritPathList.RemoveItemEdits(path)


def is_bare(spec: Sdf.PrimSpec) -> bool:
    """Whether a prim has no property, no prim and no variant in it."""
    return not (len(spec.properties) or len(spec.nameChildren) or len(spec.variantSets))


def remove(layer: Sdf.Layer, spec: Sdf.PrimSpec) -> None:
    """Takes a prim out of a layer, or a variant, and a set of variants that is then without any."""
    path = spec.path
    if not path.IsPrimVariantSelectionPath():
        siblings = spec.nameParent.nameChildren if spec.nameParent else layer.rootPrims
        del siblings[spec.name]
        return
    owner, (group, chosen) = layer.GetPrimAtPath(path.GetParentPath()), path.GetVariantSelection()
    variants = owner.variantSets[group]
    variants.RemoveVariant(variants.variants[chosen])
    if not len(variants.variants):
        del owner.variantSets[group]
        owner.variantSetNameList.RemoveItemEdits(group)


def below(prim: Sdf.PrimSpec) -> Iterator[Sdf.PrimSpec | Sdf.PropertySpec]:
    """Yields a prim, its properties, what is in it and in its variants, each before what is in it."""
    yield prim
    yield from list(prim.properties)
    for child in list(prim.nameChildren):
        yield from below(child)
    for group in list(prim.variantSets.values()):
        for variant in list(group.variants.values()):
            yield from below(variant.primSpec)


def _roots(layer: Sdf.Layer) -> list[Sdf.PrimSpec]:
    return [r for r in layer.rootPrims if r.name != SILENT]


def _away(path: Sdf.Path) -> Sdf.Path:
    return path.ReplacePrefix(_ROOT, _HOME)


def _merged(known: list[str], order: list[str]) -> list[str]:
    """Two orders of prims in one: those known come with what they were before."""
    found = list(known)
    after = -1
    for name in order:
        if name in found:
            after = found.index(name)
        else:
            after += 1
            found.insert(after, name)
    return found


def _move(layer: Sdf.Layer, source: Sdf.Path, target: Sdf.Path) -> None:
    Sdf.CreatePrimInLayer(layer, target.GetPrimPath())
    Sdf.CopySpec(layer, source, layer, target)
    spec = layer.GetPropertyAtPath(source)
    spec.owner.RemoveProperty(spec)


def _copy_metadata(source: Sdf.PrimSpec, target: Sdf.PrimSpec) -> None:
    for name in source.ListInfoKeys():
        if name != "variantSetNames":  # said where a variant is made
            target.SetInfo(name, source.GetInfo(name))


def _put_prims_back(layer: Sdf.Layer, path: Sdf.Path) -> Sdf.Path:
    """Makes the prims of a path that are missing, as they were; returns the topmost."""
    for prefix in path.GetPrefixes():
        if layer.GetPrimAtPath(prefix):
            continue
        made = Sdf.CreatePrimInLayer(layer, prefix)
        if away := layer.GetPrimAtPath(_away(prefix)):
            _copy_metadata(away, made)
    return path.GetPrefixes()[0]


def _put_in_order(layer: Sdf.Layer, order: dict[str, int]) -> None:
    """Puts the prims of a layer in the order of their paths' numbers; those without one stay behind the one before."""
    new = Sdf.Layer.CreateAnonymous(".usda")

    def copy(source: Sdf.PrimSpec) -> None:
        target = Sdf.CreatePrimInLayer(new, source.path)
        _copy_metadata(source, target)
        for each in source.properties:
            Sdf.CopySpec(layer, each.path, new, each.path)
        copy_all(list(source.nameChildren))
        for group in source.variantSets.values():
            for variant in group.variants.values():
                copy(variant.primSpec)

    def copy_all(siblings: list[Sdf.PrimSpec]) -> None:
        number, last = {}, -1
        for each in siblings:
            last = number[each.path] = order.get(str(each.path), last)
        for each in sorted(siblings, key=lambda s: number[s.path]):
            copy(each)

    copy_all(list(layer.rootPrims))
    for name in layer.pseudoRoot.ListInfoKeys():
        new.pseudoRoot.SetInfo(name, layer.pseudoRoot.GetInfo(name))
    layer.TransferContent(new)
