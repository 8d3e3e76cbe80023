"""Timeline: the frame of an animated shot, and playback."""

from __future__ import annotations

import time

from PySide6.QtCore import Qt, QTimer
from PySide6.QtWidgets import QDoubleSpinBox, QHBoxLayout, QLabel, QSlider, QToolButton, QWidget

from hydra_viewer.model.document import Document
from hydra_viewer.model.work import Framed, framing
from hydra_viewer.ui import words
from hydra_viewer.ui.icons import icon
from hydra_viewer.ui.worker import Job, Worker

KIND = "frame"


class Timeline(QWidget):
    """A slider over the frames, hidden where a shot has one alone."""

    def __init__(self, document: Document, worker: Worker, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._document, self._worker = document, worker
        self._began = (0.0, 0.0)  # of playback: the time, and the frame
        self.play, self.slider = QToolButton(), QSlider(Qt.Orientation.Horizontal)
        self.box, self._last = QDoubleSpinBox(), QLabel()
        self.play.setCheckable(True)
        self.play.setIcon(icon("play"))
        self.play.setToolTip(words.tooltip(*words.PLAY, words.PLAY_KEY))
        self.slider.setToolTip(words.FRAME_TIP)
        self.box.setDecimals(1)
        self.box.setFixedWidth(80)
        self.box.setKeyboardTracking(False)
        self.box.setToolTip(words.FRAME_TIP)
        layout = QHBoxLayout(self)
        layout.setContentsMargins(8, 3, 8, 3)
        layout.addWidget(self.play)
        layout.addWidget(self.slider, 1)
        layout.addWidget(self.box)
        layout.addWidget(self._last)
        self._timer = QTimer(self)
        self._timer.setSingleShot(True)
        self._timer.timeout.connect(self._go_on)
        self.play.toggled.connect(self._on_play_toggled)
        self.slider.valueChanged.connect(lambda n: self.go_to(float(n)))
        self.box.valueChanged.connect(self.go_to)
        document.shot_changed.connect(self._fill)
        self._fill()

    def go_to(self, frame: float) -> None:
        """Shows a frame, on the worker; what was on its way to another one is cancelled."""
        shot, found = self._document.shot, self._document.found
        self._show_frame(frame)
        if shot is None or shot.scene.frame == frame:
            return
        self._worker.start(Job(KIND, lambda: framing(shot, frame, found), self._take, self._fail))

    def _take(self, framed: Framed) -> None:
        self._document.take_shot(framed.shot, framed.found)
        if self.play.isChecked():
            self._timer.start(0)

    def _fail(self, sentence: str, error: BaseException) -> None:
        self.play.setChecked(False)
        self._document.report(sentence)

    def _fill(self) -> None:
        frames, shot = self._document.frames, self._document.shot
        self.setVisible(frames is not None)
        if frames is None or shot is None:
            self.play.setChecked(False)
            return
        for each in (self.slider, self.box):
            each.blockSignals(True)
        self.slider.setRange(round(frames.first), round(frames.last))
        self.box.setRange(frames.first, frames.last)
        self._last.setText(words.frames(frames.first, frames.last, frames.per_second))
        for each in (self.slider, self.box):
            each.blockSignals(False)
        self._show_frame(shot.scene.frame)

    def _show_frame(self, frame: float) -> None:
        for each in (self.slider, self.box):
            each.blockSignals(True)
        self.slider.setValue(round(frame) if frame == frame else self.slider.minimum())
        self.box.setValue(frame if frame == frame else self.box.minimum())
        for each in (self.slider, self.box):
            each.blockSignals(False)

    def _on_play_toggled(self, is_playing: bool) -> None:
        self.play.setIcon(icon("pause" if is_playing else "play"))
        self._timer.stop()
        if is_playing:
            self._began = time.monotonic(), self.box.value()
            self._timer.start(0)
        else:
            self._worker.cancel(KIND)

    def _go_on(self) -> None:
        """Goes to the frame that is due; those that are late are left out."""
        frames = self._document.frames
        if frames is None:
            return
        began, first = self._began
        passed = (time.monotonic() - began) * frames.per_second
        due = frames.first + (first - frames.first + round(passed)) % (frames.last - frames.first + 1)
        if due == self.box.value():
            self._timer.start(max(1, round(500 / frames.per_second)))
        else:
            self.go_to(due)
