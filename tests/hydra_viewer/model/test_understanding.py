"""Understanding: a stroke on a ball is said in words with its range, its alternatives, and what else it changes."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import pytest
from kit.painted_table import CAMERA, ON_RED, OPTIONS, write_table

from hydra_viewer.model.found import Found
from hydra_viewer.model.previews import Effects, Preview, Sight, WholePicture, crop_of, effects_of, previewing
from hydra_viewer.model.scope_mask import scope_mask
from hydra_viewer.model.understanding import NOTHING, Understood, title_of, understood
from usdslf import About, Remark, Shot, Solution, Stroke, UsdslfError, author, paint_stroke, run, seen_prims, solve

BLUE = (0.05, 0.08, 0.5)
ASPECT, SIZE = 4 / 3, (40, 30)


@dataclass(frozen=True)
class Case:
    """A stroke on the red ball, and what came of it."""

    shot: Shot
    stroke: Stroke
    found: Found
    group: Understood
    sight: Sight


@pytest.fixture(scope="module")
def case(tmp_path_factory: pytest.TempPathFactory) -> Case:
    folder = tmp_path_factory.mktemp("understanding")
    shot = Shot.open(str(write_table(folder)), **OPTIONS)
    camera = shot.camera(CAMERA)
    paint = lambda **more: paint_stroke(  # noqa: E731
        shot.scene, shot.tracer, camera, [np.array(ON_RED)], 0.02, BLUE, aspect=ASPECT, **more
    )
    stroke = paint(name="stroke_0001", space="reflectance")
    solution = run(solve(shot, [stroke]), lambda *_: None)
    look = author(shot, solution, folder / "look.usda")
    found = Found((stroke,), solution, look, shot.edited(look.path), is_lit=True)
    (group,) = understood(shot, found)
    return Case(shot, stroke, found, group, Sight(camera, ASPECT, SIZE))


def test_a_stroke_is_said_in_words_with_what_the_paint_allows(case: Case) -> None:
    group = case.group
    (change,) = [c for c in group.changes if c.name == "diffuse"]
    assert np.abs(np.subtract(change.after, BLUE)).max() < 0.12  # painted as an albedo
    assert change.is_color and change.in_words.startswith("diffuse 0.50 0.08 0.06 → ")
    assert all(low <= value <= high for low, value, high in zip(change.low, change.after, change.high))
    assert group.explained > 0.8 and f"explains {100 * group.explained:.0f} % of the stroke" in group.sentence
    assert group.material.endswith("/red") and f"on {group.material}" in group.sentence


def test_alternatives_are_ranked_and_hold_the_chosen_one(case: Case) -> None:
    alternatives = case.group.alternatives
    chances = [a.chance or 0.0 for a in alternatives if a.changes]
    assert chances == sorted(chances, reverse=True) and len(alternatives) > 2
    assert [a.id for a in alternatives if a.is_chosen] == [case.group.chosen.id if case.group.chosen else ""]
    assert not case.group.is_chosen_by_hand
    assert title_of("diffuse+glossiness") == "diffuse colour and glossiness"
    assert title_of("specular of /World/mtl/ring") == "specular colour of ring"
    assert title_of("none") == "nothing changes"


def test_gprims_that_share_the_material_are_named_apart_from_the_painted_ones(case: Case) -> None:
    assert [p.rsplit("/", 1)[-1] for p in case.group.painted] == ["red_ball"]
    assert [p.rsplit("/", 1)[-1] for p in case.group.sharing] == ["other_red_ball"]


def test_another_explanation_is_had_without_solving_and_is_what_solving_begins_with(case: Case) -> None:
    other = next(a for a in case.group.alternatives if a.id == "specular")
    (answer,) = case.found.solution.as_chosen("stroke_0001", "specular").answers
    assert answer.chosen.id == "specular"
    for change in other.changes:
        assert np.allclose(answer.after[change.name], change.after)
    with pytest.raises(UsdslfError, match="no alternative 'gloss'"):
        case.found.solution.as_chosen("stroke_0001", "gloss")
    with pytest.raises(UsdslfError, match="no answer to the stroke nobody"):
        Solution().as_chosen("nobody", "diffuse")


def test_what_a_solve_says_of_a_stroke_is_a_note_but_for_a_near_tie(case: Case) -> None:
    path = case.stroke.path
    other, nothing = "/SlfStrokes/other", "nothing that comes near; nothing is changed"
    said = (
        Remark((other, path), nothing, About.PAINT),
        Remark((path,), "diffuse and specular explain it about equally well; paint more or choose", About.TIE),
        Remark((other,), "painted 2.0 times brighter than the surface can be", About.PAINT),
        "the shot has no lights",
    )
    (group,) = understood(case.shot, replace(case.found, solution=replace(case.found.solution, warnings=said)))
    assert group.notes == (nothing,)
    assert said[0] == f"{other}, {path}: {nothing}"  # as it is said elsewhere


def test_nothing_is_offered_where_it_is_chosen_and_asks_no_question(case: Case) -> None:
    assert case.group.chosen in case.group.offered and len(case.group.offered) == 4 < len(case.group.alternatives)
    answers = tuple(
        replace(a, chosen=next(c for c in a.candidates if c.id == "none"), after=a.before)
        for a in case.found.solution.answers
    )
    (group,) = understood(case.shot, replace(case.found, solution=replace(case.found.solution, answers=answers)))
    assert group.chosen.title == NOTHING and group.chosen.chance is None
    assert group.offered[-1] is group.chosen and len(group.offered) == 4 and not group.question
    tie = replace(case.group, rival="specular")
    assert tie.question == (tie.chosen, tie.alternative("specular")) == tie.offered[:2]


def test_previews_differ_where_the_stroke_is_and_effects_tell_paint_from_light(case: Case) -> None:
    made = list(previewing(case.shot, case.found, (case.group,), case.sight, WholePicture()))
    previews = {p.id: p.picture for p in made if isinstance(p, Preview)}
    assert list(previews) == [a.id for a in case.group.alternatives[: len(previews)]]
    assert all(p is not None and p.shape == (SIZE[1], SIZE[0], 3) for p in previews.values())
    first, second = list(previews.values())[:2]
    assert first is not None and second is not None
    middle = first[12:18, 16:24].mean((0, 1))
    assert middle[2] > 2 * middle[0]  # blue where it was painted blue
    assert np.abs(first - second).max() > 0.02
    (effects,) = [e for e in made if isinstance(e, Effects)]
    by_name = {e.path.rsplit("/", 1)[-1]: e for e in effects.rows}
    assert by_name["red_ball"].is_painted and not by_name["other_red_ball"].is_painted
    assert by_name["other_red_ball"].shows_material
    assert "grey_ball" not in by_name or not by_name["grey_ball"].shows_material


def test_effects_are_means_over_what_a_gprim_shows(case: Case) -> None:
    mesh = np.array([[0, 0, 1], [-1, 2, 2]])
    before, after = np.ones((2, 3, 3)), np.ones((2, 3, 3))
    after[0, 0], after[1, 1] = 1.5, 1.001
    rows = effects_of(case.shot, (case.group,), mesh, before, after)
    assert [(e.path, round(e.change, 6)) for e in rows] == [(case.shot.scene.meshes[0].path, 0.25)]


def test_a_preview_frames_its_stroke(case: Case) -> None:
    (w, h), (left, top, right, bottom) = crop_of(case.shot, [case.stroke], case.sight)
    assert (right - left, bottom - top) == SIZE and left >= 0 and right <= w and top >= 0 and bottom <= h
    (x, y) = np.mean(ON_RED, 0) * [w, h]
    assert abs(x - (left + right) / 2) < 3 and abs(y - (top + bottom) / 2) < 3


def test_a_scope_covers_more_and_more_of_the_picture(case: Case) -> None:
    mask = lambda scope: scope_mask(  # noqa: E731
        case.shot, case.stroke, scope, case.group.material, case.sight.camera, (80, 60)
    ) > 0
    stroke, prim, material, similar = (mask(s) for s in ("stroke", "prim", "material", "similar"))
    seen = seen_prims(case.shot, case.sight.camera, (80, 60))
    shows = lambda name: seen.mesh == [m.path.rsplit("/", 1)[-1] for m in case.shot.scene.meshes].index(name)  # noqa: E731
    assert 0 < stroke.sum() < prim.sum() < material.sum()
    assert (prim == shows("red_ball")).all()
    assert (material == shows("red_ball") | shows("other_red_ball")).all()
    assert not (stroke & ~prim).any() and not (material & ~similar).any()
