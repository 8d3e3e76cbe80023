"""An artist's work in the window with real mouse, pen and key events: look, paint, undo, save, open again."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from kit.moving_stages import roll
from kit.windows import (
    ALT,
    CTRL,
    LEFT,
    MIDDLE,
    RIGHT,
    SHIFT,
    drag,
    opened,
    pen,
    pixel,
    press,
    sentences,
    solved,
    wait_for,
)
from PySide6.QtCore import QPoint, Qt
from PySide6.QtGui import QWheelEvent
from PySide6.QtTest import QTest
from PySide6.QtWidgets import QApplication

from hydra_viewer.ui import panel_words as words
from hydra_viewer.ui.window import Window
from usdslf import project_points, read_strokes

BALL = "/World/ball"
ACROSS = [(0.0, 0.0), (0.01, 0.0), (0.02, 0.0), (0.03, 0.01)]


@pytest.fixture(scope="module")
def stage(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return roll(tmp_path_factory.mktemp("shot"))


@pytest.fixture(scope="module")
def shared(stage: Path) -> Iterator[Window]:
    with opened(stage, stage.with_name("strokes.usda"), stage.with_name("look.usda")) as window:
        yield window


@pytest.fixture
def window(shared: Window) -> Window:
    """The window with nothing painted, looked at through the shot's camera, with a red brush."""
    shared.document.change_strokes("nothing", [])
    solved(shared)
    shared.painting.look_through(None)
    shared.easel.draw(pointer="paint", drawn="outline", has_gate=False)
    shared.easel.set_brush(color=(0.02, 0.3, 0.05), radius=0.02, tool="replace", mode="direct", clone_source=None)
    shared.document.select("")
    shared.bar.hide()
    shared.activateWindow()
    wait_for(shared.isActiveWindow)
    return shared


def ball(window: Window) -> tuple[float, float]:
    """Where on the picture the ball's middle is."""
    scene, canvas, view = window.document.shot.scene, window.painting.canvas, window.easel.view
    middle = next(m for m in scene.meshes if m.path == BALL).positions.mean(0, keepdims=True)
    at, _ = project_points(view.camera, middle, canvas.aspect)
    return float(at[0, 0]), float(at[0, 1])


def on_ball(window: Window, path: list[tuple[float, float]] = ACROSS) -> list[tuple[float, float]]:
    x, y = ball(window)
    return [(x + dx, y + dy) for dx, dy in path]


def test_a_stroke_is_understood_undone_and_done_again(window: Window) -> None:
    canvas, document = window.painting.canvas, window.document
    before = canvas.viewport.pixels().mean((0, 1))
    press(canvas, on_ball(window))
    assert len(canvas.overlay.path.places) == len(ACROSS) and not document.strokes  # raw, while it is painted
    QTest.mouseRelease(canvas, LEFT, pos=pixel(canvas, on_ball(window)[-1]))
    (stroke,) = document.strokes
    assert stroke.surfaces == (BALL,) and np.allclose(stroke.colors, (0.02, 0.3, 0.05))
    assert window.easel.brush.recent[0] == (0.02, 0.3, 0.05)
    painted = lambda: canvas.overlay.grab().toImage().pixelColor(pixel(canvas, on_ball(window)[1]))  # noqa: E731
    raw, is_first = painted(), list[bool]()
    assert raw.green() > 1.5 * raw.red() and raw.green() > 1.5 * raw.blue()  # until there is an answer
    document.found_changed.connect(lambda: is_first.append(document.found is not None and document.found.is_first))
    solved(window)
    assert is_first[0] and not is_first[-1]  # an answer in the light as it was came before
    assert painted().alpha() == 0  # the picture shows through
    assert "/World/mtl/red" in sentences(window)
    whole, said = document.found, window.understanding_panel._said
    document.take_found(replace(whole, is_first=True))
    assert said.text() == words.FOLLOWING and "/World/mtl/red" in sentences(window)
    document.take_found(whole)
    assert not said.isVisible()
    wait_for(lambda: canvas.viewport.pixels().mean((0, 1))[1] > before[1] * 1.005)  # greener
    QTest.keyClick(window, Qt.Key.Key_Z, CTRL)
    assert document.strokes == () and window.redo_action.text().endswith("replace stroke")
    solved(window)
    assert sentences(window) == ""
    wait_for(lambda: np.allclose(canvas.viewport.pixels().mean((0, 1)), before, rtol=0.02))
    QTest.keyClick(window, Qt.Key.Key_Z, CTRL | SHIFT)
    assert document.strokes == (stroke,)


