"""What a look says it is meant to move, on each Material that it changes: so that anybody can see what else it moves.

moves_data(moves) -> dict                     for customData.usdslf.moves
moves_in(data) -> {parameter: Move}           of such a dictionary, whoever wrote it
meant(stage, look, materials) -> {path: moves}      of the materials that show, also by classes and inherits
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np
from pxr import Sdf, Usd, Vt

from usdslf.edits.moves import Move
from usdslf.usd.look_data import our_data

MOVES = "moves"
_ENDS = ("low", "high", "least", "most")


def moves_data(moves: Mapping[str, Move]) -> dict[str, dict[str, Vt.FloatArray]]:
    """Returns moves as USD holds them in a dictionary."""
    return {
        name: {end: Vt.FloatArray([float(x) for x in values]) for end in _ENDS if (values := getattr(move, end))}
        for name, move in moves.items()
    }


def moves_in(data: Any) -> dict[str, Move]:
    """Returns the moves that a dictionary holds; what is none is left out."""
    found = {}
    for name, ends in data.items() if isinstance(data, Mapping) else ():
        values = {end: _numbers(ends.get(end)) for end in _ENDS} if isinstance(ends, Mapping) else {}
        if values.get("low") and values.get("high"):
            found[str(name)] = Move(**values)
    return found


def meant(stage: Usd.Stage, look: Sdf.Layer, materials: Iterable[str]) -> dict[str, dict[str, Move]]:
    """Returns what a look means to move on each of the materials of a stage that it is composed in.

    Args:
        materials: paths.
    """
    found: dict[str, dict[str, Move]] = {}
    for path in materials:
        prim = stage.GetPrimAtPath(path) if path else None
        for spec in prim.GetPrimStack() if prim else ():
            if spec.layer == look:
                for name, move in moves_in(our_data(spec.customData).get(MOVES)).items():
                    mine = found.setdefault(path, {})
                    mine[name] = mine[name].joined(move) if name in mine else move
    return found


def _numbers(value: Any) -> tuple[float, ...]:
    try:
        values = np.asarray(value, np.float64).ravel() if value is not None else np.zeros(0)
    except (TypeError, ValueError):
        return ()
    return tuple(float(x) for x in values) if len(values) in (1, 3) and np.isfinite(values).all() else ()
