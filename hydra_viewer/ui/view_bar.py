"""View bar: above the picture: what a click does, the camera, how strokes are drawn, exposure and gamma."""

from __future__ import annotations

from PySide6.QtCore import QSize, Qt
from PySide6.QtWidgets import QComboBox, QDoubleSpinBox, QHBoxLayout, QLabel, QToolButton, QWidget

from hydra_viewer.model.document import Document
from hydra_viewer.model.easel import DRAWN, POINTERS
from hydra_viewer.ui import words
from hydra_viewer.ui.display_menu import DisplayMenu
from hydra_viewer.ui.icons import icon
from hydra_viewer.ui.painting_widget import PaintingWidget


class ViewBar(QWidget):
    """Controls of the picture."""

    def __init__(self, painting: PaintingWidget, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._painting, self._easel = painting, painting.easel
        self.pointers = {name: self._pointer(name) for name in POINTERS}
        self.camera, self.drawn = QComboBox(), QComboBox()
        self.camera.setMinimumWidth(130)
        self.camera.setSizeAdjustPolicy(QComboBox.SizeAdjustPolicy.AdjustToMinimumContentsLengthWithIcon)
        self.camera.setToolTip(words.CAMERA_TIP)
        self.drawn.setToolTip(words.DRAWN_TIP)
        self.drawn.setMinimumWidth(105)
        self.drawn.setSizeAdjustPolicy(QComboBox.SizeAdjustPolicy.AdjustToMinimumContentsLengthWithIcon)
        for way in DRAWN:
            self.drawn.addItem(words.DRAWN[way], way)
        self.gate = QToolButton()
        self.gate.setCheckable(True)
        self.gate.setIcon(icon("gate"))
        self.gate.setToolTip(words.tooltip(*words.GATE, "G"))
        self.display_menu = DisplayMenu(painting.document, painting.easel, self)
        self.display = QToolButton()
        self.display.setMenu(self.display_menu)
        self.display.setPopupMode(QToolButton.ToolButtonPopupMode.InstantPopup)
        self.display.setMaximumWidth(190)
        self.display_menu.named.connect(self._name_display)
        self.exposure = self._number(words.EXPOSURE, (-12.0, 12.0), lambda v: self._easel.set_display(exposure=v))
        self.gamma = self._number(words.GAMMA, (0.1, 5.0), lambda v: self._easel.set_display(gamma=v))
        layout = QHBoxLayout(self)
        layout.setContentsMargins(6, 3, 6, 3)
        for each in (*self.pointers.values(), self.camera, self.gate, self.drawn):
            layout.addWidget(each)
        layout.addStretch(1)
        layout.addWidget(self.display)
        for label, box in ((words.EXPOSURE[0], self.exposure), (words.GAMMA[0], self.gamma)):
            layout.addWidget(QLabel(label))
            layout.addWidget(box)
        self.camera.activated.connect(self._on_camera_chosen)
        self.drawn.activated.connect(lambda n: self._easel.draw(drawn=self.drawn.itemData(n)))
        self.gate.clicked.connect(lambda on: self._easel.draw(has_gate=on))
        painting.document.shot_changed.connect(lambda: self._fill(painting.document))
        self._easel.view_changed.connect(self._update)
        self._easel.drawn_changed.connect(self._update)
        self._easel.display_changed.connect(self._update)
        self._update()

    def _pointer(self, name: str) -> QToolButton:
        button = QToolButton()
        button.setCheckable(True)
        button.setIcon(icon(name))
        button.setIconSize(QSize(20, 20))
        button.setToolTip(words.tooltip(*words.POINTERS[name], words.POINTER_KEYS[name]))
        button.setAccessibleName(words.POINTERS[name][0])
        button.clicked.connect(lambda _=False: self._easel.draw(pointer=name))
        return button

    def _number(self, tip: tuple[str, str], ends: tuple[float, float], put: object) -> QDoubleSpinBox:
        box = QDoubleSpinBox()
        box.setRange(*ends)
        box.setSingleStep(0.25)
        box.setFixedWidth(66)
        box.setToolTip(tip[1])
        box.valueChanged.connect(put)
        return box

    def _name_display(self, name: str) -> None:
        """Shows what it is without what stands in brackets, where there is little room."""
        self.display.setText(name.partition(" (")[0])
        self.display.setToolTip(f"{name}\n{words.DISPLAY_TIP}")

    def _fill(self, document: Document) -> None:
        self.camera.clear()
        if document.shot is not None:
            for camera in document.shot.scene.cameras:
                self.camera.addItem(camera.path.rsplit("/", 1)[-1], camera.path)
                self.camera.setItemData(self.camera.count() - 1, camera.path, Qt.ItemDataRole.ToolTipRole)
            if not document.shot.scene.cameras:
                self.camera.addItem(words.OVERVIEW, None)
        self._update()

    def _on_camera_chosen(self, number: int) -> None:
        self._painting.look_through(self.camera.itemData(number))

    def _update(self) -> None:
        easel = self._easel
        if easel.view is not None:
            found = self.camera.findData(easel.view.camera.path)
            self.camera.setCurrentIndex(found)
            self.camera.setPlaceholderText(words.FREE_CAMERA)
        for name, button in self.pointers.items():
            button.setChecked(name == easel.pointer)
        self.gate.setChecked(easel.has_gate)
        self.drawn.setCurrentIndex(self.drawn.findData(easel.drawn))
        for box, value in ((self.exposure, easel.display.exposure), (self.gamma, easel.display.gamma)):
            if box.value() != value:
                box.setValue(value)
