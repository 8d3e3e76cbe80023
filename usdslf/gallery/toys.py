"""The paper's first picture: a toy wagon and a toy plane, painted with one brush.

    1  a red stroke on the wagon              -> its diffuse colour
    2  a white, tighter highlight on the plane -> its roughness
    3  a white highlight on the wheels         -> their specular reflectance

The colours are what a path tracer shows of the materials of TRUTH, rounded.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from usdslf.gallery.records import Dabs, Entry, PlayLike, on_picture
from usdslf.gallery.still_life import wagon
from usdslf.procedural.built_shot import BuiltShot, Inputs, Lamp, Part, View
from usdslf.procedural.shapes import QuadMesh, ball, curve, join, lathe, panel, rounded_box, torus, turned_about
from usdslf.procedural.textures import planks, studio
from usdslf.textures.images import write_image

RADIUS = 0.011
MATERIALS: dict[str, Inputs] = {
    "wall": {"diffuseColor": (0.50, 0.54, 0.56), "roughness": 0.9},
    "table": {"diffuseColor": "planks.png", "roughness": 0.6},
    "wagon_paint": {"diffuseColor": (0.20, 0.33, 0.16), "roughness": 0.45},
    "rubber": {"useSpecularWorkflow": 1, "diffuseColor": (0.03, 0.03, 0.035), "specularColor": (0.02, 0.02, 0.02),
               "roughness": 0.3},
    "plane_paint": {"useSpecularWorkflow": 1, "diffuseColor": (0.62, 0.47, 0.10), "specularColor": (0.22, 0.22, 0.22),
                    "roughness": 0.65},
    "wood": {"diffuseColor": (0.36, 0.19, 0.09), "roughness": 0.5},
}  # fmt: skip
TRUTH: dict[str, Inputs] = {
    "wagon_paint": {"diffuseColor": (0.55, 0.05, 0.035)},
    "plane_paint": {"roughness": 0.18},
    "rubber": {"specularColor": (0.20, 0.20, 0.20)},
}
"""What the strokes were painted for."""


def plane() -> tuple[QuadMesh, QuadMesh]:
    """Body with wings and tail, and propeller with wheels, of a toy plane that flies towards +X."""
    profile = [(0.0, -0.33), (0.018, -0.325), (0.03, -0.25), (0.06, -0.08), (0.075, 0.08), (0.068, 0.2), (0.05, 0.255),
               (0.022, 0.272), (0.0, 0.275)]  # fmt: skip
    body = turned_about(lathe(curve(profile, 90), 72), 2, -np.pi / 2)
    wings = rounded_box((0.17, 0.022, 0.74), 0.0105).moved((0.07, 0.02, 0))
    tail = rounded_box((0.09, 0.016, 0.26), 0.0075).moved((-0.28, 0.02, 0))
    fin = rounded_box((0.09, 0.13, 0.016), 0.0075).moved((-0.285, 0.07, 0))
    cabin = ball(0.048, 32, 64).moved((0.02, 0.06, 0))
    blades = [rounded_box((0.012, 0.24, 0.03), 0.0055), rounded_box((0.012, 0.03, 0.24), 0.0055)]
    wheel = turned_about(torus(0.026, 0.014, 48), 0, np.pi / 2)
    struts = [rounded_box((0.02, 0.09, 0.012), 0.005).moved((0.12, -0.075, z)) for z in (-0.06, 0.06)]
    return join(body, wings, tail, fin, cabin), join(
        *(b.moved((0.288, 0, 0)) for b in blades), ball(0.016, 16, 32).moved((0.29, 0, 0)), *struts,
        *(wheel.moved((0.12, -0.12, z)) for z in (-0.075, 0.075)),
    )  # fmt: skip


def build(folder: Path, hdri: str | None = None) -> BuiltShot:
    """Returns the shot, its textures written."""
    write_image(folder / "planks.png", planks())
    write_image(folder / "studio.exr", studio())
    cart, wheels = (turned_about(s, 1, 0.45).moved((-0.40, 0, 0.12)) for s in wagon())
    flyer, fittings = (turned_about(turned_about(s, 2, 0.10), 1, 0.75).moved((0.40, 0.172, 0.02)) for s in plane())
    parts = (
        Part("table", panel((-1.4, 0, 1.3), (2.8, 0, 0), (0, 0, -2.2)), "table"),
        Part("wall", panel((-1.4, 0, -0.9), (2.8, 0, 0), (0, 1.5, 0)), "wall"),
        Part("wagon", cart, "wagon_paint"),
        Part("wheels", wheels, "rubber"),
        Part("plane", flyer, "plane_paint"),
        Part("fittings", fittings, "wood"),
    )
    lamps = (
        Lamp("window", "rect", (26.0, 24.5, 22.0), (-0.5, 1.45, 0.75), (0.0, 0.1, 0.0), size=(0.6, 0.5)),
        Lamp("studio", "dome", (0.4, 0.4, 0.4), file="studio.exr"),
    )
    views = (
        View("camera", (0.08, 0.80, 1.75), (0.05, 0.13, 0.02), 42.0),
        View("from_the_left", (-1.25, 0.62, 1.25), (0.02, 0.12, 0.02), 42.0),
    )
    return BuiltShot("toys", MATERIALS, parts, lamps, views)


RED_ON_WAGON: Dabs = (
    ((0.44, 0.046, 0.029), ((73, 207), (120, 200))),
    ((0.41, 0.043, 0.027), ((167, 197), (207, 190))),
    ((0.60, 0.064, 0.048), ((113, 160), (40, 180))),
)
HIGHLIGHT_ON_PLANE: Dabs = (
    ((1.64, 1.43, 1.02), ((463, 132),)),
    ((1.41, 1.23, 0.865), ((463, 137), (466, 135))),
    ((0.91, 0.745, 0.406), ((459, 132),)),
    ((0.69, 0.546, 0.23), ((467, 130),)),
    ((0.575, 0.428, 0.13), ((455, 132), (456, 137))),
    ((0.625, 0.48, 0.16), ((459, 128),)),
    ((0.466, 0.328, 0.08), ((469, 144),)),
    ((0.70, 0.573, 0.33), ((417, 190),)),
    ((0.68, 0.51, 0.21), ((371, 207), (410, 196))),
    ((0.435, 0.333, 0.117), ((497, 145), (460, 167))),
)
WHITE_ON_WHEELS: Dabs = (
    ((0.318, 0.303, 0.288), ((85, 233),)),
    ((0.18, 0.17, 0.16), ((202, 215), (202, 251))),
    ((0.155, 0.13, 0.113), ((85, 275),)),
    ((0.13, 0.082, 0.054), ((67, 263), (107, 250))),
    ((0.115, 0.072, 0.048), ((183, 240), (223, 233), (85, 253), (202, 233))),
)


def run(play: PlayLike) -> None:
    """Three strokes, solved together."""
    for dabs in (RED_ON_WAGON, HIGHLIGHT_ON_PLANE, WHITE_ON_WHEELS):
        play.paint(on_picture(dabs), RADIUS)
    step = play.step("red on the wagon, a tighter highlight on the plane, a white one on the wheels")
    wanted = (
        ("The red stroke on the wagon changes its diffuse colour", "diffuse"),
        ("The white stroke changes the highlight's shape on the plane", "glossiness"),
        ("The white highlight on the wheels is a specular reflectance", "specular"),
    )
    for (sentence, parameter), stroke in zip(wanted, step.report["strokes"]):
        error = f"relative error {stroke['residual_before']:.2f} to {stroke['residual_after']:.3f}"
        play.shows(sentence, stroke["inferred"] == parameter, f"{stroke['inferred']}, {error}")


ENTRY = Entry(
    "toys",
    "1",
    "Wagon and plane",
    "A red stroke indicates a change of diffuse colour, a white one of a highlight's shape, a white highlight one of "
    "specular reflectance; the smallest change of shading parameters that matches them is found.",
    build,
    run,
)
