"""The built-in viewport: the live picture of the program itself, coarse at once, refined at rest.

All work is done on a thread of its own.  What it is to show is one record; whoever changes it leaves a new one, and the
thread, which looks for one between blocks, drops what it was about.
"""

from __future__ import annotations

import threading
import time
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray
from PySide6.QtCore import QObject, QSize, Qt, Signal, SignalInstance
from PySide6.QtGui import QImage, QPainter, QPaintEvent, QPixmap, QResizeEvent
from PySide6.QtWidgets import QWidget

from hydra_viewer.model.display import DisplaySettings, display_codes
from hydra_viewer.ui import words
from hydra_viewer.ui.ending import stop_at_exit
from hydra_viewer.ui.giving_way import give_way
from hydra_viewer.ui.viewport import Shown, ViewportKind
from usdslf import Camera, LivePicture, UsdslfError, color_of, live_picture, stepwise

FRAMES = 64  # of a picture at rest: as good as `usdslf render`
MOVING_S = 0.07  # seconds that a picture may take while the camera moves; its size follows
LEAST_SCALE = 0.2  # of the widget's size
MOST_PIXELS = 1_200_000  # of a picture at rest; what has more is magnified
FIRST_PIXELS = 130_000  # of the first one after a change


@dataclass(frozen=True, eq=False)
class _Wanted:
    """What the thread is to show."""

    shown: Shown | None = None
    camera: Camera | None = None
    size: tuple[int, int] = (0, 0)  # device pixels
    is_moving: bool = False
    display: DisplaySettings = field(default_factory=DisplaySettings)
    is_held: bool = False

    @property
    def is_whole(self) -> bool:
        return self.shown is not None and self.camera is not None and min(self.size) > 0


class _Screen(QWidget):
    """Shows the last picture, stretched to its size once, not each time that something over it is drawn."""

    def __init__(self, parent: QWidget) -> None:
        super().__init__(parent)
        self.resized: SignalInstance | None = None
        self._image: QImage | None = None
        self._stretched: QPixmap | None = None
        self.setAttribute(Qt.WidgetAttribute.WA_OpaquePaintEvent)

    def show_image(self, image: QImage | None) -> None:
        """Shows a picture; None: nothing."""
        self._image, self._stretched = image, None
        self.update()

    def paintEvent(self, event: QPaintEvent) -> None:
        painter = QPainter(self)
        if self._image is None:
            painter.fillRect(event.rect(), self.palette().dark())
            painter.end()
            return
        ratio = self.devicePixelRatioF()
        size = QSize(round(self.width() * ratio), round(self.height() * ratio))
        if self._stretched is None or self._stretched.size() != size:
            smooth = Qt.TransformationMode.SmoothTransformation
            whole = self._image.scaled(size, Qt.AspectRatioMode.IgnoreAspectRatio, smooth)
            self._stretched = QPixmap.fromImage(whole)
            self._stretched.setDevicePixelRatio(ratio)
        painter.drawPixmap(0, 0, self._stretched)
        painter.end()

    def resizeEvent(self, event: QResizeEvent) -> None:
        if self.resized is not None:
            self.resized.emit()


_KEPT: set[LiveViewport] = set()  # those whose thread may still work


