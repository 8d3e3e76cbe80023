"""Does a picture of the unchanged shot, painted back over itself, leave nothing to explain?

    python tests/truth/identity.py [SHOT ...] [--samples N] [--elements N] [--dabs N] [--fine N] [--keep DIR]
                                  [--json OUT]

Each shot of kit/asset_shots.py is rendered by usdslf itself.  For every material that fills enough of the
picture, dabs are laid anywhere on it, edges and thin parts too, and painted with the mean of the picture over each
dab.  Printed: the residual that the evidence leaves before any change, that picture's own noise at the dabs (from
a second picture of another seed, in the same measure), and what the solve makes of it; the right answer is none.
A pixel's colour is of all of it, also of what lies outside of a dab that cuts it: at the rim of something dark before a
bright sky that alone was .08.  Pictures are finer than the places of dabs, `fine` pixels on a side, with the same rays.
It compares the evidence with the renderer, not with the truth.  --keep reads pictures that are there from a
folder, and puts those that are made into it.
"""

from __future__ import annotations

import argparse
import json
import sys
import tempfile
import time
from collections.abc import Iterator
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))
sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

import numpy as np
from kit.asset_shots import ASPECT, SHOTS, Shot, build_shot
from numpy.typing import NDArray

import usdslf
from usdslf.scene.cameras import camera_rays

ASSETS = Path(__file__).resolve().parents[3] / "shared/assets"
LEAST_PIXELS = 300  # of a material
WANTED = 0.02  # residual, or twice the noise
FLOOR = 0.1  # of the mean, in the denominator of a relative residual
SPLIT = 8  # of a pixel's side, where a dab's edge cuts it


