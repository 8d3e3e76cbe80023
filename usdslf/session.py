"""Session: the page of verbs that scripts know.

    usdslf.open(stage) -> Session;  .add_stroke .solve .stylize .author .render .report .edited .at_frame

What it does is done by shot.py, solution.py, look.py and hints.py, which a viewer or a server uses instead.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from usdslf.hints import find_next_dab, similarity_to
from usdslf.inference.answers import Answer
from usdslf.inference.next_dab import NextDab
from usdslf.inference.weights import Options
from usdslf.look import PathLike, author
from usdslf.pictures import render_shot
from usdslf.progress import Say, step
from usdslf.scene.records import F32, Camera
from usdslf.session_state import SessionState
from usdslf.shot import Shot
from usdslf.similarity.similarity import Weights
from usdslf.solution import Settings, Solution, check_stroke, find_solution, find_style
from usdslf.strokes.stroke import Stroke
from usdslf.stylize.unsharp_mask import AMOUNT, RADIUS, Stylized
from usdslf.usd.layer.wins import AuthoredEdit
from usdslf.viewing import view_shot


class Session(SessionState):
    """A shot, the strokes on it and what they ask for.  What the Shot has is found here too."""

    def __init__(self, stage: Any, frame: float | None = None, say: Say | None = None, **options: Any) -> None:
        """Opens a shot, a path, a Usd.Stage (never written to) or a Shot; steps run when they are first needed.

        Args:
            stage, frame, options: as of `Shot.open`; time code; device, ocio, make_preview, elements, ... as there.
            say: told the name of a step and how much of it is done, 0..1; what it raises ends the step.
        """
        if isinstance(stage, Shot) and (frame is not None or options):
            raise TypeError("a Shot has its frame and options already; open its `source` with others")
        super().__init__(stage if isinstance(stage, Shot) else Shot.open(stage, frame, **options), say)
        self.strokes: list[Stroke] = []

    def add_stroke(self, stroke: Stroke) -> None:
        """Adds a stroke, or replaces the one of the same name.  Raises: StrokeError, see `check_stroke`."""
        check_stroke(stroke)
        self.remove_stroke(stroke.name)
        self.strokes.append(stroke)

    def remove_stroke(self, name: str) -> None:
        """Takes the stroke of a name away; what was found is dropped."""
        self.strokes = [s for s in self.strokes if s.name != name]
        self.solution, self.look = Solution(stylized=self.stylized), None

    def solve(
        self, norm: str | None = None, choose: Mapping[str, str] | None = None, options: Options | None = None,
        similarity: Weights | None = None,
    ) -> list[Answer]:  # fmt: skip
        """Finds the smallest change that explains the strokes; returns the answers.  Source: see `usdslf.solve`.

        Args:
            norm, choose, options, similarity: as `norm`, `choose`, `weights` and `similarity` of `usdslf.Settings`.
        """
        with self.hearing():
            settings = Settings(norm, dict(choose or {}), options, similarity)
            self.keep(find_solution(self.shot, self.strokes, settings))
        return self.answers

    def stylize(self, amount: float = AMOUNT, radius: float = RADIUS, norm: str = "mixed") -> Stylized:
        """Unsharp masks the light field of the whole shot; returns what it found.  Source: see `usdslf.stylize_shot`.

        Args:
            amount, radius, norm: contrast that is added; as a fraction of the scene's diagonal; l0 | mixed | l2.
        """
        with self.hearing():
            self.keep(find_style(self.shot, amount, radius, norm))
        assert self.stylized is not None
        return self.stylized

    def author(
        self, path: PathLike, strokes_path: PathLike | None = None, review_root: PathLike | None = None, mode: str = "",
        alternatives: int = 0,
    ) -> list[AuthoredEdit]:  # fmt: skip
        """Writes what was found as a look layer; returns its edits.

        Args:
            path, strokes_path, review_root, mode, alternatives: as of `usdslf.author`, which also says what is raised.
        """
        with self.hearing():
            self.keep(author(self.shot, self.solution, path, strokes_path, review_root, mode, alternatives))
        return self.edits

    def camera(self, path: str | None = None) -> Camera:
        """Returns the camera of a path, by default the first one, or one that sees everything; see `Shot.camera`."""
        with self.hearing():
            return self.shot.camera(path)

    def render(
        self, camera: Camera | str | None = None, size: tuple[int, int] = (640, 360), aovs: tuple[str, ...] = (),
        samples: int = 16, **options: Any,
    ) -> dict[str, F32]:  # fmt: skip
        """Returns pictures (h, w, c) of the shot as it is, by name, `color` first.

        Args:
            camera, size, aovs, samples, options: as of `usdslf.render_shot`; size is in pixels.
        """
        with self.hearing():
            return render_shot(self.shot, camera, None, size, aovs, samples, **options)

    def next_dab(self, stroke: str | None = None, camera: Camera | str | None = None) -> NextDab:
        """Returns where one more dab decides between the explanations of a stroke; see `hints.find_next_dab`.

        Args:
            stroke, camera: name or path of each; None: the stroke that is least sure, the first camera.
        """
        with self.hearing():
            return find_next_dab(self.shot, self.solution, stroke, camera)

    def similarity(
        self, stroke: Stroke | Sequence[Stroke], camera: Camera | str | None = None,
        size: tuple[int, int] = (640, 360), weights: Weights | None = None,
    ) -> F32:  # fmt: skip
        """Returns a picture (h, w, 1): how similar what each pixel shows is to the dabs of a stroke, or of several.

        Args:
            stroke, camera, size, weights: as of `hints.similarity_to`; size is in pixels.
        """
        with self.hearing(), step("similarity", self.own_seconds):
            return similarity_to(self.shot, stroke, camera, size, weights, self.warnings)

    def view(self) -> None:
        """Shows the shot and the strokes in the viewer until its window is closed; what is painted there is kept."""
        strokes, solution = view_shot(self.shot, self.strokes)
        self.strokes = list(strokes)
        self.keep(solution)

    def at_frame(self, frame: float) -> Session:
        """Returns a session on the shot at another frame, a time code, with the strokes; see `Shot.at_frame`."""
        with self.hearing():
            other = Session(self.shot.at_frame(frame), say=self.say)
        other.strokes = list(self.strokes)
        return other


def open(stage: Any, **options: Any) -> Session:
    """Opens a shot; returns a session on it.

    Args:
        stage, options: as of `Session`.
    """
    return Session(stage, **options)
