"""Easel: what an artist works with: brush, view, display, and what is drawn over the picture."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from hydra_viewer.model.announcer import Announcer
from hydra_viewer.model.brush import Brush
from hydra_viewer.model.display import DisplaySettings
from hydra_viewer.model.navigation import View

POINTERS = ("paint", "select", "eyedropper")  # what a click does
DRAWN = ("outline", "paint", "hidden")  # how strokes are drawn over the picture


class Easel:
    """Brush, view and display, and whom to tell when they change.

    Attributes:
        brush: what the next stroke is painted with.
        view: what is looked through; None: nothing is open.
        is_moving: the view is being moved.
        display: how pixels are brought to the screen.
        pointer: one of POINTERS.
        drawn: one of DRAWN.
        has_gate: the frame of the camera's film is drawn.
        brush_changed, view_changed, display_changed, drawn_changed: whom to tell.
    """

    def __init__(self) -> None:
        self.brush = Brush()
        self.view: View | None = None
        self.is_moving = False
        self.display = DisplaySettings()
        self.pointer, self.drawn, self.has_gate = "paint", "outline", False
        self.brush_changed, self.view_changed = Announcer(), Announcer()
        self.display_changed, self.drawn_changed = Announcer(), Announcer()

    def set_brush(self, brush: Brush | None = None, **values: Any) -> None:
        """Takes another brush, or changes attributes of it."""
        changed = replace(brush or self.brush, **values)
        if changed != self.brush:
            self.brush = changed
            self.brush_changed()

    def take_tool(self, tool: str) -> None:
        """Takes a tool in hand; a click paints with it."""
        self.set_brush(tool=tool)
        self.draw(pointer="paint")

    def look_from(self, view: View | None, is_moving: bool = False) -> None:
        """Looks through another camera.

        Args:
            view: what is looked through.
            is_moving: more will follow at once.
        """
        self.view, self.is_moving = view, is_moving
        self.view_changed()

    def set_display(self, **values: Any) -> None:
        """Changes how pixels are brought to the screen."""
        changed = replace(self.display, **values)
        if changed != self.display:
            self.display = changed
            self.display_changed()

    def draw(self, **values: Any) -> None:
        """Changes `pointer`, `drawn` or `has_gate`."""
        for name, value in values.items():
            assert name in ("pointer", "drawn", "has_gate"), name
            setattr(self, name, value)
        self.drawn_changed()
