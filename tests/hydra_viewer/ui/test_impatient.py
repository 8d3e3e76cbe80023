"""An artist who does not wait: what comes in the middle of a stroke, of a solve, of saving."""

from __future__ import annotations

import threading
import time
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from kit.moving_stages import roll
from kit.windows import LEFT, NOTHING, RIGHT, drag, opened, pixel, press, wait_for
from PySide6.QtCore import QPoint, QPointF, Qt, QTimer
from PySide6.QtGui import QWheelEvent
from PySide6.QtTest import QTest
from PySide6.QtWidgets import QApplication, QLabel, QMessageBox

from hydra_viewer.model.autosave import autosave_path
from hydra_viewer.model.document import Files
from hydra_viewer.ui import panel_words
from hydra_viewer.ui.bars import FoldedNote
from hydra_viewer.ui.live_viewport import LIVE, _Painter
from hydra_viewer.ui.window import Window
from usdslf import read_strokes

ON_TABLE = [(0.45, 0.9), (0.5, 0.9), (0.55, 0.9)]
LEFT_ON_TABLE = [(0.25, 0.9), (0.3, 0.9), (0.35, 0.9)]


@pytest.fixture(scope="module")
def window(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Window]:
    stage = roll(tmp_path_factory.mktemp("shot"))
    with opened(stage, stage.with_name("strokes.usda"), stage.with_name("look.usda")) as found:
        yield found


@pytest.fixture(autouse=True)
def _afterwards_nothing_is_painted(window: Window) -> Iterator[None]:
    yield
    window.document.change_strokes("cleared", ())
    window.painting.look_through(None)


def release(window: Window, at: tuple[float, float], button: Qt.MouseButton = LEFT) -> None:
    canvas = window.painting.canvas
    QTest.mouseRelease(canvas, button, NOTHING, pixel(canvas, at))


def wheel(window: Window, at: tuple[float, float]) -> None:
    canvas = window.painting.canvas
    there = QPointF(pixel(canvas, at))
    event = QWheelEvent(
        there, QPointF(canvas.mapToGlobal(there.toPoint())), QPoint(), QPoint(0, 120), Qt.MouseButton.LeftButton,
        NOTHING, Qt.ScrollPhase.NoScrollPhase, False,
    )  # fmt: skip
    QApplication.sendEvent(canvas, event)


def middle_of(window: Window, number: int) -> np.ndarray:
    return np.asarray(window.document.strokes[number].points, np.float64).mean(0)


def test_a_wheel_or_another_button_does_nothing_to_the_stroke_under_way(window: Window) -> None:
    canvas, view = window.painting.canvas, window.easel.view
    press(canvas, ON_TABLE[:2])
    wheel(window, ON_TABLE[1])
    QTest.mousePress(canvas, RIGHT, NOTHING, pixel(canvas, ON_TABLE[1]))
    release(window, ON_TABLE[1], RIGHT)
    assert window.easel.view is view and not window.document.strokes  # it goes on
    release(window, ON_TABLE[2])
    assert len(window.document.strokes) == 1


def test_a_stroke_is_on_what_was_seen_when_the_camera_goes(window: Window) -> None:
    drag(window.painting.canvas, ON_TABLE)
    where = middle_of(window, 0)
    press(window.painting.canvas, ON_TABLE)
    window.document.select("/World/box")
    QTest.keyClick(window, Qt.Key.Key_F)  # in mid-stroke
    assert len(window.document.strokes) == 2  # it ended there
    release(window, LEFT_ON_TABLE[2])
    assert len(window.document.strokes) == 2
    np.testing.assert_allclose(middle_of(window, 1), where, atol=0.02)


def test_a_picture_that_fails_once_is_tried_again(window: Window, monkeypatch: pytest.MonkeyPatch) -> None:
    viewport, tries = window.painting.canvas.viewport, list[object]()
    paint = viewport._painter.paint

    def fail_first(wanted: object) -> None:
        tries.append(wanted)
        if len(tries) == 1:
            raise MemoryError("the device has no memory left")
        paint(wanted)

    monkeypatch.setattr(viewport._painter, "paint", fail_first)
    painted = list[object]()
    changed = viewport.changed.connect(lambda: painted.append(viewport.shown))
    window.easel.view_changed()
    wait_for(lambda: bool(painted), 20)
    viewport.changed.disconnect(changed)  # which would hold the viewport, and that its shot
    assert len(tries) > 1 and window.bar.text == ""


class Host:
    """What a painter of pictures hands them to; notes their sizes."""

    def __init__(self, whole: tuple[int, ...]) -> None:
        self.sizes, self._whole = list[tuple[int, ...]](), whole

    def is_stale(self) -> bool:
        return self.sizes[-1:] == [self._whole]  # a whole one is all that is wanted

    def hand_over(self, shown: object, linear: np.ndarray, codes: np.ndarray, share: float) -> None:
        assert linear.shape == codes.shape
        self.sizes.append(codes.shape[1::-1])


