"""Panels by real events: paint, read, choose, undo, edit the list of strokes by keys, compare."""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Iterator
from pathlib import Path

os.environ.setdefault("QT_QPA_PLATFORM", "offscreen")

import numpy as np
import pytest
from kit.painted_table import CAMERA, ON_RED, OPTIONS, write_table
from PySide6.QtCore import QPoint, Qt
from PySide6.QtTest import QTest
from PySide6.QtWidgets import QApplication, QLabel, QWidget

from hydra_viewer.model.document import Files
from hydra_viewer.ui import panel_words as words
from hydra_viewer.ui.application import make_application
from hydra_viewer.ui.window import Window
from usdslf import paint_stroke

LEFT, CTRL, SHIFT, ALT = (
    Qt.MouseButton.LeftButton,
    Qt.KeyboardModifier.ControlModifier,
    Qt.KeyboardModifier.ShiftModifier,
    Qt.KeyboardModifier.AltModifier,
)
PATIENCE_S = 120.0
BESIDE_THE_HIGHLIGHT = (0.70, 0.40), (0.72, 0.42)  # of the grey ball, in a picture of 4 : 3


class Artist:
    """Works in a window by mouse and keys."""

    def __init__(self, window: Window) -> None:
        self.window = window

    def wait(self, until: Callable[[], object]) -> None:
        began, application = time.monotonic(), QApplication.instance()
        while not until():
            assert application is not None and time.monotonic() - began < PATIENCE_S, self.window.bar.text
            application.processEvents()
            time.sleep(0.005)

    def until_understood(self) -> None:
        w = self.window
        self.wait(lambda: w.explaining.is_current and (not w.document.active or w.document.found.is_lit))

    def paint(self, *places: tuple[float, float]) -> None:
        canvas = self.window.painting.canvas
        at = [QPoint(round(x * canvas.width()), round(y * canvas.height())) for x, y in places]
        QTest.mousePress(canvas, LEFT, pos=at[0])
        for point in at[1:]:
            QTest.mouseMove(canvas, point)
        QTest.mouseRelease(canvas, LEFT, pos=at[-1])

    def press(self, key: Qt.Key, held: Qt.KeyboardModifier = Qt.KeyboardModifier.NoModifier,
              on: QWidget | None = None) -> None:  # fmt: skip
        QTest.keyClick(on or self.window, key, held)


@pytest.fixture(scope="module")
def artist(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Artist]:
    folder = tmp_path_factory.mktemp("panels")
    make_application()
    window = Window(OPTIONS)
    window.resize(1100, 700)
    window.show()
    window.filing.open(Files(str(write_table(Path(folder)))))
    found = Artist(window)
    found.wait(lambda: window.document.shot is not None)
    window.easel.set_brush(color=(0.05, 0.08, 0.5), space="reflectance", radius=0.02)
    found.paint(*ON_RED)
    found.until_understood()
    yield found
    window.document.mark_saved(window.document.files, window.document.strokes)
    window.close()
    window.deleteLater()


@pytest.fixture
def first(artist: Artist) -> Iterator[Artist]:
    """With the first stroke alone, as it was understood."""
    yield artist
    while len(artist.window.document.undoes) and len(artist.window.document.strokes) != 1:
        artist.window.document.undo()
    while artist.window.document.undoes and artist.window.document.undoes != "replace stroke":
        artist.window.document.undo()
    artist.until_understood()


def test_a_sentence_and_pictures_come_and_a_click_takes_another_explanation(first: Artist) -> None:
    w = first.window
    (card,) = w.understanding_panel.cards
    assert w.understanding_panel.sentences == (card.group.sentence,) and card.sentence.text()
    first.wait(lambda: w.explaining.effects is not None)
    before = card.group.chosen
    assert before is not None and all(tile.has_picture or not tile.isEnabled() for tile in card.tiles.values())
    other = next(t for t in card.tiles.values() if not t.isChecked() and t.isEnabled())
    QTest.mouseClick(other, LEFT)
    assert w.document.undoes == f"choice of {other.alternative.title}"
    assert not w.understanding_panel.sentences  # it is looked for
    first.until_understood()
    (card,) = w.understanding_panel.cards
    assert all(tile.has_picture or not tile.isEnabled() for tile in card.tiles.values())  # they are the same
    assert card.group.chosen is not None and card.group.chosen.id == other.alternative.id
    assert card.group.is_chosen_by_hand
    QTest.mouseClick(card.let_decide, LEFT)
    first.until_understood()
    chosen = w.understanding_panel.cards[0].group.chosen
    assert chosen is not None and chosen.id == before.id


def test_a_near_tie_is_asked_as_a_question_with_two_pictures(first: Artist) -> None:
    w = first.window
    shot, places = w.document.shot, [np.array(BESIDE_THE_HIGHLIGHT)]
    # light there may come from a stronger highlight, or from a broader one
    lighter = paint_stroke(
        shot.scene, shot.tracer, shot.camera(CAMERA), places, 0.02, (0.3, 0.3, 0.3), aspect=4 / 3, name="stroke_0002"
    )
    w.document.change_strokes("replace stroke", [*w.document.strokes, lighter])
    first.until_understood()
    card = w.understanding_panel.cards[0]
    assert card.group.strokes == ("stroke_0002",) and card.group.rival
    (question,) = [x for x in card.findChildren(QLabel) if x.text() == words.QUESTION]
    first.wait(lambda: w.explaining.effects is not None)
    asked = list(card.tiles.values())[:2]
    assert [t.alternative.id for t in asked] == [card.group.chosen.id, card.group.rival]
    assert all(t.has_picture and t.y() > question.y() for t in asked) and asked[0].y() == asked[1].y()
    pictures = [np.asarray(t.preview.picture) for t in asked]
    assert np.abs(pictures[0] - pictures[1]).mean() > 0.01 * pictures[0].mean()  # a question that can be answered
    first.press(Qt.Key.Key_2, ALT)
    first.until_understood()
    answered = w.understanding_panel.cards[0].group
    assert answered.chosen.id == asked[1].alternative.id and answered.is_chosen_by_hand and not answered.rival
    assert w.document.strokes[1].choice == asked[1].alternative.id


