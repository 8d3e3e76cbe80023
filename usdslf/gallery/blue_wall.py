"""Figure 6: a white indirect stroke on the floor near a blue wall; a second one, held, tells what is meant."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from usdslf.gallery.play import changed_material
from usdslf.gallery.records import Entry, PlayLike, Point, Rgb, Step
from usdslf.procedural.built_shot import BuiltShot, Inputs, Lamp, Part, View
from usdslf.procedural.shapes import panel, rounded_box

RADIUS = 0.012
MATERIALS: dict[str, Inputs] = {
    "floor": {"diffuseColor": (0.6, 0.6, 0.6), "roughness": 0.9},
    "blue": {"diffuseColor": (0.1, 0.18, 0.5), "roughness": 0.35},
    "side": {"diffuseColor": (0.5, 0.48, 0.45), "roughness": 0.9},
    "crate": {"diffuseColor": (0.4, 0.3, 0.2), "roughness": 0.8},
}
NEAR: tuple[Point, ...] = ((0.45, 0.56), (0.48, 0.6), (0.51, 0.55), (0.54, 0.6), (0.57, 0.56), (0.5, 0.64))
AWAY: tuple[Point, ...] = ((0.4, 0.86), (0.45, 0.88), (0.5, 0.87), (0.55, 0.86))
GAIN = (0.99, 1.1)  # of the floor's radiance, in the first stroke and when the change is repeated
SEEN: Rgb = (0.125, 0.13, 0.145)  # what the floor has near the wall


def build(folder: Path, hdri: str | None = None) -> BuiltShot:
    """Returns the wall's shot."""
    parts = (
        Part("floor", panel((-1.2, 0, 1.2), (2.4, 0, 0), (0, 0, -2)), "floor"),
        Part("wall", panel((-1.2, 0, -0.8), (2.4, 0, 0), (0, 1.2, 0)), "blue"),
        Part("side", panel((1.2, 0, -0.8), (0, 0, 2), (0, 1.2, 0)), "side"),
        Part("crate", rounded_box((0.35, 0.35, 0.35), 0.02).moved((0.85, 0.175, 0.2)), "crate"),
    )
    lamps = (
        Lamp("lamp", "sphere", (30.0, 30.0, 30.0), (-1.7, 0.75, 0.4), size=(0.2, 0.2)),
        Lamp("fill", "dome", (0.1, 0.1, 0.1)),
    )
    views = (View("camera", (0.0, 1.3, 2.7), (0.0, 0.15, -0.2), 40.0), View("right_eye", (0.8, 1.1, 2.3), (0, 0.2, 0)))
    return BuiltShot("blue_wall", MATERIALS, parts, lamps, views)


def run(play: PlayLike) -> None:
    """White; white and a held place; white again, brighter."""
    play.paint([(_white(GAIN[0]), NEAR)], RADIUS, mode="indirect")
    first = play.step("a white indirect stroke near the blue wall", goes_on=False)
    play.shows("the floor that was painted does not change", "floor" not in _changed(first), ", ".join(_changed(first)))
    f0s: list[tuple[float, float]] = []
    for gain in GAIN:
        play.paint([(_white(gain), NEAR)], RADIUS, mode="indirect")
        play.paint([(_white(gain), AWAY)], RADIUS, mode="indirect", tool="fixate")
        step = play.step(f"with a second stroke, {'again, ' if f0s else ''}{gain:g} of the floor's light")
        names, found = _changed(step), step.report["strokes"][0]
        is_specular = names == ["blue"] and "specular" in found["inferred"]
        play.shows("the wall becomes specular", is_specular, f"{found['inferred']} of {', '.join(names)}")
        play.shows("the stroke is met within 5 %", found["note"].startswith("met within"), found["note"])
        f0s.append((float(np.mean(found["before"]["specular"])), float(np.mean(found["after"]["specular"]))))
    rises = f0s[0][0] < f0s[0][1] < f0s[1][1]
    f0 = f"F0 {f0s[0][0]:.2f}, {f0s[0][1]:.2f}, {f0s[1][1]:.2f}"
    play.shows("repeating the change makes it increasingly metallic", rises, f0)


def _white(gain: float) -> Rgb:
    light = gain * max(SEEN)
    return light, light, light


def _changed(step: Step) -> list[str]:
    return sorted(n for a in step.answers if (n := changed_material(a, step.before)))


ENTRY = Entry(
    "blue_wall",
    "6",
    "A caustic from a blue wall",
    "A second stroke tells that the diffuse blue wall is to become specular, and repeating it makes it more metallic.",
    build,
    run,
    2500,
)