def test_the_picture_is_half_the_size_while_the_camera_moves_and_whole_at_rest(window: Window) -> None:
    wanted = window.painting.canvas.viewport._wanted
    host = Host(wanted.size)
    painter = _Painter(host)  # type: ignore[arg-type]
    painter.paint(replace(wanted, is_moving=True))
    assert host.sizes == [pytest.approx([n / 2 for n in wanted.size], abs=1)]
    painter.paint(replace(wanted, is_moving=False))
    assert host.sizes[-1] == wanted.size


def test_a_stroke_is_on_the_frame_that_was_seen(window: Window) -> None:
    shot, panel = window.document.shot, window.stage_panel
    panel.tree.collapse(panel.model.index(0, 0))
    press(window.painting.canvas, ON_TABLE)
    window.timeline.box.setValue(3.0)
    wait_for(lambda: window.document.shot is not shot)
    assert len(window.document.strokes) == 1
    release(window, ON_TABLE[2])
    assert len(window.document.strokes) == 1
    window.document.change_strokes("cleared", ())
    window.timeline.box.setValue(1.0)
    wait_for(lambda: window.document.shot.scene.frame == 1.0)
    QApplication.processEvents()
    assert not panel.tree.isExpanded(panel.model.index(0, 0))  # it stays as it was unfolded


def test_many_strokes_are_drawn_a_few_at_a_time_and_all_in_the_end(
    window: Window, monkeypatch: pytest.MonkeyPatch
) -> None:
    overlay, drawn = window.painting.canvas.overlay, list[object]()
    monkeypatch.setattr("hydra_viewer.ui.overlay.DRAWING", 0.0)  # one at a time
    monkeypatch.setattr("hydra_viewer.ui.overlay.draw_marks", lambda painter, marks, paint: drawn.append(marks.stroke))
    for path in (ON_TABLE, LEFT_ON_TABLE, ON_TABLE):
        drag(window.painting.canvas, path)
    before = len(drawn)
    overlay.repaint()
    assert len(drawn) <= before + 1
    wait_for(lambda: {id(s) for s in window.document.strokes} <= {id(s) for s in drawn}, 20)


def test_a_change_of_viewport_waits_for_no_thread(window: Window) -> None:
    canvas, before = window.painting.canvas, window.painting.canvas.viewport
    busy = threading.Event()
    before._painter.paint = lambda wanted: busy.wait(20)  # a picture that takes long
    window.easel.view_changed()
    began = time.monotonic()
    canvas.use_viewport(LIVE)
    assert time.monotonic() - began < 1 and before._thread.is_alive()
    busy.set()
    before._thread.join(20)
    assert not before._thread.is_alive()
    wait_for(lambda: canvas.viewport.pixels() is not None)


def test_what_is_said_moves_no_picture(window: Window) -> None:
    size = window.painting.canvas.size()
    window.bar.say("a sentence that is said while somebody paints")
    QApplication.processEvents()
    assert window.bar.isVisible() and window.painting.canvas.size() == size
    window.bar.say("a note that was read", is_error=False)
    window.bar._until_folded.timeout.emit()
    assert not window.bar.isVisible() and window.statusBar().findChild(FoldedNote).toolTip() == "a note that was read"
    window.bar.say("an error stays")
    assert not window.bar._until_folded.isActive()
    window.bar.hide()


def test_a_solve_that_was_cancelled_is_not_said_to_go_on(window: Window) -> None:
    said = lambda: [label.text() for label in window.understanding_panel.findChildren(QLabel)]  # noqa: E731
    drag(window.painting.canvas, ON_TABLE)
    assert panel_words.LOOKING in said()
    window.worker.cancel()
    wait_for(lambda: panel_words.NOT_LOOKED in said(), 5)
    QTest.keyClick(window, Qt.Key.Key_R, Qt.KeyboardModifier.ControlModifier)
    wait_for(lambda: window.explaining.is_current)
    assert panel_words.NOT_LOOKED not in said()


def test_what_is_painted_while_the_rest_is_saved_is_kept_on_the_disk(window: Window) -> None:
    drag(window.painting.canvas, ON_TABLE)
    window.filing.save()
    drag(window.painting.canvas, LEFT_ON_TABLE)
    window.filing.autosave.flush()
    saved = Path(window.document.files.strokes)
    wait_for(lambda: saved.is_file() and window.worker.is_idle)
    assert len(read_strokes(saved)) == 1 and not window.document.is_saved
    window.filing.autosave.flush()
    assert len(read_strokes(autosave_path(window.document.files))) == 2


def test_another_shot_is_opened_once_the_strokes_are_saved(window: Window) -> None:
    files = window.document.files
    other = roll(Path(files.stage).parent / "other")
    drag(window.painting.canvas, ON_TABLE)

    def save() -> None:
        box = QApplication.activeModalWidget()
        assert isinstance(box, QMessageBox)
        box.button(QMessageBox.StandardButton.Save).click()

    QTimer.singleShot(50, save)
    window.filing.open(Files(str(other)))
    wait_for(lambda: window.document.files.stage == str(other), 60)
    assert window.isVisible() and len(read_strokes(files.strokes)) == 1
