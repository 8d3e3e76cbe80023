"""Drawings are XML, and put values where they belong."""

from __future__ import annotations

from xml.etree import ElementTree

import pytest

from usdslf.gallery.plots import HEIGHT, WIDTH, Axis, bars, lines

SVG = "{http://www.w3.org/2000/svg}"
Y = Axis("y", -1, 1, (-1, 0, 1))


def test_a_curve_rises_with_its_values_and_stays_on_the_sheet() -> None:
    drawn = ElementTree.fromstring(
        lines("a < b & c", Axis("x", 0, 2, (0, 1, 2)), Y, {"up": [(0, -1), (1, 0), (2, 1)], "far": [(1, 9)]}, at=1)
    )
    spots = [(float(c.get("cx")), float(c.get("cy"))) for c in drawn.iter(f"{SVG}circle")]
    (x0, y0), (x1, y1), (x2, y2), (_, far) = spots
    assert x0 < x1 < x2 and y0 > y1 > y2 == far
    assert x1 == pytest.approx((x0 + x2) / 2, abs=0.1) and y1 == pytest.approx((y0 + y2) / 2, abs=0.1)
    assert all(0 < x < WIDTH and 0 < y < HEIGHT for x, y in spots)
    dashed = [line for line in drawn.iter(f"{SVG}line") if line.get("stroke-dasharray")]
    assert [float(line.get("x1")) for line in dashed] == pytest.approx([x1], abs=0.1)
    assert "a < b & c" in [t.text for t in drawn.iter(f"{SVG}text")]


def test_bars_are_as_high_as_their_values() -> None:
    drawn = ElementTree.fromstring(bars("t", Axis("", 0, 1, (0, 1)), {"l2": {"a": 0.5, "b": 1.0}, "l0": {"b": 0.25}}))
    high = [float(r.get("height")) for r in drawn.iter(f"{SVG}rect")][1:]  # the first is the paper
    assert high[:2] == pytest.approx([high[1] / 2, high[1]], rel=0.01)
    assert high[2] == 1 and high[3] == pytest.approx(high[1] / 4, rel=0.01)
