"""A row of buttons of which one is down: modes, scopes."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

from PySide6.QtCore import QEvent, Qt
from PySide6.QtGui import QEnterEvent, QFocusEvent
from PySide6.QtWidgets import QButtonGroup, QHBoxLayout, QToolButton, QWidget

from hydra_viewer.ui.words import tooltip


class _Choice(QToolButton):
    """A button that tells when it is looked at: pointed at, or with the focus."""

    def __init__(self, name: str, look_at: Callable[[str], object]) -> None:
        super().__init__()
        self._name, self._look_at = name, look_at

    def enterEvent(self, event: QEnterEvent) -> None:
        super().enterEvent(event)
        self._look_at(self._name)

    def leaveEvent(self, event: QEvent) -> None:
        super().leaveEvent(event)
        self._look_at("")

    def focusInEvent(self, event: QFocusEvent) -> None:
        super().focusInEvent(event)
        self._look_at(self._name)

    def focusOutEvent(self, event: QFocusEvent) -> None:
        super().focusOutEvent(event)
        self._look_at("")


def choice_row(
    owner: QWidget, names: Sequence[str], words_of: Mapping[str, tuple[str, str]], choose: Callable[[str], object],
    keys: Mapping[str, str] | None = None, look_at: Callable[[str], object] | None = None,
) -> tuple[QHBoxLayout, dict[str, QToolButton]]:  # fmt: skip
    """Makes a button for each name.

    Args:
        owner: of what lets only one be down.
        words_of: text and explanation of each name.
        choose: told the name when its button is pressed.
        keys: shortcut of each name, for its tooltip.
        look_at: told the name that is pointed at or has the focus, "" when none is any more.

    Returns: the row, and its buttons by name; none is down yet.
    """
    row, group = QHBoxLayout(), QButtonGroup(owner)
    row.setSpacing(2)
    buttons: dict[str, QToolButton] = {}
    for name in names:
        button = _Choice(name, look_at) if look_at else QToolButton()
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
