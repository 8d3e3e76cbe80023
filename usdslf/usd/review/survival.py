"""Will it survive? Where another program will not show an edit as it is shown here: rules over the composed stage.

    risks_of(stage, layer, edits, time) -> list[Risk]      by rule, each with its public source

InstanceRootBinding   a binding on an instance root, which Arnold drops (Blender 5.2's import too, tried)
NestedInstanceBinding the same inside another instance, which Hydra 2 drops
CollectionInInstance  what shows by a collection binding inside an instance, which Storm shows otherwise since 25.11
WrapMode              a wrap mode of an edited texture that renderers ignore or name otherwise
NoBindingAPI          a binding without MaterialBindingAPI, which strict checking drops
OtherContext          a surface of another render context, which does not see the edit
FullPurpose           shown by a binding of purpose full alone, which Storm does not use
DriftedBase           a scale or bias whose texture, or an opinion whose base, is not what it was solved over
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property

from pxr import Sdf, Usd, UsdShade

from usdslf.usd.binding import BINDING, bound_material, bound_relationship, final_material, render_contexts, shown_by
from usdslf.usd.layer.affected import network_of
from usdslf.usd.review.records import ReviewedEdit, Risk

SOURCES = {
    "InstanceRootBinding": "github.com/Autodesk/arnold-usd/issues/2153 and 2258",
    "NestedInstanceBinding": "github.com/PixarAnimationStudios/OpenUSD/issues/4113",
    "CollectionInInstance": "github.com/PixarAnimationStudios/OpenUSD/issues/4104 and 3690",
    "WrapMode": "github.com/Autodesk/arnold-usd/issues/727, github.com/AcademySoftwareFoundation/MaterialX/issues/2899",
    "NoBindingAPI": "github.com/PixarAnimationStudios/OpenUSD/pull/3154, USD_SHADE_MATERIAL_BINDING_API_CHECK=strict",
    "OtherContext": "openusd.org/release/api/class_usd_shade_material.html, render contexts of terminal outputs",
    "FullPurpose": "github.com/PixarAnimationStudios/OpenUSD/issues/4000",
    "DriftedBase": "openusd.org/release/spec_usdpreviewsurface.html, UsdUVTexture: texel * scale + bias",
}
_EVERYWHERE = ("repeat", "clamp")  # wrap modes that all of these know


@dataclass(frozen=True)
class ComposedLook:
    """A look where it is composed.

    Attributes:
        stage: the shot with it.
        layer: the look.
        edits: its opinions.
    """

    stage: Usd.Stage
    layer: Sdf.Layer
    edits: Sequence[ReviewedEdit]

    @cached_property
    def gprims(self) -> list[Usd.Prim]:
        """Gprims and GeomSubsets that show something else."""
        paths = dict.fromkeys(p for e in self.edits if e.wins for p in e.gprims)
        return [prim for prim in map(self.stage.GetPrimAtPath, paths) if prim]

    @cached_property
    def materials(self) -> list[UsdShade.Material]:
        """What they show, each once."""
        found = {bound_relationship(p)[0]: bound_material(p) for p in self.gprims}
        return [m for m in found.values() if m]

    @property
    def bindings(self) -> Iterator[tuple[Usd.Prim, Usd.Relationship]]:
        """What the look binds: the prim, and the relationship as it is composed."""
        for edit in self.edits:
            if edit.wins and edit.attribute.startswith(BINDING):
                prim = self.stage.GetPrimAtPath(edit.shown_at)
                if prim and prim.GetRelationship(edit.attribute):
                    yield prim, prim.GetRelationship(edit.attribute)


Said = Iterable[tuple[str, str]]  # prim, sentence


def risks_of(stage: Usd.Stage, layer: Sdf.Layer, edits: Sequence[ReviewedEdit]) -> list[Risk]:
    """Returns where another program will not show the edits of a look as they are shown here, each once.

    Args:
        stage: the shot with the look.
        layer: the look.
        edits: its opinions, as they are composed.
    """
    look = ComposedLook(stage, layer, edits)
    found = [Risk(rule, at, say, SOURCES[rule]) for rule, check in _RULES.items() for at, say in check(look)]
    return list(dict.fromkeys(found))


def _instance_roots(look: ComposedLook) -> Said:
    for prim, _ in look.bindings:
        if prim.IsInstance():
            at = str(prim.GetPath())
            yield at, f"{at} is an instance: Arnold keeps the material of its prototype, unless instanceable is off"


def _nested_instances(look: ComposedLook) -> Said:
    for prim, _ in look.bindings:
        above = [p for p in prim.GetPath().GetPrefixes()[:-1] if look.stage.GetPrimAtPath(p).IsInstance()]
        if above and prim.IsInstance():
            at = str(prim.GetPath())
            yield at, f"{at} is an instance inside the instance {above[-1]}: Hydra 2 drops what is bound there"


def _collections(look: ComposedLook) -> Said:
    for prim in look.gprims:
        if not prim.IsInstanceProxy():
            continue
        by = shown_by(prim)
        if by and by.GetName().startswith(f"{BINDING}:collection"):
            at = str(prim.GetPath())
            yield at, f"{at} shows {bound_relationship(prim)[0]} by the collection of {by.GetPath()}: bind it directly"


def _wrap_modes(look: ComposedLook) -> Said:
    nodes = {e.shown_at for e in look.edits if e.wins}
    for material in look.materials:
        for prim in network_of(material.GetPrim()):
            shader = UsdShade.Shader(prim)
            if not shader or shader.GetIdAttr().Get() != "UsdUVTexture" or not _is_edited(prim, look.layer, nodes):
                continue
            ports = {name: shader.GetInput(name) for name in ("wrapS", "wrapT")}
            modes = {name: (port.Get() if port else None) or "useMetadata" for name, port in ports.items()}
            odd = [f"{name} {mode}" for name, mode in modes.items() if mode not in _EVERYWHERE]
            if odd:
                at = str(prim.GetPath())
                say = f"{at} wraps by {', '.join(odd)}, which renderers ignore or name otherwise"
                yield at, f"{say}: use repeat or clamp"


def _is_edited(prim: Usd.Prim, layer: Sdf.Layer, nodes: set[str]) -> bool:
    return str(prim.GetPath()) in nodes or any(s.layer == layer for s in prim.GetPrimStack())


def _binding_apis(look: ComposedLook) -> Said:
    for prim in look.gprims:
        by = shown_by(prim)
        home = by.GetPrim() if by else None
        if home and not home.HasAPI(UsdShade.MaterialBindingAPI):
            at = str(home.GetPath())
            yield at, f"{at} binds a material without MaterialBindingAPI, which strict checking drops: apply the schema"


def _contexts(look: ComposedLook) -> Said:
    for material in look.materials:
        if others := render_contexts(material, connected=True):
            at = str(material.GetPath())
            yield at, f"{at} has a surface of its own for {', '.join(others)}: renders by it do not see the edit"
    for prim in look.gprims:
        full, shown = final_material(prim), bound_relationship(prim)[0]
        if full and full.GetPath() != shown:
            where = ", ".join(render_contexts(full, connected=True)) or "any renderer"
            at = str(prim.GetPath())
            yield at, f"{at} shows {full.GetPath()} in final renders by {where}, bound for purpose full: edit that too"


def _full_purpose(look: ComposedLook) -> Said:
    for prim in look.gprims:
        shown, relationship = bound_relationship(prim)
        if relationship == f"{BINDING}:full":
            at = str(prim.GetPath())
            yield at, f"{at} shows {shown} by purpose full alone, which Storm does not use: bind it for all purposes"


def _drifted(look: ComposedLook) -> Said:
    for edit in look.edits:
        if edit.drifted:
            yield edit.shown_at, f"{edit.shown_at}.{edit.attribute} {edit.drifted}: solve again"


_RULES: dict[str, Callable[[ComposedLook], Said]] = {
    "InstanceRootBinding": _instance_roots,
    "NestedInstanceBinding": _nested_instances,
    "CollectionInInstance": _collections,
    "WrapMode": _wrap_modes,
    "NoBindingAPI": _binding_apis,
    "OtherContext": _contexts,
    "FullPurpose": _full_purpose,
    "DriftedBase": _drifted,
}
