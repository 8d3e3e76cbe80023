"""Does a picture of the unchanged shot, painted back over itself, leave nothing to explain?

    python tests/truth/identity.py [SHOT ...] [--samples N] [--elements N] [--dabs N] [--json OUT]

Each shot of kit/asset_shots.py is rendered by usdslf itself.  For every material that fills enough of the
picture, dabs are spread over all of it and painted with the mean of the picture over each dab.  Printed: the
residual that the evidence leaves before any change, that picture's own noise at the dabs (from a second
picture of another seed, in the same measure), and what the solve makes of it; the right answer is none.
It compares the evidence with the renderer, not with the truth.
"""

from __future__ import annotations

import argparse
import json
import sys
import tempfile
import time
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))
sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

import numpy as np
from kit.asset_shots import ASPECT, SHOTS, Shot, build_shot
from numpy.typing import NDArray
from scipy.ndimage import maximum_filter, minimum_filter

import usdslf

ASSETS = Path(__file__).resolve().parents[3] / "shared/assets"
SIZE = (320, 240)
RADIUS = 0.01  # of the picture's height: 2.4 pixels
DABS = 24
LEAST_PIXELS = 400  # of a material, whole dabs only
WANTED = 0.02  # residual, or twice the noise
FLOOR = 0.1  # of the mean, in the denominator of a relative residual


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


def measure(shot: Shot, samples: int, elements: int, dabs: int) -> list[Identity]:
    """Returns the identity of each material of a shot."""
    found = []
    with tempfile.TemporaryDirectory() as folder:
        session = usdslf.open(build_shot(shot, ASSETS, Path(folder)), elements=elements)
        camera = session.camera(shot.camera)
        pictures = [session.render(camera, SIZE, ("material",), samples, seed=seed) for seed in (0, 1)]
        shown = pictures[0]["material"][..., 0].round().astype(int)
        for m in np.unique(shown):
            centers = spread_places(whole_dabs(shown == m), dabs)
            if m < 0 or len(centers) < dabs:
                continue
            start = time.perf_counter()
            colors, other = (disc_means(p["color"], centers) for p in pictures)
            report = paint_back(session, camera, centers, colors)
            # Two pictures differ by sqrt(2) of the noise of one.
            noise = relative(colors, other) / np.sqrt(2)
            path = report["material"] or f"material {m}"
            seconds = time.perf_counter() - start
            residual = float(report["residual_before"])
            found.append(Identity(shot.name, path, len(centers), residual, noise, report["inferred"], seconds))
    return found


def paint_back(session: Any, camera: Any, centers: NDArray, colors: NDArray) -> dict[str, Any]:
    """Paints colours (n, 3) at pixels (n, 2; column, row) and returns the report of the stroke."""
    paths = [((c + 0.5) / SIZE)[None] for c in centers]
    stroke = usdslf.paint_stroke(session.scene, session.tracer, camera, paths, RADIUS, aspect=ASPECT)
    assert len(stroke.counts) == len(paths), "a dab missed its surface"
    stroke = replace(stroke, colors=np.repeat(colors.astype(np.float32), stroke.counts, axis=0))
    session.add_stroke(stroke)
    try:
        session.solve()
        return dict(session.report()["strokes"][0])
    finally:
        session.remove_stroke(stroke.name)


def whole_dabs(mask: NDArray) -> NDArray:
    """Returns pixels (n, 2; column, row) about which a dab lies within the mask and the picture."""
    reach = int(np.ceil(RADIUS * SIZE[1]))
    inside = minimum_filter(mask.astype(np.uint8), 2 * reach + 1, mode="constant", cval=0) > 0
    rows, columns = np.nonzero(inside)
    if len(rows) * (2 * reach + 1) < LEAST_PIXELS and maximum_filter(mask, 3).sum() < LEAST_PIXELS:
        return np.zeros((0, 2), int)
    return np.stack([columns, rows], -1)


def spread_places(places: NDArray, count: int) -> NDArray:
    """Returns up to `count` of the places, each as far as can be from those before; the first is in the middle."""
    if not len(places):
        return places
    chosen = [int(np.argmin(np.linalg.norm(places - np.median(places, axis=0), axis=1)))]
    distance = np.linalg.norm(places - places[chosen[0]], axis=1)
    while len(chosen) < count and distance.max() >= 1:
        chosen.append(int(np.argmax(distance)))
        distance = np.minimum(distance, np.linalg.norm(places - places[chosen[-1]], axis=1))
    return places[chosen]


def disc_means(picture: NDArray, centers: NDArray) -> NDArray:
    """Returns the mean colours (n, 3) of the pixels within a dab about each centre."""
    radius = RADIUS * SIZE[1]
    reach = int(np.ceil(radius))
    x, y = np.meshgrid(np.arange(-reach, reach + 1), np.arange(-reach, reach + 1))
    near = np.hypot(x, y) <= radius
    x, y = x[near], y[near]
    return np.stack([picture[r + y, c + x].mean(0) for c, r in centers]).astype(float)


def relative(a: NDArray, b: NDArray) -> float:
    """Relative root mean square of a - b (n, 3), in the measure of the reports' residuals."""
    return float(np.sqrt(np.mean(((a - b) / (a + FLOOR * a.mean())) ** 2)))


def main() -> None:
    """Prints a line for each material and the worst of each asset."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("shots", nargs="*", help=f"of {', '.join(SHOTS)}; none: all")
    parser.add_argument("--samples", type=int, default=64)
    parser.add_argument("--elements", type=int, default=4000)
    parser.add_argument("--dabs", type=int, default=DABS)
    parser.add_argument("--json", type=Path)
    a = parser.parse_args()
    found: list[Identity] = []
    for name in a.shots or SHOTS:
        of_shot = measure(SHOTS[name], a.samples, a.elements, a.dabs)
        for identity in of_shot:
            print(identity, flush=True)
        found += of_shot
    for name in dict.fromkeys(i.shot for i in found):
        worst = max((i for i in found if i.shot == name), key=lambda i: i.residual)
        print(f"worst of {name}: {worst.residual:.3f} on {worst.material}, noise there {worst.noise:.3f}")
    if a.json:
        a.json.write_text(json.dumps([asdict(i) for i in found], indent=1))


if __name__ == "__main__":
    main()
