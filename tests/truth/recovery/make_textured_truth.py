"""Renders the truth of the textured cases with the path tracer, at the dabs alone.

    python tests/truth/recovery/make_textured_truth.py [NAME ...] [--pictures DIR] [--again]

As make_truth, on shots of the real assets (textured_cases.py).  Saved as truth/NAME.json: exact colours, what
was changed and by how much, how visible the change is, and the noise.  Cases whose change is lost in the
noise, or that leave fewer than 16 dabs, are named and not saved.
"""

from __future__ import annotations

import argparse
import json
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).resolve().parents[3]))
sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

import numpy as np
from numpy.typing import NDArray
from reference.pathtracer import Tracer, camera_rays
from truth.recovery.make_truth import (
    ASPECT,
    MAX_DEPTH,
    RADIUS,
    SIZE,
    TRUTH,
    changed_where,
    compact,
    dab_radiance,
    disc_offsets,
    pick_dabs,
    rounded,
    save_pictures,
)
from truth.recovery.textured_cases import TEXTURED, TexturedCase

PICTURE_SAMPLES = 32  # they choose the dabs, no more
MOST_ROUNDS = 40
LEAST_DABS = 16
LEAST_CHANGE = 0.05  # median over the dabs, relative
LEAST_OVER_NOISE = 5.0


def make_truth(case: TexturedCase, pictures: Path | None = None) -> dict[str, Any]:
    """Renders one case and returns what is to be saved."""
    start = time.perf_counter()
    rng = np.random.default_rng(1000 + case.seed)
    camera = case.shot.camera
    with tempfile.TemporaryDirectory() as folder:
        stages = [case.build(Path(folder) / str(changed), changed) for changed in (False, True)]
        tracers = [Tracer(stage, max_depth=MAX_DEPTH) for stage in stages]
    before, after = (t.render(camera, *SIZE, PICTURE_SAMPLES, seed=1) for t in tracers)
    xy, visible = changed_places(tracers[0], case, before, after)
    if len(xy) < LEAST_DABS:
        raise ValueError(f"{len(xy)} places on {case.material}")
    xy = pick_dabs(xy, visible, case.seed % 2 == 0, rng)
    colors, noise = dab_radiance(tracers[1], xy, MOST_ROUNDS, 2, camera)
    colors_before, noise_before = dab_radiance(tracers[0], xy, MOST_ROUNDS // 4, 3, camera)
    if pictures:
        save_pictures(pictures / f"{case.name}.png", before, after, xy)
    surfaces = [true_surface(t, case, xy) for t in tracers]
    scale = np.maximum(colors, colors_before).max(1) + 0.05 * colors.mean()
    change = np.abs(colors - colors_before).max(1) / scale
    return {
        "name": case.name,
        "parameter": case.parameter,
        "material": case.material,
        "asset": case.shot.asset,
        "hdri": case.shot.hdri,
        "changed": case.changed_values(),
        "camera": camera,
        "radius": RADIUS,
        "xy": np.round(xy, 5).tolist(),
        "colors": {"exact": rounded(colors)},
        "colors_before": rounded(colors_before),
        "before": surfaces[0],
        "after": surfaces[1],
        "change": {"median": float(np.round(np.median(change), 4)), "most": float(np.round(change.max(), 4))},
        "noise": {
            "median": float(np.round(np.median(noise), 4)),
            "most": float(np.round(noise.max(), 4)),
            "before": float(np.round(np.median(noise_before), 4)),
        },
        "not_honoured": tracers[0].warnings[:6],
        "seconds": round(time.perf_counter() - start, 1),
    }


def is_subject(tracer: Tracer, case: TexturedCase, xy: NDArray) -> NDArray:
    """Whether places (n, 2) of the picture show the material, and all of it where it is cut out."""
    seen = tracer.first_surfaces(*camera_rays(tracer.stage, case.shot.camera, xy, ASPECT))
    tail = case.material.removeprefix(case.shot.root) if case.shot.copies else case.material
    return np.char.endswith(seen.material.astype(str), tail) & (seen.opacity > 0.99)


def changed_places(tracer: Tracer, case: TexturedCase, before: NDArray, after: NDArray) -> tuple[NDArray, NDArray]:
    """Returns places xy (n, 2) on the subject where the picture changed, and by how much (n,), relative."""
    width, height = SIZE
    x, y = np.meshgrid((np.arange(width) + 0.5) / width, (np.arange(height) + 0.5) / height)
    xy = np.stack([x.ravel(), y.ravel()], -1)
    xy, visible = changed_where(xy, is_subject(tracer, case, xy), before, after)
    if not len(xy):
        return xy, visible
    # The whole footprint lies on the subject.
    rings = [r * RADIUS * np.exp(2j * np.pi * np.arange(12) / 12) for r in (1.25, 0.6)]
    ring = np.concatenate(rings)
    around = xy[:, None] + np.stack([ring.real / ASPECT, ring.imag], -1)
    inside = is_subject(tracer, case, around.reshape(-1, 2)).reshape(len(xy), -1).all(1)
    inside &= ((around > 0) & (around < 1)).all((1, 2))
    return xy[inside], visible[inside]


def true_surface(tracer: Tracer, case: TexturedCase, xy: NDArray) -> dict[str, Any]:
    """Returns diffuse, specular (F0) and roughness, the mean over the dabs, as the BSDF reads them."""
    rng = np.random.default_rng(5)
    spread = (xy[:, None] + disc_offsets(200, rng)).reshape(-1, 2)
    seen = tracer.first_surfaces(*camera_rays(tracer.stage, case.shot.camera, spread, ASPECT))
    mine = is_subject(tracer, case, spread)
    means = {"diffuse": seen.diffuse[mine].mean(0), "specular": seen.f0[mine].mean(0)}
    return {k: rounded(v) for k, v in means.items()} | {"roughness": round(float(seen.roughness[mine].mean()), 4)}


def main() -> None:
    """Renders the cases that are named, or all that have no truth yet."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("names", nargs="*", help="parts of names; none: all")
    parser.add_argument("--pictures", type=Path, help="folder for pictures to look at")
    parser.add_argument("--again", action="store_true", help="also those that are there")
    a = parser.parse_args()
    for case in TEXTURED:
        path = TRUTH / f"{case.name}.json"
        if (a.names and not any(n in case.name for n in a.names)) or (path.exists() and not a.again):
            continue
        try:
            truth = make_truth(case, a.pictures)
        except ValueError as error:
            print(f"{case.name:52s} not saved: {error}", flush=True)
            continue
        change, noise = truth["change"], truth["noise"]
        is_seen = change["median"] >= max(LEAST_CHANGE, LEAST_OVER_NOISE * noise["median"])
        if is_seen:
            path.write_text(compact(json.dumps(truth, indent=1)) + "\n")
        print(
            f"{case.name:52s} dabs {len(truth['xy']):2d}  change {change['median']:.3f}"
            f"  noise {noise['median']:.4f} most {noise['most']:.4f}  {truth['seconds']:.0f} s"
            f"{'' if is_seen else '  not saved: the change is not seen'}",
            flush=True,
        )


if __name__ == "__main__":
    main()