@dataclass(frozen=True)
class Setting:
    """How it is measured."""

    samples: int = 64  # of the pictures, in each place of `size`
    elements: int = 4000
    dabs: int = 24  # of a material
    size: tuple[int, int] = (320, 240)
    radius: float = 0.01  # of a dab, in picture heights: 2.4 of the places
    keep: Path | None = None  # folder of pictures
    fine: int = 1  # pixels on a side of each place

    @property
    def pixels(self) -> float:
        """Radius of a dab [places]."""
        return self.radius * self.size[1]

    @property
    def picture(self) -> tuple[tuple[int, int], int]:
        """Size of the pictures [pixels] and samples of a pixel."""
        return (self.size[0] * self.fine, self.size[1] * self.fine), max(1, self.samples // self.fine**2)


@dataclass(frozen=True)
class Identity:
    """One material of one shot."""

    shot: str
    material: str
    dabs: int
    residual: float
    noise: float
    inferred: str
    seconds: float

    @property
    def is_wanted(self) -> bool:
        """Whether no more is left than noise explains."""
        return self.residual <= max(WANTED, 2 * self.noise)

    def __str__(self) -> str:
        mark = "ok   " if self.is_wanted else "ABOVE"
        return (
            f"{mark} {self.shot:18s} {self.material[-44:]:44s} {self.dabs:2d} dabs  residual {self.residual:.3f}"
            f"  noise {self.noise:.3f}  {self.inferred:22s} {self.seconds:5.1f} s"
        )


def measure(shot: Shot, setting: Setting) -> Iterator[Identity]:
    """Yields the identity of each material of a shot."""
    with tempfile.TemporaryDirectory() as folder:
        session = usdslf.open(build_shot(shot, ASSETS, Path(folder)), elements=setting.elements)
        camera = session.camera(shot.camera)
        pictures = two_pictures(session, camera, shot.name, setting)
        shown = materials_shown(session, camera, setting)
        for m in np.unique(shown[shown >= 0]):
            centers = places_on(shown == m, setting)
            if len(centers) < setting.dabs:
                continue
            start = time.perf_counter()
            colors, other = (disc_means(p, centers, setting.pixels, setting.fine) for p in pictures)
            report = paint_back(session, camera, centers, colors, setting)
            # Two pictures differ by sqrt(2) of the noise of one.
            noise = relative(colors, other) / np.sqrt(2)
            path = report["material"] or f"material {m}"
            seconds = time.perf_counter() - start
            residual = float(report["residual_before"])
            yield Identity(shot.name, path, len(centers), residual, noise, report["inferred"], seconds)


def two_pictures(session: Any, camera: Any, name: str, setting: Setting) -> list[NDArray]:
    """Returns two pictures of other seeds, read from a folder where they are in it."""
    kept = setting.keep / f"{name}_{setting.samples}_{setting.fine}.npz" if setting.keep else None
    size, samples = setting.picture
    if kept and kept.exists():
        with np.load(kept) as both:
            return [both["first"], both["second"]]
    first, second = (
        session.render(camera, size, samples=samples, seed=seed)["color"] for seed in (0, 1)
    )
    if kept:
        kept.parent.mkdir(parents=True, exist_ok=True)
        np.savez(kept, first=first, second=second)
    return [first, second]


def materials_shown(session: Any, camera: Any, setting: Setting) -> NDArray:
    """Returns the material (height, width) in the middle of each pixel, -1 where nothing is seen."""
    width, height = setting.size
    x, y = np.meshgrid((np.arange(width) + 0.5) / width, (np.arange(height) + 0.5) / height)
    rays = camera_rays(camera, np.stack([x.ravel(), y.ravel()], -1), ASPECT)
    hits = session.tracer.intersect(rays.origin, rays.direction)
    is_seen = (hits.triangle >= 0) & (hits.distance <= rays.limit)
    found = session.scene.triangles.material[np.maximum(hits.triangle, 0)]
    return np.where(is_seen, found, -1).reshape(height, width)


def paint_back(session: Any, camera: Any, centers: NDArray, colors: NDArray, setting: Setting) -> dict[str, Any]:
    """Paints colours (n, 3) at pixels (n, 2; column, row) and returns the report of the stroke."""
    paths = [((c + 0.5) / setting.size)[None] for c in centers]
    stroke = usdslf.paint_stroke(session.scene, session.tracer, camera, paths, setting.radius, aspect=ASPECT)
    assert len(stroke.counts) == len(paths), "a dab missed its surface"
    stroke = replace(stroke, colors=np.repeat(colors.astype(np.float32), stroke.counts, axis=0))
    session.add_stroke(stroke)
    try:
        session.solve()
        return dict(session.report()["strokes"][0])
    finally:
        session.remove_stroke(stroke.name)


def places_on(mask: NDArray, setting: Setting) -> NDArray:
    """Returns pixels (dabs, 2; column, row) anywhere on a mask, dabs apart; fewer where it is small."""
    reach = int(np.ceil(setting.pixels))
    inside = np.zeros_like(mask)
    inside[reach:-reach, reach:-reach] = mask[reach:-reach, reach:-reach]
    if mask.sum() < LEAST_PIXELS:
        return np.zeros((0, 2), int)
    rows, columns = np.nonzero(inside)
    places = np.random.default_rng(3).permutation(np.stack([columns, rows], -1))
    chosen: list[NDArray] = []
    for place in places:
        if len(chosen) < setting.dabs and all(np.hypot(*(place - c)) >= 2 * reach for c in chosen):
            chosen.append(place)
    return np.array(chosen).reshape(-1, 2)


def disc_means(picture: NDArray, centers: NDArray, radius: float, fine: int = 1) -> NDArray:
    """Returns mean colours (n, 3) of the picture within a dab about the middle of places, pixels by their share of it.

    Args:
        centers: (n, 2) column and row of each place, of `fine` x `fine` pixels.
        radius: [places].
    """
    middle = 0.5 * (fine - 1)  # [pixels] of a place from its first
    reach = int(np.ceil(radius * fine + middle))
    x, y = np.meshgrid(np.arange(-reach, fine + reach), np.arange(-reach, fine + reach))
    part = (np.arange(SPLIT) + 0.5) / SPLIT - 0.5 - middle
    away = np.hypot(x[..., None, None] + part, y[..., None, None] + part[:, None])
    share = (away <= radius * fine).mean((2, 3))
    x, y, share = x[share > 0], y[share > 0], share[share > 0]
    means = [np.average(picture[fine * r + y, fine * c + x], 0, weights=share) for c, r in centers]
    return np.stack(means).astype(float)


def relative(a: NDArray, b: NDArray) -> float:
    """Relative root mean square of a - b (n, 3), in the measure of the reports' residuals."""
    return float(np.sqrt(np.mean(((a - b) / (a + FLOOR * a.mean())) ** 2)))


def main() -> None:
    """Prints a line for each material and the worst of each asset."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("shots", nargs="*", help=f"of {', '.join(SHOTS)}; none: all")
    parser.add_argument("--samples", type=int, default=Setting.samples)
    parser.add_argument("--elements", type=int, default=Setting.elements)
    parser.add_argument("--dabs", type=int, default=Setting.dabs)
    parser.add_argument("--fine", type=int, default=4, help="pixels on a side of a place; default 4")
    parser.add_argument("--keep", type=Path, help="folder of pictures")
    parser.add_argument("--json", type=Path)
    a = parser.parse_args()
    found: list[Identity] = []
    for name in a.shots or SHOTS:
        for identity in measure(SHOTS[name], Setting(a.samples, a.elements, a.dabs, keep=a.keep, fine=a.fine)):
            print(identity, flush=True)
            found.append(identity)
    for name in dict.fromkeys(i.shot for i in found):
        worst = max((i for i in found if i.shot == name), key=lambda i: i.residual)
        print(f"worst of {name}: {worst.residual:.3f} on {worst.material}, noise there {worst.noise:.3f}")
    if a.json:
        a.json.write_text(json.dumps([asdict(i) for i in found], indent=1))


if __name__ == "__main__":
    main()
