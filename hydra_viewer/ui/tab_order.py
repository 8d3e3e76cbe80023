"""Tab order: Tab walks through a panel as the eye does, also where parts of it were made later.

    controls_of(panel)      what takes keys, in the order of the layouts
    tab_through(panel)      makes Tab go through them in this order
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import pairwise

from PySide6.QtCore import Qt
from PySide6.QtWidgets import QAbstractItemView, QAbstractSpinBox, QComboBox, QLayout, QLineEdit, QWidget

WHOLE = QAbstractItemView, QAbstractSpinBox, QComboBox, QLineEdit  # whose own parts are no controls


def controls_of(panel: QWidget) -> list[QWidget]:
    """Returns the controls of a panel that Tab comes to, from the first to the last, hidden ones too."""
    return [w for w in _below(panel) if w.focusPolicy() & Qt.FocusPolicy.TabFocus and w.focusProxy() is None]


def tab_through(panel: QWidget) -> None:
    """Makes Tab go through a panel in the order of its layouts."""
    for first, second in pairwise(controls_of(panel)):
        QWidget.setTabOrder(first, second)


def _below(widget: QWidget) -> Iterator[QWidget]:
    layout = widget.layout()
    if layout is not None and not isinstance(widget, WHOLE):
        yield from _in(layout)


def _in(layout: QLayout) -> Iterator[QWidget]:
    for number in range(layout.count()):
        item = layout.itemAt(number)
        widget, inner = (item.widget(), item.layout()) if item is not None else (None, None)
        if widget is not None:
            yield widget
            yield from _below(widget)
        elif inner is not None:
            yield from _in(inner)
