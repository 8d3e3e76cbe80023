"""Gestures: what goes on from the press of a button or a pen to its release.  A drag is one step of undo."""

from __future__ import annotations

from typing import TYPE_CHECKING, Protocol

from hydra_viewer.model.navigation import dollied, orbited, panned
from hydra_viewer.model.painting import PenPath

if TYPE_CHECKING:
    from hydra_viewer.model.easel import Easel
    from hydra_viewer.model.navigation import View

At = tuple[float, float]
DOLLY = 3.0  # doublings of the distance a picture's height
RESIZE = 2.0  # doublings of the brush a picture's height


class Gesture(Protocol):
    """A drag.  Places are x, y in pixels of the canvas."""

    def move(self, at: At, pressure: float, is_straight: bool) -> None:
        """Goes on to a place."""

    def release(self, at: At) -> None:
        """Ends there."""

    def cancel(self) -> None:
        """Ends as if nothing had been."""


class Paper(Protocol):
    """What is painted on."""

    def place(self, at: At) -> At:
        """Returns where in the picture, 0..1 from its top left, a pixel is."""

    def draw_path(self, path: PenPath | None) -> None:
        """Draws the stroke that is being painted; None: none is."""

    def finish_stroke(self, path: PenPath) -> None:
        """Makes a stroke of a path."""


class Navigate:
    """Orbit, pan or dolly: the view follows the mouse from where it was pressed."""

    def __init__(self, easel: Easel, kind: str, at: At, height: float) -> None:
        """Begins.

        Args:
            kind: orbit | pan | dolly.
            height: of the canvas [pixels].
        """
        assert easel.view is not None
        self._easel, self._kind, self._start, self._height = easel, kind, at, max(height, 1.0)
        self._view: View = easel.view

    def _moved(self, at: At) -> View:
        right, down = ((b - a) / self._height for a, b in zip(self._start, at))
        if self._kind == "orbit":
            return orbited(self._view, right, down)
        if self._kind == "pan":
            return panned(self._view, right, down)
        return dollied(self._view, DOLLY * (right - down))

    def move(self, at: At, pressure: float, is_straight: bool) -> None:
        self._easel.look_from(self._moved(at), is_moving=True)

    def release(self, at: At) -> None:
        self._easel.look_from(self._moved(at))

    def cancel(self) -> None:
        self._easel.look_from(self._view)


class Paint:
    """A stroke: raw colour while it is painted, then what was meant."""

    def __init__(self, paper: Paper, at: At, pressure: float) -> None:
        self._paper, self.path = paper, PenPath()
        self.path.add(*paper.place(at), pressure)
        paper.draw_path(self.path)

    def move(self, at: At, pressure: float, is_straight: bool) -> None:
        put = self.path.straighten if is_straight else self.path.add
        put(*self._paper.place(at), pressure)
        self._paper.draw_path(self.path)

    def release(self, at: At) -> None:
        self._paper.draw_path(None)
        self._paper.finish_stroke(self.path)

    def cancel(self) -> None:
        self._paper.draw_path(None)


class Resize:
    """The brush gets wider to the right, narrower to the left."""

    def __init__(self, easel: Easel, at: At, height: float) -> None:
        self._easel, self._start, self._height, self._brush = easel, at, max(height, 1.0), easel.brush

    def move(self, at: At, pressure: float, is_straight: bool) -> None:
        right = (at[0] - self._start[0]) / self._height
        self._easel.set_brush(self._brush.resized(self._brush.radius * 2 ** (RESIZE * right * 2)))

    def release(self, at: At) -> None:
        pass

    def cancel(self) -> None:
        self._easel.set_brush(self._brush)


class Click:
    """Does something where the pointer is, and goes on doing it while it is dragged."""

    def __init__(self, do: object, at: At) -> None:
        assert callable(do)
        self._do = do
        do(at)

    def move(self, at: At, pressure: float, is_straight: bool) -> None:
        self._do(at)

    def release(self, at: At) -> None:
        pass

    def cancel(self) -> None:
        pass
