"""Stroke fields: tool, mode, scope, colour and strength of strokes that are there."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from PySide6.QtCore import QSignalBlocker, Qt, Signal
from PySide6.QtWidgets import QColorDialog, QComboBox, QDoubleSpinBox, QFormLayout, QPushButton, QWidget

from hydra_viewer.model.brush_color import linear_color, shot_color
from hydra_viewer.model.document import Document
from hydra_viewer.model.easel import Easel
from hydra_viewer.ui import panel_words, words
from hydra_viewer.ui.swatches import shown, swatch_icon
from usdslf import MODES, NORMS, SCOPES, SPACES, TOOLS, Stroke

CHOICES = {"tool": TOOLS, "mode": MODES, "scope": SCOPES, "norm": NORMS, "space": SPACES}


class StrokeFields(QWidget):
    """What selected strokes mean; where they differ nothing is said.

    Attributes:
        value_changed: Signal(str, object): a field of `Stroke` and its new value.
        color_changed: Signal(object): scene-linear.
        choices: by field.
    """

    value_changed = Signal(str, object)
    color_changed = Signal(object)

    def __init__(self, document: Document, easel: Easel, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._document, self._easel = document, easel
        self._strokes: list[Stroke] = []
        self.choices: dict[str, QComboBox] = {}
        form = QFormLayout(self)
        form.setContentsMargins(0, 4, 0, 0)
        form.setVerticalSpacing(4)
        form.setLabelAlignment(Qt.AlignmentFlag.AlignVCenter)
        for field, values in CHOICES.items():
            box = QComboBox()
            for value in values:
                known = words.TOOLS if field == "tool" else words.VALUES
                box.addItem(known[value][0], value)
            box.activated.connect(lambda _=0, f=field, b=box: self._say(f, b.currentData()))
            self.choices[field] = box
            form.addRow(panel_words.FIELDS[field], box)
        self.strength = QDoubleSpinBox(decimals=2, minimum=0.0, maximum=1.0, singleStep=0.05)
        self.strength.setKeyboardTracking(False)
        self.strength.valueChanged.connect(lambda value: self._say("strength", value))
        form.addRow(panel_words.FIELDS["strength"], self.strength)
        self.color = QPushButton(panel_words.STROKE_COLOR[0])
        self.color.setToolTip(words.tooltip(*panel_words.STROKE_COLOR, ""))
        self.color.clicked.connect(self._ask_color)
        form.addRow("", self.color)

    def show_strokes(self, strokes: Sequence[Stroke]) -> None:
        """Shows what strokes have in common."""
        self._strokes = list(strokes)
        self.setVisible(bool(strokes))
        if not strokes:
            return
        for field, box in self.choices.items():
            values = {getattr(s, field) for s in strokes}
            with QSignalBlocker(box):
                box.setCurrentIndex(box.findData(values.pop()) if len(values) == 1 else -1)
                box.setPlaceholderText(panel_words.SEVERAL)
        with QSignalBlocker(self.strength):
            self.strength.setValue(strokes[0].strength)
        self.color.setEnabled(any(s.tool == "replace" for s in strokes))
        if self._document.shot is not None:
            mean = np.mean([s.colors.mean(0) for s in strokes], 0)
            self.color.setIcon(swatch_icon(shown(mean, self._document.shot, self._easel.display)))

    def _say(self, field: str, value: object) -> None:
        if any(getattr(s, field) != value for s in self._strokes):
            self.value_changed.emit(field, value)

    def _ask_color(self) -> None:
        shot, display = self._document.shot, self._easel.display
        if shot is None or not self._strokes:
            return
        dialog = QColorDialog(shown(self._strokes[0].colors.mean(0), shot, display), self)
        dialog.setOption(QColorDialog.ColorDialogOption.DontUseNativeDialog)

        def take() -> None:
            c = dialog.currentColor()
            codes = (c.redF(), c.greenF(), c.blueF())
            self.color_changed.emit(linear_color(codes, display, shot_color(shot)))

        dialog.accepted.connect(take)
        dialog.open()
