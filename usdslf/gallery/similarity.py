"""Similarity of a scene to two painted places: by position, by normal, by reflectance, and by all of them.

Balls and boxes of three paints stand on a floor before a wall; one dab lies on a red ball, another on the floor.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from scipy.stats import spearmanr

from usdslf.color import color_of
from usdslf.gallery.records import Entry, PlayLike
from usdslf.procedural.built_shot import BuiltShot, Inputs, Lamp, Part, View
from usdslf.procedural.shapes import QuadMesh, ball, panel, rounded_box, turned_about
from usdslf.scene.records import F32
from usdslf.similarity.similarity import Weights

SIZE = (320, 180)
RADIUS = 0.07
MATERIALS: dict[str, Inputs] = {
    "floor": {"diffuseColor": (0.44, 0.42, 0.40), "roughness": 0.8},
    "wall": {"diffuseColor": (0.62, 0.60, 0.50), "roughness": 0.9},
    "red": {"diffuseColor": (0.52, 0.07, 0.05), "roughness": 0.4},
    "red_too": {"diffuseColor": (0.50, 0.08, 0.06), "roughness": 0.42},
    "blue": {"diffuseColor": (0.07, 0.13, 0.46), "roughness": 0.4},
}
PLACES = {"ball": (0.25, 0.56), "floor": (0.5, 0.93)}
"""What is painted, and where on the picture; the first lies on `red`."""
WEIGHTS = {
    "position": Weights(1, 0, 0), "normal": Weights(0, 1, 0), "reflectance": Weights(0, 0, 1), "all": Weights(),
}  # fmt: skip


def build(folder: Path, hdri: str | None = None) -> BuiltShot:
    """Returns the shot."""

    def box(x: float, z: float, turn: float) -> QuadMesh:
        return turned_about(rounded_box((0.34, 0.42, 0.34), 0.03), 1, turn).moved((x, 0.21, z))

    parts = (
        Part("floor", panel((-1.5, 0, 1.3), (3, 0, 0), (0, 0, -2.0)), "floor"),
        Part("wall", panel((-1.5, 0, -0.7), (3, 0, 0), (0, 1.5, 0)), "wall"),
        Part("red_ball", ball(0.24, 80, 160).moved((-0.55, 0.24, 0.15)), "red"),
        Part("blue_ball", ball(0.24, 80, 160).moved((0.02, 0.24, 0.2)), "blue"),
        Part("red_box", box(0.58, 0.12, 0.5), "red_too"),
        Part("blue_box", box(-0.2, -0.38, -0.3), "blue"),
    )
    lamps = (
        Lamp("lamp", "rect", (16.0, 15.0, 13.5), (-0.8, 2.0, 1.4), (0.0, 0.2, 0.0), size=(0.8, 0.8)),
        Lamp("sky", "dome", (0.35, 0.40, 0.48)),
    )
    return BuiltShot("similarity", MATERIALS, parts, lamps, (View("camera", (0.0, 0.85, 2.5), (0.0, 0.27, 0.0), 42.0),))


def falls(similarity: F32, distance: F32) -> float:
    """Rank correlation of a similarity with a distance: -1 where it falls throughout."""
    return float(spearmanr(similarity, distance).statistic)


def run(play: PlayLike) -> None:
    """No solve: the places are only looked at."""
    session = play.session
    camera = play.shot.view_path(0)
    aovs = ("position", "normal", "material", "albedo")
    seen = session.render(camera, SIZE, aovs, samples=play.samples if play.has_pictures else 1)
    shown = seen["material"][..., 0]
    names = [m.path.rsplit("/", 1)[-1] for m in session.scene.materials]
    of = {m: shown == names.index(m) for m in MATERIALS}
    inside = shown >= 0
    found = {}
    for place, at in PLACES.items():
        stroke = play.sweep([[at]], RADIUS)
        for name, weights in WEIGHTS.items():
            found[place, name] = session.similarity(stroke, camera, SIZE, weights)[..., 0]
        x, y = int(at[0] * SIZE[0]), int(at[1] * SIZE[1])
        apart = np.linalg.norm(seen["position"] - seen["position"][y, x], axis=-1)
        rank = falls(found[place, "position"][inside], apart[inside])
        play.shows(
            f"By position alone it falls with distance, from the {place}", rank < -0.99, f"rank correlation {rank:.4f}"
        )
        turned = np.clip(seen["normal"] @ seen["normal"][y, x], 0, 1)
        rank = falls(found[place, "normal"][inside], 1 - turned[inside])
        play.shows(
            f"By normal alone it follows the normal, from the {place}", rank < -0.97, f"rank correlation {rank:.4f}"
        )
    mean = {m: float(np.median(found["ball", "reflectance"][of[m]])) for m in MATERIALS}
    far = max(v for m, v in mean.items() if not m.startswith("red"))
    play.shows(
        "By reflectance alone it picks the like materials", min(mean["red"], mean["red_too"]) > 0.8 and far < 0.2,
        ", ".join(f"{m} {v:.2f}" for m, v in mean.items()),
    )  # fmt: skip
    all_of = {m: float(np.median(found["ball", "all"][of[m]])) for m in MATERIALS}
    order = sorted(all_of, key=lambda m: -all_of[m])
    play.shows(
        "By all of it the painted material comes first and the like one next", order[:2] == ["red", "red_too"],
        ", ".join(f"{m} {all_of[m]:.2f}" for m in order),
    )  # fmt: skip
    if play.has_pictures:
        color = color_of(session.scene.ocio or None, session.scene.working_space)
        play.picture("shot", _marked(color.display(seen["color"], 0.0)), "the shot, and the two places")
        for place in PLACES:
            row = np.concatenate([found[place, name] for name in WEIGHTS], 1)
            play.picture(
                f"similar_to_{place}", np.repeat(row[..., None], 3, 2),
                f"similarity to the {place}'s place: {', '.join(WEIGHTS)}",
            )  # fmt: skip


def _marked(picture: F32) -> F32:
    """The picture with a white ring about each place."""
    out = np.array(picture, np.float32)
    y, x = np.mgrid[: out.shape[0], : out.shape[1]]
    for at in PLACES.values():
        distance = np.hypot(x - at[0] * SIZE[0], y - at[1] * SIZE[1])
        out[np.abs(distance - 5) < 1] = 1
    return out


ENTRY = Entry(
    "similarity",
    "7",
    "What is similar to a painted place",
    "Similarity by position falls with distance, by normal follows the shape, by reflectance picks the like "
    "materials, and together they say where an edit goes.",
    build,
    run,
    elements=2000,
)