def test_where_to_dab_next_is_marked_on_the_picture_with_the_colours_that_are_expected(first: Artist) -> None:
    w = first.window
    first.press(Qt.Key.Key_N)
    first.wait(lambda: w.explaining.marked is not None)
    marked, place = w.explaining.marked, w.marks.dab_place
    assert marked is not None and place is not None and len(marked.dab.expected) == 2
    seen = w.painting.canvas.pick((place.x(), place.y()))
    assert seen is not None and seen.material == marked.group.material
    first.press(Qt.Key.Key_N)
    assert w.explaining.marked is None


def test_a_scope_is_shown_while_it_is_pointed_at_and_changes_strokes_when_it_is_clicked(first: Artist) -> None:
    w = first.window
    (card,) = w.understanding_panel.cards
    card.scopes["prim"].setFocus()
    card.scope_looked_at.emit("prim")
    first.wait(lambda: w.explaining.mask is not None)
    prim = float(np.mean(w.explaining.mask > 0))
    card.scope_looked_at.emit("material")
    first.wait(lambda: w.explaining.mask is not None and float(np.mean(w.explaining.mask > 0)) > prim)
    QTest.mouseClick(card.scopes["prim"], LEFT)
    assert w.explaining.mask is None and [s.scope for s in w.document.strokes] == ["prim"]


def test_the_list_of_strokes_is_worked_with_keys_alone(first: Artist) -> None:
    w = first.window
    tree = w.strokes_panel.tree
    first.paint((0.66, 0.50), (0.70, 0.52))
    first.until_understood()
    assert tree.topLevelItemCount() == 2 and w.understanding_panel.cards[0].group.strokes == ("stroke_0002",)
    tree.setFocus()
    tree.setCurrentItem(tree.topLevelItem(0))
    assert w.understanding_panel.cards[0].group.strokes == ("stroke_0001",)  # what is selected is explained first
    first.press(Qt.Key.Key_Down, on=tree)
    first.press(Qt.Key.Key_Space, on=tree)
    assert [s.active for s in w.document.strokes] == [True, False]
    first.until_understood()
    assert len(w.understanding_panel.cards) == 1 and tree.topLevelItem(1).text(2) == "off"
    first.press(Qt.Key.Key_Up, CTRL, on=tree)
    assert [s.name for s in w.document.strokes] == ["stroke_0002", "stroke_0001"]
    assert w.strokes_panel.selected == ("stroke_0002",)
    first.press(Qt.Key.Key_Delete, on=tree)
    assert [s.name for s in w.document.strokes] == ["stroke_0001"]
    first.press(Qt.Key.Key_Z, CTRL)
    assert [s.name for s in w.document.strokes] == ["stroke_0002", "stroke_0001"]


def test_what_a_stroke_means_is_edited_afterwards(first: Artist) -> None:
    w = first.window
    w.strokes_panel.select(("stroke_0001",))
    tool = w.strokes_panel.fields.choices["tool"]
    tool.setFocus()
    first.press(Qt.Key.Key_End, on=tool)
    assert [s.tool for s in w.document.strokes] == ["fixate"] and w.document.undoes == "tool fixate"
    w.strokes_panel.fields.color_changed.emit((0.1, 0.2, 0.3))
    assert np.allclose(w.document.strokes[0].colors, [0.1, 0.2, 0.3])


def test_before_wipe_and_difference_are_a_key_away(first: Artist) -> None:
    w = first.window
    first.wait(lambda: w.painting.canvas.viewport.pixels() is not None)
    first.press(Qt.Key.Key_V)
    layer, canvas = w.compare_layer, w.painting.canvas
    first.wait(lambda: layer.other is not None and layer.other.pixels() is not None)
    x = layer.handle.geometry().center().x()
    assert abs(x - canvas.width() / 2) < 3
    QTest.mousePress(layer.handle, LEFT, pos=QPoint(6, 50))
    QTest.mouseMove(layer.handle, QPoint(6 - canvas.width() // 4, 50))
    QTest.mouseRelease(layer.handle, LEFT)
    assert abs(w.comparison.state.split - 0.25) < 0.02
    first.press(Qt.Key.Key_V, SHIFT)
    first.wait(lambda: not layer.difference.image.isNull())
    image = layer.difference.image
    on_red = image.pixelColor(round(0.33 * image.width()), round(0.51 * image.height()))
    corner = image.pixelColor(2, 2)
    assert on_red.lightness() > corner.lightness() + 40
    first.press(Qt.Key.Key_Backslash)
    assert not layer.is_beside and not layer.handle.isVisible() and w.comparison.state.mode == "other"
    first.press(Qt.Key.Key_K)
    assert w.compare_panel.snapshots.count() == 1
    first.press(Qt.Key.Key_L)
    assert w.comparison.other is w.document.found
    first.press(Qt.Key.Key_Backslash)
    assert w.comparison.state.mode == "now"