class LiveViewport(QObject):
    """The live picture as a viewport; see `viewport.Viewport`."""

    changed = Signal()
    failed = Signal(str)
    noted = Signal(str)
    progress = Signal(float)
    _resized = Signal()
    _made = Signal(object, float)
    _ended = Signal()

    def __init__(self, parent: QWidget) -> None:
        super().__init__()  # it outlives the widget until its thread has ended
        self._screen = _Screen(parent)
        self._screen.resized = self._resized
        self._screen.destroyed.connect(self.stop)  # by a host that does not end it first
        self._resized.connect(self._take_size)
        self._made.connect(self._show)
        self._ended.connect(self._on_ended)
        self._pixels: NDArray | None = None
        self._shown: Shown | None = None  # what the picture on the screen is of
        self._wanted, self._is_new, self._is_stopped = _Wanted(), False, False
        self._condition = threading.Condition()
        self._painter = _Painter(self)
        self._thread = threading.Thread(target=self._work, name="viewer-picture", daemon=True)
        self._thread.start()
        _KEPT.add(self)
        stop_at_exit(self.finish)

    @property
    def widget(self) -> QWidget:
        return self._screen

    @property
    def shown(self) -> Shown | None:
        return self._shown

    def show_shot(self, shown: Shown | None) -> None:
        if shown is None:
            self._pixels = self._shown = None
            self._screen.show_image(None)
        elif _looks_alike(shown, self._wanted.shown):
            return  # it is written as a look now, which changes no picture
        self._want(shown=shown)

    def let_go(self) -> None:
        """It reads no stage."""

    @property
    def holds_stage(self) -> bool:
        return False

    def set_camera(self, camera: Camera, is_moving: bool) -> None:
        self._want(camera=camera, is_moving=is_moving)

    def set_display(self, display: DisplaySettings) -> None:
        self._want(display=display)

    def hold(self, is_held: bool) -> None:
        self._want(is_held=is_held)

    def pixels(self) -> NDArray | None:
        return self._pixels

    def stop(self) -> None:
        with self._condition:
            self._is_stopped = self._is_new = True
            self._condition.notify()

    def finish(self) -> None:
        self.stop()
        self._thread.join(timeout=10)
        _KEPT.discard(self)

    # ── on the main thread ─────────────────────────────────────────────────────────────────────

    def _take_size(self) -> None:
        ratio = self._screen.devicePixelRatioF()
        self._want(size=(round(self._screen.width() * ratio), round(self._screen.height() * ratio)))

    def _want(self, **values: object) -> None:
        with self._condition:
            self._wanted = replace(self._wanted, **values)  # type: ignore[arg-type]
            self._is_new = True
            self._condition.notify()

    def _on_ended(self) -> None:
        _KEPT.discard(self)

    def _show(self, picture: tuple[Shown, NDArray, QImage], share: float) -> None:
        if self._is_stopped:  # it was on its way
            return
        self._shown, self._pixels, image = picture
        self._screen.show_image(image)
        self.changed.emit()
        self.progress.emit(share)

    # ── on the thread ──────────────────────────────────────────────────────────────────────────

    def _work(self) -> None:
        give_way()
        while True:
            with self._condition:
                while not self._is_new:
                    self._condition.wait()
                if self._is_stopped:
                    break
                wanted, self._is_new = self._wanted, False
            if not wanted.is_whole:
                self._painter.forget()
                continue
            if self._why_not(wanted) and not self._is_new:
                self._painter.forget()  # what was left of the last picture, memory of the device for one
                if sentence := self._why_not(wanted):
                    self.failed.emit(sentence)
                    self._painter.forget()
        self._painter.forget()
        self._ended.emit()

    def _why_not(self, wanted: _Wanted) -> str:
        """Paints; returns why that failed, a sentence, or ""."""
        try:
            self._painter.paint(wanted)
        except UsdslfError as error:
            return str(error)
        except Exception as error:  # a picture that cannot be made is no reason to lose the window
            return words.internal(error)
        return ""

    def is_stale(self) -> bool:
        """Whether something else is wanted by now."""
        return self._is_new

    def hand_over(self, shown: Shown, linear: NDArray, codes: NDArray[np.uint8], share: float) -> None:
        """Hands a picture to the main thread."""
        h, w = codes.shape[:2]
        image = QImage(np.ascontiguousarray(codes).data, w, h, 3 * w, QImage.Format.Format_RGB888).copy()
        self._made.emit((shown, linear, image), share)


