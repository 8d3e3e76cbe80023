"""Viewport: the interface of whatever shows the picture of the shot.

A viewport is a widget that shows what a camera sees, and nothing else.  Mouse, pen and keys, strokes, the brush, masks
and marks are the canvas's (canvas.py), which lies over it and is the same for all of them.

The picture fills the widget: where its shape differs from the camera's film, the shorter side of the film is widened,
as `usdslf` and UsdRender's `expandAperture` do.  A place (x, y) of the picture is 0..1 from the top left of the widget.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

from numpy.typing import NDArray
from PySide6.QtCore import SignalInstance
from PySide6.QtWidgets import QWidget

from hydra_viewer.model.display import DisplaySettings
from hydra_viewer.model.found import Found
from usdslf import Camera, Shot


@dataclass(frozen=True, eq=False)
class Shown:
    """What a viewport shows.

    Attributes:
        shot: as its files have it.
        edited: with the look over it; the same as `shot` without one.
        look: path of the look layer that is over it, composed as the strongest opinion, "" without one.  Its content
            changes from one to the next, its path too.
        is_lit: the light field of `edited` is made; False: it would have to be, and comes next.
    """

    shot: Shot
    edited: Shot
    look: str = ""
    is_lit: bool = True

    @staticmethod
    def of(shot: Shot, found: Found | None) -> Shown:
        """Returns what was found over a shot; None, or what has no shot yet: the shot without a look."""
        if found is None or found.shot is None:
            return Shown(shot, shot)
        return Shown(shot, found.shot, found.look.path if found.look else "", found.is_lit)

    @property
    def is_ahead(self) -> bool:
        """Whether `edited` is under a look that is not written yet: no stage shows it."""
        return not self.look and self.edited is not self.shot


class Viewport(Protocol):
    """Shows what a camera sees.  Made on the main thread, and called on it; no call takes longer than 20 ms there."""

    @property
    def widget(self) -> QWidget:
        """The widget; mouse and keys do not reach it."""

    @property
    def changed(self) -> SignalInstance:
        """Signal(): another picture is shown, or a better one."""

    @property
    def failed(self) -> SignalInstance:
        """Signal(str): why no picture can be shown, a sentence for the error bar."""

    @property
    def noted(self) -> SignalInstance:
        """Signal(str): what people should know of the picture, a sentence."""

    @property
    def progress(self) -> SignalInstance:
        """Signal(float): how far the picture is, 0..1; 1: it gets no better."""

    @property
    def shown(self) -> Shown | None:
        """What the picture on the screen is of; None: there is none yet."""

    def show_shot(self, shown: Shown | None) -> None:
        """Shows a shot, or another state of the one that it shows; None: nothing."""

    def let_go(self) -> None:
        """Gives back the stage of the shot, which is to be read anew; the picture stays until another shot comes."""

    @property
    def holds_stage(self) -> bool:
        """Whether a thread of it may be reading the stage of the shot."""

    def set_camera(self, camera: Camera, is_moving: bool) -> None:
        """Looks through a camera.

        Args:
            camera: relative to `Scene.origin` of the shot.
            is_moving: more will follow at once; a coarse picture will do.
        """

    def set_display(self, display: DisplaySettings) -> None:
        """Brings pixels to the screen in a way."""

    def hold(self, is_held: bool) -> None:
        """Leaves the processor to work that somebody waits for: the picture gets no better until it is let go."""

    def pixels(self) -> NDArray | None:
        """Returns what is shown (h, w, 3), scene-linear in the working space, of any size; None: nothing yet."""

    def stop(self) -> None:
        """Ends its threads after what they are about, and gives back what it holds; waits for nothing."""

    def finish(self) -> None:
        """Stops before the window goes, and waits for threads that nobody else waits for."""


@dataclass(frozen=True)
class ViewportKind:
    """A kind of viewport, as the window's menu lists it.

    Attributes:
        name: of the menu's entry.
        make: returns a new one, a child of a widget.
        why_not: a sentence where it cannot be used here; "" where it can.
        needs_look: it shows nothing of what was found until the look is written.
    """

    name: str
    make: Callable[[QWidget], Viewport]
    why_not: str = ""
    needs_look: bool = False
