"""The painting widget, for hosts too: a picture to paint on, and a worker that finds what the paint asks for."""

from __future__ import annotations

from collections.abc import Sequence

from PySide6.QtCore import Signal
from PySide6.QtGui import QCloseEvent
from PySide6.QtWidgets import QVBoxLayout, QWidget

from hydra_viewer.model.document import Document, Files
from hydra_viewer.model.easel import Easel
from hydra_viewer.model.navigation import bounds_under, framed, view_of
from hydra_viewer.ui.canvas import Canvas
from hydra_viewer.ui.live_viewport import LIVE
from hydra_viewer.ui.solving import Solving
from hydra_viewer.ui.viewport import ViewportKind
from hydra_viewer.ui.worker import Worker
from usdslf import Shot, Stroke


class PaintingWidget(QWidget):
    """Takes a Shot and strokes, and lets people paint more.

    Attributes:
        document: shot, strokes, and what was found; connect to its announcers.
        easel: brush, view, display.
        worker: what long work runs on.
        canvas: the picture.
        solving: keeps what was found up with the strokes.
        failed: Signal(str): a sentence that people should see.
        noted: Signal(str): one that is no error.
    """

    failed = Signal(str)
    noted = Signal(str)

    def __init__(
        self, shot: Shot | None = None, strokes: Sequence[Stroke] = (), parent: QWidget | None = None,
        viewport: ViewportKind = LIVE,
    ) -> None:  # fmt: skip
        """Begins with a shot, or with none.

        Args:
            shot: its light is made on the worker where it is not there yet.
            strokes: on it.
            viewport: kind of the widget that shows the picture.
        """
        super().__init__(parent)
        self.document, self.easel, self.worker = Document(), Easel(), Worker(self)
        self.canvas = Canvas(self.document, self.easel, viewport, self)
        self.solving = Solving(self.document, self.worker, self)
        self.canvas.failed.connect(self.failed)
        self.canvas.noted.connect(self.noted)
        self.solving.failed.connect(self.failed)
        self.worker.idle_changed.connect(lambda is_idle: self.canvas.hold(not is_idle))
        layout = QVBoxLayout(self)
        layout.setContentsMargins(0, 0, 0, 0)
        layout.addWidget(self.canvas)
        self.setFocusProxy(self.canvas)
        if shot is not None:
            self.show_shot(shot, Files(shot.path), strokes)

    def show_shot(self, shot: Shot, files: Files, strokes: Sequence[Stroke] = (), is_saved: bool = True) -> None:
        """Takes a shot in, looked at through its first camera.

        Args:
            shot: with what pictures need made.
            files: of it.
            strokes: on it.
            is_saved: the strokes are those of the file.
        """
        self.worker.cancel()
        self.document.open(shot, files, strokes, is_saved)
        self.look_through(None)

    def look_through(self, camera: str | None) -> None:
        """Looks through a camera of the shot, by its path; None: the first one, or one that sees everything."""
        shot = self.document.shot
        if shot is not None:
            self.easel.look_from(view_of(shot.camera(camera), shot.scene.bounds, shot.scene.up_axis))

    def frame_selected(self) -> None:
        """Looks at what is selected, or at everything, from where the camera is."""
        shot, view = self.document.shot, self.easel.view
        if shot is not None and view is not None:
            self.easel.look_from(framed(view, bounds_under(shot.scene, self.document.selected)))

    def stop(self) -> None:
        """Ends all work; nothing is called afterwards."""
        self.worker.stop()
        self.canvas.stop()
        self.solving.stop()

    def closeEvent(self, event: QCloseEvent) -> None:
        self.stop()
        super().closeEvent(event)
