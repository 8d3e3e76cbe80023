"""The panel Brush: tool, mode, size, strength, colour."""

from __future__ import annotations

from PySide6.QtWidgets import QComboBox, QDoubleSpinBox, QFormLayout, QWidget

from hydra_viewer.model.document import Document
from hydra_viewer.model.easel import Easel
from usdslf import MODES, TOOLS


class BrushPanel(QWidget):
    """What the next stroke is painted with."""

    def __init__(self, document: Document, easel: Easel, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._easel = easel
        self.tool, self.mode = QComboBox(), QComboBox()
        self.tool.addItems(TOOLS)
        self.mode.addItems(MODES)
        self.radius = QDoubleSpinBox(decimals=3, minimum=0.002, maximum=0.25, singleStep=0.002)
        layout = QFormLayout(self)
        layout.addRow("Tool", self.tool)
        layout.addRow("Mode", self.mode)
        layout.addRow("Size", self.radius)
        self.tool.currentTextChanged.connect(lambda tool: easel.set_brush(tool=tool))
        self.mode.currentTextChanged.connect(lambda mode: easel.set_brush(mode=mode))
        self.radius.valueChanged.connect(lambda size: easel.set_brush(easel.brush.resized(size)))
        easel.brush_changed.connect(self._update)
        self._update()

    def _update(self) -> None:
        self.radius.setValue(self._easel.brush.radius)
