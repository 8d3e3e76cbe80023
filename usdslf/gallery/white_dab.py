"""A white dab on a red ball: a highlight or a white spot, according to where it lies.

    1  the same white dab on two equal red balls: where the lamp would glint, and beside it
    2  dabs from two eyes on one ball are solved together
    3  a stroke on top of a first, rough one refines it

The colours of rounds 2 and 3 are what a path tracer shows of TRUTH, rounded; the white dabs are a plain white.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from usdslf.gallery.records import Entry, PlayLike, on_picture
from usdslf.gallery.sketch_specular import LAMPS, put_table
from usdslf.gallery.sketch_specular import MATERIALS as SKETCH
from usdslf.procedural.built_shot import BuiltShot, Inputs, Part, View
from usdslf.procedural.shapes import ball

RADIUS = 0.012
MATERIALS: dict[str, Inputs] = {
    "wall": SKETCH["wall"],
    "table": SKETCH["table"],
    "red_left": SKETCH["red"],
    "red_right": SKETCH["red"],
}
TRUTH: dict[str, Inputs] = {"red_left": {"specularColor": (0.15, 0.15, 0.15)}}
"""What the dabs of rounds 2 and 3 were painted for."""


def build(folder: Path, hdri: str | None = None) -> BuiltShot:
    """Returns the shot, its textures written."""
    parts = (
        *put_table(folder),
        Part("left", ball(0.19, 48, 96).moved((-0.27, 0.19, 0.05)), "red_left"),
        Part("right", ball(0.19, 48, 96).moved((0.27, 0.19, 0.05)), "red_right"),
    )
    views = (
        View("camera", (0.0, 0.66, 1.75), (0.0, 0.19, 0.02), 44.0),
        View("from_the_left", (-1.15, 0.62, 1.30), (-0.05, 0.19, 0.0), 44.0),
    )
    return BuiltShot("white_dab", MATERIALS, parts, LAMPS, views)


GLINT, BESIDE = (178, 155), (470, 200)  # on pictures of 640 x 360
ROUGH_STROKE = (((1.1, 0.62, 0.57), (GLINT,)), ((0.66, 0.20, 0.18), ((190, 165), (168, 165))))
FROM_THE_FRONT = (
    ((1.84, 1.36, 1.24), (GLINT,)),
    ((0.71, 0.315, 0.29), ((190, 165),)),
    ((0.85, 0.44, 0.415), ((168, 165),)),
    ((0.52, 0.21, 0.19), ((228, 170),)),
    ((0.347, 0.063, 0.041), ((150, 220),)),
    ((0.222, 0.041, 0.026), ((200, 250), (250, 210))),
)
FROM_THE_LEFT = (
    ((1.79, 1.32, 1.2), ((255, 172),)),
    ((0.88, 0.46, 0.425), ((268, 182), (243, 165))),
    ((0.62, 0.207, 0.188), ((300, 165),)),
    ((0.33, 0.057, 0.038), ((230, 250), (290, 240))),
    ((0.341, 0.049, 0.047), ((200, 200),)),
)


def run(play: PlayLike) -> None:
    """One white dab in two places; then one material from two eyes; then a rough stroke that is refined."""
    white, grey = (1.5, 1.4, 1.3), (0.45, 0.42, 0.39)  # the same paint, in the lamp's glint and in its half-shade
    play.paint(on_picture([(white, [GLINT])]), RADIUS)
    play.paint(on_picture([(grey, [BESIDE])]), RADIUS)
    left, right = play.step("a white dab at the glint, and one beside it", goes_on=False).report["strokes"]
    play.shows("At the glint it is a highlight", left["inferred"] == "specular", left["inferred"])
    play.shows("Beside it, it is a white diffuse surface", right["inferred"] == "diffuse", right["inferred"])

    true = float(TRUTH["red_left"]["specularColor"][0])
    play.paint(on_picture(FROM_THE_FRONT), RADIUS)
    play.paint(on_picture(FROM_THE_LEFT), RADIUS, view=1)
    step = play.step("the left ball, painted from two eyes", goes_on=False)
    (answer,) = step.answers
    got = float(np.mean(step.report["strokes"][0]["after"]["specular"]))
    together = len(answer.pool.strokes)
    play.shows("Strokes from two eyes are solved together", together == 2, f"one answer for {together} strokes")
    play.shows("They say the ball's specular reflectance", abs(got - true) < 0.02, f"{got:.3f}, true {true:.3f}")

    play.paint(on_picture(ROUGH_STROKE), RADIUS)
    first = play.step("a rough first stroke").report["strokes"][0]
    play.paint(on_picture(FROM_THE_FRONT), RADIUS)
    second = play.step("a second, finer one on top of what came of it").report["strokes"][0]
    off = [abs(float(np.mean(s["after"]["specular"])) - true) for s in (first, second)]
    play.shows("A repeated stroke refines the first", off[1] < off[0], f"off by {off[0]:.3f}, then by {off[1]:.3f}")


ENTRY = Entry(
    "white_dab",
    "introduction, 3",
    "A white dab on a red ball",
    "A white dab on a red sphere can mean a highlight or a white, diffuse dot; which one follows from where it lies, "
    "and the answer holds from other views.",
    build,
    run,
)
