"""A row of buttons of which one is down: modes, scopes."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

from PySide6.QtCore import Qt
from PySide6.QtWidgets import QButtonGroup, QHBoxLayout, QToolButton, QWidget

from hydra_viewer.ui.words import tooltip


def choice_row(
    owner: QWidget, names: Sequence[str], words_of: Mapping[str, tuple[str, str]], choose: Callable[[str], object],
    keys: Mapping[str, str] | None = None,
) -> tuple[QHBoxLayout, dict[str, QToolButton]]:  # fmt: skip
    """Makes a button for each name.

    Args:
        owner: of what lets only one be down.
        words_of: text and explanation of each name.
        choose: told the name when its button is pressed.
        keys: shortcut of each name, for its tooltip.

    Returns: the row, and its buttons by name; none is down yet.
    """
    row, group = QHBoxLayout(), QButtonGroup(owner)
    row.setSpacing(2)
    buttons: dict[str, QToolButton] = {}
    for name in names:
        button = QToolButton()
        button.setText(words_of[name][0])
        button.setToolTip(tooltip(*words_of[name], keys[name] if keys else ""))
        button.setCheckable(True)
        button.setFocusPolicy(Qt.FocusPolicy.StrongFocus)
        button.clicked.connect(lambda _=False, name=name: choose(name))
        group.addButton(button)
        buttons[name] = button
        row.addWidget(button)
    row.addStretch(1)
    return row, buttons
