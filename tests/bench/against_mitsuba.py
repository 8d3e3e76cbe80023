"""Side by side with Mitsuba 3: the demo's strokes by usdslf, its light field in hand, and by Adam on seven scalars.

    python tests/bench/against_mitsuba.py [--stroke 1 2 3] [--seconds 120] [--elements 10000] [--samples 16]

Mitsuba's `prb` integrator differentiates a picture of 900 x 450, cropped to the stroke, by diffuse (3), specular (3)
and roughness of the painted material, which start where they are.  Adam minimizes the painted error until what it has
found is no further from the paint than what usdslf has found, or for so many seconds.  Both are judged alike, by the
path tracer, dab by dab, |seen - painted| / (painted + a tenth of their mean), at many samples, outside of the time
that counts; nor does the first iteration count, which compiles.  Seconds are those of all processors together, so that
other programs do not count.  Printed as a table in Markdown, with how many of the seven moved by more than MOVED.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
import time
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

if __name__ == "__main__":
    sys.path[:0] = [str(Path(__file__).resolve().parents[2]), str(Path(__file__).resolve().parents[1])]

import numpy as np
from numpy.typing import NDArray
from pxr import Usd
from reference.pathtracer import Tracer, camera_description, mi

import drjit as dr  # isort: skip

from usdslf.gallery import still_life
from usdslf.gallery.play import Play
from usdslf.scene.cameras import pixel_size, project_points
from usdslf.solution import find_solution
from usdslf.strokes.stroke import Stroke, dab_rows

SIZE = (900, 450)
DEPTH = 8
RATE = 0.02  # of Adam
FINE = 64  # samples a pixel of what judges
JUDGED = 1.25  # times as many steps until it is judged again
MOVED = 0.02
LEAST_ROUGHNESS = 0.05
NAMES = ("diffuse", "specular", "roughness")
Values = dict[str, NDArray]
"""diffuse (3,), specular (3,) F0, roughness (1,)."""


@dataclass(frozen=True)
class Crop:
    """Part of a picture, and the pixels of each dab in it."""

    left: int
    top: int
    width: int
    height: int
    dab_of_pixel: NDArray[np.int64]  # (height * width,), -1 for none

    @staticmethod
    def around(at: NDArray, radius: NDArray) -> Crop:
        """The pixels of dabs at (n, 2) of radius (n,), all in pixels."""
        low = np.floor((at - radius[:, None]).min(0)).astype(int)
        high = np.ceil((at + radius[:, None]).max(0)).astype(int)
        width, height = (high - low).tolist()
        y, x = np.divmod(np.arange(width * height), width)
        apart = np.hypot(x[:, None] + 0.5 + low[0] - at[:, 0], y[:, None] + 0.5 + low[1] - at[:, 1]) / radius
        nearest = apart.argmin(1)
        return Crop(*low.tolist(), width, height, np.where(apart.min(1) <= 1, nearest, -1))


class Optimizer:
    """Adam on the seven scalars of a material, by pictures of a crop."""

    def __init__(self, tracer: Tracer, sensor: Any, material: str, start: Values, painted: NDArray, crop: Crop) -> None:
        self.scene, self.sensor = tracer.scene, sensor
        self.bsdfs = [s.bsdf() for s in self.scene.shapes() if tracer.materials.get(s.id()) == material]
        assert self.bsdfs, material
        for bsdf in self.bsdfs:
            bsdf.use_specular_workflow = True
            # a metal's F90 is its colour; a dielectric's is white
            bsdf.f90 = mi.Color3f(start["specular"].tolist()) if start["specular"].max() > 0.3 else 1.0
        self.integrator = mi.load_dict({"type": "prb", "max_depth": DEPTH, "rr_depth": 1000})
        self.adam = mi.ad.Adam(lr=RATE)
        for name in NAMES:
            value = start[name].tolist()
            self.adam[name] = mi.Color3f(value) if len(value) == 3 else mi.Float(value)
        inside = crop.dab_of_pixel >= 0
        self.pixel = mi.UInt32(np.flatnonzero(inside).astype(np.uint32))
        self.dab = mi.UInt32(crop.dab_of_pixel[inside].astype(np.uint32))
        count = np.maximum(np.bincount(crop.dab_of_pixel[inside], minlength=len(painted)), 1)
        self.share = mi.Float((1 / count).astype(np.float32))
        self.painted = [mi.Float(painted[:, c].astype(np.float32)) for c in range(3)]
        scale = painted + 0.1 * painted.mean()
        self.scale = [mi.Float(scale[:, c].astype(np.float32)) for c in range(3)]
        self.off = (painted, scale)

    def take(self, values: Any) -> None:
        """Gives the material values."""
        for bsdf in self.bsdfs:
            for name in NAMES:
                setattr(bsdf, name, values[name])

    def means(self, picture: Any) -> list[Any]:
        """The mean of each dab, channel by channel."""
        found = []
        for c in range(3):
            seen = dr.gather(mi.Float, picture.array, self.pixel * 3 + c)
            total = dr.zeros(mi.Float, len(self.share))
            dr.scatter_add(total, seen, self.dab)
            found.append(total * self.share)
        return found

    def step(self, number: int, samples: int) -> None:
        """One step of Adam."""
        self.take(self.adam)
        params = mi.traverse(self.scene)
        picture = mi.render(
            self.scene, params, sensor=self.sensor, integrator=self.integrator, spp=samples, seed=2 * number + 1
        )
        means = self.means(picture)
        loss = sum(dr.mean(dr.square((m - p) / s)) for m, p, s in zip(means, self.painted, self.scale))
        dr.backward(loss)
        self.adam.step()
        for name in NAMES:
            self.adam[name] = dr.clip(self.adam[name], LEAST_ROUGHNESS if name == "roughness" else 0, 1)
        dr.eval(*[self.adam[name] for name in NAMES])

    def values(self) -> Values:
        """What it has found so far."""
        return {name: np.array(dr.detach(self.adam[name]), np.float64).reshape(-1) for name in NAMES}

    def error_of(self, values: Values) -> float:
        """How far the paint is from what the path tracer sees of values."""
        self.take({k: mi.Color3f(v.tolist()) if len(v) == 3 else mi.Float(v.tolist()) for k, v in values.items()})
        with dr.suspend_grad():
            picture = mi.render(self.scene, sensor=self.sensor, integrator=self.integrator, spp=FINE, seed=999)
            means = np.stack([np.array(m) for m in self.means(picture)], 1)
        painted, scale = self.off
        return float(np.mean(np.abs(means - painted) / scale))


def compare(play: Play, strokes: list[Stroke], number: int, seconds: float, samples: int) -> str:
    """A row of the table."""
    shot, stroke = play.session.shot, strokes[number]
    aside = stroke.points + np.float32(0.1) * stroke.widths[:, None]
    find_solution(shot, [replace(stroke, points=aside)])  # kernels are built, the light field is there
    began = time.process_time()
    (answer,) = find_solution(shot, [stroke]).answers
    own = time.process_time() - began
    material = answer.pool.material
    before, after = ({k: np.asarray(v, float).reshape(-1) for k, v in x.items()} for x in (answer.before, answer.after))
    rows = dab_rows(stroke)
    camera = shot.camera(play.shot.view_path())
    at, depth = project_points(camera, stroke.points[rows], SIZE[0] / SIZE[1])
    radius = 0.5 * stroke.widths[rows] / pixel_size(camera, depth, SIZE)
    crop = Crop.around(at * np.array(SIZE), np.maximum(radius, 1.5))
    stage = Usd.Stage.Open(shot.path)
    sensor = camera_description(stage, play.shot.view_path(), *SIZE, Usd.TimeCode.EarliestTime())
    sensor["film"] |= {
        "crop_offset_x": crop.left, "crop_offset_y": crop.top, "crop_width": crop.width, "crop_height": crop.height,
    }  # fmt: skip
    optimizer = Optimizer(
        Tracer(stage, "smith", DEPTH), mi.load_dict(sensor), shot.scene.materials[material].path, before,
        stroke.colors[rows].astype(float), crop,
    )  # fmt: skip
    start, aim = optimizer.error_of(before), optimizer.error_of(after)
    best, spent, steps, due, reached = start, 0.0, 0, 5, ""
    while spent < seconds:
        began = time.process_time()
        optimizer.step(steps, samples)
        spent += time.process_time() - began if steps else 0.0
        steps += 1
        if steps >= due:
            due = int(np.ceil(JUDGED * steps))
            best = min(best, optimizer.error_of(optimizer.values()))
            if best <= aim:
                reached = f"{spent:.1f} s"
                break
    cells = (
        answer.chosen.id, f"{start:.3f}", f"{own:.2f} s", f"{aim:.3f}", moved(before, after),
        reached or f"not in {spent:.0f} s", f"{best:.3f}", moved(before, optimizer.values()), steps,
        f"{spent / own:.0f}" if reached else f"> {spent / own:.0f}",
    )  # fmt: skip
    return f"| {' | '.join(map(str, cells))} |"


def moved(before: Values, after: Values) -> int:
    """How many of the seven scalars are another value."""
    return int(sum((np.abs(after[name] - before[name]) > MOVED).sum() for name in NAMES))


def main() -> None:
    """Runs the command line."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--stroke", type=int, nargs="+", default=[1, 2, 3])
    parser.add_argument("--seconds", type=float, default=120.0)
    parser.add_argument("--elements", type=int, default=10000)
    parser.add_argument("--samples", type=int, default=16, help="of Mitsuba, a pixel and step")
    asked = parser.parse_args()
    head = "stroke", "error before", "usdslf", "error", "moved", "Mitsuba 3, Adam", "error", "moved", "steps", "times"
    print(f"| {' | '.join(head)} |")
    print("| --- " * len(head) + "|")
    with tempfile.TemporaryDirectory(prefix="usdslf_mitsuba_") as name:
        play = Play(still_life.ENTRY, Path(name), elements=asked.elements, pictures=False)
        strokes = list(still_life.paint(play))
        for number in asked.stroke:
            print(compare(play, strokes, number - 1, asked.seconds, asked.samples), flush=True)


if __name__ == "__main__":
    main()
