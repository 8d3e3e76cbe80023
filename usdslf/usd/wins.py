"""Does an opinion of a look layer win?  Composed over the shot and read back.

    AuthoredEdit                             one opinion, and what hides it if it does not win
    with_wins(stage, layer, written, bindings) -> list[AuthoredEdit]
    hidden_by(review, layer, path, shown_at) -> str
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

from pxr import Sdf, Usd

from usdslf.usd.look_layer import bound_relationship
from usdslf.usd.network import same_value
from usdslf.usd.shot_metadata import ROOT_ONLY, copy_shot_metadata


@dataclass(frozen=True)
class AuthoredEdit:
    """One opinion of a look layer."""

    prim: str  # in the look layer
    attribute: str
    before: Any  # the composed value below the look layer
    after: Any
    representation: str  # constant | scale | primvar
    wins: bool = True
    hidden_by: str = ""  # what is stronger, if it does not win
    shown_at: str = ""  # composed path of the attribute; differs from `prim` for instances


def with_wins(
    stage: Usd.Stage,
    layer: Sdf.Layer,
    written: list[AuthoredEdit],
    bindings: dict[int, list[tuple[Sdf.Path, Sdf.Path]]],
) -> list[AuthoredEdit]:
    """Composes the look layer over the shot and reads every opinion back."""
    root = Sdf.Layer.CreateAnonymous(".usda")
    root.subLayerPaths = [layer.identifier, stage.GetRootLayer().identifier]
    copy_shot_metadata(stage, root, ROOT_ONLY)
    review = Usd.Stage.OpenMasked(
        root, stage.GetSessionLayer(), stage.GetPathResolverContext(), stage.GetPopulationMask()
    )
    out = []
    for i, edit in enumerate(written):
        path = Sdf.Path(edit.prim).AppendProperty(edit.attribute)
        hidden = edit.hidden_by or hidden_by(review, layer, path, Sdf.Path(edit.shown_at))
        for prim, material in bindings.get(i, []) if not hidden else []:
            shown = bound_relationship(review.GetPrimAtPath(prim))[0]
            if shown != material:
                hidden = f"a stronger binding of {shown} on {prim}"
        out.append(replace(edit, wins=not hidden, hidden_by=hidden))
    return out


def hidden_by(review: Usd.Stage, layer: Sdf.Layer, path: Sdf.Path, shown_at: Sdf.Path) -> str:
    """Says what is stronger than the opinion at a path of a layer; "" if the opinion is what shows."""
    attribute = review.GetAttributeAtPath(shown_at)
    if not attribute:
        return f"{shown_at} is not in the composed shot: a variant or an inactive prim"
    if attribute.HasAuthoredConnections() and attribute.GetConnections():
        return f"a connection to {attribute.GetConnections()[0]}"
    spec = layer.GetAttributeAtPath(path)
    times = [Usd.TimeCode.Default(), Usd.TimeCode.EarliestTime()]
    if all(same_value(attribute.Get(t), spec.default) for t in times):
        return ""
    stack = attribute.GetPropertyStack(Usd.TimeCode.EarliestTime())
    stronger = next((s for s in stack if s.layer != layer), None)
    where = f"{stronger.layer.GetDisplayName()} at {stronger.path}" if stronger else "a session layer or clip"
    samples = "time samples in " if stronger and stronger.layer.ListTimeSamplesForPath(stronger.path) else ""
    return f"{samples}{where}"
