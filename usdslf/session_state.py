"""The state of a session: a Shot, the last Solution and Look that are whole, and what was said of all of them."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from typing import Any, Generic, Self, TypeVar

from usdslf.edits.edits import MaterialChange
from usdslf.inference.answers import Answer
from usdslf.lazy import Lazy
from usdslf.look import Look, PathLike
from usdslf.progress import Say, hearing
from usdslf.report import report_of
from usdslf.shot import Shot
from usdslf.solution import Solution
from usdslf.stylize.unsharp_mask import Stylized
from usdslf.usd.layer.wins import AuthoredEdit

Value = TypeVar("Value")


class _OfShot(Generic[Value]):
    """What the Shot of a session has, found on the session."""

    def __init__(self, lazy: Lazy[Value] | None = None) -> None:
        """Takes the type from what is made at first use."""

    def __set_name__(self, owner: type, name: str) -> None:
        self._name = name

    def __get__(self, state: SessionState | None, owner: type) -> Value:
        if state is None:
            raise AttributeError(self._name)
        with state.hearing():
            found: Value = getattr(state.shot, self._name)
            return found


class SessionState:
    """A Shot, what was found and written of it, and what was said meanwhile.  What the Shot has is found here too."""

    stage, source, made, ocio = _OfShot[Any](), _OfShot[Any](), _OfShot[Any](), _OfShot[str | None]()
    frame, element_count, bounces = _OfShot[float | None](), _OfShot[int](), _OfShot[int]()
    refine, model = _OfShot[int](), _OfShot[str]()
    scene, device, tracer = _OfShot(Shot.scene), _OfShot(Shot.device), _OfShot(Shot.tracer)
    lights, light_set, fixed_light = _OfShot(Shot.lights), _OfShot(Shot.light_set), _OfShot(Shot.fixed_light)
    elements, lookup, visibility = _OfShot(Shot.elements), _OfShot(Shot.lookup), _OfShot(Shot.visibility)
    dark_probes, light_field = _OfShot(Shot.dark_probes), _OfShot(Shot.light_field)

    def __init__(self, shot: Shot, say: Say | None) -> None:
        """Begins with nothing found.

        Args:
            shot: it may have said something already.
            say: told the name of a step and how much of it is done, 0..1; what it raises ends the step.
        """
        self.shot, self.say = shot, say
        self.warnings: list[str] = []
        self.own_seconds: dict[str, float] = {}  # of steps that are not the shot's
        self.solution = Solution()
        self.look: Look | None = None
        self._heard = 0  # of the shot's warnings
        with self.hearing():
            pass

    @contextmanager
    def hearing(self) -> Iterator[None]:
        """Passes on what is told within the block, and the shot's warnings; yields nothing."""
        try:
            with hearing(lambda p: self.say(p.step, p.share) if self.say else None):
                yield
        finally:
            heard, self._heard = self.shot.warnings[self._heard :], len(self.shot.warnings)
            self.warn(*heard)

    def warn(self, *sentences: str) -> None:
        """Keeps warnings, `sentences`, each once."""
        self.warnings += [s for s in dict.fromkeys(sentences) if s not in self.warnings]

    def keep(self, found: Solution | Look) -> None:
        """Keeps what was found, or what was written, with what was said of it, and the time that it took."""
        self.solution = found.solution if isinstance(found, Look) else found
        self.look = found if isinstance(found, Look) else None
        self.warn(*found.warnings)
        for name, spent in found.seconds.items():
            self.own_seconds[name] = self.own_seconds.get(name, 0.0) + spent

    def edited(self, look: PathLike) -> Self:
        """Returns a session on the shot with a look layer over it; see `Shot.edited`."""
        with self.hearing():
            return type(self)(self.shot.edited(look), say=self.say)

    def reopened(self, stage: Any) -> Self:
        """Returns a session on another composition of the shot, a stage or its path; see `Shot.reopened`."""
        with self.hearing():
            return type(self)(self.shot.reopened(stage), say=self.say)

    def changes(self, mode: str = "") -> list[MaterialChange]:
        """Returns what was found as changes of materials; `mode` as of `Solution.changes`."""
        with self.hearing():
            return self.solution.changes(self.shot, mode)

    def report(self) -> dict[str, Any]:
        """Returns what was inferred, as JSON-ready values (DESIGN: the report of solve)."""
        with self.hearing():
            found = report_of(self.shot, self.solution, self.look)
        return found | {"warnings": list(self.warnings), "seconds": {k: round(v, 4) for k, v in self.seconds.items()}}

    @property
    def seconds(self) -> dict[str, float]:
        """Time of all steps so far, by name."""
        names = dict.fromkeys([*self.shot.seconds, *self.own_seconds])
        return {k: self.shot.seconds.get(k, 0.0) + self.own_seconds.get(k, 0.0) for k in names}

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
