"""Session: the page of verbs: open, paint, solve, author, render.  Keeps the last Solution and Look that are whole.

    usdslf.open(stage) -> Session;  .add_stroke .solve .stylize .author .render .report .edited .at_frame

What it does is done by shot.py, solution.py and look.py, which a viewer or a server uses instead.
"""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import replace
from typing import Any, Generic, TypeVar

import numpy as np
from numpy.typing import NDArray

from usdslf.animation.revealed import DarkProbes
from usdslf.edits.edits import MaterialChange
from usdslf.elements.elements import Elements
from usdslf.elements.lookup import ElementLookup
from usdslf.gpu.device import Device
from usdslf.inference.answers import Answer
from usdslf.inference.next_dab import NextDab, next_dab
from usdslf.inference.weights import Options
from usdslf.light_field.light_field import LightField
from usdslf.light_field.visibility import Visibility
from usdslf.lights.sources import LightSet
from usdslf.look import Look, author, render_shot
from usdslf.progress import Say, hearing, step
from usdslf.rays import RayTracer
from usdslf.report import report_of
from usdslf.scene.records import Camera, Light, Scene
from usdslf.shot import Shot
from usdslf.similarity.materials import similarity_of
from usdslf.similarity.similarity import Weights
from usdslf.solution import Settings, Solution, check_stroke, find_solution, find_style
from usdslf.strokes.stroke import Stroke
from usdslf.stylize.unsharp_mask import AMOUNT, RADIUS, Stylized
from usdslf.usd.layer.wins import AuthoredEdit

Value = TypeVar("Value")

class _OfShot(Generic[Value]):
    """What a Session's Shot has."""

    def __set_name__(self, owner: type, name: str) -> None:
        self._name = name

    def __get__(self, session: Session | None, owner: type) -> Value:
        if session is None:
            raise AttributeError(self._name)
        with session._hearing():
            found: Value = getattr(session.shot, self._name)
            return found


