"""What moves: visibility is traced again where that can have changed it, and comes out as a trace of everything."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from kit import moving_stages as stages
from kit.moving_stages import FRAMES

import usdslf
from usdslf.animation.retrace import move_elements, retrace
from usdslf.elements.lookup import ElementLookup
from usdslf.light_field.links import BLOCKED
from usdslf.light_field.visibility import Visibility, trace_visibility
from usdslf.scene.difference import Moved, Space, find_moved, why_not_comparable
from usdslf.session import Session
from usdslf.shot import Shot

NOWHERE = Space(np.zeros((0, 3)), np.zeros(0), np.zeros((0, 3)), np.zeros((0, 3)))


@pytest.fixture(scope="module")
def path(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return stages.roll(tmp_path_factory.mktemp("roll"))


@pytest.fixture(scope="module")
def opened_first(path: Path) -> Shot:
    return usdslf.open(str(path), frame=FRAMES[0], elements=700).shot


@pytest.fixture
def first(opened_first: Shot) -> Session:
    return Session(opened_first)


@pytest.fixture(scope="module")
def opened_second(opened_first: Shot) -> Shot:
    return opened_first.at_frame(FRAMES[1])


@pytest.fixture
def second(opened_second: Shot) -> Session:
    return Session(opened_second)


def whole(session: Session) -> Visibility:
    return trace_visibility(session.elements, session.lookup, session.tracer, session.device)


@pytest.mark.parametrize(
    "stage",
    [
        stages.roll,
        stages.glass,
        stages.behind_a_veil,
        stages.glass_behind_a_veil,
        stages.crowd,
        stages.instances,
        stages.copies,
        stages.skinned,
        stages.chest,
        stages.slab,
    ],
    ids=lambda s: s.__name__,
)
def test_the_links_are_those_of_a_trace_of_everything(stage: Callable[[Path], Path], tmp_path: Path) -> None:
    first = usdslf.open(str(stage(tmp_path)), frame=FRAMES[0], elements=400)
    second = first.at_frame(FRAMES[1])
    assert not [w for w in second.warnings if "afresh" in w]
    expected = whole(second)
    known = len(first.visibility.hit)
    assert not np.array_equal(first.visibility.hit, expected.hit[:known])
    np.testing.assert_array_equal(second.visibility.hit, expected.hit)
    assert second.visibility.rays < (0.9 if stage in (stages.crowd, stages.slab) else 0.75) * expected.rays
    assert second.visibility.rays >= (second.visibility.hit[:known] != first.visibility.hit).sum()


def test_a_small_mover_costs_little(second: Session) -> None:
    assert second.visibility.rays < 0.25 * whole(second).rays  # the ball's own rays and those that meet it


@pytest.mark.parametrize("missed", ["all", "what lies on it", "where it is now"])
def test_a_missed_ray_would_be_found(first: Session, second: Session, missed: str) -> None:
    """With a part of what moved left out, the links are wrong."""
    moved = find_moved(first.scene, second.scene)
    nothing = np.zeros(len(second.scene.meshes), bool)
    left = {
        "all": Moved(nothing, NOWHERE, NOWHERE),
        "what lies on it": replace(moved, meshes=nothing),
        "where it is now": replace(moved, after=NOWHERE),
    }[missed]
    # Tables that name nothing otherwise: elements that changed in them would hide what is left out.
    stale = retrace(first.visibility, second.lookup, second.elements, second.lookup, second.tracer, second.device, left)
    assert stale.rays < second.visibility.rays
    assert not np.array_equal(stale.hit, second.visibility.hit)


def test_rays_that_ended_in_the_dark_are_traced_again(first: Session, second: Session) -> None:
    """What they met has no number, so it may have moved, or be lit now."""
    hit = first.visibility.hit.copy()
    hit[::7, ::5] = BLOCKED
    again = retrace(
        replace(first.visibility, hit=hit), first.lookup, second.elements, second.lookup, second.tracer,
        second.device, find_moved(first.scene, second.scene),
    )  # fmt: skip
    np.testing.assert_array_equal(again.hit, second.visibility.hit)


def test_only_what_moved_moves(first: Session, path: Path) -> None:
    after = usdslf.open(str(path), frame=FRAMES[1]).scene
    assert not why_not_comparable(first.scene, after)
    moved = find_moved(first.scene, after).meshes
    assert [m.path for m, is_moved in zip(after.meshes, moved) if is_moved] == ["/World/ball"]
    elements = move_elements(first.elements, first.scene, after, moved)
    on = moved[elements.mesh]
    np.testing.assert_array_equal(elements.position[~on], first.elements.position[~on])
    centre = np.array([0.1, 0.2, 0.25])
    assert np.abs(np.linalg.norm(elements.position[on] - centre, axis=1) - 0.2).max() < 0.02
    np.testing.assert_allclose(elements.area, first.elements.area, rtol=1e-4)
    f = elements.frame
    np.testing.assert_allclose(f @ f.transpose(0, 2, 1), np.tile(np.eye(3), (len(f), 1, 1)), atol=1e-4)
    np.testing.assert_allclose(np.linalg.det(f), 1, atol=1e-4)
    np.testing.assert_allclose(f[:, 2], elements.normal, atol=1e-5)


def test_frames_that_cannot_be_compared_say_why(first: Session, second: Session) -> None:
    before, after = first.scene, second.scene
    assert str(why_not_comparable(before, replace(after, meshes=after.meshes[:-1]))) == "shows other meshes"
    clear = tuple(replace(m, opacity=np.float32([0.2])) for m in after.materials)
    assert "opacity" in str(why_not_comparable(before, replace(after, materials=clear)))
    ball = after.meshes[-1]
    cut = replace(ball, triangles=ball.triangles[:, [1, 2, 0]])
    assert ball.path in str(why_not_comparable(before, replace(after, meshes=(*after.meshes[:-1], cut))))


@pytest.mark.parametrize("stage", [stages.roll, stages.copies, stages.slab, stages.wall], ids=lambda s: s.__name__)
def test_tables_that_are_done_again_in_part_answer_as_new_ones(stage: Callable[[Path], Path], tmp_path: Path) -> None:
    """At random places of all surfaces.

    On what moved, entries that cells share may be stood for by another cell of them; on what did not, they are the
    same, also where something stood between cells and elements, or does now.
    """
    first = usdslf.open(str(stage(tmp_path)), frame=FRAMES[0], elements=600)
    session = first.at_frame(FRAMES[1])
    new = ElementLookup(session.scene, session.tracer, session.elements)
    rng = np.random.default_rng(3)
    n = 20000
    triangle = rng.integers(len(session.scene.triangles.mesh), size=n)
    root = np.sqrt(rng.random(n))
    bary = np.stack([root * rng.random(n), 1 - root], 1).astype(np.float32)
    side = rng.choice([-1, 1], n)
    (mine, share), (other, other_share) = (t.nearest(triangle, bary, side) for t in (session.lookup, new))
    np.testing.assert_array_equal(share.sum(1) > 0, other_share.sum(1) > 0)
    lit = share.sum(1) > 0
    same = mine[:, 0] == other[:, 0]
    still = ~find_moved(first.scene, session.scene).meshes[session.scene.triangles.mesh[triangle]]
    assert same[lit].mean() > 0.95
    assert same[lit & still].mean() > 0.9995
    corners = session.scene.triangles.positions[triangle]
    weights = np.stack([1 - bary.sum(1), *bary.T], 1)
    away = session.elements.position[np.stack([mine, other])] - (corners * weights[..., None]).sum(1)[:, None]
    mean = [(np.linalg.norm(a, axis=2) * s).sum(1)[lit].mean() for a, s in zip(away, (share, other_share))]
    assert mean[0] == pytest.approx(mean[1], rel=5e-3)


def test_no_dark_side_is_met_where_light_comes_only_now(tmp_path: Path) -> None:
    first = usdslf.open(str(stages.chest(tmp_path)), frame=FRAMES[0], elements=400)
    assert (whole(first.at_frame(FRAMES[1])).hit == BLOCKED).mean() < 1e-3
