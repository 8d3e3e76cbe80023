"""The panels Stage, Brush and the timeline, by keys and mouse."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pytest
from kit.moving_stages import roll
from kit.windows import LEFT, drag, opened, pixel, solved, wait_for
from PySide6.QtCore import Qt
from PySide6.QtGui import QAction, QColor, QIcon
from PySide6.QtTest import QTest
from PySide6.QtWidgets import QApplication, QComboBox, QLabel, QLineEdit

from hydra_viewer.model.brush_color import shot_color, shown_colors
from hydra_viewer.ui import words
from hydra_viewer.ui.cheat_sheet import CheatSheet
from hydra_viewer.ui.highlight import rim
from hydra_viewer.ui.swatches import swatch_icon
from hydra_viewer.ui.window import Window


@pytest.fixture(scope="module")
def window(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Window]:
    with opened(roll(tmp_path_factory.mktemp("shot"))) as window:
        yield window


def test_a_search_finds_prims_by_name_type_and_material(window: Window) -> None:
    panel = window.stage_panel
    for text, found in (
        ("camera", ["/World/camera"]),
        ("mesh red", ["/World/ball"]),
        ("no such prim", []),
        ("WORLD/MTL wood material", ["/World/mtl/wood"]),
    ):
        panel.search.clear()
        QTest.keyClicks(panel.search, text)
        rows = [panel.model.path(panel.model.index(n, 0)) for n in range(panel.model.rowCount())]
        assert rows[: len(found)] == found and (found or not rows), text
    panel.search.clear()
    assert panel.model.rowCount() == 1 and panel.model.path(panel.model.index(0, 0)) == "/World"


def test_keys_walk_the_tree_and_enter_nothing_by_accident(window: Window) -> None:
    panel = window.stage_panel
    panel.tree.setFocus()
    QTest.keyClick(panel.tree, Qt.Key.Key_Home)
    assert window.document.selected == "/World"
    QTest.keyClick(panel.tree, Qt.Key.Key_Down)
    assert window.document.selected.startswith("/World/")
    assert not window.document.strokes


def test_a_camera_is_looked_through_from_the_tree_and_from_the_bar(window: Window) -> None:
    drag(window.painting.canvas, [(0.5, 0.5), (0.6, 0.5)], Qt.KeyboardModifier.AltModifier)
    assert window.view_bar.camera.currentIndex() == -1
    index = window.stage_panel.model.index_of("/World/camera")
    window.stage_panel.tree.doubleClicked.emit(index)
    assert window.easel.view.camera.path == "/World/camera" == window.view_bar.camera.currentData()


def test_a_colour_is_picked_as_the_screen_shows_it(window: Window) -> None:
    panel, easel = window.brush_panel, window.easel
    for exposure in (0.0, 1.5):
        easel.set_display(exposure=exposure)
        panel.picker.hex.setText("#b4503c")
        panel.picker.hex.editingFinished.emit()
        shown = shown_colors(easel.brush.color, easel.display, shot_color(window.document.shot))[0]
        np.testing.assert_allclose(shown * 255, (0xB4, 0x50, 0x3C), atol=1.0)
    easel.set_display(exposure=0.0)
    brighter = easel.brush.color
    square = panel.picker.findChildren(type(panel.picker._square))[0]
    QTest.mouseClick(square, LEFT, pos=pixel(square, (0.1, 0.1)))
    assert sum(easel.brush.color) > sum(brighter)  # near white
    QTest.keyClick(square, Qt.Key.Key_Down)
    assert easel.brush.color != brighter


def test_choices_go_to_the_brush(window: Window) -> None:
    for name, box in window.brush_panel.choices.items():
        assert isinstance(box, QComboBox) and box.count() >= 2
        box.setFocus()
        box.setCurrentIndex(0)
        QTest.keyClick(box, Qt.Key.Key_Down)
        assert getattr(window.easel.brush, name) == box.currentData()
    window.easel.set_brush(mode="direct", scope="material", norm="mixed", space="scene")


def test_the_timeline_shows_other_frames_with_the_look_over_them(window: Window) -> None:
    assert window.timeline.isVisible()
    drag(window.painting.canvas, [(0.45, 0.9), (0.5, 0.9)])
    solved(window)
    first = window.document.shot
    window.timeline.go_to(3.0)
    wait_for(lambda: window.document.shot is not first)
    assert window.document.shot.scene.frame == 3.0
    assert window.document.found is not None and window.document.found.shot.scene.frame == 3.0
    wood = [next(m for m in s.scene.materials if m.path.endswith("wood")) for s in (window.document.found.shot, first)]
    assert not np.allclose(wood[0].diffuse_color, wood[1].diffuse_color)
    assert len(window.document.strokes) == 1
    QTest.keyClick(window.painting.canvas, Qt.Key.Key_Space)
    assert window.timeline.play.isChecked()
    wait_for(lambda: window.document.shot.scene.frame != 3.0)
    QTest.keyClick(window.painting.canvas, Qt.Key.Key_Space)
    assert not window.timeline.play.isChecked()
    wait_for(lambda: window.worker.is_idle)


def test_a_stroke_that_is_not_found_yet_is_found_at_the_frame_that_one_goes_to(window: Window) -> None:
    document = window.document
    before, strokes = document.shot, len(document.strokes)
    drag(window.painting.canvas, [(0.5, 0.88), (0.55, 0.88)])
    window.timeline.go_to(1.0 if before.scene.frame != 1.0 else 2.0)
    wait_for(lambda: document.shot is not before and document.is_shown, 30)
    assert len(document.found.strokes) == strokes + 1 == len(document.strokes)


def test_the_cheat_sheet_lists_every_shortcut(window: Window) -> None:
    QTest.keyClick(window, Qt.Key.Key_F1)
    sheet = window.findChildren(CheatSheet)[-1]
    said = {label.text() for label in sheet.findChildren(QLabel)}
    keyed = [a for a in window.findChildren(QAction) if not a.shortcut().isEmpty() and a.parent() is window]
    assert len(keyed) > 20
    for action in keyed:
        assert action.shortcut().toString() in said, action.text()
        assert action.shortcut().toString() in action.toolTip()
    sheet.close()


def test_letters_in_a_field_are_letters_and_no_shortcuts(window: Window) -> None:
    field = window.stage_panel.search
    assert isinstance(field, QLineEdit)
    window.easel.take_tool("replace")
    window.activateWindow()
    field.setFocus()
    wait_for(lambda: QApplication.focusWidget() is field)
    QTest.keyClicks(field, "xcd")
    assert field.text() == "xcd" and window.easel.brush.tool == "replace"
    field.clear()


def test_every_panel_can_be_reached_by_keys(window: Window) -> None:
    window.activateWindow()
    window.stage_panel.search.setFocus()
    seen = []
    for _ in range(80):
        focus = QApplication.focusWidget()
        if focus is None or focus in seen:
            break
        seen.append(focus)
        QTest.keyClick(focus, Qt.Key.Key_Tab)
    for panel in (window.stage_panel, window.brush_panel, window.view_bar, window.timeline):
        assert any(panel.isAncestorOf(w) for w in seen), panel
    assert words.TITLE in window.windowTitle()


def test_a_swatch_and_what_is_selected_keep_their_colour(window: Window) -> None:
    icon, looks = swatch_icon(QColor(20, 90, 110)), (QIcon.Mode.Normal, QIcon.Mode.Selected)
    plain, selected = (icon.pixmap(14, 14, mode).toImage().pixelColor(7, 7).getRgb() for mode in looks)
    assert plain == selected == (20, 90, 110, 255)
    inside = np.zeros((40, 40), bool)
    inside[8:32, 8:32] = True
    veil = rim(inside, QColor("white"))
    assert veil.pixelColor(20, 20).alpha() == 0 and veil.pixelColor(8, 20).alpha() > 100
