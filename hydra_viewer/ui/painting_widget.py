"""The painting widget, for hosts too: a picture to paint on, and a worker that finds what the paint asks for."""

from __future__ import annotations

from collections.abc import Sequence

from PySide6.QtCore import Signal
from PySide6.QtGui import QCloseEvent
from PySide6.QtWidgets import QVBoxLayout, QWidget

from hydra_viewer.model.document import Document, Files
from hydra_viewer.model.easel import Easel
from hydra_viewer.model.navigation import are_turned, bounds_under, faces_under, framed, in_sight, view_of
from hydra_viewer.model.work import Opened, preparing, warming
from hydra_viewer.ui.canvas import Canvas
from hydra_viewer.ui.collector import collect_here
from hydra_viewer.ui.live_viewport import LIVE
from hydra_viewer.ui.solving import WARM, Solving
from hydra_viewer.ui.viewport import ViewportKind
from hydra_viewer.ui.worker import Job, Worker
from usdslf import Camera, Shot, Stroke, are_seen


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
        collect_here()
        self.document, self.easel, self.worker = Document(), Easel(), Worker(self)
        self.canvas = Canvas(self.document, self.easel, self.worker, viewport, self)
        self.solving = Solving(self.document, self.worker, lambda: self.canvas.kind.needs_look, self)
        self.canvas.failed.connect(self.failed)
        self.canvas.noted.connect(self.noted)
        self.solving.failed.connect(self.failed)
        self.worker.idle_changed.connect(lambda is_idle: self.canvas.hold(not is_idle))
        layout = QVBoxLayout(self)
        layout.setContentsMargins(0, 0, 0, 0)
        layout.addWidget(self.canvas)
        self.setFocusProxy(self.canvas)
        if shot is not None:
            steps = lambda: preparing(shot, Files(shot.path), tuple(strokes))  # noqa: E731
            self.worker.start(Job("open", steps, self.show_shot, lambda words, _: self.failed.emit(words)))

    def show_shot(self, opened: Opened) -> None:
        """Takes a shot in, looked at through its first camera."""
        self.worker.cancel()
        self.document.open(opened.shot, opened.files, opened.strokes, opened.prims)
        self.look_through(None)
        if opened.look is not None:
            self.document.take_found(opened.look)
        self.worker.start(Job(WARM, lambda: warming(opened.shot), lambda _: None, lambda *_: None, is_quiet=True))

    def look_through(self, camera: Camera | str | None) -> None:
        """Looks through a camera, or one of the shot by its path; None: the first one, or one that sees everything."""
        shot = self.document.shot
        if shot is not None:
            seen_by = camera if isinstance(camera, Camera) else shot.camera(camera)
            self.easel.look_from(view_of(seen_by, shot.scene.bounds, shot.scene.up_axis))

    def frame_selected(self) -> None:
        """Looks at what is selected, or at everything, from where the camera is."""
        self._frame(self.document.selected)

    def frame_all(self) -> None:
        """Looks at everything, from where the camera is."""
        self._frame("")

    def _frame(self, path: str) -> None:
        shot, view = self.document.shot, self.easel.view
        if shot is not None and view is not None:
            (points, normals), aspect = faces_under(shot.scene, path), self.canvas.aspect
            seen = lambda c: are_turned(c, points, normals) & are_seen(shot, c, points, aspect)  # noqa: E731
            found = framed(view, bounds_under(shot.scene, path))
            self.easel.look_from(in_sight(found, lambda c: float(seen(c).mean()) if len(points) else 0.0))

    def stop(self) -> None:
        """Ends all work; nothing is called afterwards."""
        self.worker.stop()
        self.canvas.stop()
        self.solving.stop()

    def closeEvent(self, event: QCloseEvent) -> None:
        self.stop()
        super().closeEvent(event)
