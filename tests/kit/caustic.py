"""Strokes on a path-traced caustic inside a ring, and beside it."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

import usdslf
from usdslf.strokes.stroke import Stroke

TRUTH = json.loads((Path(__file__).parents[1] / "truth/recovery/caustic_truth.json").read_text())


def paint(session: Any, xy: list, colors: Any = None, name: str = "stroke_0001", **brush: Any) -> Stroke:
    """Dabs on the picture, each of a colour of its own."""
    paths = [np.array([p]) for p in xy]
    stroke = usdslf.paint_stroke(
        session.scene, session.tracer, session.camera("/World/camera"), paths, 0.01, aspect=4 / 3, name=name,
        mode="indirect", **brush,
    )  # fmt: skip
    if colors is None:
        return stroke
    rows = np.broadcast_to(np.array(colors, np.float32), (len(xy), 3))
    return replace(stroke, colors=np.repeat(rows, stroke.counts, axis=0))


def held(session: Any) -> list[Stroke]:
    """Two fixate strokes beside the caustic."""
    return [paint(session, xy, None, f"stroke_001{i}", tool="fixate") for i, xy in enumerate(TRUTH["held"])]
