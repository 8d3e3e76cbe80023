"""Diffuse painting where light goes round many times: a white room, lit from its ceiling, is painted pale blue.

Floor, walls and ceiling share one plaster, so that darker paint also takes away the light that falls on it: the first
answer, under the light of before, comes out too dark.  Iterated with the new reflectance, it arrives.

The colours are what a path tracer shows of the room in TRUTH, rounded.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

from usdslf.gallery.plots import Axis, lines
from usdslf.gallery.records import Dabs, Entry, PlayLike, Step, on_picture
from usdslf.inference.answers import Answer
from usdslf.inference.bilinear import pool_tables
from usdslf.inference.direct import gather_strokes, infer_changes
from usdslf.inference.first_answers import Asking
from usdslf.procedural.built_shot import BuiltShot, Inputs, Lamp, Part, View
from usdslf.procedural.shapes import ball, panel, rounded_box

RADIUS = 0.02
MATERIALS: dict[str, Inputs] = {
    "plaster": {"useSpecularWorkflow": 1, "diffuseColor": (0.80, 0.79, 0.77), "specularColor": (0.0, 0.0, 0.0),
                "roughness": 1.0},
    "block": {"diffuseColor": (0.45, 0.42, 0.38), "roughness": 0.7},
    "ball": {"diffuseColor": (0.55, 0.10, 0.06), "roughness": 0.5},
}  # fmt: skip
TRUTH: dict[str, Inputs] = {"plaster": {"diffuseColor": (0.50, 0.62, 0.74)}}
"""The room that the stroke was painted for."""


def build(folder: Path, hdri: str | None = None) -> BuiltShot:
    """Returns the shot."""
    w, h, d = 2.0, 1.3, 2.2  # the room opens towards +Z
    parts = (
        Part("floor", panel((-w / 2, 0, d / 2), (w, 0, 0), (0, 0, -d)), "plaster"),
        Part("ceiling", panel((-w / 2, h, -d / 2), (w, 0, 0), (0, 0, d)), "plaster"),
        Part("back", panel((-w / 2, 0, -d / 2), (w, 0, 0), (0, h, 0)), "plaster"),
        Part("left", panel((-w / 2, 0, d / 2), (0, 0, -d), (0, h, 0)), "plaster"),
        Part("right", panel((w / 2, 0, -d / 2), (0, 0, d), (0, h, 0)), "plaster"),
        Part("block", rounded_box((0.4, 0.62, 0.36), 0.02).moved((-0.42, 0.31, -0.45)), "block"),
        Part("ball", ball(0.2, 32, 64).moved((0.45, 0.2, -0.1)), "ball"),
    )
    lamps = (Lamp("panel", "rect", (9.0, 8.6, 8.0), (0.0, h - 0.02, -0.1), (0.0, 0.0, -0.1), size=(0.6, 0.5)),)
    views = (
        View("camera", (0.0, 0.72, 2.55), (0.0, 0.5, 0.0), 36.0),
        View("from_the_left", (-0.65, 1.0, 1.9), (0.15, 0.35, -0.2), 30.0),
    )
    return BuiltShot("white_room", MATERIALS, parts, lamps, views)


PALE_BLUE: Dabs = (
    ((0.269, 0.339, 0.412), ((250, 300),)),
    ((0.279, 0.346, 0.42), ((300, 306), (350, 304))),
    ((0.255, 0.32, 0.391), ((275, 318), (330, 322))),
)


def run(play: PlayLike) -> None:
    """One stroke; how far it is off after each iteration, with its sign, and the looks of the first and the last."""
    play.paint(on_picture(PALE_BLUE), RADIUS)
    step = play.step("pale blue dabs on the floor of a white room")
    (room,) = step.report["strokes"]
    error, bias = errors_of_rounds(play, step)
    play.shows(
        "After one iteration the colour is too dark", bias[0] < -0.02, f"{100 * bias[0]:+.1f} % of what was painted"
    )
    third = min(len(bias), 3) - 1
    play.shows(
        "After three iterations it is as painted", abs(bias[third]) < 0.01 and error[third] < 0.35 * error[0],
        f"{100 * bias[third]:+.1f} %; relative error {error[0]:.3f}, then {', '.join(f'{e:.3f}' for e in error[1:])}",
    )  # fmt: skip
    off = float(np.abs(np.subtract(room["after"]["diffuse"], TRUTH["plaster"]["diffuseColor"])).max())
    play.shows(
        "The room's colour is found", room["inferred"] == "diffuse" and off < 0.05,
        f"{room['inferred']}, off by {off:.3f} at most",
    )  # fmt: skip
    points = lambda values: list(enumerate(values, 1))  # noqa: E731
    most = max(0.05, 1.1 * max(map(abs, (*error, *bias))))
    play.drawing(
        "iterations",
        lines(
            "Painted against shown, by iteration", Axis("iteration", 1, max(len(error), 2), range(1, len(error) + 1)),
            Axis("relative", -most, most, (-0.1, -0.05, 0, 0.05, 0.1) if most > 0.1 else (-0.05, 0, 0.05)),
            {"RMS error": points(error), "mean, signed": points(bias)},
        ),
        "error after each iteration",
    )  # fmt: skip


def errors_of_rounds(play: PlayLike, step: Step) -> tuple[list[float], list[float]]:
    """Relative RMS error and signed mean after each iteration, from the light as it then is.

    On the page also the look after the first iteration.
    """
    session = step.before
    field = session.light_field.with_surface(session.light_field.surface)  # the shot's stays as it is
    painted = gather_strokes(session.strokes, session.scene, session.tracer, field, session.light_set, [])
    error, bias = [], []
    last: list[Answer] | None = None
    for answers in infer_changes(painted, Asking(session.scene, field, bounces=session.bounces)):
        if answers is last:  # the round fitted worse and was not accepted
            break
        last = answers
        (answer,) = answers
        tables = pool_tables([p.evidence(field) for p in painted], answer.pool.material, field.model)
        chosen = replace(answer.chosen, level=tables.own)  # its level is one of the tables that it was fitted to
        shown = chosen.radiance(tables)
        off = (shown - tables.target) / tables.scale
        error.append(float(np.sqrt((off * off).mean())))
        bias.append(float(shown.sum() / tables.target.sum() - 1))
        if len(error) == 1 and play.has_pictures:
            solution, look = session.solution, session.look
            session.solution = replace(solution, answers=tuple(answers))
            session.author(step.folder / "look_first.usda", review_root=step.folder / "review_first.usda")
            session.solution, session.look = solution, look
            play.look_at(session.reopened(str(step.folder / "review_first.usda")), "first", "after one iteration")
    return error, bias


ENTRY = Entry(
    "white_room",
    "15",
    "Diffuse painting with many bounces",
    "After one iteration a pale blue stroke comes out too dark, because the light that goes round was not accounted "
    "for; iterated three times it looks as it was painted.",
    build,
    run,
)
