"""Holds the renderer against the path tracer on the stages of kit/lit_stages.py, or on any stage.

    python tests/truth/compare_pictures.py OUT [NAME ...] [--stage FILE --camera PRIM] [--width W] [--height H]
                                     [--samples N] [--spp N] [--elements N] [--paths]

Writes to OUT for each: the stage, both pictures, the difference (red: too bright, blue: too dark; full at 20 %),
and prints mean and 95th percentile of the relative error after 5 x 5 averaging.  The path tracer's picture is kept
and used again.
"""

from __future__ import annotations

import argparse
import sys
import time
from pathlib import Path

sys.path[:0] = [str(Path(__file__).resolve().parents[1]), str(Path(__file__).resolve().parent)]

import numpy as np  # noqa: E402
from kit.lit_stages import CAMERA, SCENES  # noqa: E402
from kit.picture_errors import error_map  # noqa: E402
from numpy.typing import NDArray  # noqa: E402


def truth_of(stage: Path, camera: str, size: tuple[int, int], spp: int, kept: Path) -> NDArray:
    """Returns the path tracer's picture, from `kept` if it is there."""
    if kept.exists():
        return np.load(kept)
    from reference.pathtracer import Tracer

    tracer = Tracer(stage)
    for warning in tracer.warnings:
        print("  path tracer:", warning)
    picture = tracer.render(camera, *size, spp)
    np.save(kept, picture)
    return picture


def save_png(path: Path, picture: NDArray, exposure: float = 1.0) -> None:
    """Writes (h, w, 3) for looking at: gamma 2.2."""
    import OpenImageIO as oiio

    pixels = np.clip(np.nan_to_num(picture) * exposure, 0, 1) ** (1 / 2.2)
    oiio.ImageBuf(np.ascontiguousarray(pixels, np.float32)).write(str(path), "uint8")


def difference_picture(picture: NDArray, truth: NDArray) -> NDArray:
    """Signed relative difference: red too bright, blue too dark, on grey."""
    sign = np.sign((picture - truth).mean(-1, keepdims=True))
    e = np.clip(error_map(picture, truth).mean(-1, keepdims=True) / 0.2, 0, 1) * sign
    return np.concatenate([np.maximum(e, 0), 0 * e, np.maximum(-e, 0)], -1) + 0.02


def our_picture(stage: Path, camera: str, size: tuple[int, int], samples: int, elements: int, paths: bool) -> NDArray:
    """Renders with usdslf; `paths` follows every path instead of asking the light field."""
    import usdslf
    from usdslf.render.picture import LitScene, PictureOptions, render

    begun = time.perf_counter()
    session = usdslf.open(str(stage), elements=elements)
    for warning in session.warnings:
        print("  usdslf:", warning)
    light_field = None if paths else session.light_field
    between = time.perf_counter()
    view = next(c for c in session.scene.cameras if c.path == camera)
    options: dict = {"footprint": np.inf, "depth": 10} if paths else {}
    lit = LitScene(session.scene, session.tracer, light_field, session.lights, session.device)
    picture = render(lit, view, size, options=PictureOptions(samples, elements, **options))["color"]
    print(f"  light field {between - begun:.1f} s, picture {time.perf_counter() - between:.1f} s")
    return picture


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("out", type=Path)
    parser.add_argument("names", nargs="*")
    parser.add_argument("--stage", type=Path)
    parser.add_argument("--camera", default=CAMERA)
    parser.add_argument("--width", type=int, default=192)
    parser.add_argument("--height", type=int, default=144)
    parser.add_argument("--samples", type=int, default=16)
    parser.add_argument("--spp", type=int, default=1024)
    parser.add_argument("--elements", type=int, default=10000)
    parser.add_argument("--paths", action="store_true")
    a = parser.parse_args()
    size = a.width, a.height
    for name in ["stage"] if a.stage else a.names or list(SCENES):
        folder = a.out / name
        folder.mkdir(parents=True, exist_ok=True)
        stage, limit = a.stage, 0.08
        if stage is None:
            limit = SCENES[name].tolerance
            stage = folder / "stage.usda"
            if not stage.exists():
                SCENES[name].write(folder)
        print(name)
        truth = truth_of(stage, a.camera, size, a.spp, folder / f"truth_{a.width}x{a.height}_{a.spp}.npy")
        picture = our_picture(stage, a.camera, size, a.samples, a.elements, a.paths)
        errors = error_map(picture, truth)
        bias = picture.mean() / truth.mean() - 1
        print(
            f"  mean {errors.mean():.4f}  p95 {np.quantile(errors, 0.95):.4f}  max {errors.max():.2f}  "
            f"brightness {bias:+.4f}  {'ok' if errors.mean() <= limit else 'ABOVE'} {limit}"
        )
        exposure = 0.5 / np.quantile(truth, 0.8)
        save_png(folder / "truth.png", truth, exposure)
        save_png(folder / "ours.png", picture, exposure)
        save_png(folder / "difference.png", difference_picture(picture, truth))


if __name__ == "__main__":
    main()
