"""Work: what is found of strokes is told part by part: first the answer, then its picture, its light, its look."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest
from kit.painted_table import CAMERA, ON_RED, OPTIONS, write_table

from hydra_viewer.model.found import Found
from hydra_viewer.model.understanding import understood
from hydra_viewer.model.work import finding
from usdslf import Shot, Stroke, paint_stroke
from usdslf.scene.difference import look_alike

BLUE = (0.05, 0.08, 0.5)


@dataclass(frozen=True)
class Case:
    """A stroke on the red ball, and what was told of it, in order."""

    shot: Shot
    told: tuple[Found, ...]


@pytest.fixture(scope="module")
def shot(tmp_path_factory: pytest.TempPathFactory) -> Shot:
    options = OPTIONS | {"bounces": 8}  # until the light rests
    return Shot.open(str(write_table(tmp_path_factory.mktemp("work"))), **options)


def painted(shot: Shot, **more: str) -> Stroke:
    camera = shot.camera(CAMERA)
    return paint_stroke(
        shot.scene, shot.tracer, camera, [np.array(ON_RED)], 0.02, BLUE, aspect=4 / 3, space="reflectance", **more
    )


def found_of(shot: Shot, stroke: Stroke, folder: Path, is_look_first: bool = True) -> tuple[Found, ...]:
    """All that is told of a stroke, what comes last too."""
    steps, told = finding(shot, (stroke,), folder, is_look_first), list[Found]()
    while True:
        try:
            part = next(steps)
        except StopIteration as end:
            return (*told, end.value)
        if isinstance(part, Found):
            told.append(part)


@pytest.fixture(scope="module")
def case(shot: Shot, tmp_path_factory: pytest.TempPathFactory) -> Case:
    return Case(shot, found_of(shot, painted(shot), tmp_path_factory.mktemp("looks")))


def test_the_answer_comes_before_its_light_and_both_before_the_look(case: Case) -> None:
    parts = [(f.is_first, f.shot is not None, f.look is not None, f.is_lit) for f in case.told]
    assert parts == [
        (True, False, False, False), (True, True, False, False), (False, False, False, False),
        (False, True, False, False), (False, True, True, False), (False, True, True, True),
    ]  # fmt: skip
    assert [f.is_whole for f in case.told] == [False] * 5 + [True]


def test_the_light_comes_before_the_look_where_the_picture_needs_none(case: Case, tmp_path: Path) -> None:
    told = found_of(case.shot, case.told[-1].strokes[0], tmp_path, is_look_first=False)
    assert [(f.shot is not None, f.look is not None, f.is_lit) for f in told[-3:]] == [
        (True, False, False), (True, False, True), (True, True, True),
    ]  # fmt: skip
    assert told[-1].shot is told[-2].shot is told[-3].shot


def test_the_first_answer_is_what_the_whole_one_refines(case: Case) -> None:
    first, last = (understood(case.shot, f)[0] for f in (case.told[0], case.told[-1]))
    assert first.material == last.material and first.chosen.id == last.chosen.id
    for a, b in zip(first.changes, last.changes, strict=True):
        assert np.abs(np.subtract(a.after, b.after)).max() < 0.05
    assert abs(first.explained - last.explained) < 0.05 and last.explained > 0.8


def test_what_is_shown_before_there_is_a_look_is_what_usd_shows_with_it(case: Case) -> None:
    last, before = case.told[-1], case.told[3].shot
    read = case.shot.edited(last.look.path).scene.materials
    assert look_alike(read, before.scene.materials) and not look_alike(read, case.shot.scene.materials)
    assert last.shot is before  # so it stays, and its light is not made twice
    assert last.look.over(case.shot, case.shot) is not case.shot


def test_a_look_is_read_once(case: Case, monkeypatch: pytest.MonkeyPatch) -> None:
    def not_again(*_: object, **__: object) -> None:
        raise AssertionError("the look is read again")

    last, before = case.told[-1], case.told[3].shot
    monkeypatch.setattr("usdslf.shot.read_scene", not_again)
    assert last.look.over(case.shot, before) is before


def test_its_light_is_that_of_the_look(case: Case) -> None:
    anew, follows = (s.light_field.radiance() for s in (case.shot.edited(case.told[-1].look.path), case.told[-1].shot))
    before = case.shot.light_field.radiance()
    assert np.abs(follows - anew).sum() < 5e-3 * np.abs(anew).sum() < 0.1 * np.abs(anew - before).sum()


def test_a_change_of_a_part_of_what_shows_a_material_waits_for_its_look(shot: Shot, tmp_path: Path) -> None:
    told = found_of(shot, painted(shot, scope="prim", name="stroke_0002"), tmp_path)
    assert [f.shot is not None for f in told] == [False, False, True, True]
    mine = [m.path for m in told[-1].shot.scene.materials]
    assert len(mine) == len(shot.scene.materials) + 1  # the ball's own, beside the one that the other ball shows
