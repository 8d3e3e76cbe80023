"""One size of one axis of the growth bench, in a process of its own, so that the peak of its memory is its own.

    python -m usdslf.cli.growth_point STAGE ELEMENTS STROKES [DEVICE]

prints processors' seconds of each step and the peak of memory [bytes] as JSON.
"""

from __future__ import annotations

import json
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from usdslf.cache import switched
from usdslf.cli.bench import peak_memory
from usdslf.cli.growth_shots import HALF, Growing, build_growing
from usdslf.pictures import live_picture, render_shot
from usdslf.scene.cameras import project_points
from usdslf.shot import Shot
from usdslf.solution import find_solution
from usdslf.strokes.paint import paint_stroke
from usdslf.strokes.stroke import Stroke

SIZE = (240, 135)


def measure_point(built: Growing, device: str | None = None) -> dict[str, Any]:
    """Takes a shot from its stage to its pictures, and to answers where it has strokes.

    Returns: `seconds` of all processors together by step, `memory` [bytes] at most.
    """
    with switched("weights"), tempfile.TemporaryDirectory(prefix="usdslf_growth_") as name:
        warm_up(device, Path(name))
        shot = Shot.open(str(built.stage), device=device, elements=built.elements)
        steps: dict[str, Callable[[], object]] = {
            "read": lambda: (shot.scene, shot.tracer),
            "elements": lambda: (shot.elements, shot.lookup),
            "visibility": lambda: shot.visibility,
            "light": lambda: shot.fixed_light,
            "light field": lambda: shot.light_field,
        }
        seconds = {step: _timed(work) for step, work in steps.items()}
        if built.strokes:
            strokes = painted(shot, built.strokes)
            seconds["answers"] = _timed(lambda: find_solution(shot, strokes))
        seconds["live, first frame"] = _timed(lambda: next(live_picture(shot, size=SIZE).frames(1)))
        seconds["picture"] = _timed(lambda: render_shot(shot, size=SIZE))
    return {"seconds": seconds, "memory": peak_memory()}


def warm_up(device: str | None, folder: Path) -> None:
    """Builds the kernels and the weights that all sizes need, on a small shot."""
    built = build_growing("elements", 100, folder)
    shot = Shot.open(str(built.stage), device=device, elements=built.elements, bounces=1)
    find_solution(shot, painted(shot, 1))
    next(live_picture(shot, size=(16, 9)).frames(1))
    render_shot(shot, size=(16, 9))


def painted(shot: Shot, count: int) -> list[Stroke]:
    """Returns strokes of a dab each, where the camera sees them, of colours that want a change."""
    rng, camera = np.random.default_rng(6), shot.camera()
    side = int(np.ceil(np.sqrt(count)))
    t = (np.arange(side) + 0.5) / side * 1.6 * HALF - 0.8 * HALF
    x, z = np.meshgrid(t, t)
    floor = np.stack([x.ravel(), 0 * x.ravel(), z.ravel()], 1)[:count]
    at, _ = project_points(camera, floor, SIZE[0] / SIZE[1])
    return [
        paint_stroke(shot.scene, shot.tracer, camera, [[place]], 0.01, rng.uniform(0.05, 0.4, 3), name=f"s{k:04d}")
        for k, place in enumerate(at)
    ]


def _timed(work: Callable[[], object]) -> float:
    """Time of the processors, so that other programs do not count."""
    began = time.process_time()
    work()
    return time.process_time() - began


if __name__ == "__main__":
    stage, elements, strokes, *device = sys.argv[1:]
    print(json.dumps(measure_point(Growing(Path(stage), int(elements), int(strokes)), *device)))
