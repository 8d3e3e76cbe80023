"""The first entry: a still life in the corner of a room, three strokes, one parameter each.

Left wall brick, right wall teal, back wall white; a vase, a teapot, a ball, a ring and a toy wagon on a
planked board; an area light from above and a dome with a picture of a studio.  Five materials use the metal
workflow, two the specular one; one is textured.

The strokes' colours are what a painter would have dabbed to get the changed materials of TRUTH: a path
tracer's picture of them, seen through few colours.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from usdslf.gallery.records import Dabs, Entry, PlayLike, Point, Rgb
from usdslf.procedural.built_shot import BuiltShot, Inputs, Lamp, Part, View
from usdslf.procedural.shapes import (
    QuadMesh,
    ball,
    curve,
    join,
    lathe,
    panel,
    rounded_box,
    torus,
    tube,
    turned_about,
)
from usdslf.procedural.textures import planks, studio
from usdslf.strokes.stroke import Stroke
from usdslf.textures.images import write_image

RADIUS = 0.012  # of a dab, in picture heights

MATERIALS: dict[str, Inputs] = {
    "plaster": {"diffuseColor": (0.72, 0.70, 0.66), "roughness": 0.9},
    "brick": {"diffuseColor": (0.62, 0.16, 0.09), "roughness": 0.85},
    "teal": {"diffuseColor": (0.07, 0.30, 0.32), "roughness": 0.85},
    "planks": {"diffuseColor": "planks.png", "roughness": 0.55},
    "glaze": {"diffuseColor": (0.30, 0.42, 0.55), "roughness": 0.3},
    "lacquer": {"useSpecularWorkflow": 1, "diffuseColor": (0.035, 0.05, 0.16),
                "specularColor": (0.04, 0.04, 0.04), "roughness": 0.25},
    "pewter": {"metallic": 1.0, "diffuseColor": (0.56, 0.54, 0.50), "roughness": 0.5},
    "gold": {"metallic": 1.0, "diffuseColor": (0.98, 0.68, 0.27), "roughness": 0.22},
    "paint": {"diffuseColor": (0.75, 0.44, 0.06), "roughness": 0.4},
    "rubber": {"useSpecularWorkflow": 1, "diffuseColor": (0.03, 0.03, 0.03),
               "specularColor": (0.03, 0.03, 0.03), "roughness": 0.6},
}  # fmt: skip
"""Inputs of each material; a text is the file of a texture."""

TRUTH: dict[str, Inputs] = {
    "glaze": {"diffuseColor": (0.60, 0.055, 0.04)},
    "lacquer": {"specularColor": (0.25, 0.25, 0.25)},
    "pewter": {"roughness": 0.2},
}
"""What the scripted strokes are meant to bring about: one parameter of each of three materials."""


def build(folder: Path, hdri: str | None = None) -> BuiltShot:
    """Returns the shot, its textures written."""
    write_image(folder / "planks.png", planks())
    write_image(folder / "studio.exr", studio())
    return BuiltShot("still_life", MATERIALS, (*_room(), *_objects()), _lamps(), _views())


def _room() -> tuple[Part, ...]:
    # A board of 2 x 1.8, walls 1.4 high behind, at the left and, lower, at the right.
    return (
        Part("board", panel((-1, 0, 1), (2, 0, 0), (0, 0, -1.8)), "planks"),
        Part("wall_back", panel((-1, 0, -0.8), (2, 0, 0), (0, 1.4, 0)), "plaster"),
        Part("wall_left", panel((-1, 0, 1), (0, 0, -1.8), (0, 1.4, 0)), "brick"),
        Part("wall_right", panel((1, 0, -0.8), (0, 0, 1.8), (0, 0.9, 0)), "teal"),
    )


def _objects() -> tuple[Part, ...]:
    body, wheels = wagon()
    turn, place = 0.55, (0.57, 0, 0.02)
    return (
        Part("teapot", teapot().moved((-0.36, 0, -0.12)), "glaze"),
        Part("ball", ball(0.15).moved((0.10, 0.15, 0.26)), "lacquer"),
        Part("vase", vase().moved((0.20, 0, -0.36)), "pewter"),
        Part("ring", torus(0.12, 0.032).moved((-0.30, 0.032, 0.42)), "gold"),
        Part("wagon", turned_about(body, 1, turn).moved(place), "paint"),
        Part("wagon_wheels", turned_about(wheels, 1, turn).moved(place), "rubber"),
    )


def _lamps() -> tuple[Lamp, ...]:
    window = Lamp(
        "window", "rect", (24.0, 24.0 * 0.93, 24.0 * 0.82), (0.55, 1.45, 0.75), (-0.05, 0.1, -0.1), size=(0.7, 0.5)
    )
    return window, Lamp("studio", "dome", (0.4, 0.4, 0.4), file="studio.exr")


def _views() -> tuple[View, ...]:
    return (
        View("camera", (0.18, 0.86, 2.25), (0.03, 0.235, -0.05)),
        View("from_the_left", (-0.72, 0.62, 1.55), (0.08, 0.20, -0.05), 35.0),
    )


def teapot() -> QuadMesh:
    """A teapot that stands on the origin, its spout towards +X."""
    body = lathe(
        curve(
            [(0, 0.0), (0.10, 0.0), (0.125, 0.012), (0.185, 0.075), (0.20, 0.14), (0.17, 0.215), (0.12, 0.262),
             (0.108, 0.268), (0.095, 0.282), (0.05, 0.302), (0.022, 0.31), (0.02, 0.322), (0.036, 0.34),
             (0.03, 0.357), (0, 0.362)],
            110,
        ),
        96,
    )  # fmt: skip
    spout = curve([(0.15, 0.09, 0), (0.235, 0.12, 0), (0.275, 0.20, 0), (0.335, 0.262, 0)], 40)
    handle = curve(
        [(-0.15, 0.222, 0), (-0.235, 0.25, 0), (-0.29, 0.20, 0), (-0.27, 0.125, 0), (-0.18, 0.075, 0)], 48
    )
    return join(body, tube(spout, np.linspace(0.052, 0.022, 40)), tube(handle, 0.017))


def vase() -> QuadMesh:
    """A vase with an inside."""
    outside = [(0, 0.0), (0.085, 0.0), (0.10, 0.012), (0.15, 0.12), (0.185, 0.25), (0.165, 0.39), (0.09, 0.50),
               (0.072, 0.55), (0.09, 0.60), (0.112, 0.622)]  # fmt: skip
    inside = [(0.115, 0.63), (0.105, 0.628), (0.08, 0.60), (0.062, 0.55), (0.08, 0.49), (0.15, 0.38), (0, 0.36)]
    return lathe(curve(outside + inside, 130), 112)


def wagon() -> tuple[QuadMesh, QuadMesh]:
    """Body with handle, and wheels, of a toy wagon along X."""
    floor = rounded_box((0.42, 0.03, 0.24), 0.012).moved((0, 0.10, 0))
    side = rounded_box((0.42, 0.10, 0.022), 0.009)
    end = rounded_box((0.022, 0.10, 0.24), 0.009)
    walls = [side.moved((0, 0.145, z)) for z in (-0.112, 0.112)] + [end.moved((x, 0.145, 0)) for x in (-0.2, 0.2)]
    pole = tube(curve([(0.2, 0.09, 0), (0.29, 0.10, 0), (0.34, 0.2, 0), (0.36, 0.27, 0)], 30), 0.009)
    grip = tube(curve([(0.36, 0.27, -0.055), (0.362, 0.275, 0), (0.36, 0.27, 0.055)], 16), 0.011)
    tyre = turned_about(torus(0.044, 0.02, 64), 0, np.pi / 2)
    disk = turned_about(lathe(curve([(0, -0.012), (0.04, -0.012), (0.04, 0.012), (0, 0.012)], 40), 48), 0, np.pi / 2)
    wheel = join(tyre, disk)
    places = [(x, 0.064, z) for x in (-0.13, 0.13) for z in (-0.145, 0.145)]
    return join(floor, *walls, pole, grip), join(*(wheel.moved(p) for p in places))


@dataclass(frozen=True)
class ScriptedStroke:
    """Dabs by colour; places in a picture of 800 x 450."""

    intent: str  # what it must come out as
    story: str
    dabs: tuple[tuple[Rgb, tuple[Point, ...]], ...]

    @property
    def on_picture(self) -> Dabs:
        """The dabs in picture coordinates 0..1."""
        return tuple((rgb, tuple((x / 800, y / 450) for x, y in places)) for rgb, places in self.dabs)


STROKES: tuple[ScriptedStroke, ...] = (
    ScriptedStroke(
        "diffuse",
        "the blue teapot should be red",
        (
            ((0.40, 0.034, 0.020), ((192, 262), (215, 276), (245, 286), (275, 282))),
            ((0.53, 0.046, 0.029), ((303, 266), (205, 238))),
            ((0.64, 0.062, 0.047), ((232, 226),)),
            ((0.755, 0.084, 0.063), ((258, 224), (285, 230))),
        ),
    ),
    ScriptedStroke(
        "specular",
        "the ball's lacquer should mirror more: a stronger glint, and the room in its flanks",
        (
            ((4.3, 4.0, 3.7), ((435, 270),)),
            ((0.205, 0.23, 0.325), ((415, 268), (455, 280))),
            ((0.14, 0.09, 0.15), ((382, 290), (396, 274))),
            ((0.054, 0.092, 0.163), ((470, 298),)),
            ((0.143, 0.088, 0.080), ((395, 335), (423, 347), (452, 337))),
        ),
    ),
    ScriptedStroke(
        "glossiness",
        "the pewter vase should be polished: a smaller, brighter highlight beside clearer reflections",
        (
            ((7.7, 6.9, 5.7), ((476, 140),)),
            ((2.5, 2.25, 1.9), ((476, 153),)),
            ((1.08, 1.0, 0.83), ((492, 150),)),
            ((0.39, 0.365, 0.35), ((450, 150), (500, 140))),
            ((0.20, 0.20, 0.197), ((460, 145), (468, 158), (484, 160))),
            ((0.09, 0.092, 0.095), ((456, 168), (478, 175))),
            ((0.057, 0.128, 0.11), ((494, 172), (506, 165))),
            ((0.216, 0.102, 0.087), ((440, 140),)),
        ),
    ),
)


def paint(play: PlayLike) -> list[Stroke]:
    """Paints the scripted strokes and returns them."""
    return [play.paint(script.on_picture, RADIUS) for script in STROKES]


def run(play: PlayLike) -> None:
    """Three strokes, solved together."""
    paint(play)
    step = play.step("a red teapot, a mirror-like ball, a polished vase")
    for script, stroke in zip(STROKES, step.report["strokes"]):
        play.shows(f"{script.story}: {script.intent}", stroke["inferred"] == script.intent, stroke["inferred"])


ENTRY = Entry(
    "still_life",
    "2",
    "Still life",
    "Three strokes of a plain brush change a diffuse colour, a specular strength and a roughness, each alone.",
    build,
    run,
)