def test_what_is_saved_opens_again_as_it_was(window: Window, stage: Path) -> None:
    drag(window.painting.canvas, on_ball(window))
    solved(window)
    said = sentences(window)
    assert window.isWindowModified()
    bytes_of_shot = stage.read_bytes()
    QTest.keyClick(window, Qt.Key.Key_S, CTRL)
    wait_for(lambda: window.worker.is_idle and not window.isWindowModified())
    assert [s.surfaces for s in read_strokes(stage.with_name("strokes.usda"))] == [(BALL,)]
    assert "/World/mtl/red" in said and "red" in stage.with_name("look.usda").read_text()
    assert stage.read_bytes() == bytes_of_shot
    with opened(stage, stage.with_name("strokes.usda")) as again:
        solved(again)
        assert sentences(again) == said


def test_a_pen_that_presses_less_paints_narrower(window: Window) -> None:
    x, y = ball(window)
    pen(window.painting.canvas, [(x - 0.02, y, 0.3), (x, y, 0.6), (x + 0.02, y, 1.0)])
    (stroke,) = window.document.strokes
    assert stroke.widths[0] < 0.45 * stroke.widths.max() and stroke.widths[-1] > 0.9 * stroke.widths.max()


def test_shift_paints_a_straight_line(window: Window) -> None:
    x, y = ball(window)
    drag(window.painting.canvas, [(x - 0.02, y), (x, y - 0.03), (x + 0.02, y)], SHIFT)
    (stroke,) = window.document.strokes
    at, _ = project_points(window.easel.view.camera, stroke.points, window.painting.canvas.aspect)
    assert np.abs(at[:, 1] - at[0, 1]).max() < 0.005 < np.ptp(at[:, 0])


def test_escape_gives_the_stroke_up(window: Window) -> None:
    canvas = window.painting.canvas
    press(canvas, on_ball(window))
    QTest.keyClick(canvas, Qt.Key.Key_Escape)
    QTest.mouseRelease(canvas, LEFT, pos=pixel(canvas, on_ball(window)[-1]))
    assert not window.document.strokes and canvas.overlay.path is None


def test_a_stroke_off_every_surface_is_an_error_in_the_bar(window: Window) -> None:
    drag(window.painting.canvas, [(0.02, 0.02), (0.05, 0.02)])
    assert not window.document.strokes
    assert "lies off every surface" in window.bar.text


def test_keys_and_drags_change_the_brush(window: Window) -> None:
    canvas, easel = window.painting.canvas, window.easel
    QTest.keyClick(window, Qt.Key.Key_BracketRight)
    assert easel.brush.radius == pytest.approx(0.024)
    QTest.keyClick(window, Qt.Key.Key_BracketLeft)
    assert easel.brush.radius == pytest.approx(0.02)
    QTest.keyPress(canvas, Qt.Key.Key_B)
    drag(canvas, [(0.5, 0.5), (0.7, 0.5)])
    QTest.keyRelease(canvas, Qt.Key.Key_B)
    assert easel.brush.radius > 0.03 and not window.document.strokes
    for key, tool in ((Qt.Key.Key_X, "fixate"), (Qt.Key.Key_C, "clone"), (Qt.Key.Key_R, "replace")):
        QTest.keyClick(window, key)
        assert easel.brush.tool == tool and window.brush_panel.tools.buttons[tool].isChecked()


def test_a_colour_of_the_picture_is_taken_scene_linear(window: Window) -> None:
    canvas = window.painting.canvas
    x, y = ball(window)
    QTest.mouseClick(canvas, LEFT, CTRL, pixel(canvas, (x, y)))
    pixels = canvas.viewport.pixels()
    h, w = pixels.shape[:2]
    near = pixels[int(y * h) - 2 : int(y * h) + 3, int(x * w) - 2 : int(x * w) + 3].reshape(-1, 3)
    low, high = near.min(0) - 0.02, near.max(0) + 0.02
    assert (low <= window.easel.brush.color).all() and (window.easel.brush.color <= high).all()
    window.easel.set_display(exposure=2.0)  # of the screen alone
    QTest.mouseClick(canvas, LEFT, CTRL, pixel(canvas, (x, y)))
    assert (window.easel.brush.color <= high).all()
    window.easel.set_display(exposure=0.0)


