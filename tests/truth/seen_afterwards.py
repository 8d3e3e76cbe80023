"""What does a path tracer see of the look that a stroke got, where it was wanted and everywhere else?

    python tests/truth/seen_afterwards.py [NAME ...] [--set textured|tuning|twin] [--ways exact,uneven,swatch,few]
                                          [--every N] [--elements N] [--samples N] [--json OUT]

A case of the recovery suite is painted, solved and authored; the composed stage is path-traced, beside the stage
before and the stage with the true change: B, G (got) and W (wanted), small pictures with the same random numbers.
Over the pixels where W differs from B by more than CHANGED of the brighter one:

    shown      = sum (G - B)(W - B) / sum (W - B)^2              1 where all of the change is seen
and over all others
    collateral = sum |G - W| / sum over all pixels of |W - B|
    strict     = the same / sum over the changed pixels of |W - B|

which differ where most of the wanted change is faint and wide, as of roughness.
A stroke changes the copy that it is painted on, so that W is that one's change where a shot has several copies.
What B against a B of other random numbers would make of `collateral` is printed beside it.  Failures are marked, and
for collateral above the aim it is said what of it comes from where: `on it` on pixels that show the painted material,
where the value that was painted is seen, `beside` on others, and `chance` is what G - W of one set of random numbers
against G - W of another one would make of it.
"""

from __future__ import annotations

import argparse
import json
import sys
import tempfile
from collections.abc import Iterator
from dataclasses import asdict, dataclass
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))
sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

import numpy as np
from numpy.typing import NDArray
from reference.pathtracer import Tracer, camera_rays
from truth.recovery.cases import SETS
from truth.recovery.run_recovery import is_same_material, on_one_copy, paint, read_truth, select
from truth.recovery.stages import CAMERA, Case, build_stage
from truth.recovery.textured_cases import TexturedCase

import usdslf

SIZE = (96, 72)
CHANGED = 0.15  # of the brighter of two pictures
FLOOR = 0.05  # of the picture's mean, that counts as brightness
MAX_DEPTH = 8
SEED, OTHER_SEED = 5, 977
LEAST_SHOWN = {"exact": 0.9, "uneven": 0.85, "swatch": 0.8, "few": 0.8}  # medians that are aimed at
MOST_COLLATERAL = 0.1  # in 95 % of the cases
POOR = 0.5  # share shown, below which a case is named


@dataclass(frozen=True)
class Seen:
    """What came of one stroke."""

    case: str
    way: str
    wanted: str
    inferred: str
    is_right: bool
    pixels: int  # that change
    shown: float
    collateral: float
    strict: float
    noise: float  # what `collateral` is of noise alone, where pictures share no random numbers
    parts: tuple[float, float, float] | None = None  # on the painted material, beside it, by chance; None: not asked

    @property
    def is_poor(self) -> bool:
        """Whether little of the change is seen, or much else."""
        return self.shown < POOR or self.collateral > MOST_COLLATERAL

    def __str__(self) -> str:
        mark = "POOR " if self.is_poor else "ok   "
        return (
            f"{mark} {self.case:46s} {self.way:7s} {self.wanted:10s} {self.inferred:22s} {self.pixels:5d} pixels"
            f"  shown {self.shown:6.3f}  collateral {self.collateral:.3f}, strict {self.strict:.3f}"
            f"  noise {self.noise:.3f}"
            + ("  on it {:.3f}, beside {:.3f}, chance {:.3f}".format(*self.parts) if self.parts else "")
        )


def see_case(case: Case | TexturedCase, ways: list[str], elements: int, samples: int) -> Iterator[Seen]:
    """Yields what a path tracer sees of each painter's look."""
    truth = read_truth(case)
    camera = truth.get("camera", CAMERA)
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        before = _stage(case, folder / "False", False)
        b, other = (trace(before, camera, samples, seed) for seed in (SEED, OTHER_SEED))
        wanted: dict[str, tuple[Path, NDArray]] = {}
        session = usdslf.open(before, elements=elements)
        truth = on_one_copy(session, case, truth)
        for way in ways:
            stroke = paint(session, truth, way)
            session.add_stroke(stroke)
            session.solve()
            report = session.report()["strokes"][0]
            got, root = b, before
            if report["inferred"] != "none":
                root = folder / f"{way}_root.usda"
                session.author(folder / f"{way}.usda", review_root=root)
                got = trace(root, camera, samples)
            session.remove_stroke(stroke.name)
            copy = painted_copy(case, report["material"])
            if copy not in wanted:
                changed = _stage(case, folder / f"True{len(wanted)}", True, copy)
                wanted[copy] = changed, trace(changed, camera, samples)
            right = report["inferred"] == case.parameter and is_same_material(
                case, truth["material"], report["material"]
            )
            (changed, w), parts = wanted[copy], None
            seen = compare(b, w, got, other)
            if seen[2] > MOST_COLLATERAL:
                again = [trace(x, camera, samples, OTHER_SEED) for x in (root, changed)]
                parts = parts_of((b, w, got), again[0] - again[1], shown_in(before, camera, truth["material"]))
            yield Seen(case.name, way, case.parameter, report["inferred"], right, *seen, parts)


