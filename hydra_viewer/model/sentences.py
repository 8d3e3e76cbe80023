"""Sentences: what was inferred, in a line each."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from usdslf import Shot, Solution, report_of


def sentences_of(shot: Shot, solution: Solution) -> Iterator[str]:
    """Yields a line for what strokes ask for together: "roughness 0.30 -> 0.12 on /World/mtl/ball, explains 94 %"."""
    said: set[str] = set()
    for stroke in report_of(shot, solution)["strokes"]:
        sentence = _sentence(stroke)
        if sentence not in said:
            said.add(sentence)
            yield sentence


def _sentence(stroke: dict[str, Any]) -> str:
    before, after = stroke["before"], stroke["after"]
    changed = [name for name in after if before[name] != after[name]]
    changes = [f"{name} {_value(before[name])} -> {_value(after[name])}" for name in changed]
    explained = 100 * (1 - min(stroke["residual_after"] / max(stroke["residual_before"], 1e-9), 1.0))
    what = ", ".join(changes) or "nothing changes"
    return f"{what} on {stroke['material']}, explains {explained:.0f} % of the stroke"


def _value(value: float | list[float]) -> str:
    return f"{value:.2f}" if isinstance(value, float) else "(" + ", ".join(f"{v:.2f}" for v in value) + ")"
