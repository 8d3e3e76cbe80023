"""Viewports: the kinds that can be used here, and the menu that changes from one to another while all goes on."""

from __future__ import annotations

from functools import cache

from PySide6.QtGui import QAction, QActionGroup
from PySide6.QtWidgets import QMenu, QWidget

from hydra_viewer.ui import words
from hydra_viewer.ui.canvas import Canvas
from hydra_viewer.ui.live_viewport import LIVE
from hydra_viewer.ui.viewport import Viewport, ViewportKind
from usdslf import choose_pxr


@cache
def viewport_kinds() -> tuple[ViewportKind, ...]:
    """Returns the built-in viewport, then Hydra by each installed render delegate, or why there is no Hydra."""
    choice = choose_pxr()
    if not choice.has_imaging:
        return LIVE, ViewportKind(words.HYDRA, _none, choice.sentence)
    try:
        from hydra_viewer.ui.hydra_viewport import hydra_kinds
    except ImportError as error:  # a library of the system that it needs
        return LIVE, ViewportKind(words.HYDRA, _none, words.no_hydra(choice.sentence, error))
    return LIVE, *hydra_kinds()


def _none(parent: QWidget) -> Viewport:
    raise AssertionError("a viewport that cannot be used was asked for")


class ViewportMenu(QMenu):
    """Lists the kinds of viewports; what cannot be used is there with the reason."""

    def __init__(self, canvas: Canvas, parent: QWidget | None = None) -> None:
        """Lists them.

        Args:
            canvas: whose viewport is changed.
            parent: as QMenu.
        """
        super().__init__(words.VIEWPORT, parent)
        self.setToolTipsVisible(True)
        self._canvas = canvas
        group = QActionGroup(self)
        for number, kind in enumerate(viewport_kinds(), start=1):
            action = self._action(kind, f"Ctrl+{number}")
            action.setChecked(kind is canvas.kind)
            group.addAction(action)
            self.addAction(action)

    def _action(self, kind: ViewportKind, key: str) -> QAction:
        action = QAction(kind.name, self)
        action.setCheckable(True)
        action.setEnabled(not kind.why_not)
        action.setShortcut(key)
        action.setToolTip(kind.why_not or words.tooltip(kind.name, words.VIEWPORT_TIP, key))
        action.triggered.connect(lambda _=False: self._canvas.use_viewport(kind))
        return action
