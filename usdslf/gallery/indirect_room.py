"""Figures 5, 17 and 18: strokes on a floor that change what the floor sees.

A room of a left, a back and a right wall and a box, each of a material of its own, under a lamp.  The floor is dull,
glossy or a mirror: it hands the stroke to many surfaces, to few, or to one.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np

from usdslf.gallery.play import changed_material
from usdslf.gallery.records import Entry, PlayLike, Point, Rgb, Step
from usdslf.procedural.built_shot import BuiltShot, Inputs, Lamp, Part, View
from usdslf.procedural.shapes import panel, rounded_box

RADIUS = 0.012
WALLS: dict[str, Inputs] = {
    "left": {"diffuseColor": (0.55, 0.5, 0.45), "roughness": 0.8},
    "back": {"diffuseColor": (0.6, 0.6, 0.6), "roughness": 0.8},
    "right": {"diffuseColor": (0.45, 0.5, 0.55), "roughness": 0.8},
    "box": {"diffuseColor": (0.4, 0.42, 0.5), "roughness": 0.7},
}
FLOORS: dict[str, Inputs] = {
    "dull": {"diffuseColor": (0.6, 0.6, 0.6), "roughness": 0.9},
    "glossy": {"diffuseColor": (0.7, 0.7, 0.7), "metallic": 1.0, "roughness": 0.25},
    "mirror": {"diffuseColor": (0.85, 0.85, 0.85), "metallic": 1.0, "roughness": 0.05},
}


def shot_of(name: str, floor: str) -> BuiltShot:
    """The room with one of the floors."""
    parts = (
        Part("floor", panel((-1, 0, 1), (2, 0, 0), (0, 0, -2)), "floor"),
        Part("wall_back", panel((-1, 0, -1), (2, 0, 0), (0, 1.3, 0)), "back"),
        Part("wall_left", panel((-1, 0, 1), (0, 0, -2), (0, 1.3, 0)), "left"),
        Part("wall_right", panel((1, 0, -1), (0, 0, 2), (0, 1.3, 0)), "right"),
        Part("box", rounded_box((0.36, 0.5, 0.36), 0.02).moved((-0.35, 0.25, -0.35)), "box"),
    )
    lamps = (
        Lamp("lamp", "rect", (9.0, 9.0, 9.0), (0.0, 2.2, 0.6), (0.0, 0.3, -0.4), size=(0.9, 0.9)),
        Lamp("fill", "dome", (0.15, 0.15, 0.16)),
    )
    camera = View("camera", (0.0, 1.05, 2.9), (0.0, 0.3, -0.2), 40.0)
    views = (camera, View("left_eye", (-0.7, 0.9, 2.6), (0.1, 0.3, 0)))
    return BuiltShot(name, {**WALLS, "floor": FLOORS[floor]}, parts, lamps, views)


def _build(name: str, floor: str) -> Callable[[Path, str | None], BuiltShot]:
    return lambda folder, hdri: shot_of(name, floor)


def changed(step: Step) -> list[str]:
    """Names of the materials that a step changed, sorted."""
    return sorted(n for a in step.answers if (n := changed_material(a, step.before)))


def _shows_met(play: PlayLike, step: Step, sentence: str) -> None:
    note = step.report["strokes"][0]["note"]
    play.shows(sentence, note.startswith("met within"), note)


def _shows_floor_stays(play: PlayLike, step: Step) -> None:
    play.shows("the floor does not change", "floor" not in changed(step), ", ".join(changed(step)))


# ── figure 5, a to c: a mirror ───────────────────────────────────────────────────────────────────

ON_BOX: tuple[Point, ...] = ((0.37, 0.73), (0.385, 0.77), (0.4, 0.74), (0.375, 0.81), (0.395, 0.83), (0.385, 0.87))
ORANGE: Rgb = (0.27, 0.15, 0.06)


def _run_mirror(play: PlayLike) -> None:
    play.paint([(ORANGE, ON_BOX)], RADIUS)
    step = play.step("an orange stroke on the mirror, direct: the floor changes", goes_on=False)
    play.shows("a direct stroke changes the floor alone", changed(step) == ["floor"], ", ".join(changed(step)))
    play.paint([(ORANGE, ON_BOX)], RADIUS, mode="indirect")
    step = play.step("the same stroke, indirect: what the mirror shows changes")
    _shows_floor_stays(play, step)
    play.shows("an indirect one changes the box that is mirrored there", changed(step) == ["box"], str(changed(step)))
    after = np.array(step.report["strokes"][0]["after"]["diffuse"])
    play.shows("the box becomes orange", bool(after[0] > 1.5 * after[1] > 2 * after[2]), str(np.round(after, 2)))
    _shows_met(play, step, "the painted spot has the stroke's radiance within 5 %")


# ── figure 18: a glossy floor ────────────────────────────────────────────────────────────────────

NEAR_RIGHT: tuple[Point, ...] = ((0.82, 0.7), (0.83, 0.74), (0.85, 0.78), (0.84, 0.84), (0.87, 0.86), (0.88, 0.9))
DARK_ORANGE: Rgb = (0.215, 0.15, 0.085)


def _run_glossy(play: PlayLike) -> None:
    play.paint([(DARK_ORANGE, NEAR_RIGHT)], RADIUS, mode="indirect")
    step = play.step("an orange stroke on the glossy floor, indirect: the right wall changes")
    _shows_floor_stays(play, step)
    play.shows("the right wall changes, that is seen there", "right" in changed(step), ", ".join(changed(step)))
    after = np.array(step.report["strokes"][0]["after"]["diffuse"])
    play.shows("it becomes orange", bool(after[0] > 1.3 * after[1] > 1.5 * after[2]), f"{np.round(after, 2).tolist()}")
    _shows_met(play, step, "the painted spot has the stroke's radiance within 5 %")


# ── figure 17: a dull floor ──────────────────────────────────────────────────────────────────────

MIDDLE: tuple[Point, ...] = ((0.45, 0.72), (0.5, 0.75), (0.55, 0.72), (0.5, 0.7), (0.47, 0.79), (0.55, 0.8))
GREEN: Rgb = (0.315, 0.375, 0.32)


def _run_dull(play: PlayLike) -> None:
    play.paint([(GREEN, MIDDLE)], RADIUS, mode="indirect")
    step = play.step("a green stroke on the dull floor, indirect: the walls change")
    _shows_floor_stays(play, step)
    names = changed(step)
    play.shows("all walls that the floor sees change", {"left", "back", "right"} <= set(names), ", ".join(names))
    changes = [np.asarray(a.after["diffuse"]) - a.before["diffuse"] for a in step.answers if a.chosen.freed]
    play.shows("all of them towards green", all(c[1] > c[0] and c[1] > c[2] for c in changes))
    _shows_met(play, step, "the painted spot has the stroke's radiance within 5 %")


MIRROR = Entry(
    "across_the_mirror",
    "5",
    "Drawing across a mirror",
    "A direct stroke changes the mirror it lies on; an indirect one changes the object that is mirrored there.",
    _build("across_the_mirror", "mirror"),
    _run_mirror,
    2500,
)
DULL = Entry(
    "indirect_diffuse",
    "5, 17",
    "Indirect painting on a dull floor",
    "A green indirect stroke on the floor changes all other surfaces, and the floor's spot becomes as painted.",
    _build("indirect_diffuse", "dull"),
    _run_dull,
    2500,
)
GLOSSY = Entry(
    "indirect_specular",
    "5, 18",
    "Indirect painting on a glossy floor",
    "An orange indirect stroke on a glossy floor changes the right wall, which contributes to it.",
    _build("indirect_specular", "glossy"),
    _run_glossy,
    2500,
)
