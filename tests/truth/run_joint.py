"""Prints what shots say alone, and what they say together, of one change of their asset.

    python tests/truth/run_joint.py [--all] [--traced]

A plane under rect lights (kit/joint_shots.py).  What is painted is what it should look like by a closed form, or, with
--traced, what a path tracer sees of the changed plane.  --all takes every pair of lamps for every change and ring of
dabs, and counts; else the cases of the test.
"""

from __future__ import annotations

import itertools
import sys
import tempfile
from functools import cache
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))
sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

import numpy as np
from kit.joint_shots import AFTER, BEFORE, CASES, LAMPS, RINGS, painted, ring, write_asset, write_shot
from kit.lit_plane import dabs as lay_dabs
from numpy.typing import NDArray
from reference.pathtracer import Tracer

from usdslf.inference.bilinear import Tables, pool_tables
from usdslf.inference.direct import gather_stroke
from usdslf.inference.pooled import Joint, choose_jointly
from usdslf.inference.weights import Options
from usdslf.shot import Shot
from usdslf.strokes.stroke import Stroke

ELEMENTS = 64
PATHS = 1 << 14  # of a dab


class Shots:
    """The shots of all lamps, and what each says of a change.

    Args:
        traced: what is painted is what a path tracer sees; else a closed form.
    """

    def __init__(self, folder: Path, traced: bool = False) -> None:
        self.folder, self.is_traced = folder, traced
        asset = write_asset(folder, BEFORE)
        files = {name: write_shot(folder / name, asset, lamp) for name, lamp in LAMPS.items()}
        self.shots = {name: Shot.open(file, elements=ELEMENTS) for name, file in files.items()}
        self.tables = cache(self._tables)
        self.tracer = cache(self._tracer)
        self.alone = cache(lambda *at: choose_jointly([self.tables(*at)], Options()))

    def _tables(self, dabs: str, change: str, lamp: str) -> Tables:
        shot = self.shots[lamp]
        stroke = self._stroke(dabs, change, lamp)
        evidence = gather_stroke(stroke, shot.scene, shot.pictured, []).evidence(shot.light_field)
        return pool_tables([evidence], int(evidence.material[0]))

    def _stroke(self, dabs: str, change: str, lamp: str) -> Stroke:
        if not self.is_traced:
            return painted(ring(dabs), LAMPS[lamp], AFTER[change])
        return lay_dabs(ring(dabs), self.seen(dabs, change, lamp), np.array(LAMPS[lamp].eye))

    def seen(self, dabs: str, change: str, lamp: str) -> NDArray[np.float64]:
        """Radiance (n, 3) that a path tracer sees of the changed plane from a lamp's eye, in the middle of dabs."""
        points, eye = ring(dabs), np.array(LAMPS[lamp].eye)
        way = (points - eye) / np.linalg.norm(points - eye, axis=1, keepdims=True)
        rays = [np.repeat(x, PATHS, 0) for x in (np.broadcast_to(eye, way.shape), way)]
        found = self.tracer(change, lamp).radiance(*rays, seed=1)
        return np.asarray(found, np.float64).reshape(len(points), PATHS, 3).mean(1)

    def _tracer(self, change: str, lamp: str) -> Tracer:
        home = self.folder / f"true_{change}"
        asset = write_asset(home, AFTER[change])
        return Tracer(write_shot(home / lamp, asset, LAMPS[lamp]), "smith", hide_lights=True)

    def together(self, dabs: str, change: str, *lamps: str) -> Joint:
        """What several shots say."""
        return choose_jointly([self.tables(dabs, change, lamp) for lamp in lamps], Options())


def meant(change: str) -> str:
    """The id of what was changed."""
    return "diffuse" if change == "darker" else change


def is_sure(found: Joint, change: str) -> bool:
    """Whether an answer is right, and nothing else costs about as little."""
    return found.chosen.id == meant(change) and not found.ties


def main() -> None:
    """Prints a line a case, or counts all."""
    everything = [
        (dabs, change, a, b)
        for dabs, change in itertools.product(RINGS, AFTER)
        for a, b in itertools.combinations(LAMPS, 2)
    ]
    with tempfile.TemporaryDirectory() as folder:
        shots = Shots(Path(folder), "--traced" in sys.argv)
        unsure = sure = lost = 0
        for dabs, change, a, b in everything if "--all" in sys.argv else CASES:
            alone = [shots.alone(dabs, change, lamp) for lamp in (a, b)]
            both = shots.together(dabs, change, a, b)
            one_is_sure = any(is_sure(j, change) for j in alone)
            unsure += not one_is_sure
            sure += not one_is_sure and is_sure(both, change)
            lost += one_is_sure and both.chosen.id != meant(change)
            said = [f"{j.chosen.id}{'?' if j.ties else ''}" for j in (*alone, both)]
            print(f"{dabs:6} {change:11} {a:5} {said[0]:22} {b:5} {said[1]:22} both {said[2]}", flush=True)
    print(f"neither alone is sure of what is right: {unsure}; of these both together are: {sure}")
    print(f"one alone is, and both together are wrong: {lost}")


if __name__ == "__main__":
    main()
