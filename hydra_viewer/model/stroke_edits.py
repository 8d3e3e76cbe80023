"""Edits of the list of strokes: each takes all strokes and returns all, for one step of undo.

    toggled, deleted, moved, changed, recolored, chosen
    described(stroke) -> str        a line for a list
    is_same_paint(one, other)       whether two strokes differ in the chosen explanation at most
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import fields, replace
from typing import Any

import numpy as np

from usdslf import Stroke

Strokes = tuple[Stroke, ...]
EDITABLE = ("tool", "mode", "space", "norm", "scope", "strength")  # of a stroke that is there


def toggled(strokes: Sequence[Stroke], names: Collection[str]) -> Strokes:
    """Switches strokes off; where all of them are off, on."""
    is_on = any(s.active for s in strokes if s.name in names)
    return tuple(replace(s, active=not is_on) if s.name in names else s for s in strokes)


def deleted(strokes: Sequence[Stroke], names: Collection[str]) -> Strokes:
    """Leaves strokes out."""
    return tuple(s for s in strokes if s.name not in names)


def moved(strokes: Sequence[Stroke], names: Collection[str], by: int) -> Strokes:
    """Moves strokes one place towards the first (-1) or the last (1); they stay where the end is reached."""
    found = list(strokes)
    rows = [i for i, s in enumerate(found) if s.name in names]
    for i in rows if by < 0 else reversed(rows):
        j = i + by
        if 0 <= j < len(found) and found[j].name not in names:
            found[i], found[j] = found[j], found[i]
    return tuple(found)


def placed(strokes: Sequence[Stroke], order: Sequence[str]) -> Strokes:
    """Puts strokes in the order of names."""
    by_name = {s.name: s for s in strokes}
    return tuple(by_name[name] for name in order)


def changed(strokes: Sequence[Stroke], names: Collection[str], **values: Any) -> Strokes:
    """Gives strokes other values of EDITABLE; what a person chose as their explanation is asked anew.

    A stroke that becomes a clone has to have a source: others stay as they are.
    """
    assert set(values) <= set(EDITABLE), values

    def edited(s: Stroke) -> Stroke:
        is_clone_of_nothing = values.get("tool") == "clone" and not np.any(s.clone_offset)
        is_same = all(getattr(s, name) == value for name, value in values.items())
        return s if is_clone_of_nothing or is_same else replace(s, choice="", **values)

    return tuple(edited(s) if s.name in names else s for s in strokes)


def recolored(strokes: Sequence[Stroke], names: Collection[str], color: tuple[float, float, float]) -> Strokes:
    """Gives strokes one colour, scene-linear; what a person chose as their explanation is asked anew."""
    return tuple(
        replace(s, colors=np.tile(np.array(color, np.float32), (len(s.points), 1)), choice="") if s.name in names else s
        for s in strokes
    )


def chosen(strokes: Sequence[Stroke], names: Collection[str], choice: str) -> Strokes:
    """Takes an explanation for strokes; "": the solver's best."""
    return tuple(replace(s, choice=choice) if s.name in names and s.choice != choice else s for s in strokes)


def is_same_paint(one: Stroke, other: Stroke) -> bool:
    """Returns whether two strokes differ in what was chosen as their explanation at most."""
    names = [f.name for f in fields(Stroke) if f.name != "choice"]
    return all(getattr(one, name) is getattr(other, name) for name in names)


def described(stroke: Stroke) -> str:
    """Returns a stroke in a line: tool, and what is not as usual."""
    s = stroke
    unusual = [s.mode] if s.mode != "direct" else []
    unusual += [f"{100 * s.strength:.0f} %"] if s.strength != 1 else []
    unusual += [s.scope] if s.scope != "material" else []
    unusual += [s.norm] if s.norm != "mixed" else []
    unusual += [s.space] if s.space != "scene" else []
    return ", ".join([s.tool, *unusual])
