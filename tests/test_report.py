"""The lines of a report: what strokes ask together is said once."""

from __future__ import annotations

from typing import Any

from usdslf.report import lines_of_report


def stroke(name: str, surface: str, material: str) -> dict[str, Any]:
    before, after = ({"diffuse": [v, 0.1, 0.1], "specular": [0.04] * 3, "roughness": 0.5} for v in (0.5, 0.25))
    return {
        "path": f"/SlfStrokes/{name}", "surface": surface, "material": material, "inferred": "diffuse",
        "before": before, "after": after, "residual_before": 1.0, "residual_after": 0.0, "range": {},
    }  # fmt: skip


def test_strokes_with_one_answer_are_said_once() -> None:
    strokes = [stroke("a", "/left", "/m"), stroke("b", "/other", "/g"), stroke("c", "/right", "/m")]
    lines = list(lines_of_report({"strokes": strokes, "edits": []}))
    assert lines == [
        "/SlfStrokes/a, /SlfStrokes/c on /left, /right: diffuse of /m",
        "  diffuse (0.5, 0.1, 0.1) -> (0.25, 0.1, 0.1); residual 1.000 -> 0.000",
        "/SlfStrokes/b on /other: diffuse of /g",
        "  diffuse (0.5, 0.1, 0.1) -> (0.25, 0.1, 0.1); residual 1.000 -> 0.000",
    ]
