"""Renders what a caustic is painted with: the floor within a ring that is dull, then of silver, then of gold.

    python tests/truth/recovery/make_caustic_truth.py

writes caustic_truth.json: dabs where the golden ring throws its caustic, two fixate strokes where it changes
little, the path-traced mean radiances of all of them and their noise.
"""

from __future__ import annotations

import json
import sys
import tempfile
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

import numpy as np
from reference.pathtracer import camera_rays
from truth.recovery.indirect_stages import DULL, GOLDEN, SILVER, build_caustic
from truth.recovery.make_truth import ASPECT, Tracer, dab_radiance, rounded
from truth.recovery.stages import CAMERA

DABS, HELD = 24, 5
OUT = Path(__file__).with_name("caustic_truth.json")


def main() -> None:
    """Picks the dabs and renders them under the three rings."""
    with tempfile.TemporaryDirectory() as folder:
        rings = {"dull": DULL, "silver": SILVER, "golden": GOLDEN}
        tracers = {n: Tracer(build_caustic(Path(folder) / n, r), max_depth=10) for n, r in rings.items()}
        grid = np.stack(np.meshgrid(np.linspace(0.24, 0.9, 45), np.linspace(0.3, 0.95, 45)), -1).reshape(-1, 2)
        rays = camera_rays(tracers["dull"].stage, CAMERA, grid, ASPECT)
        shape, place = tracers["dull"].first_hits(*rays)[:2]
        grid, place = (x[np.array(["floor" in str(s) for s in shape])] for x in (grid, place))
        radius = np.hypot(place[:, 0], place[:, 2])
        before, after = (dab_radiance(tracers[n], grid, 6, 5)[0].mean(1) for n in ("dull", "golden"))
        ratio, inside = after / before, radius < 0.52
        # the caustic from its brightest to its rim, each dab for itself
        rng = np.random.default_rng(3)
        wanted = np.flatnonzero(inside & (ratio > 1.25))
        dabs = grid[rng.choice(wanted, DABS, replace=False, p=(w := (ratio[wanted] - 1)) / w.sum())]
        quiet = np.flatnonzero(inside & (np.abs(ratio - 1) < 0.12) | (radius > 0.9) & (np.abs(ratio - 1) < 0.05))
        held = [grid[_about(grid, quiet, quiet[inside[quiet] == side], rng)] for side in (True, False)]
        found = {"xy": np.round(dabs, 5).tolist(), "held": [np.round(h, 5).tolist() for h in held]}
        for name, tracer in tracers.items():
            found[name], noise = dab_radiance(tracer, dabs, 24, 7)
            found[name] = rounded(found[name])
            found[f"held_{name}"] = [rounded(dab_radiance(tracer, h, 24, 8)[0]) for h in held]
            found[f"noise_{name}"] = round(float(noise.max()), 4)
            print(name, "noise", found[f"noise_{name}"])
    OUT.write_text(json.dumps(found) + "\n")


def _about(grid: np.ndarray, allowed: np.ndarray, start: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Rows of a short stroke: the allowed places nearest to one of them."""
    first = start[rng.integers(len(start))]
    distance = np.linalg.norm((grid[allowed] - grid[first]) * [ASPECT, 1], axis=1)
    return allowed[np.argsort(distance)[:HELD]]


if __name__ == "__main__":
    main()
