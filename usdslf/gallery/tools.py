"""Every tool once: a row of like balls, each under another tool.

Strokes of blur, sharpen, brighten and darken lie over a ball's highlight and have no colour of their own; clone takes
what its neighbour looks like; replace has a colour; fixate asks for nothing.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from usdslf.gallery.records import Entry, PlayLike
from usdslf.procedural.built_shot import BuiltShot, Inputs, Lamp, Part, View
from usdslf.procedural.shapes import ball, panel
from usdslf.procedural.textures import planks, studio
from usdslf.scene.cameras import project_points
from usdslf.strokes.anchors import unit
from usdslf.textures.images import write_image

TOOLS = ("blur", "sharpen", "brighten", "darken", "replace", "clone", "fixate")
SIZE, GAP = 0.115, 0.26  # radius of a ball and distance of two
GLOSSY: Inputs = {
    "useSpecularWorkflow": 1,
    "diffuseColor": (0.10, 0.14, 0.24),
    "specularColor": (0.14, 0.14, 0.14),
    "roughness": 0.3,
}
SOURCE: Inputs = {**GLOSSY, "diffuseColor": (0.50, 0.09, 0.05)}  # what clone takes: the ball under fixate
TRUTH: dict[str, Inputs] = {"under_replace": {"diffuseColor": (0.20, 0.50, 0.10)}}
REPLACED = ((0.076, 0.131, 0.028), (0.092, 0.147, 0.034), (0.09, 0.145, 0.033), (0.084, 0.133, 0.03),
            (0.077, 0.117, 0.026), (0.071, 0.10, 0.026))  # fmt: skip
"""What replace paints, dab by dab: what a path tracer shows of the ball in TRUTH, rounded."""


def build(folder: Path, hdri: str | None = None) -> BuiltShot:
    """Returns the shot, its textures written."""
    write_image(folder / "planks.png", planks())
    write_image(folder / "studio.exr", studio())
    parts = [
        Part("table", panel((-1.5, 0, 1.1), (3.0, 0, 0), (0, 0, -1.9)), "table"),
        Part("wall", panel((-1.5, 0, -0.8), (3.0, 0, 0), (0, 1.2, 0)), "wall"),
    ]
    materials: dict[str, Inputs] = {
        "table": {"diffuseColor": "planks.png", "roughness": 0.6},
        "wall": {"diffuseColor": (0.5, 0.5, 0.48), "roughness": 0.9},
    }
    for i, tool in enumerate(TOOLS):
        materials[f"under_{tool}"] = SOURCE if tool == "fixate" else GLOSSY
        parts.append(Part(f"ball_{tool}", ball(SIZE, 40, 80).moved((_x(i), SIZE, 0.0)), f"under_{tool}"))
    lamps = (
        Lamp("softbox", "rect", (20.0, 19.0, 17.0), (-0.55, 1.45, 1.15), (0.0, 0.1, 0.0), size=(0.5, 0.4)),
        Lamp("studio", "dome", (0.4, 0.4, 0.4), file="studio.exr"),
    )
    views = (
        View("camera", (0.0, 0.55, 2.2), (0.0, 0.10, 0.0), 43.0),
        View("from_the_left", (-1.5, 0.6, 1.5), (-0.1, 0.1, 0.0), 40.0),
    )
    return BuiltShot("tools", materials, parts, lamps, views)


def _x(ball_: int) -> float:
    return GAP * (ball_ - (len(TOOLS) - 1) / 2)


def run(play: PlayLike) -> None:
    """One stroke a ball, solved together."""
    for i, tool in enumerate(TOOLS):
        places = highlight(play, i) if tool in ("blur", "sharpen", "brighten", "darken") else body(play, i)
        offset = (GAP, 0.0, 0.0) if tool == "clone" else (0.0, 0.0, 0.0)
        strength = {"brighten": 0.8, "darken": 0.5}.get(tool, 1.0)
        colors = REPLACED if tool == "replace" else [(1.0, 1.0, 1.0)] * len(places)
        dabs = [(color, [place]) for color, place in zip(colors, places, strict=True)]
        play.paint(dabs, 0.012, tool=tool, strength=strength, clone_offset=offset)
    found = {s["surface"].rsplit("_", 1)[-1]: s for s in play.step("seven balls, seven tools").report["strokes"]}
    rough = {t: s["after"]["roughness"] - s["before"]["roughness"] for t, s in found.items()}
    shine = {t: float(np.mean(s["after"]["specular"]) - np.mean(s["before"]["specular"])) for t, s in found.items()}
    play.shows("blur makes the highlight larger", rough["blur"] > 0.02, _says(found["blur"]))
    play.shows("sharpen makes it smaller", rough["sharpen"] < -0.02, _says(found["sharpen"]))
    play.shows("brighten makes it stronger", shine["brighten"] > 0.02, _says(found["brighten"]))
    play.shows("darken makes it weaker", shine["darken"] < -0.02, _says(found["darken"]))
    off = np.abs(np.subtract(found["replace"]["after"]["diffuse"], TRUTH["under_replace"]["diffuseColor"])).max()
    play.shows(
        "replace changes the diffuse colour", found["replace"]["inferred"] == "diffuse" and off < 0.05,
        f"{_says(found['replace'])}, off by {off:.3f}",
    )  # fmt: skip
    off = np.abs(np.subtract(found["clone"]["after"]["diffuse"], SOURCE["diffuseColor"])).max()
    play.shows("clone makes it look like its neighbour", off < 0.1, f"{_says(found['clone'])}, off by {off:.3f}")
    play.shows("fixate changes nothing", found["fixate"]["inferred"] == "none", _says(found["fixate"]))


def highlight(play: PlayLike, ball_: int) -> list[tuple[float, float]]:
    """Places through the highlight of a ball: where half-way between lamp and eye is its normal, and about it."""
    centre, eye = np.array([_x(ball_), SIZE, 0.0]), np.array(play.shot.views[0].eye)
    lamp = np.array(play.shot.lamps[0].at)
    at = centre
    for _ in range(4):
        half = unit(lamp[None] - at)[0] + unit(eye[None] - at)[0]
        at = centre + SIZE * half / np.linalg.norm(half)
    along = np.cross(at - centre, [0.0, 1.0, 0.0])
    along /= np.linalg.norm(along)
    up = np.cross(along, at - centre)
    up /= np.linalg.norm(up)
    spread = [(0, 0), (0.02, 0), (-0.02, 0), (0, 0.02), (0, -0.02), (0.045, 0), (-0.045, 0), (0, 0.045), (0, -0.045)]
    return on_view(play, [at + a * along + b * up for a, b in spread])


def body(play: PlayLike, ball_: int) -> list[tuple[float, float]]:
    """Places on the lower front of a ball, off its highlight."""
    turn = np.linspace(-0.9, 0.9, 6)
    offsets = np.stack([0.8 * np.sin(turn), np.full(6, -0.35), 0.8 * np.cos(turn)], 1)
    offsets /= np.linalg.norm(offsets, axis=1, keepdims=True)
    return on_view(play, [np.array([_x(ball_), SIZE, 0.0]) + SIZE * o for o in offsets])


def on_view(play: PlayLike, points: list[np.ndarray]) -> list[tuple[float, float]]:
    """Returns points of the world on the first view's picture."""
    at, _ = project_points(play.session.camera(play.shot.view_path()), np.array(points), play.size[0] / play.size[1])
    return [(float(x), float(y)) for x, y in at]


def _says(stroke: dict) -> str:
    before, after = stroke["before"], stroke["after"]
    shine = f"specular {np.mean(before['specular']):.2f} to {np.mean(after['specular']):.2f}"
    return f"{stroke['inferred']}, roughness {before['roughness']:.2f} to {after['roughness']:.2f}, {shine}"


ENTRY = Entry(
    "tools",
    "4",
    "Tools",
    "Tools of image editing act on the light field under a stroke: some change the size of a highlight, some its "
    "strength, others the diffuse colour.",
    build,
    run,
)
