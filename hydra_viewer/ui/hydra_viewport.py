"""HydraViewport: the shot as Hydra draws it, by Storm or any other installed render delegate."""

from __future__ import annotations

from dataclasses import replace
from functools import partial

from numpy.typing import NDArray
from PySide6.QtCore import QEvent, QObject, QRect, Qt, Signal
from PySide6.QtGui import QImage, QPainter, QPaintEvent
from PySide6.QtWidgets import QWidget

from hydra_viewer.hydra.engine import delegates
from hydra_viewer.ui import words
from hydra_viewer.ui.hydra_renderer import Drawn, HydraRenderer
from hydra_viewer.ui.viewport import Shown, ViewportKind
from usdslf import Camera, DisplaySettings


class HydraPicture(QWidget):
    """Shows the last picture, stretched until there is one of its own size."""

    resized = Signal()

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.setAttribute(Qt.WidgetAttribute.WA_OpaquePaintEvent)
        self.setAttribute(Qt.WidgetAttribute.WA_TransparentForMouseEvents)
        self._image = QImage()

    def show_image(self, image: QImage) -> None:
        """Shows a picture."""
        self._image = image
        self.update()

    def pixel_size(self) -> tuple[int, int]:
        """Returns width and height [pixels of the screen]."""
        ratio = self.devicePixelRatioF()
        return max(1, round(self.width() * ratio)), max(1, round(self.height() * ratio))

    def paintEvent(self, event: QPaintEvent) -> None:
        """Paints the picture, or the neutral ground."""
        painter = QPainter(self)
        if self._image.isNull():
            painter.fillRect(self.rect(), self.palette().window())
            return
        painter.setRenderHint(QPainter.RenderHint.SmoothPixmapTransform)
        painter.drawImage(QRect(0, 0, self.width(), self.height()), self._image)

    def event(self, event: QEvent) -> bool:
        """Tells when another size is to be drawn."""
        kinds = (QEvent.Type.Resize, QEvent.Type.Show, QEvent.Type.DevicePixelRatioChange)
        if event.type() in kinds:
            self.resized.emit()
        return super().event(event)


_KEPT: set[HydraViewport] = set()  # those whose thread may still draw


class HydraViewport(QObject):
    """A `Viewport` by Hydra; see viewport.py for what each call does."""

    changed = Signal()
    failed = Signal(str)
    progress = Signal(float)
    noted = Signal(str)

    def __init__(self, parent: QWidget, delegate: str = "") -> None:
        """Begins with nothing shown.

        Args:
            parent: of the widget.
            delegate: id of the render delegate; "": the default.
        """
        super().__init__()  # it outlives the widget until its thread has ended
        self.widget = HydraPicture(parent)
        self.widget.resized.connect(self._on_resized)
        self.widget.destroyed.connect(self._on_destroyed)  # by a host that does not end it first
        self._drawn: Drawn | None = None
        self._is_stopped = False
        self._renderer = HydraRenderer(self)
        self._renderer.ask(lambda w: replace(w, delegate=delegate))
        self._renderer.drawn.connect(self._on_drawn)
        self._renderer.failed.connect(self.failed)
        self._renderer.ended.connect(self._on_ended)
        _KEPT.add(self)

    @property
    def shown(self) -> Shown | None:
        """What the picture is of."""
        return None if self._drawn is None else self._drawn.wish.shown

    def show_shot(self, shown: Shown | None) -> None:
        """Shows a shot, or another state of it; None: nothing."""
        if shown is not None and shown.is_ahead:  # Hydra reads a stage: what is there stays until the look is written
            plain = Shown(shown.shot, shown.shot)
            self._renderer.ask(lambda w: w if w.shows(shown.shot) else replace(w, shown=plain))
            return
        self._renderer.ask(lambda w: replace(w, shown=shown))
        if shown is None:
            self._drawn = None
            self.widget.show_image(QImage())

    def let_go(self) -> None:
        """Gives back the stage; the picture stays."""
        self._renderer.ask(lambda w: replace(w, shown=None))

    @property
    def holds_stage(self) -> bool:
        """Whether the thread may be reading the stage."""
        return self._renderer.holds_stage

    def set_camera(self, camera: Camera, is_moving: bool) -> None:
        """Looks through a camera."""
        self._renderer.ask(lambda w: replace(w, camera=camera, is_moving=is_moving))

    def set_display(self, display: DisplaySettings) -> None:
        """Brings pixels to the screen in a way."""
        self._renderer.ask(lambda w: replace(w, display=display))

    def hold(self, is_held: bool) -> None:
        """Leaves the processor to other work, or goes on."""
        self._renderer.ask(lambda w: replace(w, is_held=is_held))

    def pixels(self) -> NDArray | None:
        """Returns what is shown (h, w, 3), scene-linear; None: nothing yet."""
        return None if self._drawn is None else self._drawn.pixels

    def stop(self) -> None:
        """Ends the thread after the picture that it draws."""
        self._is_stopped = True
        self.widget.resized.disconnect()
        self._renderer.failed.disconnect()
        self._renderer.stop()

    def finish(self) -> None:
        """Ends the thread, as `stop` does: it is kept until then."""
        self.stop()

    def _on_destroyed(self) -> None:
        self._is_stopped = True
        self._renderer.stop()

    def _on_ended(self) -> None:
        _KEPT.discard(self)

    def _on_resized(self) -> None:
        size = self.widget.pixel_size()
        self._renderer.ask(lambda w: w if w.size == size else replace(w, size=size))

    def _on_drawn(self, drawn: Drawn) -> None:
        if self._is_stopped:  # it was on its way
            return
        self._drawn = drawn
        self.widget.show_image(drawn.image)
        self.changed.emit()
        self.progress.emit(drawn.share)
        if drawn.note:
            self.noted.emit(drawn.note)


def hydra_kinds() -> list[ViewportKind]:
    """Returns a kind of viewport for each installed render delegate, Storm first."""
    make = lambda d: partial(HydraViewport, delegate=d.id)  # noqa: E731
    return [ViewportKind(words.hydra_viewport(d.name), make(d), needs_look=True) for d in delegates()]
