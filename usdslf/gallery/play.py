"""A play: an entry that is being run.  Paints strokes, solves them, takes pictures, notes what is shown.

    play.paint(dabs, radius, ...)        a stroke on the picture of a view; kept for the next step
    play.step(title, ...)                strokes -> solve -> look layer -> pictures; the next step starts from there
    play.shows(sentence, is_true, ...)   a part of the figure's claim, checked
    play.picture(pixels, caption)        any other picture or drawing on the page
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any
from weakref import WeakKeyDictionary

import numpy as np
from numpy.typing import NDArray

from usdslf.color import color_of
from usdslf.errors import AuthorError, StrokeError
from usdslf.gallery.records import Dabs, Entry, Picture, Shown, Step
from usdslf.outputs import write_json, write_picture
from usdslf.replacing import replacing
from usdslf.report import lines_of_report
from usdslf.session import Session
from usdslf.strokes.overlay import draw_strokes
from usdslf.strokes.paint import paint_stroke
from usdslf.strokes.stroke import Stroke
from usdslf.textures.images import write_image
from usdslf.usd.build_stage import write_stage
from usdslf.usd.stroke_layer import write_strokes

if TYPE_CHECKING:
    from usdslf.inference.answers import Answer
    from usdslf.inference.weights import Options

SIZE = (448, 252)
SAMPLES = 16


class Play:
    """An entry in its folder: the shot, the session of the shot as it looks now, and all that was made."""

    def __init__(
        self, entry: Entry, folder: Path, hdri: str | None = None, elements: int | None = None,
        size: tuple[int, int] = SIZE, samples: int = SAMPLES, pictures: bool = True, **options: Any,
    ) -> None:  # fmt: skip
        """Writes the entry's stage.

        Args:
            folder: made if it is missing.
            hdri: an environment picture for entries that take one.
            elements: None: as the entry says.
            pictures: False: no pictures are rendered, for tests of what is shown.
            options: device, ocio, say, as of `Session`.

        Raises: AuthorError where the folder cannot be written, InputError for a bad hdri.
        """
        try:
            folder.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            why = error.strerror or error
            raise AuthorError(f"{folder} cannot be made: {why}; choose another folder with -o") from None
        self.entry, self.folder, self.size, self.samples, self.has_pictures = entry, folder, size, samples, pictures
        self.shot = entry.build(folder, hdri)
        self.session = Session(
            str(write_stage(self.shot, folder)), elements=elements or entry.elements, **options
        )
        self.steps: list[Step] = []
        self.shown: list[Shown] = []
        self.extras: list[Picture] = []
        self._painted: list[Stroke] = []
        self._seen: WeakKeyDictionary[Session, dict[int, dict[str, NDArray[np.float32]]]] = WeakKeyDictionary()

    # ── painting ───────────────────────────────────────────────────────────────────────────────

    def paint(self, dabs: Dabs, radius: float = 0.012, view: int = 0, **brush: Any) -> Stroke:
        """Paints dabs, by colour, on the picture of a view, and keeps the stroke for the next step.

        Args:
            dabs: (rgb, places) pairs.
            brush: tool, mode, strength, space, norm, scope, clone_offset of `paint_stroke`.

        Raises: StrokeError where a dab misses every surface.
        """
        colors = [rgb for rgb, places in dabs for _ in places]
        paths = [[place] for _, places in dabs for place in places]
        stroke = self._on_picture(paths, radius, view, brush)
        if len(stroke.points) != 2 * len(colors):  # each dab is a curve of one point twice
            raise StrokeError(f"a dab of {stroke.name} misses every surface that {self.shot.views[view].name} sees")
        return self.keep(replace(stroke, colors=np.repeat(np.array(colors, np.float32), 2, axis=0)))

    def sweep(
        self, paths: Sequence[Sequence[tuple[float, float]]], radius: float = 0.02,
        color: tuple[float, float, float] = (1.0, 1.0, 1.0), view: int = 0, **brush: Any,
    ) -> Stroke:  # fmt: skip
        """Sweeps a brush of one colour along paths on the picture of a view, and keeps the stroke."""
        return self.keep(self._on_picture(paths, radius, view, {"color": color, **brush}))

    def keep(self, stroke: Stroke) -> Stroke:
        """Keeps a stroke for the next step; returns it."""
        self._painted.append(stroke)
        return stroke

    def _on_picture(self, paths: Sequence[Any], radius: float, view: int, brush: Mapping[str, Any]) -> Stroke:
        camera = self.session.camera(self.shot.view_path(view))
        number = sum(len(s.report["strokes"]) for s in self.steps) + len(self._painted) + 1
        return paint_stroke(
            self.session.scene, self.session.tracer, camera, paths, radius, aspect=self.size[0] / self.size[1],
            name=f"stroke_{number:04d}", **brush,
        )  # fmt: skip

    # ── steps ──────────────────────────────────────────────────────────────────────────────────

    def step(
        self, title: str, norm: str | None = None, choose: Mapping[str, str] | None = None,
        options: Options | None = None, goes_on: bool = True,
    ) -> Step:  # fmt: skip
        """Solves the strokes painted since the last step, writes their layers, takes pictures.

        Args:
            goes_on: the next step starts from this one's look; False: from where this one started.
        """
        strokes, self._painted = self._painted, []
        before = self.session
        before.strokes = []
        for stroke in strokes:
            before.add_stroke(stroke)
        answers = before.solve(norm, choose, options)
        folder = self.folder / f"step_{len(self.steps) + 1}" if self.steps else self.folder
        folder.mkdir(exist_ok=True)
        write_strokes(folder / "strokes.usda", strokes, before.stage)
        before.author(folder / "look.usda", folder / "strokes.usda", review_root=folder / "review.usda")
        after = before.reopened(str(folder / "review.usda"))
        report = before.report()
        write_json(folder / "report.json", report)
        pictures = self._pictures(folder, before, after, strokes) if self.has_pictures else ()
        lines = (*lines_of_report(report), *(f"said: {w}" for w in before.warnings))
        step = Step(title, pictures, lines, report, tuple(answers), tuple(strokes), before, after, folder)
        self.steps.append(step)
        if goes_on:
            self.session = after
        return step

    def _pictures(self, folder: Path, before: Session, after: Session, strokes: list[Stroke]) -> tuple[Picture, ...]:
        """before, strokes and after from the first view, before and after from the second."""
        made = []
        for view in range(min(2, len(self.shot.views))):
            end = "" if view == 0 else "_2"
            for name, session in (("before", before), ("after", after)):
                file = folder / f"{name}{end}.png"
                write_picture(file, self.see(session, view), session.scene)
                made.append(Picture(str(file.relative_to(self.folder)), f"{name}, {self.shot.views[view].name}"))
            if view == 0:
                file = folder / "strokes.png"
                color = color_of(before.scene.ocio or None, before.scene.working_space)
                camera = before.camera(self.shot.view_path(0))
                write_image(file, draw_strokes(self.see(before, 0)["color"], strokes, camera, color))
                made.insert(1, Picture(str(file.relative_to(self.folder)), "strokes"))
        return tuple(made)

    def see(self, session: Session, view: int = 0) -> dict[str, NDArray[np.float32]]:
        """Renders what a session's view shows; each once."""
        seen = self._seen.setdefault(session, {})
        if view not in seen:
            aovs = ("albedo", "specular", "roughness")
            seen[view] = session.render(self.shot.view_path(view), self.size, aovs, samples=self.samples)
        return seen[view]

    # ── what is shown ──────────────────────────────────────────────────────────────────────────

    def shows(self, sentence: str, is_true: bool, measured: str = "") -> None:
        """Notes a part of the figure's claim, whether this run shows it, and the figure that says so."""
        self.shown.append(Shown(sentence, bool(is_true), measured))

    def picture(self, name: str, pixels: NDArray, caption: str) -> None:
        """Writes another picture, display values (h, w, 3) in 0..1, for the page."""
        write_image(self.folder / f"{name}.png", np.asarray(pixels, np.float32))
        self.extras.append(Picture(f"{name}.png", caption))

    def look_at(self, session: Session, name: str, caption: str, view: int = 0) -> None:
        """Renders what a session's view shows for the page."""
        write_picture(self.folder / f"{name}.png", self.see(session, view), session.scene)
        self.extras.append(Picture(f"{name}.png", caption))

    def drawing(self, name: str, svg: str, caption: str) -> None:
        """Writes a drawing for the page."""
        with replacing(self.folder / f"{name}.svg") as temporary:
            temporary.write_text(svg, encoding="utf-8")
        self.extras.append(Picture(f"{name}.svg", caption))

    @property
    def seconds(self) -> float:
        """Time of all steps."""
        sessions = dict.fromkeys(s for step in self.steps for s in (step.before, step.after))
        return sum(sum(s.seconds.values()) for s in sessions)


def changed_material(answer: Answer, session: Session) -> str:
    """Returns the last name of the material that an answer changes, "" where it changes nothing."""
    if not answer.chosen.freed:
        return ""
    return session.scene.materials[answer.pool.material].path.rsplit("/", 1)[-1]
