"""HydraRenderer: draws a shot by Hydra on a thread of its own, picture by picture, as long as it gets better.

UsdImagingGL lets go of Python's lock while it draws, so that a slow rasterizer or a slow delegate does not hold up the
window.  The thread has its own OpenGL context without a window, its own stage over the shot's layers, and the engine;
nobody else touches them.  The window says what it wishes to see; what is wished last is drawn next.

A rasterizer has one sample a pixel, or a few.  At rest the picture is drawn again, each time shifted by a part of a
pixel, and the mean is shown: edges come out smooth on any machine.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray
from PySide6.QtCore import QCoreApplication, QObject, Signal
from PySide6.QtGui import QImage, QOffscreenSurface, QOpenGLContext, QSurfaceFormat

from hydra_viewer.hydra.engine import STORM, Engine
from hydra_viewer.ui import words
from hydra_viewer.ui.ending import stop_at_exit
from hydra_viewer.ui.giving_way import give_way
from hydra_viewer.ui.gl_picture import GlPicture
from hydra_viewer.ui.viewport import Shown
from usdslf import Camera, DisplayPass, DisplaySettings, LiveStage, Shot, UsdslfError, color_of

FRAMES, FEW_FRAMES = 16, 4  # pictures that the mean at rest is of; where each is slow
SLOW = 0.08  # seconds: what takes longer is drawn coarser while the camera moves
COARSE = 0.5  # of the width and the height, then
PAUSE = 0.02  # seconds between pictures of a delegate that goes on by itself


_ONE = threading.Lock()
"""Held by the thread that draws: engines of several viewports in one process are not safe on several threads."""


@dataclass(frozen=True, eq=False)
class Wish:
    """What is to be drawn.

    Attributes:
        shown: a shot and the look over it; None: nothing.
        camera: relative to the origin of the shot's scene; None: nothing is drawn yet.
        is_moving: more cameras follow at once.
        size: width and height [pixels of the screen].
        display: how pixels are brought to the screen.
        delegate: id of the render delegate; "": the default.
        is_held: the picture is not to get better for now.
    """

    shown: Shown | None = None
    camera: Camera | None = None
    is_moving: bool = False
    size: tuple[int, int] = (0, 0)
    display: DisplaySettings = field(default_factory=DisplaySettings)
    delegate: str = ""
    is_held: bool = False

    def shows(self, shot: Shot) -> bool:
        """Whether it is of a shot, under any look."""
        return self.shown is not None and self.shown.shot is shot

    @property
    def is_complete(self) -> bool:
        """Whether something can be drawn."""
        return self.shown is not None and self.camera is not None and min(self.size) > 0


@dataclass(frozen=True, eq=False)
class Drawn:
    """A picture that was drawn.

    Attributes:
        wish: that it is of.
        image: code values of the screen.
        pixels: (h, w, 3), scene-linear.
        share: how far the picture is, 0..1; 1: it gets no better.
        delegate: id of the delegate that drew it.
        note: what is to be said of it, a sentence or "".
    """

    wish: Wish
    image: QImage
    pixels: NDArray[np.float32]
    share: float
    delegate: str
    note: str = ""


class HydraRenderer(QObject):
    """Draws what is wished for; made and called on the main thread.

    Attributes:
        holds_stage: the thread may be reading the stage of the shot.
    """

    drawn = Signal(object)  # a Drawn
    failed = Signal(str)
    ended = Signal()  # the thread has ended, and nothing more comes

    def __init__(self, parent: QObject | None = None) -> None:
        """Begins with no wish; the thread starts with the first one.

        Args:
            parent: as QObject.
        """
        super().__init__(parent)
        self._surface = QOffscreenSurface()
        self._surface.setFormat(surface_format())
        self._surface.create()  # on the main thread, as Qt demands
        self._wished = threading.Condition()
        self._wish, self._is_stopped = Wish(), False
        self._thread: threading.Thread | None = None
        self.holds_stage = False
        if (app := QCoreApplication.instance()) is not None:
            app.aboutToQuit.connect(self.finish)
        stop_at_exit(self.finish)

    def ask(self, change: Callable[[Wish], Wish]) -> None:
        """Changes what is wished for; it is drawn next."""
        with self._wished:
            self._wish = change(self._wish)
            self._wished.notify()
        if self._thread is None and self._wish.is_complete and not self._is_stopped:
            self._thread = threading.Thread(target=self._draw_all, name="hydra", daemon=True)
            self._thread.start()

    def stop(self) -> None:
        """Lets the thread end after the picture that it draws; `ended` comes then, or at once where there is none."""
        with self._wished:
            self._is_stopped = True
            self._wished.notify()
        if self._thread is None:
            self.ended.emit()

    def finish(self) -> None:
        """Stops, and waits for the thread."""
        self.stop()
        if self._thread is not None:
            self._thread.join()

    # ── on the thread ──────────────────────────────────────────────────────────────────────────
    def _draw_all(self) -> None:
        """The thread: makes a context, draws until it is stopped, gives back what it holds."""
        give_way()
        context = QOpenGLContext()
        context.setFormat(surface_format())
        if not (context.create() and context.makeCurrent(self._surface)):
            self.failed.emit(words.NO_OPENGL)
            self.ended.emit()
            return
        drawing = None
        try:
            drawing = _Drawing()
            self._follow_wishes(drawing)
        except Exception as error:
            self.failed.emit(words.internal(error))
        finally:
            if drawing is not None:
                with _ONE:
                    drawing.release()
            self.holds_stage = False
            context.doneCurrent()
            self.ended.emit()

    def _follow_wishes(self, drawing: _Drawing) -> None:
        last: Wish | None = None
        while (wish := self._next(last, drawing.share)) is not None:
            last = wish
            if wish.shown is None:
                with _ONE:
                    drawing.let_go()
                self.holds_stage = False
                continue
            try:
                with _ONE:
                    drawn = drawing.draw(wish)
            except UsdslfError as error:
                self.failed.emit(str(error))
                drawing.share = 1.0
            except Exception as error:  # the next wish is tried with a new engine
                self.failed.emit(words.internal(error))
                drawing.share = 1.0
                with _ONE:
                    drawing.let_go()
            else:
                self.drawn.emit(drawn)

    def _next(self, last: Wish | None, share: float) -> Wish | None:
        """Waits for what is to be drawn: another wish, or the last one where it gets better; None: stop."""
        with self._wished:
            while not self._is_stopped:
                wish = self._wish
                is_new = wish is not last
                if wish.is_complete and (is_new or (share < 1 and not wish.is_held)):
                    self.holds_stage = True
                    return wish
                if is_new and wish.shown is None and self.holds_stage:
                    return wish
                self._wished.wait()
        return None


class _Drawing:
    """What the thread holds: the stage, the engine, and the picture so far."""

    def __init__(self) -> None:
        self.picture = GlPicture()
        self.share = 0.0
        self._engine: Engine | None = None
        self._last = Wish()
        self._frames, self._seconds = 0, 0.0
        self._notes: list[str] = []

    def draw(self, wish: Wish) -> Drawn:
        """Draws a picture of a wish, or one more."""
        shown, camera = wish.shown, wish.camera
        assert shown is not None and camera is not None
        engine = self._engine_of(wish)
        if self._is_new(wish):
            self._frames = 0
        if self._frames == 0 or (self.share < 1 and not wish.is_held):
            self._add_frame(engine, wish)
        self._last = wish
        color = color_of(shown.shot.ocio, shown.shot.scene.working_space)
        image = self.picture.codes(DisplayPass.of(color, wish.display), wish.display)
        notes, self._notes = self._notes, []
        share = 0.0 if wish.is_moving else self.share
        return Drawn(wish, image, self.picture.pixels(), share, engine.delegate, "; ".join(notes))

    def let_go(self) -> None:
        """Gives back the stage and what draws it; the context is current."""
        if self._engine is not None:
            self._engine.release()
        self._engine, self._last = None, Wish()

    def release(self) -> None:
        """Gives back all; the context is current."""
        self.let_go()
        self.picture.release()

    def _engine_of(self, wish: Wish) -> Engine:
        """The engine with the stage and the look of a wish."""
        shown, before = wish.shown, self._last.shown
        assert shown is not None
        is_same = before is not None and before.shot.source is shown.shot.source and before.shot.made is shown.shot.made
        if self._engine is None or not is_same or wish.delegate != self._last.delegate:
            live = LiveStage.of(shown.shot.stage, shown.shot.scene)
            if self._engine is not None:
                self._engine.release()
            self._engine, before = Engine(live, wish.delegate), None
            self._notes += [s for s in (live.note, self._engine.problem) if s]
            plain = [x.path for x in shown.shot.scene.lights if x.kind == "dome" and x.texture is None]
            if plain and self._engine.delegate == STORM:
                self._notes.append(words.dome_without_picture(plain))
        if before is not shown and (before is None or (before.look, before.edited) != (shown.look, shown.edited)):
            self._engine.live.show(shown.look)
        return self._engine

    def _is_new(self, wish: Wish) -> bool:
        """Whether a wish is for another picture than the last one, and not only for other code values."""
        a, b = wish, self._last
        is_same = a.shown is b.shown and a.camera is b.camera
        return not is_same or (a.is_moving, a.size, a.delegate) != (b.is_moving, b.size, b.delegate)

    def _add_frame(self, engine: Engine, wish: Wish) -> None:
        assert wish.shown is not None and wish.camera is not None
        began = time.perf_counter()
        is_storm = engine.delegate == STORM
        is_coarse = is_storm and wish.is_moving and self._seconds > SLOW
        size = (max(1, int(wish.size[0] * COARSE)), max(1, int(wish.size[1] * COARSE))) if is_coarse else wish.size
        self.picture.resize(size)
        shift = _shift(self._frames) if is_storm else (0.0, 0.0)
        with self.picture.linear():
            scene, refine = wish.shown.shot.scene, wish.shown.shot.refine
            is_done = engine.draw(scene, wish.camera, size, refine, (shift[0] / size[0], shift[1] / size[1]))
        self._frames += 1
        self.picture.add(self._frames if is_storm else 1)
        if not is_coarse:
            self._seconds = time.perf_counter() - began
        if is_storm:
            wanted = FEW_FRAMES if self._seconds > SLOW else FRAMES
            self.share = 1.0 if wish.is_moving else min(1.0, self._frames / wanted)
        else:
            self.share = 1.0 if is_done else min(0.99, self._frames / (self._frames + 16))
            time.sleep(0 if is_done else PAUSE)


def _shift(number: int) -> tuple[float, float]:
    """Where in its pixel picture `number` looks, from the middle [pixels]: 0, then a Halton sequence about it."""
    if number == 0:
        return 0.0, 0.0
    return _radical_inverse(number, 2) - 0.5, _radical_inverse(number, 3) - 0.5


def _radical_inverse(number: int, base: int) -> float:
    out, digit = 0.0, 1.0 / base
    while number:
        out, number, digit = out + digit * (number % base), number // base, digit / base
    return out


def surface_format() -> QSurfaceFormat:
    """Returns the OpenGL that Storm is at home in: 4.5 with what is deprecated; in a Core profile it posts errors."""
    found = QSurfaceFormat()
    found.setRenderableType(QSurfaceFormat.RenderableType.OpenGL)
    found.setVersion(4, 5)
    found.setProfile(QSurfaceFormat.OpenGLContextProfile.CompatibilityProfile)
    found.setOption(QSurfaceFormat.FormatOption.DeprecatedFunctions)
    found.setDepthBufferSize(24)
    found.setSamples(0)
    return found
