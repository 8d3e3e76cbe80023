"""Toggle: edits of a look that are kept and silent, and that come back as they were.

    toggle(look, names, on) -> Toggled       writes the look
"""

from __future__ import annotations

import os
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

from pxr import Sdf

from usdslf.errors import InputError
from usdslf.replacing import is_file
from usdslf.usd.border import reading
from usdslf.usd.files import write_layer
from usdslf.usd.layer.parts import Part, Parts
from usdslf.usd.layer.silent import restore, silence
from usdslf.usd.look_data import is_look


@dataclass(frozen=True)
class Toggled:
    """What became of a look.

    Attributes:
        look: its file.
        on: the edits were brought back; else they are silent now.
        changed: properties, as they stand in the look when they show.
        silent: all that are silent now.
    """

    look: str
    on: bool
    changed: tuple[str, ...]
    silent: tuple[str, ...]

    def as_values(self) -> dict[str, Any]:
        """As JSON holds it."""
        return {"look": self.look, "on": self.on, "changed": list(self.changed), "silent": list(self.silent)}


def toggle(look: str | os.PathLike[str], names: Iterable[str], on: bool) -> Toggled:
    """Silences edits of a look, or brings them back; the look is written anew, whole or not at all.

    Args:
        names: attributes, inputs, Materials, prims or strokes, as of `Parts`.
        on: bring them back.

    Raises: InputError where the look is none, or a name is for nothing in it, or for a part of an opinion only.
    """
    layer = open_look(look)
    parts = Parts.of(layer)
    named = {path for name in names for path in parts.named(name)}
    wanted = [p for p in parts.parts if p.path in named and p.is_silent == on]
    for part in wanted:
        _require_whole(part, parts, named)
    (restore if on else silence)(layer, [p.path for p in wanted])
    if wanted:
        write_layer(layer, look)
    silent = {str(p.path) for p in parts.parts if p.is_silent and not (on and p.path in named)}
    silent |= set() if on else {str(p.path) for p in wanted}
    return Toggled(os.fspath(look), on, tuple(str(p.path) for p in wanted), tuple(sorted(silent)))


def _require_whole(part: Part, parts: Parts, named: set[Sdf.Path]) -> None:
    """Raises InputError for an opinion that is also for an input which was not named."""
    for target in part.targets:
        if "." in target and len(part.targets) > 1:
            of = [p.path for p in parts.parts if target in p.targets]
            if any(path not in named for path in of):
                others = ", ".join(t for t in part.targets)
                raise InputError(f"{part.path} is for {others} together, as one texture drives them: name all of these")


def open_look(look: str | os.PathLike[str]) -> Sdf.Layer:
    """Opens a look as it is on disk, in memory alone.

    Raises: InputError where it is none.
    """
    name = os.fspath(look)
    if not is_file(name):
        raise InputError(f"there is no look layer {name}; make one with: usdslf solve")
    with reading(name, InputError, "make a look with usdslf solve"):
        layer = Sdf.Layer.OpenAsAnonymous(name)
        if layer is None or not is_look(layer):
            raise InputError(f"{name} is not a look layer of usdslf; make one with: usdslf solve")
    return layer
