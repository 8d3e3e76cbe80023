"""What was inferred, in lines that people read."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any


def lines_of_report(report: Mapping[str, Any]) -> Iterator[str]:
    """Yields two lines a stroke or stylized material, and up to two an edit."""
    for style in report.get("materials", ()):
        yield f"{style['material']}: {style['inferred']}"
        residual = f"{style['residual_before']:.3f} -> {style['residual_after']:.3f}"
        written = f", as written {style['residual_as_written']:.3f}" if "residual_as_written" in style else ""
        yield f"  {_changes(style)}; residual of its elements {residual}{written}"
    for stroke in report["strokes"]:
        tie = "  (ambiguous)" if stroke.get("ambiguous") else ""
        tie += "  (varies over the surface; means follow)" if stroke.get("varies") else ""
        yield f"{stroke['path']} on {stroke['surface']}: {stroke['inferred']} of {stroke['material']}{tie}"
        residual = f"{stroke['residual_before']:.3f} -> {stroke['residual_after']:.3f}"
        yield f"  {_changes(stroke)}; residual {residual}"
        for also in stroke.get("also", ()):
            yield f"  and {also['inferred']} of {also['material']}: {_changes(also)}"
    for edit in report["edits"]:
        loses = "" if edit["wins"] else f"  (hidden by {edit['hidden_by']}: {edit['mend']})"
        change = f"{_value(edit['before'])} -> {_value(edit['after'])}"
        yield f"{edit['prim']}.{edit['attribute']}: {change}{loses}"
        if edit["affects"]:
            yield f"  shown by {len(edit['affects'])}: {_some(edit['affects'])}"


def _some(prims: Sequence[str], most: int = 3) -> str:
    more = len(prims) - most
    return ", ".join(prims[:most]) + (f" and {more} more" if more > 0 else "")


def _changes(of: Mapping[str, Any]) -> str:
    before, after = of["before"], of["after"]
    changed = [f"{k} {_value(before[k])} -> {_value(after[k])}" for k in after if before[k] != after[k]]
    return ", ".join(changed) or "nothing changed"


def _value(value: Any) -> str:
    if isinstance(value, list | tuple):
        return "(" + ", ".join(_value(v) for v in value) + ")"
    return f"{value:.3g}" if isinstance(value, float) else str(value)
