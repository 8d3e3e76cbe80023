"""Renders the lit stages of tests/kit/lit_stages.py with the path tracer, into NAME.npz beside this file.

    python tests/truth/pictures/make_pictures.py [NAME ...] [--spp N]

Each file holds `picture` (120, 160, 3), half float, scene-linear.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
import time
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

import numpy as np
from kit.lit_stages import CAMERA, SCENES, SIZE
from reference.pathtracer import Tracer

HERE = Path(__file__).resolve().parent
MAX_DEPTH = 16


def main() -> None:
    """Renders the stages that are named, or all."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("names", nargs="*")
    parser.add_argument("--spp", type=int, default=1024)
    a = parser.parse_args()
    for name in a.names or SCENES:
        start = time.perf_counter()
        with tempfile.TemporaryDirectory() as folder:
            tracer = Tracer(SCENES[name].write(Path(folder)), max_depth=MAX_DEPTH)
            assert not tracer.warnings, tracer.warnings
            halves = [tracer.render(CAMERA, *SIZE, a.spp // 2, seed=seed) for seed in (0, 1_000_000)]
        picture = (halves[0] + halves[1]) / 2
        np.savez_compressed(HERE / f"{name}.npz", picture=picture.astype(np.float16))
        # Noise after averaging 5 x 5 pixels, from the difference of two halves.
        height, width = SIZE[1], SIZE[0]
        blocks = [h.reshape(height // 5, 5, width // 5, 5, 3).mean((1, 3)) for h in halves]
        noise = np.abs(blocks[0] - blocks[1]) / 2 / (blocks[0] + 0.05 * blocks[0].mean())
        seconds = time.perf_counter() - start
        print(f"{name:24s} mean {picture.mean():.4f} noise {noise.mean():.4f} {seconds:.0f} s", flush=True)


if __name__ == "__main__":
    main()
