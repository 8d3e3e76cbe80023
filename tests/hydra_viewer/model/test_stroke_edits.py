"""Edits of the list of strokes: only what is named changes, and what did not change is the very same record."""

from __future__ import annotations

import numpy as np
import pytest

from hydra_viewer.model.document import Document
from hydra_viewer.model.stroke_edits import (
    changed,
    chosen,
    deleted,
    described,
    is_same_paint,
    moved,
    placed,
    recolored,
    toggled,
)
from usdslf import Stroke

ONES = np.ones((2, 3), np.float32)
A, B, C = (Stroke(name, ONES, np.ones(2, np.float32), ONES * 0.5, ONES) for name in "abc")
ALL = (A, B, C)


def names(strokes: tuple[Stroke, ...]) -> str:
    return "".join(s.name for s in strokes)


def test_strokes_are_switched_together_and_on_only_where_all_are_off() -> None:
    one_off = toggled(ALL, "b")
    assert [s.active for s in one_off] == [True, False, True] and one_off[0] is A
    assert [s.active for s in toggled(one_off, "abc")] == [False, False, False]
    assert [s.active for s in toggled(toggled(ALL, "bc"), "bc")] == [True, True, True]


@pytest.mark.parametrize(
    ("which", "by", "order"),
    [("c", -1, "acb"), ("a", -1, "abc"), ("ab", 1, "cab"), ("bc", 1, "abc"), ("ac", -1, "acb"), ("b", 1, "acb")],
)
def test_strokes_move_a_place_and_stop_at_the_end(which: str, by: int, order: str) -> None:
    assert names(moved(ALL, which, by)) == order


def test_strokes_are_deleted_and_placed_by_name() -> None:
    assert deleted(ALL, "ac") == (B,)
    assert placed(ALL, ("c", "a", "b")) == (C, A, B)


def test_what_a_stroke_means_is_changed_and_asked_anew() -> None:
    by_hand = chosen(ALL, "a", "diffuse")
    assert (by_hand[0].choice, by_hand[1]) == ("diffuse", B)
    again = changed(by_hand, "ab", scope="prim")
    assert [(s.scope, s.choice) for s in again] == [("prim", ""), ("prim", ""), ("material", "")]
    assert changed(again, "ab", scope="prim")[0] is again[0]
    red = recolored(by_hand, "a", (0.5, 0.1, 0.0))
    assert (red[0].colors == np.float32([0.5, 0.1, 0.0])).all() and red[0].choice == "" and red[1] is B


def test_a_choice_leaves_the_paint_the_same() -> None:
    assert is_same_paint(A, chosen(ALL, "a", "specular")[0])
    assert not is_same_paint(A, recolored(ALL, "a", (0.5, 0.5, 0.5))[0])
    assert not is_same_paint(A, changed(ALL, "a", strength=0.5)[0])


def test_a_stroke_without_a_source_does_not_become_a_clone() -> None:
    assert changed(ALL, "a", tool="clone")[0] is A
    assert changed(ALL, "a", tool="fixate")[0].tool == "fixate"


def test_a_line_says_what_is_not_as_usual() -> None:
    assert described(A) == "replace"
    edited = changed(ALL, "a", tool="darken", strength=0.3, mode="indirect")
    assert described(edited[0]) == "darken, indirect, 30 %"


def test_each_edit_is_one_step_of_undo() -> None:
    document = Document()
    document.change_strokes("paint", ALL)
    document.change_strokes("order", moved(document.strokes, "c", -1))
    document.change_strokes("nothing", moved(document.strokes, "a", -1))
    assert document.undoes == "order"
    document.undo()
    assert document.strokes == ALL and document.redoes == "order"
    document.redo()
    assert names(document.strokes) == "acb"
