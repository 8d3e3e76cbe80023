"""Figure 19: a caustic by indirect strokes; the floor is painted, the ring changes.

A dull ring stands on a floor under a low lamp.  A white stroke within it may mean a brighter ring or one that
mirrors; two fixate strokes say which; a yellow stroke on the caustic makes the ring golden.
"""

from __future__ import annotations

from itertools import pairwise
from pathlib import Path

import numpy as np

from usdslf.gallery.play import changed_material
from usdslf.gallery.records import Entry, PlayLike, Rgb
from usdslf.procedural.built_shot import BuiltShot, Inputs, Lamp, Part, View
from usdslf.procedural.shapes import ball, lathe, panel, rounded_box

RADIUS = 0.012
MATERIALS: dict[str, Inputs] = {
    "floor": {"diffuseColor": (0.65, 0.65, 0.65), "roughness": 0.9},
    "wall": {"diffuseColor": (0.5, 0.5, 0.55), "roughness": 0.9},
    "clay": {"diffuseColor": (0.5, 0.2, 0.12), "roughness": 0.6},
    "blue": {"diffuseColor": (0.12, 0.2, 0.5), "roughness": 0.5},
    "ring": {"diffuseColor": (0.55, 0.55, 0.55), "roughness": 0.5},
}
WHITE: Rgb = (0.27, 0.27, 0.27)
YELLOW: Rgb = (0.42, 0.36, 0.215)


def build(folder: Path, hdri: str | None = None) -> BuiltShot:
    """Returns the ring's shot."""
    band = np.array([[0.66, 0.0], [0.66, 0.26], [0.62, 0.26], [0.62, 0.0]])
    profile = np.concatenate([np.linspace(a, b, 6) for a, b in pairwise(band)])
    parts = (
        Part("floor", panel((-2, 0, 2), (4, 0, 0), (0, 0, -4)), "floor"),
        Part("back", panel((-2, 0, -2), (4, 0, 0), (0, 1.5, 0)), "wall"),
        Part("ring", lathe(profile, 96), "ring"),
        Part("ball", ball(0.28).moved((-1.15, 0.28, -0.4)), "clay"),
        Part("box", rounded_box((0.4, 0.5, 0.4), 0.03).moved((1.15, 0.25, -0.5)), "blue"),
    )
    lamps = (
        Lamp("bulb", "sphere", (44.0, 44.0, 44.0), (1.5, 0.95, 1.5), size=(0.3, 0.3)),
        Lamp("fill", "dome", (0.09, 0.095, 0.1)),
    )
    views = (View("camera", (0.0, 2.2, 2.6), (0.0, 0.05, 0.0), 40.0), View("above", (-0.9, 2.4, 1.6), (0, 0, 0), 40.0))
    return BuiltShot("caustic", MATERIALS, parts, lamps, views)


def run(play: PlayLike) -> None:
    """White, white with two fixate strokes, yellow."""
    inside = [(0.395, 0.40), (0.40, 0.44), (0.415, 0.47), (0.43, 0.41), (0.44, 0.45), (0.445, 0.49), (0.465, 0.43),
              (0.47, 0.47), (0.42, 0.44), (0.455, 0.46)]  # fmt: skip
    beside = ([(0.56, 0.44), (0.575, 0.46), (0.585, 0.42), (0.55, 0.49)],
              [(0.75, 0.80), (0.77, 0.82), (0.79, 0.80), (0.72, 0.83)])  # fmt: skip

    def strokes(color: Rgb, hold: bool) -> None:
        play.paint([(color, inside)], RADIUS, mode="indirect")
        for places in beside if hold else ():
            play.paint([(color, places)], RADIUS, mode="indirect", tool="fixate")

    strokes(WHITE, False)
    first = play.step("a white indirect stroke on the floor: what is meant?", goes_on=False)
    found = first.report["strokes"][0]
    play.shows("the stroke alone is ambiguous, and this is said", found["ambiguous"], found["note"])
    strokes(WHITE, True)
    second = play.step("two fixate strokes: the ring turns to a white metal")
    _shows_ring(play, second.answers, "the ring becomes specular, no other surface changes")
    found = second.report["strokes"][0]
    play.shows("with the fixate strokes it is not ambiguous", not found["ambiguous"], found["note"])
    f0 = np.array(found["after"]["specular"])
    play.shows("its specular colour is white", float(np.ptp(f0)) < 0.05, f"F0 {np.round(f0, 2).tolist()}")
    strokes(YELLOW, True)
    third = play.step("a yellow stroke on the caustic: a golden ring")
    _shows_ring(play, third.answers, "again the ring alone changes")
    f0 = np.array(third.report["strokes"][0]["after"]["specular"])
    is_gold = bool(f0[0] >= f0[1] > 1.3 * f0[2])
    play.shows("its specular colour is golden", is_gold, f"F0 {np.round(f0, 2).tolist()}")
    note = third.report["strokes"][0]["note"]
    play.shows("the caustic has the painted radiance within 5 %", note.startswith("met within"), note)


def _shows_ring(play: PlayLike, answers: tuple, sentence: str) -> None:
    names = [n for a in answers if (n := changed_material(a, play.session))]
    kinds = {a.chosen.id for a in answers if a.chosen.freed}
    play.shows(sentence, names == ["ring"] and all("specular" in k for k in kinds), f"{names}, {sorted(kinds)}")


ENTRY = Entry(
    "caustic",
    "19",
    "A caustic design session",
    "A white indirect stroke is ambiguous, two fixate strokes turn the ring to a metal, a yellow one to gold.",
    build,
    run,
    2500,
)
