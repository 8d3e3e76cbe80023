"""Names of layers that people tell apart: looks of two steps of a shot often have one file name.

layer_name(stage, layer) -> str      its file name, with as many folders as no other layer of the stage has
"""

from __future__ import annotations

from pathlib import Path

from pxr import Sdf, Usd


def layer_name(stage: Usd.Stage, layer: Sdf.Layer) -> str:
    """Returns the name of a layer among those of a stage's layer stack."""
    name: str = layer.GetDisplayName()
    stack = stage.GetLayerStack(includeSessionLayers=True)
    others = [Path(x.realPath).parts for x in stack if x != layer and x.realPath and x.GetDisplayName() == name]
    own = Path(layer.realPath).parts if layer.realPath else ()
    for count in range(2, len(own) if others else 0):
        if all(parts[-count:] != own[-count:] for parts in others):
            return "/".join(own[-count:])
    return name