def parts_of(
    pictures: tuple[NDArray, NDArray, NDArray], again: NDArray, is_painted: NDArray
) -> tuple[float, float, float]:
    """Returns what of the collateral of B, W and G (h, w, 3) is on the painted material, beside it, and by chance.

    Args:
        again: (h, w, 3) G - W of other random numbers.
        is_painted: (h, w) where the painted material shows.
    """
    b, w, g = pictures
    off, others = g - w, ~where_changed(b, w)
    whole = max(float(np.abs(w - b).sum()), 1e-12)
    chance = float(np.abs(off - again)[others].sum()) / np.sqrt(2) / whole
    on_it, beside = (float(np.abs(off)[others & where].sum()) / whole for where in (is_painted, ~is_painted))
    return on_it, beside, chance


def shown_in(stage: Path, camera: str, material: str) -> NDArray:
    """Returns whether a material shows in the middle of each pixel (h, w)."""
    width, height = SIZE
    x, y = np.meshgrid((np.arange(width) + 0.5) / width, (np.arange(height) + 0.5) / height)
    tracer = Tracer(stage, max_depth=2)
    rays = camera_rays(tracer.stage, camera, np.stack([x.ravel(), y.ravel()], -1), width / height)
    shown = tracer.first_surfaces(*rays).material.astype(str)
    return np.char.endswith(shown, material.rsplit("/", 1)[-1]).reshape(height, width)


def compare(b: NDArray, w: NDArray, g: NDArray, other: NDArray) -> tuple[int, float, float, float, float]:
    """Returns how many pixels change, shown, collateral, strict and noise, of pictures (h, w, 3); see above."""
    changed = where_changed(b, w)
    wanted, got = (w - b)[changed], (g - b)[changed]
    whole, most = (max(float(np.abs(x).sum()), 1e-12) for x in (w - b, wanted))
    shown = float((wanted * got).sum() / max(float((wanted**2).sum()), 1e-12))
    off, noise = (float(np.abs(x)[~changed].sum()) for x in (g - w, other - b))
    return int(changed.sum()), shown, off / whole, off / most, noise / whole


def where_changed(b: NDArray, w: NDArray) -> NDArray:
    """Returns the pixels (h, w) that are wanted to change."""
    brighter: NDArray = np.maximum(b, w).max(-1) + FLOOR * b.mean()
    return np.abs(w - b).max(-1) > CHANGED * brighter


def trace(stage: Path, camera: str, samples: int, seed: int = SEED) -> NDArray:
    """Returns a small picture (h, w, 3) of a stage."""
    return Tracer(stage, max_depth=MAX_DEPTH).render(camera, *SIZE, samples, seed=seed)


def painted_copy(case: Case | TexturedCase, material: str) -> str:
    """Returns the path of the copy that a material is of, "" where the shot has none."""
    is_copied = isinstance(case, TexturedCase) and case.shot.copies
    return "/" + material.split("/")[1] if is_copied else ""


def _stage(case: Case | TexturedCase, folder: Path, changed: bool, copy: str = "") -> Path:
    if isinstance(case, TexturedCase):
        return case.build(folder, changed, copy)
    return build_stage(case, folder, changed)


def summary(found: list[Seen]) -> Iterator[str]:
    """Yields a line for each painter."""
    for way in dict.fromkeys(s.way for s in found):
        mine = [s for s in found if s.way == way]
        spoiled = [s for s in mine if s.collateral > MOST_COLLATERAL]
        aim = LEAST_SHOWN.get(way)
        yield (
            f"{way:7s} {len(mine)} cases, median shown {np.median([s.shown for s in mine]):.3f}"
            f"{f' (aim {aim})' if aim else ''}, collateral below {MOST_COLLATERAL} in "
            f"{1 - len(spoiled) / len(mine):.0%} (aim 95 %), median {np.median([s.collateral for s in mine]):.3f}, "
            f"strict in {np.mean([s.strict <= MOST_COLLATERAL for s in mine]):.0%}"
        )


def main() -> None:
    """Prints a line for each stroke, then one for each painter."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("names", nargs="*", help="parts of names, of stages and assets; none: all of the set")
    parser.add_argument("--set", default="textured", choices=list(SETS))
    parser.add_argument("--ways", default="exact,swatch")
    parser.add_argument("--every", type=int, default=1, help="take each N-th case")
    parser.add_argument("--elements", type=int, default=4000)
    parser.add_argument("--samples", type=int, default=128)
    parser.add_argument("--json", type=Path)
    a = parser.parse_args()
    found: list[Seen] = []
    sets = ("textured", "all") if a.names else (a.set,)
    for case in [c for name in sets for c in select(name, a.names)][:: a.every]:
        for seen in see_case(case, a.ways.split(","), a.elements, a.samples):
            print(seen, flush=True)
            found.append(seen)
    for row in summary(found):
        print(row)
    if a.json:
        a.json.write_text(json.dumps([asdict(s) for s in found], indent=1))


if __name__ == "__main__":
    main()