class _Painter:
    """Makes pictures, on the thread; keeps what the next one can use of the last."""

    def __init__(self, viewport: LiveViewport) -> None:
        self._viewport = viewport
        self._live: LivePicture | None = None
        self._shown: Shown | None = None
        self._scale = 0.5  # of a picture while the camera moves

    def forget(self) -> None:
        """Lets go of the last picture."""
        self._live = self._shown = None

    def paint(self, wanted: _Wanted) -> None:
        """Makes pictures, better and better, until something else is wanted."""
        if wanted.is_moving:
            self._paint_moving(wanted)
            return
        rest = _sized(wanted.size, MOST_PIXELS)
        first = _sized(wanted.size, FIRST_PIXELS)
        live = self._live
        is_known = live is not None and self._shown is wanted.shown and self._is_of(wanted, rest)
        if not is_known and first != rest and not self._is_similar(wanted, rest):
            self._gather(wanted, first, 1)
        if not self._viewport.is_stale():
            self._gather(wanted, rest, 1 if wanted.is_held else FRAMES)

    def _paint_moving(self, wanted: _Wanted) -> None:
        began = time.perf_counter()
        self._gather(wanted, _scaled(wanted.size, self._scale), 1)
        spent = max(time.perf_counter() - began, 1e-3)
        aimed = self._scale * float(np.clip((MOVING_S / spent) ** 0.5, 0.7, 1.3))
        self._scale = float(np.clip(aimed, LEAST_SCALE, 1.0))

    def _gather(self, wanted: _Wanted, size: tuple[int, int], frames: int) -> None:
        live = self._picture(wanted, size)
        is_whole = False
        while not is_whole:
            steps = stepwise(lambda: live.gather_frame(frames))
            try:
                while True:
                    next(steps)
                    if self._viewport.is_stale() and not wanted.is_moving:
                        return
            except StopIteration as end:
                is_whole = bool(end.value)
            finally:
                steps.close()
            frame = live.now(FRAMES)
            self._hand_over(wanted, frame.picture, 1.0 if is_whole and frames == FRAMES else min(frame.share, 0.99))
            if self._viewport.is_stale():
                return

    def _hand_over(self, wanted: _Wanted, linear: NDArray, share: float) -> None:
        assert wanted.shown is not None
        scene = wanted.shown.shot.scene
        codes = display_codes(linear, wanted.display, color_of(scene.ocio or None, scene.working_space))
        self._viewport.hand_over(wanted.shown, linear, codes, share)

    # ── what can be used again ─────────────────────────────────────────────────────────────────

    def _picture(self, wanted: _Wanted, size: tuple[int, int]) -> LivePicture:
        """The picture of what is wanted, begun anew only as far as it has to be."""
        shown, camera = wanted.shown, wanted.camera
        assert shown is not None and camera is not None
        live = self._live
        if live is None or self._shown is None or not _is_same_geometry(self._shown, shown):
            live = live_picture(shown.edited, camera, size=size)
        else:
            if live.view.camera is not camera or live.view.size != size:
                live = live.seen_by(camera, size)
            if self._shown is not shown:
                live = self._changed(live, shown, camera, size)
        self._live, self._shown = live, shown
        return live

    def _changed(self, live: LivePicture, shown: Shown, camera: Camera, size: tuple[int, int]) -> LivePicture:
        materials, light = shown.edited.scene.materials, shown.edited.light_field if shown.is_lit else None
        try:
            return live.with_materials(materials, light)
        except UsdslfError:  # opacity differs
            return live_picture(shown.edited, camera, size=size)

    def _is_of(self, wanted: _Wanted, size: tuple[int, int]) -> bool:
        live = self._live
        return live is not None and live.view.camera is wanted.camera and live.view.size == size

    def _is_similar(self, wanted: _Wanted, size: tuple[int, int]) -> bool:
        """Whether the picture at hand needs a change of materials only, which is quick at full size."""
        is_there = self._shown is not None and wanted.shown is not None
        return self._is_of(wanted, size) and is_there and _is_same_geometry(self._shown, wanted.shown)  # type: ignore


def _looks_alike(a: Shown, b: Shown | None) -> bool:
    return b is not None and a.shot is b.shot and a.edited is b.edited and a.is_lit == b.is_lit


def _is_same_geometry(a: Shown, b: Shown) -> bool:
    return a.shot is b.shot


def _scaled(size: tuple[int, int], scale: float) -> tuple[int, int]:
    return max(1, round(size[0] * scale)), max(1, round(size[1] * scale))


def _sized(size: tuple[int, int], most: int) -> tuple[int, int]:
    """A size of the same shape with at most so many pixels."""
    return _scaled(size, min(1.0, (most / max(size[0] * size[1], 1)) ** 0.5))


LIVE = ViewportKind(words.LIVE_VIEWPORT, LiveViewport)
