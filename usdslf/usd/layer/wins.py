"""Does an opinion of a look layer win, and what does it change?  Composed over the shot and read back.

    AuthoredEdit                             one opinion, what hides it and would mend that, and what it changes
    compose_over(stage, layer) -> Usd.Stage  the look over the shot, in no file
    with_wins(review, layer, written, bindings) -> list[AuthoredEdit]
    why_hidden(review, layer, path, shown_at) -> (what hides it, what would mend it)
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

from pxr import Sdf, Usd, UsdShade

from usdslf.usd.binding import bound_relationship
from usdslf.usd.layer.affected import gprims_reached
from usdslf.usd.layer.layer_names import layer_name
from usdslf.usd.layer.network import same_value
from usdslf.usd.shot_metadata import ROOT_ONLY, copy_shot_metadata, default_prim_name


@dataclass(frozen=True)
class AuthoredEdit:
    """One opinion of a look layer."""

    prim: str  # in the look layer; with the selections of the variants that it is in
    attribute: str
    before: Any  # the composed value below the look layer
    after: Any
    representation: str  # constant | scale | primvar | texture
    wins: bool = True
    hidden_by: str = ""  # what is stronger, if it does not win
    shown_at: str = ""  # composed path of the attribute; differs from `prim` for instances
    mend: str = ""  # what would make it win, if it does not
    affects: tuple[str, ...] = ()  # gprims and GeomSubsets that show it; none if it does not win
    is_hidden_by_hand: bool = False  # by what a person wrote into the look


def compose_over(stage: Usd.Stage, layer: Sdf.Layer) -> Usd.Stage:
    """Returns a stage of a layer over a shot; neither is changed."""
    root = Sdf.Layer.CreateAnonymous(".usda")
    root.subLayerPaths = [layer.identifier, stage.GetRootLayer().identifier]
    copy_shot_metadata(stage, root, ROOT_ONLY)
    if name := default_prim_name(stage):
        root.defaultPrim = name
    return Usd.Stage.OpenMasked(
        root, stage.GetSessionLayer(), stage.GetPathResolverContext(), stage.GetPopulationMask()
    )


def with_wins(
    review: Usd.Stage,
    layer: Sdf.Layer,
    written: list[AuthoredEdit],
    bindings: dict[int, list[tuple[Sdf.Path, Sdf.Path]]],
) -> list[AuthoredEdit]:
    """Reads every opinion back from the look layer over the shot."""
    out = []
    reached = gprims_reached(review, layer) if written else {}
    for i, edit in enumerate(written):
        path = Sdf.Path(edit.prim).AppendProperty(edit.attribute)
        hidden, mend = edit.hidden_by, edit.mend
        if not hidden:
            hidden, mend = why_hidden(review, layer, path, Sdf.Path(edit.shown_at))
        for prim, material in bindings.get(i, []) if not hidden else []:
            shown = bound_relationship(review.GetPrimAtPath(prim))[0]
            if shown != material:
                hidden, mend = f"a stronger binding of {shown} on {prim}", _mend_binding(review, prim)
        affects = () if hidden else reached.get(Sdf.Path(edit.prim), ())
        out.append(replace(edit, wins=not hidden, hidden_by=hidden, mend=mend, affects=tuple(affects)))
    return out


def why_hidden(
    review: Usd.Stage, layer: Sdf.Layer, path: Sdf.Path, shown_at: Sdf.Path
) -> tuple[str, str]:
    """Says what is stronger than the opinion at a path of a layer and how to mend it; "" if it shows."""
    attribute = review.GetAttributeAtPath(shown_at)
    if not attribute:
        return _why_not_there(review, shown_at)
    if attribute.HasAuthoredConnections() and attribute.GetConnections():
        source = attribute.GetConnections()[0]
        return f"a connection to {source}", f"edit {source.GetPrimPath()}, or disconnect {shown_at}"
    spec = layer.GetAttributeAtPath(path)
    # An opinion that shows is the same at all times, also where the first of stronger samples has its value.
    times = [Usd.TimeCode.Default(), Usd.TimeCode.EarliestTime()]
    varies = attribute.ValueMightBeTimeVarying()
    if not varies and all(same_value(attribute.Get(t), spec.default) for t in times):
        return "", ""
    first = Usd.TimeCode.EarliestTime()
    if attribute.GetResolveInfo(first).GetSource() == Usd.ResolveInfoSourceValueClips:
        return "a value clip", f"leave {shown_at} out of the clip"
    if layer.ListTimeSamplesForPath(path):
        return f"time samples in {layer.GetDisplayName()} itself", f"remove the time samples of {path}"
    stronger = next((s for s in attribute.GetPropertyStack(first) if s.layer != layer or s.path != path), None)
    if stronger is None:
        return "an opinion that USD does not name", "flatten the shot to find it"
    name = layer_name(review, stronger.layer)
    samples = "time samples in " if stronger.layer.ListTimeSamplesForPath(stronger.path) else ""
    return f"{samples}{name} at {stronger.path}", _mend_stronger(review, layer, path, stronger, samples)


def _mend_stronger(
    review: Usd.Stage, layer: Sdf.Layer, path: Sdf.Path, stronger: Sdf.PropertySpec, samples: str
) -> str:
    name, what = layer_name(review, stronger.layer), samples.removesuffix(" in ") or "opinion"
    if stronger.layer == layer:
        return f"remove {stronger.path} from {name}"
    session = review.GetSessionLayer()
    if session and (stronger.layer == session or stronger.layer.identifier in session.subLayerPaths):
        return f"remove the {what} from the session layer {name}"
    if stronger.path == path:
        return f"put {layer_name(review, layer)} above {name} in the list of sublayers"
    if path.GetPrefixes()[0] != stronger.path.GetPrefixes()[0]:
        return f"remove the {what} from {name}, or solve with --mode override: prims are stronger than classes"
    return f"remove the {what} from {name}: it is stronger than a variant"


def _why_not_there(review: Usd.Stage, path: Sdf.Path) -> tuple[str, str]:
    for prefix in path.GetPrimPath().GetPrefixes():
        prim = review.GetPrimAtPath(prefix)
        if prim and not prim.IsActive():
            return f"{prefix}, which is inactive", f"activate {prefix}"
        if not prim:
            parent = review.GetPrimAtPath(prefix.GetParentPath())
            above = [p for p in parent.GetPath().GetPrefixes() if review.GetPrimAtPath(p).HasVariantSets()]
            say = f"{path} is not in the composed shot"
            if not above:
                return say, "load what it is in, or solve again"
            sets = review.GetPrimAtPath(above[-1]).GetVariantSets()
            chosen = ", ".join(f"{n}={sets.GetVariantSelection(n)}" for n in sets.GetNames())
            return f"{say} with the variant {chosen} of {above[-1]}", f"choose the variant that has {prefix}"
    return f"{path} is not in the composed shot", "solve again"


def _mend_binding(review: Usd.Stage, path: Sdf.Path) -> str:
    """Which binding above a prim is the stronger one."""
    for above in path.GetParentPath().GetPrefixes():
        for rel in review.GetPrimAtPath(above).GetRelationships():
            if not rel.GetName().startswith("material:binding"):
                continue
            strength = UsdShade.MaterialBindingAPI.GetMaterialBindingStrength(rel)
            if strength == UsdShade.Tokens.strongerThanDescendants:
                return f"make {rel.GetPath()} weakerThanDescendants, or bind the new material there"
    return f"remove the collection that binds {path}"
