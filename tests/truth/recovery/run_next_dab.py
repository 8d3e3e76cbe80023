"""Runs the next dab: does one dab at the place that `solve --next` names, painted from the truth, decide rightly?

    python tests/truth/recovery/run_next_dab.py [NAME ...] [--elements N]

AMBIGUOUS are the 20 strokes of the tuning set that were least sure at 2000 elements, those that were wrong first, at
most two of a stage.  Each is solved as it is; the place is asked for on the stage's camera; the path tracer renders
the changed stage there; that dab is added as a second stroke; and all is solved again.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
from dataclasses import dataclass, replace
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[3]))
sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

import numpy as np
from reference.pathtracer import Tracer
from truth.recovery.make_truth import MAX_DEPTH, dab_radiance
from truth.recovery.run_recovery import paint, read_truth, select
from truth.recovery.stages import CAMERA, SIZE, Case, build_stage

import usdslf

ROUNDS = 8  # of the path tracer's rays
AMBIGUOUS = (
    ("room_teapot_area_diffuse_m", "few"),
    ("single_textured_ball_distant_glossiness_m", "flat"),
    ("room_box_area_specular_s", "flat"),
    ("room_textured_ball_area_glossiness_m", "flat"),
    ("single_ball_dome_glossiness_s", "flat"),
    ("single_blob_sky_diffuse_m", "flat"),
    ("single_vase_sky_specular_s", "swatch"),
    ("single_vase_sky_specular_s", "flat"),
    ("table_box_area_glossiness_s", "flat"),
    ("table_sphere_area_specular_m", "dark"),
    ("room_box_area_specular_s", "few"),
    ("room_floor_area_glossiness_s", "flat"),
    ("room_floor_area_specular_m", "flat"),
    ("table_torus_distant_glossiness_m", "flat"),
    ("room_teapot_area_diffuse_m", "flat"),
    ("single_ball_dome_glossiness_s", "few"),
    ("table_floor_sky_glossiness_s", "flat"),
    ("table_sphere_area_specular_m", "swatch"),
    ("room_vase_area_glossiness_m", "flat"),
    ("room_torus_sky_glossiness_s", "flat"),
)


@dataclass(frozen=True)
class Asked:
    """What became of one stroke."""

    case: str
    way: str
    changed: str
    before: str  # inferred, with its probability
    place: str
    gain: float
    is_decisive: bool
    after: str

    @property
    def is_right(self) -> bool:
        """Whether the added dab leaves the parameter that was changed."""
        return self.after.split()[0] == self.changed

    def __str__(self) -> str:
        mark = "ok   " if self.is_right else "WRONG"
        decides = "" if self.is_decisive else " (said not to decide)"
        return (
            f"{mark} {self.case:44s} {self.way:7s} {self.changed:10s} {self.before:22s} at {self.place} "
            f"gain {self.gain:5.1f}{decides} -> {self.after}"
        )


def ask(case: Case, way: str, elements: int) -> Asked:
    """Solves a stroke, paints the dab that is asked for, and solves again."""
    truth = read_truth(case)
    with tempfile.TemporaryDirectory() as folder:
        session = usdslf.open(build_stage(case, Path(folder) / "before"), elements=elements)
        session.add_stroke(paint(session, truth, way))
        session.solve()
        before = _inferred(session)
        camera = next(c for c in session.scene.cameras if c.path == CAMERA)
        named = session.next_dab(camera=camera)
        tracer = Tracer(build_stage(case, Path(folder) / "after", True), max_depth=MAX_DEPTH)
        color, _ = dab_radiance(tracer, np.array([named.xy]), ROUNDS, seed=5)
    aspect = SIZE[0] / SIZE[1]
    path = np.array([named.xy])
    dab = usdslf.paint_stroke(session.scene, session.tracer, camera, [path], truth["radius"], aspect=aspect)
    colors = np.repeat(color.astype(np.float32), dab.counts, axis=0)
    session.add_stroke(replace(dab, name="next_dab", colors=colors))
    session.solve()
    place = f"{named.xy[0]:.2f},{named.xy[1]:.2f}"
    return Asked(case.name, way, case.parameter, before, place, named.gain, named.is_decisive, _inferred(session))


def _inferred(session: usdslf.Session) -> str:
    """The parameters that were inferred, with their probability and the runner-up."""
    stroke = session.report()["strokes"][0]
    known = sorted(stroke["alternatives"], key=lambda a: -a["probability"])
    chance = {a["id"]: a["probability"] for a in known}.get(stroke["inferred"], 0.0)
    return f"{stroke['inferred']} {chance:.2f}"


def main() -> None:
    """Prints the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("names", nargs="*", help="parts of names; none: all")
    parser.add_argument("--elements", type=int, default=2000)
    a = parser.parse_args()
    cases = {c.name: c for c in select("tuning")}
    found = []
    for name, way in AMBIGUOUS:
        if not a.names or any(n in name for n in a.names):
            case = cases[name]
            assert isinstance(case, Case)
            found.append(ask(case, way, a.elements))
            print(found[-1], flush=True)
    print(f"{sum(f.is_right for f in found)} of {len(found)} decided rightly")


if __name__ == "__main__":
    main()