def test_clone_copies_from_where_it_was_told_to(window: Window) -> None:
    canvas = window.painting.canvas
    QTest.keyClick(window, Qt.Key.Key_C)
    drag(canvas, on_ball(window))
    assert "clones from itself" in window.bar.text and not window.document.strokes  # there is no source yet
    source = canvas.pick((0.5 * canvas.width(), 0.85 * canvas.height()))
    QTest.mouseClick(canvas, LEFT, CTRL, pixel(canvas, (0.5, 0.85)))
    drag(canvas, on_ball(window))
    (stroke,) = window.document.strokes
    assert stroke.tool == "clone"
    np.testing.assert_allclose(stroke.points[0] + stroke.clone_offset, source.point, atol=0.02)


def test_a_click_selects_and_the_tree_shows_it(window: Window) -> None:
    canvas = window.painting.canvas
    QTest.keyClick(window, Qt.Key.Key_Q)
    QTest.mouseClick(canvas, LEFT, pos=pixel(canvas, ball(window)))
    assert window.document.selected == BALL
    panel = window.stage_panel
    assert panel.model.path(panel.tree.currentIndex()) == BALL
    wait_for(lambda: canvas.overlay.rim_names == ("selected",))
    QTest.mouseClick(canvas, LEFT, pos=pixel(canvas, (0.02, 0.02)))
    assert window.document.selected == "" and canvas.overlay.rim_names == ()


def test_alt_and_the_mouse_move_the_camera(window: Window) -> None:
    canvas, easel = window.painting.canvas, window.easel
    first = easel.view
    drag(canvas, [(0.5, 0.5), (0.6, 0.5)], ALT)
    orbit = easel.view
    assert orbit.camera.path == "" and not easel.is_moving
    assert orbit.distance == pytest.approx(first.distance) and not np.allclose(
        orbit.camera.world_from_camera, first.camera.world_from_camera
    )
    drag(canvas, [(0.5, 0.5), (0.6, 0.5)], ALT, MIDDLE)
    assert not np.allclose(easel.view.pivot, orbit.pivot)
    drag(canvas, [(0.5, 0.5), (0.6, 0.5)], ALT, RIGHT)
    assert easel.view.distance < first.distance
    before = easel.view.distance
    at = pixel(canvas, (0.5, 0.5))
    wheel = QWheelEvent(
        at.toPointF(), canvas.mapToGlobal(at).toPointF(), QPoint(), QPoint(0, 120), Qt.MouseButton.NoButton,
        Qt.KeyboardModifier.NoModifier, Qt.ScrollPhase.NoScrollPhase, False,
    )  # fmt: skip
    QApplication.sendEvent(canvas, wheel)
    assert easel.view.distance < before
    near = easel.view.distance
    window.document.select(BALL)
    QTest.keyClick(window, Qt.Key.Key_F)
    assert easel.view.distance != near and ball(window) == pytest.approx((0.5, 0.5), abs=0.02)
    QTest.keyClick(window, Qt.Key.Key_0)
    assert easel.view.camera.path == "/World/camera"
    assert not window.document.strokes


def test_a_new_stroke_cancels_the_solve_that_it_makes_stale(window: Window) -> None:
    canvas = window.painting.canvas
    size = canvas.size()
    drag(canvas, on_ball(window))
    QApplication.processEvents()
    assert not window.worker.is_idle and canvas.size() == size  # the progress takes no place from the picture
    first = window.document.strokes
    drag(canvas, on_ball(window, [(0.0, 0.03), (0.01, 0.03), (0.02, 0.03)]))
    taken = []
    window.document.found_changed.connect(lambda: taken.append(window.document.found))
    solved(window)
    assert taken and all(found.strokes != first for found in taken if found is not None)
    assert len(window.document.found.strokes) == 2