class Session:
    """A shot, the strokes on it and what they ask for.  What the Shot has is found here too."""

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

    stage, source, made, ocio = _OfShot[Any](), _OfShot[Any](), _OfShot[Any](), _OfShot[str | None]()
    scene, device, tracer = _OfShot[Scene](), _OfShot[Device](), _OfShot[RayTracer]()
    lights, light_set = _OfShot[tuple[Light, ...]](), _OfShot[LightSet]()
    elements, lookup, visibility = _OfShot[Elements](), _OfShot[ElementLookup](), _OfShot[Visibility]()
    dark_probes, fixed_light = _OfShot[DarkProbes](), _OfShot[NDArray[np.float32]]()
    light_field = _OfShot[LightField]()
    frame, element_count, bounces = _OfShot[float | None](), _OfShot[int](), _OfShot[int]()
    refine, model = _OfShot[int](), _OfShot[str]()

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
        """Takes the stroke of a name away; what was found is dropped."""
        self.strokes = [s for s in self.strokes if s.name != name]
        self.solution, self.look = Solution(stylized=self.solution.stylized), None

    def solve(
        self, norm: str | None = None, choose: Mapping[str, str] | None = None, options: Options | None = None,
        similarity: Weights | None = None,
    ) -> list[Answer]:  # fmt: skip
        """Finds the smallest change of materials that explains the strokes; returns the answers.

        Args:
            norm: l2 | l0 | mixed for all strokes; None: each stroke's own.
            choose: stroke name -> id of an alternative.
            options: weights of the choice, `Options.of((1, 5, 25))` or `Options.of({"group": 8})`.
            similarity: weights of what strokes of scope `similar` change beside the painted material.

        Raises: StrokeError, SolveError.

        Source: Nguyen et al. 2013, 5.3 and 5.4.
        """
        settings = Settings(norm, dict(choose or {}), options, similarity)
        with self._hearing():
            found = find_solution(self.shot, self.strokes, settings)
        self._accept(found)
        return self.answers

    def stylize(self, amount: float = AMOUNT, radius: float = RADIUS, norm: str = "mixed") -> Stylized:
        """Unsharp masks the light field of the whole shot, and returns what it found; what `solve` found is dropped.

        Args:
            amount: contrast that is added, as a multiple of what is there; 0 changes nothing.
            radius: of the surroundings that a place is set off from, as a fraction of the scene's diagonal.
            norm: l0 | mixed | l2: how freely diffuse, specular and glossiness of a place change together.

        Raises: InputError for numbers that cannot be, AuthorError where no material can be edited.

        Source: Nguyen et al. 2013, 7 and figure 22.
        """
        with self._hearing():
            found = find_style(self.shot, amount, radius, norm)
        self._accept(found)
        assert found.stylized is not None
        return found.stylized

    def author(
        self, path: str | os.PathLike[str], strokes_path: str | os.PathLike[str] | None = None,
        review_root: str | os.PathLike[str] | None = None, mode: str = "",
    ) -> list[AuthoredEdit]:  # fmt: skip
        """Writes what was found as a look layer; returns its edits.

        Args:
            path: of the look.
            strokes_path: the stroke layer, for provenance and the review root.
            review_root: a layer to write over look, strokes and shot.
            mode: override | new | class; "": as each stroke's scope says.  See `usdslf.author`.

        Raises: AuthorError where it cannot be written.
        """
        with self._hearing():
            self.look = author(self.shot, self.solution, path, strokes_path, review_root, mode)
        self.solution = self.look.solution
        self._note(self.look)
        return self.edits

    def camera(self, path: str | None = None) -> Camera:
        """Returns the camera of a path, by default the first one, or one that sees everything; see `Shot.camera`."""
        with self._hearing():
            return self.shot.camera(path)

    def render(
        self, camera: Camera | str | None = None, size: tuple[int, int] = (640, 360), aovs: tuple[str, ...] = (),
        samples: int = 16, **options: Any,
    ) -> dict[str, NDArray[np.float32]]:  # fmt: skip
        """Renders the shot as it is; returns pictures (h, w, c) by name, `color` first.

        Args:
            camera: one, or its path; None: the shot's first, or one that sees everything.
            size: width and height [pixels].
            aovs: further layers.
            samples: gathered rays a pixel.
            options: of `usdslf.render.picture.PictureOptions`.
        """
        with self._hearing():
            return render_shot(self.shot, camera, None, size, aovs, samples, **options)

    def next_dab(self, stroke: str | None = None, camera: Camera | str | None = None) -> NextDab:
        """Returns where one more dab best tells the two leading explanations of a stroke apart, after `solve`.

        Args:
            stroke: its name or path; None: the one whose explanations are nearest to each other.
            camera: on whose picture, or its path; None: the shot's first, or one that sees everything.

        Returns: a place (0..1 of the picture and in the world [stage units]), the scene-linear radiance that each
            explanation expects there, and whether one dab there decides.

        Raises: SolveError where nothing was solved, the stroke is indirect, or the camera does not see its material.
        """
        answer = self.solution.closest_call(stroke)
        view = camera if isinstance(camera, Camera) else self.camera(camera)
        shot = self.shot
        with self._hearing():
            return next_dab(answer, view, shot.scene, shot.tracer, shot.light_field, shot.light_set)

    def similarity(
        self, stroke: Stroke | Sequence[Stroke], camera: Camera | str | None = None,
        size: tuple[int, int] = (640, 360), weights: Weights | None = None,
    ) -> NDArray[np.float32]:  # fmt: skip
        """Returns a picture (h, w, 1): how similar what each pixel shows is to the dabs of a stroke, or of several.

        Args:
            stroke: one or several.
            camera: as of `render`.
            size: width and height [pixels].
            weights: of position, normal and reflectance.
        """
        strokes = [stroke] if isinstance(stroke, Stroke) else list(stroke)
        view = camera if isinstance(camera, Camera) else self.camera(camera)
        with self._hearing(), step("similarity", self._seconds):
            return similarity_of(strokes, self.shot.scene, self.shot.tracer, view, size, weights, self.warnings)

    def edited(self, look: str | os.PathLike[str]) -> Session:
        """Returns a session on the shot with a look layer over it; see `Shot.edited`."""
        with self._hearing():
            return Session(self.shot.edited(look), say=self.say)

    def reopened(self, stage: Any) -> Session:
        """Returns a session on another composition of the shot, a stage or its path; see `Shot.reopened`."""
        with self._hearing():
            return Session(self.shot.reopened(stage), say=self.say)

    def at_frame(self, frame: float) -> Session:
        """Returns a session on the shot at another frame, a time code, with the strokes; see `Shot.at_frame`."""
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

    @property
    def answers(self) -> list[Answer]:
        """What `solve` found."""
        return list(self.solution.answers)

    @answers.setter
    def answers(self, answers: Sequence[Answer]) -> None:
        self.solution = replace(self.solution, answers=tuple(answers))

    @property
    def stylized(self) -> Stylized | None:
        """What `stylize` found."""
        return self.solution.stylized

    @property
    def edits(self) -> list[AuthoredEdit]:
        """What `author` wrote."""
        return list(self.look.edits) if self.look else []

    @property
    def seconds(self) -> dict[str, float]:
        """Time of all steps so far, by name."""
        names = dict.fromkeys([*self.shot.seconds, *self._seconds])
        return {k: self.shot.seconds.get(k, 0.0) + self._seconds.get(k, 0.0) for k in names}

    def warn(self, *sentences: str) -> None:
        """Keeps warnings, `sentences`, each once."""
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
    """Opens a shot.

    Args:
        stage: path, Usd.Stage (never written to), or a Shot.
        options: frame, say, device, ocio, make_preview, elements, bounces, refine, model: see `Session`.
    """
    return Session(stage, **options)
