"""Drawings of the gallery: lines over an axis, and bars, as SVG that stands by itself."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from html import escape

COLORS = ("#8fb8e8", "#f0b27a", "#7ccf8a", "#f08a7a")
INK, PAPER = "#b9bbbd", "#141517"
WIDTH, HEIGHT, LEFT, RIGHT, TOP, BOTTOM = 560, 320, 58, 130, 34, 46


@dataclass(frozen=True)
class Axis:
    """What runs along an axis."""

    title: str
    low: float
    high: float
    marks: Sequence[float]


def lines(
    title: str, x: Axis, y: Axis, curves: Mapping[str, Sequence[tuple[float, float]]], at: float | None = None
) -> str:
    """Draws curves of points.

    Args:
        at: where on x a dashed line stands.
    """
    across = lambda v: LEFT + (v - x.low) / (x.high - x.low) * (WIDTH - LEFT - RIGHT)  # noqa: E731
    parts = [_frame(title, y)]
    for mark in x.marks:
        parts.append(_text(across(mark), HEIGHT - BOTTOM + 16, f"{mark:g}", "middle"))
    parts.append(_text((LEFT + WIDTH - RIGHT) / 2, HEIGHT - 10, x.title, "middle"))
    if at is not None:
        parts.append(
            f'<line x1="{across(at):.1f}" x2="{across(at):.1f}" y1="{TOP}" y2="{HEIGHT - BOTTOM}" stroke="{INK}" '
            'stroke-dasharray="4 4"/>'
        )
    for k, (name, points) in enumerate(curves.items()):
        color = COLORS[k % len(COLORS)]
        spots = [(across(a), _down(b, y)) for a, b in points]
        way = " ".join(f"{a:.1f},{b:.1f}" for a, b in spots)
        parts.append(f'<polyline points="{way}" fill="none" stroke="{color}" stroke-width="2"/>')
        parts += [f'<circle cx="{a:.1f}" cy="{b:.1f}" r="3" fill="{color}"/>' for a, b in spots]
        parts.append(_text(WIDTH - RIGHT + 12, TOP + 14 + 18 * k, name, "start", color))
    return _sheet(parts)


def bars(title: str, y: Axis, groups: Mapping[str, Mapping[str, float]]) -> str:
    """Draws a group of bars for each name; bars of the same name have the same colour."""
    names = list(dict.fromkeys(name for group in groups.values() for name in group))
    wide = (WIDTH - LEFT - RIGHT) / max(len(groups), 1)
    step = 0.8 * wide / max(len(names), 1)
    parts = [_frame(title, y)]
    for g, (group, values) in enumerate(groups.items()):
        first = LEFT + (g + 0.1) * wide
        parts.append(_text(first + 0.4 * wide, HEIGHT - BOTTOM + 16, group, "middle"))
        for k, name in enumerate(names):
            top, zero = _down(values.get(name, 0.0), y), _down(max(y.low, 0.0), y)
            parts.append(
                f'<rect x="{first + k * step:.1f}" y="{min(top, zero):.1f}" width="{0.85 * step:.1f}" '
                f'height="{max(abs(zero - top), 1):.1f}" fill="{COLORS[k % len(COLORS)]}"/>'
            )
    parts += [
        _text(WIDTH - RIGHT + 12, TOP + 14 + 18 * k, name, "start", COLORS[k % len(COLORS)])
        for k, name in enumerate(names)
    ]
    return _sheet(parts)


def _down(v: float, y: Axis) -> float:
    share = min(max((v - y.low) / (y.high - y.low), 0.0), 1.0)
    return HEIGHT - BOTTOM - share * (HEIGHT - TOP - BOTTOM)


def _frame(title: str, y: Axis) -> str:
    parts = [_text(LEFT, 20, title, "start"), _text(14, TOP - 8, y.title, "start")]
    for mark in y.marks:
        at = _down(mark, y)
        parts.append(f'<line x1="{LEFT}" x2="{WIDTH - RIGHT}" y1="{at:.1f}" y2="{at:.1f}" stroke="#3a3b3e"/>')
        parts.append(_text(LEFT - 6, at + 4, f"{mark:g}", "end"))
    return "".join(parts)


def _text(x: float, y: float, text: str, anchor: str, color: str = INK) -> str:
    return f'<text x="{x:.1f}" y="{y:.1f}" text-anchor="{anchor}" fill="{color}">{escape(text)}</text>'


def _sheet(parts: Sequence[str]) -> str:
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH} {HEIGHT}" font-family="sans-serif" '
        f'font-size="12"><rect width="{WIDTH}" height="{HEIGHT}" fill="{PAPER}"/>{"".join(parts)}</svg>\n'
    )
