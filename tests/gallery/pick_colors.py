"""What a path tracer shows under dabs of a gallery entry whose materials were changed: the colours to paint.

    from gallery.pick_colors import true_colors
    true_colors(shot, folder, {"glaze": {"diffuseColor": (.6, .05, .04)}}, places, radius)
"""

from __future__ import annotations

import sys
from collections.abc import Mapping, Sequence
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

import numpy as np
from numpy.typing import NDArray
from pxr import Usd
from reference.pathtracer import Tracer, camera_rays

from usdslf.gallery.play import SIZE
from usdslf.procedural.built_shot import BuiltShot, Inputs
from usdslf.usd.build_stage import write_stage


def true_colors(
    shot: BuiltShot, folder: Path, changes: Mapping[str, Inputs], places: Sequence[tuple[float, float]], radius: float,
    paths: int = 4096, view: int = 0, depth: int = 8,
) -> NDArray[np.float64]:  # fmt: skip
    """Returns mean radiances (n, 3) of dabs; places (n, 2) in 0..1 of the picture, radius in picture heights.

    Args:
        folder: where `shot` was built; a stage truth.usda is written there.
    """
    stage = Usd.Stage.Open(str(write_stage(shot.changed(changes), folder, "truth.usda")))
    return dab_means(Tracer(stage, "smith", max_depth=depth), stage, shot.view_path(view), places, radius, paths)


def dab_means(
    tracer: Tracer, stage: Usd.Stage, camera: str, places: Sequence[tuple[float, float]], radius: float, paths: int
) -> NDArray[np.float64]:
    """Returns mean radiances (n, 3) of dabs on a camera's picture, by paths through the disk of each."""
    aspect = SIZE[0] / SIZE[1]
    rng = np.random.default_rng(1)
    at = np.asarray(places, float)
    r = radius * np.sqrt(rng.random((len(at), paths)))
    turn = 2 * np.pi * rng.random(r.shape)
    at = at[:, None] + np.stack([r * np.cos(turn) / aspect, r * np.sin(turn)], -1)
    rays = camera_rays(stage, camera, at.reshape(-1, 2), aspect)
    return tracer.radiance(*rays, seed=7).reshape(*r.shape, 3).mean(1)
