"""Diffuse painting in a shadow and in the sun: an arcade whose floor is painted twice.

    1  blue-grey dabs in the shadow, where the red wall bleeds -> the floor's own colour, without the light's
    2  ochre dabs in the sun, far brighter -> again the floor's own colour

The colours are what a path tracer shows of the floors of TRUTH, rounded.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from usdslf.gallery.records import Dabs, Entry, PlayLike, on_picture
from usdslf.gallery.still_life import teapot
from usdslf.procedural.built_shot import BuiltShot, Inputs, Lamp, Part, View
from usdslf.procedural.shapes import QuadMesh, curve, lathe, panel, rounded_box

RADIUS = 0.014
MATERIALS: dict[str, Inputs] = {
    "floor": {"diffuseColor": (0.42, 0.40, 0.38), "roughness": 0.8},
    "red_wall": {"diffuseColor": (0.60, 0.12, 0.08), "roughness": 0.9},
    "stone": {"diffuseColor": (0.66, 0.61, 0.52), "roughness": 0.85},
    "copper": {"metallic": 1.0, "diffuseColor": (0.92, 0.56, 0.42), "roughness": 0.3},
}
TRUTH: tuple[dict[str, Inputs], ...] = (
    {"floor": {"diffuseColor": (0.20, 0.34, 0.52)}},
    {"floor": {"diffuseColor": (0.62, 0.46, 0.20)}},
)
"""The floors that the strokes of each round were painted for."""


def column() -> QuadMesh:
    """A column of a height of one with base and capital."""
    profile = [(0.0, 0.0), (0.098, 0.0), (0.098, 0.03), (0.08, 0.045), (0.088, 0.07), (0.068, 0.085), (0.064, 0.45),
               (0.058, 0.86), (0.075, 0.875), (0.068, 0.895), (0.10, 0.95), (0.10, 1.0), (0.0, 1.0)]  # fmt: skip
    return lathe(curve(profile, 120), 64)


def build(folder: Path, hdri: str | None = None) -> BuiltShot:
    """Returns the shot."""
    columns = [
        Part(f"column_{i}", column().moved((x, 0, -0.15)), "stone") for i, x in enumerate(np.linspace(-0.9, 0.9, 4))
    ]
    parts = (
        Part("floor", panel((-1.6, 0, 1.5), (3.2, 0, 0), (0, 0, -2.4)), "floor"),
        Part("parapet", rounded_box((3.2, 0.36, 0.08), 0.02).moved((0, 0.18, -0.86)), "stone"),
        Part("red_wall", panel((-1.3, 0, 1.5), (0, 0, -2.36), (0, 1.5, 0)), "red_wall"),
        Part("beam", rounded_box((2.4, 0.2, 0.26), 0.02).moved((0, 1.1, -0.15)), "stone"),
        *columns,
        Part("teapot", teapot().moved((0.15, 0, 0.30)), "copper"),
    )
    lamps = (
        Lamp("sun", "distant", (90000.0, 82000.0, 66000.0), (0.9, 1.6, -0.95), (0.0, 0.0, 0.0), angle_deg=0.53),
        Lamp("sky", "dome", (0.55, 0.75, 1.05)),
    )
    views = (
        View("camera", (0.15, 1.15, 2.45), (-0.08, 0.34, 0.0), 34.0),
        View("across", (1.5, 1.0, 1.9), (-0.15, 0.34, 0.05), 34.0),
    )
    return BuiltShot("shadow_diffuse", MATERIALS, parts, lamps, views)


IN_THE_SHADE: Dabs = (
    ((0.123, 0.20, 0.40), ((190, 306),)),
    ((0.116, 0.207, 0.418), ((230, 312), (275, 316))),
    ((0.109, 0.20, 0.402), ((330, 316), (400, 318))),
    ((0.113, 0.226, 0.457), ((450, 310),)),
)
IN_THE_SUN: Dabs = (
    ((1.28, 0.87, 0.385), ((60, 340), (150, 345), (245, 262), (170, 250))),
    ((1.28, 0.95, 0.44), ((300, 345), (520, 345), (560, 280))),
    ((1.325, 1.005, 0.475), ((600, 330), (610, 240))),
)


def run(play: PlayLike) -> None:
    """In the shade, then in the sun; each time the floor's colour is compared with the one that was meant."""
    for title, dabs, truth in (
        ("blue dabs in the shade, beside the red wall", IN_THE_SHADE, TRUTH[0]),
        ("ochre dabs in the sun, on what came of it", IN_THE_SUN, TRUTH[1]),
    ):
        play.paint(on_picture(dabs), RADIUS)
        (floor,) = play.step(title).report["strokes"]
        error = float(np.abs(np.subtract(floor["after"]["diffuse"], truth["floor"]["diffuseColor"])).max())
        play.shows(
            "The floor's colour is found, the light is discounted", floor["inferred"] == "diffuse" and error < 0.05,
            f"{floor['inferred']}, off by {error:.3f} at most",
        )  # fmt: skip
        before, after = floor["residual_before"], floor["residual_after"]
        play.shows(
            "It looks as it was painted", after < 0.2 * before, f"relative error {before:.2f} to {after:.3f}"
        )


ENTRY = Entry(
    "shadow_diffuse",
    "14",
    "Diffuse painting in light and shade",
    "A stroke in a shadow with indirect light, and then one in the sun, give the surface's own colour: the illuminant "
    "is discounted.",
    build,
    run,
)
