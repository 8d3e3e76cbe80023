"""Actions: what menus and keys do, in one table a menu."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from PySide6.QtGui import QAction, QKeySequence
from PySide6.QtWidgets import QMenu

from hydra_viewer.model.brush import STEP
from hydra_viewer.model.easel import DRAWN, POINTERS
from hydra_viewer.ui import words
from hydra_viewer.ui.icons import icon
from usdslf import TOOLS

if TYPE_CHECKING:
    from PySide6.QtWidgets import QMainWindow

    from hydra_viewer.model.easel import Easel
    from hydra_viewer.ui.painting_widget import PaintingWidget

Key = QKeySequence.StandardKey | str


@dataclass
class Actions:
    """Actions of a window, by menu.

    Attributes:
        window: that they belong to.
        menus: name, and actions, of each.
        by_name: the words of an action -> it.
    """

    window: QMainWindow
    menus: list[tuple[str, list[QAction]]] = field(default_factory=list)
    by_name: dict[str, QAction] = field(default_factory=dict)

    def menu(self, name: str) -> QMenu:
        """Adds a menu; actions go into it until there is another."""
        self.menus.append((name, []))
        return self.window.menuBar().addMenu(name)

    def add(self, menu: QMenu, words_of: tuple[str, str], do: Callable[[], object], key: Key | None = None) -> QAction:
        """Adds an action with its shortcut in its tooltip; returns it.

        Args:
            menu: that it goes into.
            words_of: its name, and what its tooltip adds.
            do: what it does.
            key: its shortcut; None: none.
        """
        action = QAction(words_of[0], self.window)
        if key is not None:
            action.setShortcut(QKeySequence(key))
        tip = words.tooltip(*words_of, action.shortcut().toString(QKeySequence.SequenceFormat.NativeText))
        action.setToolTip(tip)
        action.setStatusTip(words_of[1])
        action.triggered.connect(lambda _=False: do())
        menu.addAction(action)
        self.menus[-1][1].append(action)
        self.by_name[words_of[0]] = action
        return action

    def list_too(self, made: Sequence[QAction]) -> None:
        """Lists actions of the last menu that were made elsewhere."""
        self.menus[-1][1].extend(made)


def add_paint_actions(actions: Actions, easel: Easel) -> None:
    """Adds what the brush does."""
    menu = actions.menu(words.PAINT)
    for pointer in POINTERS:
        added = actions.add(
            menu, words.POINTERS[pointer], _later(easel.draw, pointer=pointer), words.POINTER_KEYS[pointer]
        )
        added.setIcon(icon(pointer))
    menu.addSeparator()
    for tool in TOOLS:
        put = _later(easel.take_tool, tool=tool)
        actions.add(menu, words.TOOLS[tool], put, words.TOOL_KEYS[tool]).setIcon(icon(tool))
    menu.addSeparator()
    resize = lambda factor: easel.set_brush(easel.brush.resized(easel.brush.radius * factor))  # noqa: E731
    actions.add(menu, words.WIDER, lambda: resize(STEP), "]")
    actions.add(menu, words.NARROWER, lambda: resize(1 / STEP), "[")


def add_camera_actions(actions: Actions, painting: PaintingWidget) -> None:
    """Adds what the camera does."""
    menu, easel = actions.menu(words.CAMERA), painting.easel
    actions.add(menu, words.FRAME, painting.frame_selected, "F")
    actions.add(menu, words.FRAME_ALL, painting.frame_all, "A")
    actions.add(menu, words.THROUGH, lambda: painting.look_through(None), "0")
    actions.add(menu, words.GATE, lambda: easel.draw(has_gate=not easel.has_gate), "G")


def add_view_actions(actions: Actions, easel: Easel) -> QMenu:
    """Adds how the picture is shown; returns the menu."""
    menu = actions.menu(words.VIEW)
    after = lambda: DRAWN[(DRAWN.index(easel.drawn) + 1) % len(DRAWN)]  # noqa: E731
    actions.add(menu, words.NEXT_DRAWN, lambda: easel.draw(drawn=after()), "S")
    return menu


def _later(do: Callable[..., Any], **values: Any) -> Callable[[], Any]:
    return lambda: do(**values)
