"""Lists whose keys are their own while they have the focus, whatever shortcuts the window has for them."""

from __future__ import annotations

from PySide6.QtCore import QEvent, Qt
from PySide6.QtGui import QKeyEvent
from PySide6.QtWidgets import QListWidget, QTreeWidget


class _OwnKeys:
    """The first base of a list.

    Attributes:
        own_keys: that it handles itself.
    """

    own_keys: tuple[Qt.Key, ...] = ()

    def event(self, event: QEvent) -> bool:
        """Takes its keys before the window's shortcuts do."""
        is_asked = event.type() == QEvent.Type.ShortcutOverride
        if is_asked and isinstance(event, QKeyEvent) and event.key() in self.own_keys:
            event.accept()
            return True
        return bool(super().event(event))  # type: ignore[misc]  # the widget's


class KeyList(_OwnKeys, QListWidget):
    """A list with keys of its own."""


class KeyTree(_OwnKeys, QTreeWidget):
    """A tree with keys of its own."""
