"""How near a path tracer sees the painted places to the strokes' colours, before and after a step of a play."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from pxr import Usd
from reference.pathtracer import Tracer

from usdslf.gallery.records import Step
from usdslf.strokes.stroke import Stroke, dab_rows


@dataclass(frozen=True)
class Nearness:
    """Relative errors over the dabs of a stroke: mean of |seen - painted| / (painted + a tenth of their mean)."""

    stroke: str
    before: float
    after: float

    @property
    def factor(self) -> float:
        """How many times nearer the look brought it."""
        return self.before / max(self.after, 1e-6)


def nearness(step: Step, paths: int = 2048, depth: int = 8) -> list[Nearness]:
    """Path-traces the dabs of a step's strokes without and with its look layer."""
    errors: list[list[float]] = []
    for session in (step.before, step.after):
        stage = Usd.Stage.Open(session.scene.stage)
        tracer = Tracer(stage, "smith", max_depth=depth)
        errors.append([_error(tracer, s, paths) for s in step.strokes])
    return [Nearness(s.path, b, a) for s, b, a in zip(step.strokes, *errors)]


def _error(tracer: Tracer, stroke: Stroke, paths: int) -> float:
    rows = dab_rows(stroke)
    seen, painted = _dabs(tracer, stroke, rows, paths), stroke.colors[rows].astype(float)
    return float(np.mean(np.abs(seen - painted) / (painted + 0.1 * painted.mean())))


def _dabs(tracer: Tracer, stroke: Stroke, rows: NDArray, paths: int) -> NDArray[np.float64]:
    """Mean radiance (n, 3) that each dab sends to its eye, over its disk."""
    rng = np.random.default_rng(1)
    centre, eye = stroke.points[rows].astype(float), stroke.eye[rows].astype(float)
    ahead = (centre - eye) / np.linalg.norm(centre - eye, axis=1, keepdims=True)
    side = np.cross(ahead, np.where(np.abs(ahead[:, 1:2]) < 0.9, [[0, 1, 0]], [[1, 0, 0]]))
    side /= np.linalg.norm(side, axis=1, keepdims=True)
    up = np.cross(side, ahead)
    r = 0.5 * stroke.widths[rows, None] * np.sqrt(rng.random((len(rows), paths)))
    turn = 2 * np.pi * rng.random(r.shape)
    aim = centre[:, None] + (r * np.cos(turn))[..., None] * side[:, None] + (r * np.sin(turn))[..., None] * up[:, None]
    way = aim - eye[:, None]
    way /= np.linalg.norm(way, axis=-1, keepdims=True)
    origin = np.broadcast_to(eye[:, None], way.shape)
    return tracer.radiance(origin.reshape(-1, 3), way.reshape(-1, 3), seed=3).reshape(*r.shape, 3).mean(1)
