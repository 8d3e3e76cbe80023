"""An artist's work in the window with the Hydra viewport, in a process of its own.

`python kit/hydra_window.py FOLDER` opens a shot, changes to Hydra, looks round, paints, undoes, saves, changes back,
and writes FOLDER/window.npz.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np

from usdslf import choose_pxr

choose_pxr()

from kit.hydra_pictures import lit  # noqa: E402
from PySide6.QtCore import QEvent, QPoint, QPointF, Qt  # noqa: E402
from PySide6.QtGui import QMouseEvent  # noqa: E402
from PySide6.QtTest import QTest  # noqa: E402
from PySide6.QtWidgets import QApplication  # noqa: E402

from hydra_viewer.model.document import Files  # noqa: E402
from hydra_viewer.ui.application import make_application  # noqa: E402
from hydra_viewer.ui.window import Window  # noqa: E402

LEFT, ALT, CTRL = Qt.MouseButton.LeftButton, Qt.KeyboardModifier.AltModifier, Qt.KeyboardModifier.ControlModifier
SHIFT, NONE = Qt.KeyboardModifier.ShiftModifier, Qt.KeyboardModifier.NoModifier


class Hand:
    """Uses a window as a person does."""

    def __init__(self, window: Window) -> None:
        self.window, self.canvas = window, window.painting.canvas
        self.share = 0.0
        self.canvas.progress.connect(self._hear)

    def _hear(self, share: float) -> None:
        self.share = share

    def wait(self, until: Callable[[], bool]) -> None:
        end = time.monotonic() + 180
        while not until():
            assert time.monotonic() < end, "it did not happen"
            QApplication.processEvents()
            time.sleep(0.003)

    def picture(self, act: Callable[[], object], share: float = 1.0) -> np.ndarray:
        """Does something and waits for a picture after it; returns its scene-linear pixels."""
        self.share = -1.0
        act()
        self.wait(lambda: self.share >= share)
        pixels = self.canvas.viewport.pixels()
        assert pixels is not None
        return np.array(pixels)

    def changed_to_hydra(self, act: Callable[[], object]) -> np.ndarray:
        """Changes the viewport and waits for its picture at rest; the other's last word may come later than its own."""
        act()
        viewport = self.canvas.viewport
        self.wait(lambda: viewport.pixels() is not None and viewport._drawn.share >= 1)
        return np.array(viewport.pixels())

    def changed_to_built_in(self, act: Callable[[], object]) -> np.ndarray:
        """Changes the viewport and waits until most of its light is gathered."""
        act()
        self.wait(lambda: self.canvas.viewport.pixels() is not None)
        return self.picture(lambda: None, 0.9)

    def rested(self, act: Callable[[], object]) -> np.ndarray:
        """Does something that is solved, in the Hydra viewport; returns its picture at rest of what came of it."""
        act()
        self.solved()
        QTest.qWait(50)  # what was found is told
        viewport = self.canvas.viewport
        self.wait(lambda: viewport._drawn.wish is viewport._renderer._wish and viewport._drawn.share >= 1)
        return np.array(viewport.pixels())

    def drag(self, path: list[tuple[float, float]], held: Qt.KeyboardModifier = NONE) -> None:
        canvas = self.canvas
        points = [QPoint(round(x * canvas.width()), round(y * canvas.height())) for x, y in path]
        QTest.mousePress(canvas, LEFT, held, points[0])
        for p in points[1:]:
            at, away = QPointF(p), QPointF(canvas.mapToGlobal(p))
            none = Qt.MouseButton.NoButton
            QApplication.sendEvent(canvas, QMouseEvent(QEvent.Type.MouseMove, at, away, none, LEFT, held))
        QTest.mouseRelease(canvas, LEFT, held, points[-1])

    def reloaded(self) -> np.ndarray:
        """Reads the shot anew, looks round and undoes meanwhile; returns the Hydra viewport's picture at rest."""
        view = self.window.easel.view
        shot = self.window.document.shot
        self.window.filing.reload()
        self.drag([(0.5, 0.5), (0.52, 0.48), (0.54, 0.48)], ALT)
        self.window.document.redo()
        self.window.document.undo()
        self.window.easel.look_from(view)
        self.wait(lambda: self.window.document.shot is not shot)
        return self.rested(lambda: None)

    def solved(self) -> None:
        self.wait(lambda: self.window.document.is_solved and self.window.worker.is_idle)


def work(folder: Path) -> dict[str, np.ndarray]:
    (folder / "shot").mkdir()
    stage = lit(folder / "shot")
    files = Files(str(stage), str(folder / "strokes.usda"), str(folder / "look.usda"))
    window = Window({"elements": 250, "bounces": 2})
    window.resize(1100, 640)
    window.show()
    assert QTest.qWaitForWindowExposed(window)
    hand, said, before = Hand(window), list[str](), stage.read_bytes()
    window.painting.failed.connect(said.append)
    window.filing.open(files)
    hand.wait(lambda: window.document.shot is not None)
    built_in, hydra = window.viewport_menu.actions()[:2]
    out = {"hydra": hand.changed_to_hydra(hydra.trigger), "name": np.array(hand.canvas.kind.name)}
    camera = window.easel.view.camera
    out["orbited"] = hand.picture(lambda: hand.drag([(0.5, 0.5), (0.55, 0.45), (0.6, 0.45)], ALT))
    assert window.easel.view.camera is not camera
    level = float(hand.canvas.viewport.pixels()[out["orbited"].shape[0] // 2, out["orbited"].shape[1] // 2].mean())
    window.easel.set_brush(color=(0.15 * level, level, 0.15 * level), radius=0.03)
    dab = [(0.48, 0.48), (0.5, 0.48), (0.52, 0.5), (0.5, 0.52)]

    out["painted"] = hand.rested(lambda: hand.drag(dab))
    out["sentence"] = np.array("\n".join(window.understanding_panel.sentences))
    out["undone"] = hand.rested(window.document.undo)
    sunlit = stage.read_text().replace("inputs:intensity = 8", "inputs:intensity = 16")
    assert sunlit.encode() != before
    stage.write_text(sunlit)  # by another program
    out["brighter"] = hand.reloaded()
    stage.write_bytes(before)
    out["as before"] = hand.reloaded()
    window.bar.hide()
    hand.wait(lambda: hand.canvas.viewport.pixels().shape == out["undone"].shape)
    out["done again"] = hand.rested(window.document.redo)
    window.filing.save()
    hand.wait(lambda: window.document.is_saved and window.worker.is_idle)
    out["look"] = np.array((folder / "look.usda").read_text())
    seen_by = window.easel.view.camera
    out["built in"] = hand.changed_to_built_in(built_in.trigger)
    out["same camera"] = np.array(window.easel.view.camera is seen_by)
    out["said"], out["shot unchanged"] = np.array(said), np.array(stage.read_bytes() == before)
    window.close()
    return out


def main(folder: Path) -> None:
    application = make_application()
    np.savez(folder / "window.npz", **work(folder))
    application.processEvents()


if __name__ == "__main__":
    main(Path(sys.argv[1]))
