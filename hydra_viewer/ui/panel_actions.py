"""Panel actions: what menus and keys do with what was understood, and with comparisons."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from typing import TYPE_CHECKING

from PySide6.QtCore import Qt
from PySide6.QtWidgets import QDockWidget, QScrollArea

from hydra_viewer.ui import panel_words as words
from hydra_viewer.ui.tab_order import controls_of

if TYPE_CHECKING:
    from hydra_viewer.model.comparison import Comparison
    from hydra_viewer.ui.actions import Actions
    from hydra_viewer.ui.canvas import Canvas
    from hydra_viewer.ui.compare_panel import ComparePanel
    from hydra_viewer.ui.understanding_panel import UnderstandingPanel


def add_understanding_actions(actions: Actions, panel: UnderstandingPanel) -> None:
    """Adds what is done with what was understood."""
    menu = actions.menu(words.UNDERSTANDING_MENU)
    for number in range(1, 5):
        actions.add(menu, words.choice(number), partial(panel.choose_number, number), f"Alt+{number}")
    menu.addSeparator()
    actions.add(menu, words.NEXT_DAB, panel.toggle_dab, "N")
    actions.add(menu, words.SHOW_SCOPE, panel.toggle_scope, "M")


def add_compare_actions(actions: Actions, comparison: Comparison, panel: ComparePanel) -> None:
    """Adds how the picture is compared."""
    menu = actions.menu(words.COMPARE_MENU)
    for mode in ("other", "wipe", "difference"):
        actions.add(menu, words.MODES[mode], partial(comparison.toggle, mode), words.MODE_KEYS[mode])
    menu.addSeparator()
    actions.add(menu, words.KEEP, panel.keep, "K")
    actions.add(menu, words.FLIP_ON, lambda: comparison.flip(1), "L")
    actions.add(menu, words.FLIP_BACK, lambda: comparison.flip(-1), "J")


def add_panel_actions(actions: Actions, docks: Sequence[QDockWidget], canvas: Canvas) -> None:
    """Adds ways to the picture and to each panel, by keys, and which panels are there."""
    menu = actions.menu(words.PANELS_MENU)
    actions.add(menu, words.GO_TO_PICTURE, partial(canvas.setFocus, Qt.FocusReason.ShortcutFocusReason), "F2")
    for dock in docks:
        title = dock.windowTitle()
        actions.add(menu, words.go_to(title), partial(_go_to, dock), words.PANEL_KEYS[title])
    menu.addSeparator()
    for dock in docks:
        menu.addAction(dock.toggleViewAction())


def _go_to(dock: QDockWidget) -> None:
    """Shows a panel, and gives its first control the keys."""
    dock.show()
    dock.raise_()
    area = dock.widget()
    panel = area.widget() if isinstance(area, QScrollArea) else area
    controls = controls_of(panel) if panel is not None else []
    first = next((c for c in controls if c.isVisible() and c.isEnabled()), None)
    if first is not None:
        first.setFocus(Qt.FocusReason.ShortcutFocusReason)
