"""Renders what an indirect stroke is painted with: a floor beside a wall that is red, then blue.

    python tests/truth/recovery/make_indirect_truth.py

writes indirect_truth.json: dabs on the floor, and their true mean radiances before and after the wall changes.
"""

from __future__ import annotations

import json
import sys
import tempfile
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

import numpy as np
from reference.pathtracer import camera_rays
from truth.recovery.cases import CASES
from truth.recovery.make_truth import Tracer, dab_radiance
from truth.recovery.stages import CAMERA, SIZE, build_stage

CASE = "room_wall_area_diffuse_s"
DABS = 16
OUT = Path(__file__).with_name("indirect_truth.json")


def main() -> None:
    """Picks dabs on the floor near the wall and renders them."""
    case = next(c for c in CASES if c.name == CASE)
    with tempfile.TemporaryDirectory() as folder:
        tracers = [Tracer(build_stage(case, Path(folder) / n, changed=n == "after")) for n in ("before", "after")]
        grid = np.stack(np.meshgrid(np.linspace(0.05, 0.6, 24), np.linspace(0.6, 0.97, 16)), -1).reshape(-1, 2)
        shape, position = tracers[0].first_hits(*camera_rays(tracers[0].stage, CAMERA, grid, SIZE[0] / SIZE[1]))[:2]
        on_floor = np.array(["floor" in str(s) for s in shape]) & (position[:, 0] < -0.6)
        xy = np.random.default_rng(1).permutation(grid[on_floor])[:DABS]
        before, after = (dab_radiance(t, xy, 24, i)[0] for i, t in enumerate(tracers))
    rounded = {k: np.round(v, 6).tolist() for k, v in (("xy", xy), ("before", before), ("after", after))}
    OUT.write_text(json.dumps({"case": CASE, **rounded}) + "\n")


if __name__ == "__main__":
    main()
