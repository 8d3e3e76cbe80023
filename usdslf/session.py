"""Session: the page of verbs: open, paint, solve, author, render.  Keeps the last Solution and Look that are whole.

    usdslf.open(stage) -> Session;  .add_stroke .solve .stylize .author .render .report .edited .at_frame

What it does is done by shot.py, solution.py and look.py, which a viewer or a server uses instead.
"""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from typing import Any

from numpy.typing import NDArray

from usdslf.edits.edits import MaterialChange
from usdslf.inference.answers import Answer
from usdslf.inference.weights import Options
from usdslf.look import Look, author, render_shot
from usdslf.progress import Say, hearing, step
from usdslf.report import report_of
from usdslf.scene.records import Camera
from usdslf.shot import Shot
from usdslf.similarity.materials import similarity_of
from usdslf.similarity.similarity import Weights
from usdslf.solution import Settings, Solution, check_stroke, find_solution, find_style
from usdslf.strokes.stroke import Stroke
from usdslf.stylize.unsharp_mask import AMOUNT, RADIUS, Stylized
from usdslf.usd.layer.wins import AuthoredEdit


class Session:
    """A shot, the strokes on it and what they ask for.

    What a Shot has (scene, tracer, device, lights, light_set, elements, lookup, visibility, dark_probes, fixed_light,
    light_field, stage, made, frame, ocio, element_count, bounces, refine, model) is found here too.
    """

    def __init__(self, stage: Any, frame: float | None = None, say: Say | None = None, **options: Any) -> None:
        """Opens a shot; steps run when they are first needed.

        Args:
            stage: path, Usd.Stage (never written to), or a Shot.
            frame: time code; None: the first frame of an animated shot.
            say: told the name of a step and how much of it is done, 0..1; what it raises ends the step.
            options: device, ocio, make_preview, elements, bounces, refine, model: see `Shot.open`.

        Raises: StageError where the stage cannot be opened, InputError for a number that cannot be.
        """
        if isinstance(stage, Shot) and (frame is not None or options):
            raise TypeError("a Shot has its frame and options already; open its `source` with others")
        self.shot = stage if isinstance(stage, Shot) else Shot.open(stage, frame, **options)
        self.say = say
        self.strokes: list[Stroke] = []
        self.warnings: list[str] = []
        self.solution = Solution()
        self.look: Look | None = None
        self._heard = 0  # of the shot's warnings
        self._seconds: dict[str, float] = {}
        with self._hearing():  # a Shot may have said something already
            pass

    def __getattr__(self, name: str) -> Any:
        if name.startswith("_") or name == "shot" or not (hasattr(Shot, name) or name in vars(self.shot)):
            raise AttributeError(f"a Session has no '{name}'")
        with self._hearing():
            return getattr(self.shot, name)

    @contextmanager
    def _hearing(self) -> Iterator[None]:
        """Passes on what is told within, and the shot's warnings."""
        hear = lambda p: self.say(p.step, p.share) if self.say else None  # noqa: E731
        try:
            with hearing(hear):
                yield
        finally:
            heard, self._heard = self.shot.warnings[self._heard :], len(self.shot.warnings)
            self.warn(*heard)

    def add_stroke(self, stroke: Stroke) -> None:
        """Adds a stroke, or replaces the one of the same name.

        Raises: StrokeError for numbers that are not finite.
        """
        check_stroke(stroke)
        self.remove_stroke(stroke.name)
        self.strokes.append(stroke)

    def remove_stroke(self, name: str) -> None:
        """Takes a stroke away; what was found is dropped."""
        self.strokes = [s for s in self.strokes if s.name != name]
        self.solution, self.look = Solution(stylized=self.solution.stylized), None

    def solve(
        self, norm: str | None = None, choose: Mapping[str, str] | None = None, options: Options | None = None,
        similarity: Weights | None = None,
    ) -> list[Answer]:  # fmt: skip
        """Finds the smallest change of materials that explains the strokes; see `Settings` and `find_solution`."""
        settings = Settings(norm, dict(choose or {}), options, similarity)
        with self._hearing():
            found = find_solution(self.shot, self.strokes, settings)
        self._accept(found)
        return self.answers

    def stylize(self, amount: float = AMOUNT, radius: float = RADIUS, norm: str = "mixed") -> Stylized:
        """Unsharp masks the light field of the whole shot; what `solve` found is dropped.  See `find_style`."""
        with self._hearing():
            found = find_style(self.shot, amount, radius, norm)
        self._accept(found)
        assert found.stylized is not None
        return found.stylized

    def author(
        self, path: str | os.PathLike[str], strokes_path: str | os.PathLike[str] | None = None,
        review_root: str | os.PathLike[str] | None = None, mode: str = "",
    ) -> list[AuthoredEdit]:  # fmt: skip
        """Writes what was found as a look layer; see `usdslf.look.author`."""
        with self._hearing():
            self.look = author(self.shot, self.solution, path, strokes_path, review_root, mode)
        self.solution = self.look.solution
        self._note(self.look)
        return self.edits

    def camera(self, path: str | None = None) -> Camera:
        """Returns a camera of the shot, the first one by default, or one that sees everything; see `Shot.camera`."""
        with self._hearing():
            return self.shot.camera(path)

    def render(
        self, camera: Camera | str | None = None, size: tuple[int, int] = (640, 360), aovs: tuple[str, ...] = (),
        samples: int = 16, **options: Any,
    ) -> dict[str, NDArray]:  # fmt: skip
        """Renders the shot as it is; returns pictures (h, w, c) by name, `color` first.  See `render_shot`."""
        with self._hearing():
            return render_shot(self.shot, camera, None, size, aovs, samples, **options)

    def similarity(
        self, stroke: Stroke | Sequence[Stroke], camera: Camera | str | None = None,
        size: tuple[int, int] = (640, 360), weights: Weights | None = None,
    ) -> NDArray:  # fmt: skip
        """Returns a picture (h, w, 1): how similar what each pixel shows is to the dabs of a stroke, or of several."""
        strokes = [stroke] if isinstance(stroke, Stroke) else list(stroke)
        view = camera if isinstance(camera, Camera) else self.camera(camera)
        with self._hearing(), step("similarity", self._seconds):
            return similarity_of(strokes, self.shot.scene, self.shot.tracer, view, size, weights, self.warnings)

    def edited(self, look: str | os.PathLike[str]) -> Session:
        """Returns a session on the shot with a look layer over it; see `Shot.edited`."""
        with self._hearing():
            return Session(self.shot.edited(look), say=self.say)

    def reopened(self, stage: Any) -> Session:
        """Returns a session on another composition of the shot; see `Shot.reopened`."""
        with self._hearing():
            return Session(self.shot.reopened(stage), say=self.say)

    def at_frame(self, frame: float) -> Session:
        """Returns a session on the shot at another frame, with the strokes; see `Shot.at_frame`."""
        with self._hearing():
            other = Session(self.shot.at_frame(frame), say=self.say)
        other.strokes = list(self.strokes)
        return other

    def changes(self, mode: str = "") -> list[MaterialChange]:
        """Returns what was found as changes of materials; mode `new` is of painted gprims only."""
        with self._hearing():
            return self.solution.changes(self.shot, mode)

    def report(self) -> dict[str, Any]:
        """Returns what was inferred, as JSON-ready values (DESIGN: the report of solve)."""
        with self._hearing():
            found = report_of(self.shot, self.solution, self.look)
        return found | {"warnings": list(self.warnings), "seconds": {k: round(v, 4) for k, v in self.seconds.items()}}

    answers = property(lambda self: list(self.solution.answers), doc="What `solve` found.")
    stylized = property(lambda self: self.solution.stylized, doc="What `stylize` found.")
    edits = property(lambda self: list(self.look.edits) if self.look else [], doc="What `author` wrote.")

    @property
    def seconds(self) -> dict[str, float]:
        """Time of all steps so far, by name."""
        names = dict.fromkeys([*self.shot.seconds, *self._seconds])
        return {k: self.shot.seconds.get(k, 0.0) + self._seconds.get(k, 0.0) for k in names}

    def warn(self, *sentences: str) -> None:
        """Keeps warnings, each once."""
        self.warnings += [s for s in dict.fromkeys(sentences) if s not in self.warnings]

    def _accept(self, found: Solution) -> None:
        self.solution, self.look = found, None
        self._note(found)

    def _note(self, found: Solution | Look) -> None:
        """Takes over what was said, and the time."""
        self.warnings += [s for s in found.warnings if s not in self.warnings]
        for name, spent in found.seconds.items():
            self._seconds[name] = self._seconds.get(name, 0.0) + spent


def open(stage: Any, **options: Any) -> Session:
    """Opens a shot; see `Session`."""
    return Session(stage, **options)
