"""Demo: a shipped scene, three scripted strokes, and what is inferred from them.

The strokes' colours are what a painter would have dabbed to get the changed materials of
usd/demo_scene.py TRUTH: a path tracer's picture of them, seen through few colours.
"""

from __future__ import annotations

import html
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from usdslf.color import color_of
from usdslf.demo_textures import planks, studio
from usdslf.errors import AuthorError, InputError
from usdslf.images import write_image
from usdslf.outputs import write_json, write_picture
from usdslf.report import lines_of_report
from usdslf.scene import F32
from usdslf.session import Session
from usdslf.stroke_picture import draw_strokes
from usdslf.strokes import Stroke, paint_stroke
from usdslf.usd.demo_scene import CAMERA, build_demo_stage
from usdslf.usd.stroke_layer import write_strokes

if TYPE_CHECKING:
    from usdslf.session import Say

SIZE = (448, 252)
SAMPLES = 12
RADIUS = 0.012  # of a dab, in picture heights
Point = tuple[float, float]
Rgb = tuple[float, float, float]


@dataclass(frozen=True)
class ScriptedStroke:
    """Dabs by colour; places in a picture of 800 x 450."""

    intent: str  # what it must come out as
    story: str
    dabs: tuple[tuple[Rgb, tuple[Point, ...]], ...]


STROKES = (
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
NAMES = ("still_life",)


def run_demos(
    names: Sequence[str], all_names: bool, output: str | Path, device: str | None, ocio: str | None, say: Say
) -> Iterator[str]:
    """Runs shipped scenes into `output`/NAME and writes `output`/index.html; yields what was inferred.

    Raises: InputError for an unknown name, AuthorError where the folder cannot be made.
    """
    chosen = NAMES if all_names else tuple(dict.fromkeys(names)) or NAMES[:1]
    for name in chosen:
        if name not in NAMES:
            raise InputError(f"there is no demo scene '{name}'; choose from {', '.join(NAMES)}")
    pages = []
    for name in chosen:
        folder = Path(output) / name
        try:
            folder.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise AuthorError(
                f"{folder} cannot be made: {error.strerror or error}; choose another folder with -o"
            ) from None
        session = _run_demo(folder, device, ocio, say)
        found = session.report()
        yield f"{name}: {folder}"
        yield from (f"  {line}" for line in lines_of_report(found))
        for script, stroke in zip(STROKES, found["strokes"]):
            verdict = "as meant" if stroke["inferred"] == script.intent else f"meant: {script.intent}"
            yield f"  {script.story}: {stroke['inferred']} ({verdict})"
        seconds = sum(found["seconds"].values())
        yield f"  {seconds:.1f} s; open {folder / 'review.usda'} in any USD program"
        pages.append(_page(name, "\n".join(lines_of_report(found))))
    index = Path(output) / "index.html"
    index.write_text(
        "<!doctype html><meta charset='utf-8'><title>usdslf demo</title>\n"
        "<style>body{font-family:sans-serif;background:#222;color:#ddd;margin:2em}img{max-width:32%}"
        "pre{white-space:pre-wrap}</style>\n" + "\n".join(pages) + "\n",
        encoding="utf-8",
    )
    yield f"pictures: {index}"


def write_demo_shot(folder: Path) -> Path:
    """Writes the demo's stage and its pictures into `folder`; returns the stage's path."""
    write_image(folder / "planks.png", planks())
    write_image(folder / "studio.exr", studio())
    return build_demo_stage(folder)


def _run_demo(folder: Path, device: str | None, ocio: str | None, say: Say) -> Session:
    """Writes shot, strokes, look, review root, report and pictures into `folder`."""
    shot = write_demo_shot(folder)
    session = Session(str(shot), device=device, ocio=ocio, say=say)
    strokes = [paint_script(session, script, i) for i, script in enumerate(STROKES)]
    write_strokes(folder / "strokes.usda", strokes, session.stage)
    for stroke in strokes:
        session.add_stroke(stroke)
    before = session.render(CAMERA, SIZE, samples=SAMPLES)
    write_picture(folder / "before.png", before, session.scene)
    session.solve()
    session.author(
        folder / "look.usda", strokes_path=folder / "strokes.usda", review_root=folder / "review.usda"
    )
    _write_stroke_picture(folder / "strokes.png", before["color"], session, strokes)

    edited = session.edited(folder / "look.usda")
    after = edited.render(CAMERA, SIZE, samples=SAMPLES)
    write_picture(folder / "after.png", after, edited.scene)
    for step, seconds in edited.seconds.items():
        session.seconds[f"after: {step}"] = seconds
    write_json(folder / "report.json", session.report())
    return session


def paint_script(session: Session, script: ScriptedStroke, number: int) -> Stroke:
    """Paints a scripted stroke on the picture of the demo's camera."""
    dabs = [(rgb, place) for rgb, places in script.dabs for place in places]
    paths = [[(x / 800, y / 450)] for _, (x, y) in dabs]
    stroke = paint_stroke(
        session.scene, session.tracer, session.camera(CAMERA), paths, RADIUS, name=f"stroke_{number + 1:04d}"
    )
    # Each dab is a curve of one point twice.
    colors = np.repeat(np.array([rgb for rgb, _ in dabs], np.float32), 2, axis=0)
    assert len(stroke.points) == len(colors), "a scripted dab misses the scene"
    return replace(stroke, colors=colors)


def _write_stroke_picture(path: Path, picture: F32, session: Session, strokes: list[Stroke]) -> None:
    """Writes the picture with the strokes over it, in their own colours with a rim."""
    color = color_of(session.scene.ocio or None, session.scene.working_space)
    painted = draw_strokes(picture, strokes, session.camera(CAMERA), color)
    write_image(path, painted)


def _page(name: str, text: str) -> str:
    pictures = "".join(f"<img src='{name}/{p}.png' alt='{p}'>" for p in ("before", "strokes", "after"))
    return f"<h1>{html.escape(name)}</h1>\n{pictures}\n<pre>{html.escape(text)}</pre>"
