"""The panel Brush: tool, mode, size, strength, colour, and how far the change may go."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from PySide6.QtCore import QSize, Qt
from PySide6.QtWidgets import (
    QButtonGroup,
    QCheckBox,
    QComboBox,
    QDoubleSpinBox,
    QFormLayout,
    QGridLayout,
    QHBoxLayout,
    QLabel,
    QSizePolicy,
    QSlider,
    QToolButton,
    QVBoxLayout,
    QWidget,
)

from hydra_viewer.model.brush import LEAST, MOST, PALETTE, Rgb
from hydra_viewer.model.brush_color import linear_color, shot_color, shown_colors
from hydra_viewer.model.document import Document
from hydra_viewer.model.easel import Easel
from hydra_viewer.ui import words
from hydra_viewer.ui.color_picker import ColorPicker, Swatches
from hydra_viewer.ui.icons import icon
from hydra_viewer.ui.tab_order import tab_through
from usdslf import MODES, NORMS, SCOPES, SPACES, TOOLS

PER_ROW = 4


class ToolButtons(QWidget):
    """One button a tool, of which one is down."""

    def __init__(self, easel: Easel, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._group = QButtonGroup(self)
        self.buttons: dict[str, QToolButton] = {}
        grid = QGridLayout(self)
        grid.setContentsMargins(0, 0, 0, 0)
        grid.setSpacing(2)
        for n, tool in enumerate(TOOLS):
            button = QToolButton()
            button.setCheckable(True)
            button.setIcon(icon(tool))
            button.setIconSize(QSize(20, 20))
            button.setText(words.TOOLS[tool][0])
            button.setToolButtonStyle(Qt.ToolButtonStyle.ToolButtonTextUnderIcon)
            button.setSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Fixed)
            button.setToolTip(words.tooltip(*words.TOOLS[tool], words.TOOL_KEYS[tool]))
            button.setAccessibleName(words.TOOLS[tool][0])
            button.clicked.connect(lambda _=False, tool=tool: easel.take_tool(tool))
            self._group.addButton(button)
            self.buttons[tool] = button
            grid.addWidget(button, n // PER_ROW, n % PER_ROW)

    def show_tool(self, tool: str) -> None:
        """Shows which one is in hand."""
        self.buttons[tool].setChecked(True)


class Share(QWidget):
    """A slider with its number."""

    def __init__(self, ends: tuple[float, float], digits: int, set_value: Callable[[float], None]) -> None:
        super().__init__()
        self._ends, self._set = ends, set_value
        self._slider, self.box = QSlider(Qt.Orientation.Horizontal), QDoubleSpinBox()
        self._slider.setRange(0, 1000)
        self._slider.setFocusPolicy(Qt.FocusPolicy.NoFocus)  # the number beside it takes keys
        self.box.setDecimals(digits)
        self.box.setRange(*ends)
        self.box.setSingleStep(10.0**-digits * 2)
        self.box.setFixedWidth(70)
        layout = QHBoxLayout(self)
        layout.setContentsMargins(0, 0, 0, 0)
        layout.addWidget(self._slider, 1)
        layout.addWidget(self.box)
        self._slider.sliderMoved.connect(lambda n: self._set(ends[0] + (ends[1] - ends[0]) * (n / 1000) ** 2))
        self.box.editingFinished.connect(lambda: self._set(self.box.value()))

    def show_value(self, value: float) -> None:
        """Shows a value."""
        low, high = self._ends
        self._slider.setValue(round(1000 * max((value - low) / (high - low), 0.0) ** 0.5))
        self.box.setValue(value)


class BrushPanel(QWidget):
    """What the next stroke is painted with."""

    def __init__(self, document: Document, easel: Easel, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._document, self._easel = document, easel
        self.tools = ToolButtons(easel)
        self.radius = Share((LEAST, MOST), 3, lambda v: easel.set_brush(easel.brush.resized(v)))
        self.strength = Share((0.0, 1.0), 2, lambda v: easel.set_brush(strength=v))
        self.picker, self.linear = ColorPicker(), QLabel()
        self.recent, self.palette_row = Swatches(), Swatches()
        self.pressure = QCheckBox(words.PRESSURE[0])
        self.pressure.setToolTip(words.PRESSURE[1])
        self.hint = QLabel()
        self.hint.setWordWrap(True)
        self.choices = {
            "mode": self._choice("mode", MODES), "scope": self._choice("scope", SCOPES),
            "norm": self._choice("norm", NORMS), "space": self._choice("space", SPACES),
        }  # fmt: skip
        self.palette_row.show_colors(PALETTE, [""] * len(PALETTE))  # there before a shot is, which is to be quick
        self._lay_out()
        self.picker.picked.connect(self._on_picked)
        self.recent.taken.connect(lambda n: self._take(self._easel.brush.recent, n))
        self.palette_row.taken.connect(lambda n: self._take(PALETTE, n))
        self.pressure.toggled.connect(lambda on: easel.set_brush(uses_pressure=on))
        for announcer in (easel.brush_changed, easel.display_changed, document.shot_changed):
            announcer.connect(self._update)
        self._update()

    def _lay_out(self) -> None:
        layout, form, more = QVBoxLayout(self), QFormLayout(), QFormLayout()
        for each in (form, more):
            each.setLabelAlignment(Qt.AlignmentFlag.AlignVCenter)
            each.setFieldGrowthPolicy(QFormLayout.FieldGrowthPolicy.AllNonFixedFieldsGrow)
        for name, share in ((words.SIZE, self.radius), (words.STRENGTH, self.strength)):
            label = QLabel(name)
            label.setBuddy(share.box)  # no focus proxy: with one Tab would come back to the number, again and again
            form.addRow(label, share)
        for name, box in self.choices.items():
            more.addRow(words.CHOICES[name][0], box)
        layout.addWidget(self.tools)
        layout.addWidget(self.hint)
        layout.addLayout(form)
        layout.addWidget(self.pressure)
        for part in (self.picker, self.linear, self.palette_row, self.recent):
            layout.addWidget(part)
        layout.addLayout(more)
        layout.addStretch(1)

    def _choice(self, name: str, values: Sequence[str]) -> QComboBox:
        box = QComboBox()
        for value in values:
            box.addItem(words.VALUES.get(value, (value, ""))[0], value)
            box.setItemData(box.count() - 1, words.VALUES.get(value, ("", ""))[1], Qt.ItemDataRole.ToolTipRole)
        box.setToolTip(words.CHOICES[name][1])
        box.activated.connect(lambda n, name=name, box=box: self._easel.set_brush(**{name: box.itemData(n)}))
        return box

    def _update(self) -> None:
        brush, shot = self._easel.brush, self._document.shot
        self.tools.show_tool(brush.tool)
        self.radius.show_value(brush.radius)
        self.strength.show_value(brush.strength)
        self.pressure.setChecked(brush.uses_pressure)
        for name, box in self.choices.items():
            box.setCurrentIndex(box.findData(getattr(brush, name)))
        self.hint.setText(words.HINTS.get(brush.tool, ""))
        self.hint.setVisible(brush.tool in words.HINTS)
        is_colored = brush.tool == "replace"
        for each in (self.picker, self.linear, self.recent, self.palette_row):
            each.setEnabled(is_colored and shot is not None)
        if shot is not None:
            colors = (brush.color, *brush.recent, *PALETTE)
            shown = shown_colors(colors, self._easel.display, shot_color(shot)).tolist()
            self.linear.setText(words.scene_linear(brush.color))
            if not self.picker.isAncestorOf(self.focusWidget() or self):
                self.picker.show_color((shown[0][0], shown[0][1], shown[0][2]))
            n = len(brush.recent)
            more = self.recent.show_colors(shown[1 : n + 1], [words.scene_linear(c) for c in brush.recent])
            if self.palette_row.show_colors(shown[n + 1 :], [words.scene_linear(c) for c in PALETTE]) or more:
                tab_through(self)

    def _on_picked(self, code: tuple[float, float, float]) -> None:
        shot = self._document.shot
        if shot is not None:
            self._easel.set_brush(color=linear_color(code, self._easel.display, shot_color(shot)))

    def _take(self, colors: Sequence[Rgb], number: int) -> None:
        if number < len(colors):
            self._easel.set_brush(color=colors[number])
