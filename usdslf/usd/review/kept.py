"""Kept: what of a look another solve of its strokes has to keep.

    kept_of(look) -> Kept                 which explanations stand, what is silent, how many alternatives travel
    copy_look(look, target) -> None       with the textures that it needs, for a solve that is written over the copy
"""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from pxr import Sdf

from usdslf.usd.author.variants import AS_IT_WAS, variants_in
from usdslf.usd.border import plain, quiet_usd
from usdslf.usd.files import write_layer
from usdslf.usd.layer.hand_edits import specs_of
from usdslf.usd.layer.moved_look import carry_textures, move_paths
from usdslf.usd.layer.parts import Parts
from usdslf.usd.layer.silent import silent_specs
from usdslf.usd.look_data import our_data, texts
from usdslf.usd.review.toggle import open_look


@dataclass(frozen=True)
class Kept:
    """What of a look stays when its strokes are solved again.

    Attributes:
        inferred: by the paths of the strokes that were answered together the explanation that stands.
        silent: attributes that nobody sees (usdslf toggle).
        alternatives: explanations that travel as variants beside the first.
        frame: time code that it was solved at; None: none was asked for.
        strokes: file of the stroke layer; "": the look names none.
        settings: how it says that it was solved, as usdslf/provenance.py writes it.
    """

    inferred: Mapping[frozenset[str], str]
    silent: tuple[str, ...]
    alternatives: int
    frame: float | None
    strokes: str
    settings: Mapping[str, Any]


def kept_of(look: str | os.PathLike[str]) -> Kept:
    """Returns what another solve has to keep.  Raises: InputError where the look is none."""
    layer = open_look(look)
    inferred = {}
    for spec in (*specs_of(layer), *(spec for _, spec in silent_specs(layer))):
        data = our_data(spec.customData) if isinstance(spec, Sdf.PrimSpec) else {}
        if "strokes" in data and "inferred" in data:
            inferred[frozenset(texts(data["strokes"]))] = str(data["inferred"])
    silent = (str(p.path.StripAllVariantSelections()) for p in Parts.of(layer).parts if p.is_silent)
    rivals = [len(set(names) - {AS_IT_WAS}) - 1 for names in variants_in(layer).values()]
    data = our_data(layer.customLayerData)
    frame, named, settings = data.get("frame"), str(data.get("strokes", "")), data.get("settings")
    return Kept(
        inferred, tuple(dict.fromkeys(silent)), max(rivals, default=0),
        float(frame) if isinstance(frame, int | float) else None,
        os.path.normpath(os.path.join(os.path.dirname(os.path.realpath(look)), named)) if named else "",
        plain(settings) if isinstance(settings, Mapping) else {},
    )  # fmt: skip


def copy_look(look: str | os.PathLike[str], target: str | os.PathLike[str]) -> None:
    """Copies a look with the textures that were baked for it; what it names by relative paths stays the same.

    Raises: InputError where the look is none, AuthorError where `target` cannot be written.
    """
    layer = open_look(look)
    with quiet_usd():
        move_paths(layer, Path(look).parent, Path(target).parent)
        carry_textures(layer, Path(look), Path(target))
        write_layer(layer, target)
