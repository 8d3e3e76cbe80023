"""Panel actions: what menus and keys do with what was understood, and with comparisons."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING

from hydra_viewer.ui import panel_words as words

if TYPE_CHECKING:
    from hydra_viewer.model.comparison import Comparison
    from hydra_viewer.ui.actions import Actions
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
