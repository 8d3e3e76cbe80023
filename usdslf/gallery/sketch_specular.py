"""Sketching specular reflectance: a coiled dragon, a red ball, and three rounds of strokes.

    1  grey over the dragon's highlights -> it turns diffuse; yellow glints on the dull red ball -> it turns specular
    2  brighter glints on the ball -> it reflects more
    3  a smaller, sharper highlight with clear reflections beside it -> its roughness falls

The colours are what a painter would have dabbed to get the materials of TRUTH, read from a path tracer's pictures.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from usdslf.gallery.records import Dabs, Entry, PlayLike, on_picture
from usdslf.procedural.built_shot import BuiltShot, Inputs, Lamp, Part, View
from usdslf.procedural.shapes import QuadMesh, ball, curve, join, lathe, panel, tube
from usdslf.procedural.textures import planks, studio
from usdslf.textures.images import write_image

RADIUS = 0.012
MATERIALS: dict[str, Inputs] = {
    "wall": {"diffuseColor": (0.55, 0.52, 0.47), "roughness": 0.9},
    "table": {"diffuseColor": "planks.png", "roughness": 0.6},
    "jade": {"useSpecularWorkflow": 1, "diffuseColor": (0.10, 0.30, 0.16), "specularColor": (0.16, 0.16, 0.16),
             "roughness": 0.22},
    "red": {"useSpecularWorkflow": 1, "diffuseColor": (0.45, 0.035, 0.03), "specularColor": (0.0, 0.0, 0.0),
            "roughness": 0.35},
}  # fmt: skip


def dragon() -> QuadMesh:
    """A coiled dragon that lies on the origin, its neck up and its head towards +X +Z."""
    turn = np.linspace(0, 2 * np.pi * 2.15, 26)
    share = np.linspace(0, 1, 26)
    wide = 0.235 - 0.10 * share
    coil = np.stack(
        [wide * np.cos(turn + 0.4), 0.035 + 0.13 * share**1.3, wide * np.sin(turn + 0.4)], 1
    )
    neck = [(0.03, 0.235, 0.135), (0.105, 0.30, 0.115), (0.10, 0.385, 0.05), (0.075, 0.43, 0.075), (0.115, 0.438, 0.14),
            (0.15, 0.415, 0.185)]  # fmt: skip
    path = curve(np.concatenate([coil, neck]), 220)
    knots = np.array([(0, 0.003), (0.12, 0.022), (0.4, 0.05), (0.72, 0.044), (0.86, 0.031), (0.925, 0.03),
                      (0.955, 0.04), (0.98, 0.03), (0.995, 0.016), (1, 0.001)])  # fmt: skip
    thick = np.interp(np.linspace(0, 1, 220), *knots.T)
    body = tube(path, thick, 40)
    cone = np.array([(0.012, -0.012), (0.010, 0.0), (0.006, 0.014), (0.0005, 0.03)])
    spikes = []
    for k in range(70, 205, 7):
        size = thick[k] / 0.045
        spikes.append(lathe(cone * size, 16).moved(path[k] + np.array([0, thick[k], 0])))
    return join(body, *spikes)


LAMPS = (
    Lamp("softbox", "rect", (22.0, 21.0, 19.0), (-0.75, 1.35, 0.95), (0.0, 0.15, 0.0), size=(0.55, 0.45)),
    Lamp("studio", "dome", (0.45, 0.45, 0.45), file="studio.exr"),
)


def put_table(folder: Path) -> tuple[Part, Part]:
    """Returns a table before a wall, which LAMPS light, after the textures of all were written."""
    write_image(folder / "planks.png", planks())
    write_image(folder / "studio.exr", studio())
    return (
        Part("table", panel((-1.2, 0, 1.1), (2.4, 0, 0), (0, 0, -1.9)), "table"),
        Part("wall", panel((-1.2, 0, -0.8), (2.4, 0, 0), (0, 1.5, 0)), "wall"),
    )


def build(folder: Path, hdri: str | None = None) -> BuiltShot:
    """Returns the shot, its textures written."""
    parts = (
        *put_table(folder),
        Part("dragon", dragon().moved((-0.30, 0, 0.0)), "jade"),
        Part("ball", ball(0.19, 48, 96).moved((0.33, 0.19, 0.10)), "red"),
    )
    views = (
        View("camera", (0.12, 0.72, 1.75), (0.02, 0.20, 0.02)),
        View("from_the_right", (1.15, 0.62, 1.25), (0.02, 0.19, 0.0)),
    )
    return BuiltShot("sketch_specular", MATERIALS, parts, LAMPS, views)


TRUTH: tuple[dict[str, Inputs], ...] = (
    {"jade": {"specularColor": (0.0, 0.0, 0.0)}, "red": {"specularColor": (0.22, 0.18, 0.06)}},
    {"red": {"specularColor": (0.45, 0.45, 0.42)}},
    {"red": {"roughness": 0.12}},
)
"""What the strokes of each round were painted for; each on top of the last."""

GREY_ON_DRAGON: Dabs = (
    ((0.105, 0.30, 0.15), ((140, 239), (155, 240), (170, 241), (186, 240))),
    ((0.12, 0.35, 0.175), ((205, 80),)),
    ((0.088, 0.25, 0.122), ((175, 190),)),
    ((0.058, 0.153, 0.073), ((216, 160),)),
    ((0.077, 0.21, 0.103), ((200, 250),)),
)
YELLOW_ON_BALL: Dabs = (
    ((1.95, 1.3, 0.42), ((433, 172),)),
    ((0.68, 0.32, 0.12), ((420, 182), (446, 164))),
    ((0.5, 0.22, 0.082), ((437, 192), (495, 172), (500, 192))),
    ((0.32, 0.057, 0.025), ((400, 220),)),
    ((0.22, 0.042, 0.016), ((460, 250),)),
    ((0.178, 0.037, 0.016), ((520, 222),)),
    ((0.37, 0.084, 0.048), ((460, 132),)),
)
WHITE_ON_HIGHLIGHT: Dabs = (
    ((3.55, 3.25, 2.8), ((433, 172),)),
    ((0.98, 0.76, 0.68), ((420, 182), (446, 164))),
    ((0.70, 0.52, 0.46), ((437, 192), (495, 172), (500, 192))),
    ((0.31, 0.108, 0.066), ((400, 220),)),
    ((0.246, 0.087, 0.051), ((460, 250),)),
    ((0.19, 0.075, 0.052), ((520, 222),)),
    ((0.345, 0.16, 0.167), ((460, 132),)),
)
SHARPER: Dabs = (
    ((9.8, 9.2, 7.8), ((433, 172),)),
    ((4.65, 4.25, 3.6), ((427, 168),)),
    ((3.3, 3.0, 2.65), ((440, 176),)),
    ((0.35, 0.155, 0.16), ((420, 182), (446, 160), (460, 132))),
    ((0.53, 0.37, 0.40), ((437, 192),)),
    ((1.05, 0.85, 0.72), ((490, 172), (503, 192))),
    ((0.32, 0.103, 0.057), ((400, 220),)),
    ((0.23, 0.08, 0.046), ((460, 250), (520, 222), (389, 200))),
)


def run(play: PlayLike) -> None:
    """Three rounds, each painted on the result of the one before."""
    play.paint(on_picture(GREY_ON_DRAGON), RADIUS)
    play.paint(on_picture(YELLOW_ON_BALL), RADIUS)
    dragon_, ball_ = play.step("grey over the dragon's highlights, yellow glints on the dull ball").report["strokes"]
    was, now = max(dragon_["before"]["specular"]), max(dragon_["after"]["specular"])
    play.shows(
        "The dragon turns diffuse", dragon_["inferred"] == "specular" and now < 0.3 * was,
        f"{dragon_['inferred']}, specular {was:.2f} to {now:.3f}",
    )  # fmt: skip
    r, _, b = ball_["after"]["specular"]
    play.shows(
        "The ball turns specular, yellowish", ball_["inferred"] == "specular" and r > 2 * b > 0,
        f"{ball_['inferred']}, specular {_rgb(ball_['after']['specular'])}",
    )  # fmt: skip

    play.paint(on_picture(WHITE_ON_HIGHLIGHT), RADIUS)
    (ball_,) = play.step("brighter, white glints").report["strokes"]
    more = np.mean(ball_["after"]["specular"]) / np.mean(ball_["before"]["specular"])
    play.shows("The ball reflects more", ball_["inferred"] == "specular" and more > 1.5, f"{more:.1f} times as much")

    play.paint(on_picture(SHARPER), RADIUS)
    (ball_,) = play.step("a small, sharp highlight and clear reflections").report["strokes"]
    was, now = ball_["before"]["roughness"], ball_["after"]["roughness"]
    play.shows(
        "The highlight's shape is a change of glossiness", ball_["inferred"] == "glossiness" and now < 0.6 * was,
        f"{ball_['inferred']}, roughness {was:.2f} to {now:.2f}",
    )  # fmt: skip


def _rgb(color: list[float]) -> str:
    return "(" + ", ".join(f"{c:.2f}" for c in color) + ")"


ENTRY = Entry(
    "sketch_specular",
    "16",
    "Sketching specular reflectance",
    "A stroke over a highlight turns a dragon diffuse, a yellow one turns a diffuse ball specular, a white one makes "
    "it reflect more, and a change of the highlight's shape is a change of glossiness.",
    build,
    run,
)
