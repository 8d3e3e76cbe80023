"""Sessions at other frames: light, areas and strokes are right there, and no error adds up from frame to frame."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from kit import moving_stages as stages
from kit.moving_stages import FRAMES
from reference import light_field as ref

import usdslf
from usdslf.light_field.light_field import LightField
from usdslf.session import Session
from usdslf.shot import Shot
from usdslf.strokes.anchors import locate_stroke
from usdslf.strokes.paint import paint_stroke
from usdslf.strokes.stroke import Stroke


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


def seen_from_above(session: Session, places: np.ndarray, height: float) -> np.ndarray:
    """Radiance (n,) that places (n, 2) of x and z send straight up, looked at from a height."""
    n = len(places)
    origin = np.stack([places[:, 0], np.full(n, height), places[:, 1]], 1).astype(np.float32)
    down = np.tile(np.float32([0, -1, 0]), (n, 1))
    hits = session.tracer.intersect(origin, down)
    return session.light_field.radiance_from_hits(hits.triangle, hits.barycentric, down)[:, 0]


def test_there_and_back_is_where_it_was(first: Session, second: Session) -> None:
    """However often: elements are taken from the frame that they were laid at."""
    back = second.at_frame(3.0).at_frame(FRAMES[0])
    for name in ("position", "normal", "frame", "area", "diffuse"):
        np.testing.assert_array_equal(getattr(back.elements, name), getattr(first.elements, name))
    np.testing.assert_array_equal(back.visibility.hit, first.visibility.hit)
    again = back.at_frame(FRAMES[1])
    np.testing.assert_array_equal(again.elements.position, second.elements.position)
    np.testing.assert_array_equal(again.visibility.hit, second.visibility.hit)


def test_a_chest_that_opens_is_lit_within(tmp_path: Path) -> None:
    """The middle of its floor is the closed form of what it sees of the sky through the opening; walls are black."""
    path = str(stages.chest(tmp_path))
    first = usdslf.open(path, frame=FRAMES[0], elements=1200)
    within = np.abs(first.elements.position - [0, 0.5, 0]).max(1) < 0.49
    assert not within.any()
    at = np.random.default_rng(0).uniform(-0.1, 0.1, (200, 2))
    assert seen_from_above(first, at, 0.9).max() == 0
    second = first.at_frame(FRAMES[1])
    assert any("added" in w for w in second.warnings)
    # A small area sees a rectangle of half sides a, b at a distance of c, parallel and above its middle: 4 corners
    # of Howell, catalogue of configuration factors, B-4.
    a = b = 1 / np.sqrt(2)
    factor = 4 * (1 / (2 * np.pi)) * 2 * a * np.arctan(b)
    fresh = usdslf.open(path, frame=FRAMES[1], elements=1200)
    mine, other = (seen_from_above(s, at, 0.9).mean() for s in (second, fresh))
    assert other == pytest.approx(0.5 * factor, rel=0.03)
    assert mine == pytest.approx(0.5 * factor, rel=0.03)
    # Elements are as dense there as elsewhere, and stand for all of it.
    e = second.elements
    on = (e.mesh == 0) & (e.side > 0)
    assert e.area[on].sum() == pytest.approx(4.0, rel=0.03)
    assert np.median(e.area[on]) == pytest.approx(np.median(first.elements.area), rel=0.1)


def test_a_chest_that_a_lamp_is_moved_into_is_lit_within(tmp_path: Path) -> None:
    """A sphere of radius r and radiance L throws pi L r^2 h / (h^2 + x^2)^(3/2) on a floor h below it, at x."""
    first = usdslf.open(str(stages.lamp_in_a_chest(tmp_path)), frame=FRAMES[0], elements=800)
    assert (np.abs(first.elements.position - [0, 0.5, 0]).max(1) > 0.49).all()
    second = first.at_frame(FRAMES[1])
    e = second.elements
    rows = np.flatnonzero((e.mesh == 0) & (e.side > 0))
    assert e.area[rows].sum() == pytest.approx(4.0, rel=0.03)
    out = second.light_field.device.download(second.light_field.outgoing_d)[rows, :, 0].mean(1)
    away2 = (e.position[rows][:, [0, 2]] ** 2).sum(1)
    np.testing.assert_allclose(out, 0.5 * 30 * 0.1**2 * 0.5 / (0.25 + away2) ** 1.5, rtol=0.05)


def test_a_table_is_lit_where_something_lay_on_it(tmp_path: Path) -> None:
    """Under a white sky it sends out its reflectance everywhere, from as many elements as elsewhere."""
    first = usdslf.open(str(stages.slab(tmp_path)), frame=FRAMES[0], elements=800)
    e = first.elements
    under = (np.abs(e.position[:, [0, 2]]).max(1) < 0.36) & (e.mesh == 0) & (e.side > 0)
    assert not under.any()
    second = first.at_frame(FRAMES[1])
    e = second.elements
    on = (e.mesh == 0) & (e.side > 0)
    under = (np.abs(e.position[:, [0, 2]]).max(1) < 0.4) & on
    density = on.sum() / 4.0
    assert under.sum() == pytest.approx(density * 0.64, rel=0.25)
    assert e.area[on].sum() == pytest.approx(4.0, rel=0.05)
    at = np.random.default_rng(0).uniform(-0.35, 0.35, (300, 2))
    np.testing.assert_allclose(seen_from_above(second, at, 1.0), 0.5, rtol=0.01)


def test_what_sees_a_little_light_by_chance_stays_as_it_was(tmp_path: Path) -> None:
    """Probes in a chest with a slit find light now that they did not find before, and the other way round."""
    first = usdslf.open(str(stages.slit(tmp_path)), frame=FRAMES[0], elements=800)
    e = first.elements
    within = (np.abs(e.position[:, [0, 2]]).max(1) < 0.99) & (e.mesh == 0) & (e.side > 0)
    assert within.sum() < 0.7 * 4.0 / np.median(e.area)  # a part of the floor has no elements
    assert len(first.at_frame(FRAMES[1]).elements) == len(e)


def test_what_grows_shines_and_counts_by_its_new_area(tmp_path: Path) -> None:
    """Two plates, against their integral equation and their area."""
    side = 1.6
    first = usdslf.open(str(stages.plates(1.2, side)(tmp_path)), frame=FRAMES[0], elements=1200, bounces=30)
    second = first.at_frame(FRAMES[1])
    assert not second.warnings
    assert len(second.elements) == len(first.elements)
    e = second.elements
    out = second.light_field.device.download(second.light_field.outgoing_d)[..., 0].mean(1)
    for mesh, exact in zip((0, 1), ref.square_plates(side, 1, (1, 0), (0.5, 0.8)), strict=True):
        rows = np.flatnonzero((e.mesh == mesh) & (e.position[:, 1] * e.geometric_normal[:, 1] * (2 * mesh - 1) <= 0))
        rows = rows[(e.geometric_normal[rows, 1] > 0) == (mesh == 0)]
        expected = exact(e.position[rows][:, [0, 2]])
        assert out[rows].mean() == pytest.approx(expected.mean(), rel=0.01)
        assert e.area[rows].sum() == pytest.approx(side**2, rel=1e-3)


def test_what_grows_much_is_laid_afresh_and_that_is_said(tmp_path: Path) -> None:
    path = str(stages.plates(0.5, 1.5)(tmp_path))
    second = usdslf.open(path, frame=FRAMES[0], elements=300).at_frame(FRAMES[1])
    assert any("9 times its area" in w and "afresh" in w for w in second.warnings)
    fresh = usdslf.open(path, frame=FRAMES[1], elements=300)
    np.testing.assert_array_equal(second.elements.position, fresh.elements.position)


def test_other_faces_are_laid_afresh_and_that_is_said(tmp_path: Path) -> None:
    path = str(stages.flip_book(tmp_path))
    second = usdslf.open(path, frame=FRAMES[0], elements=300).at_frame(FRAMES[1])
    assert any("cuts /World/page into other triangles" in w and "afresh" in w for w in second.warnings)
    fresh = usdslf.open(path, frame=FRAMES[1], elements=300)
    np.testing.assert_array_equal(second.elements.position, fresh.elements.position)
    np.testing.assert_array_equal(second.visibility.hit, fresh.visibility.hit)


def test_iterations_go_on_from_the_last_frame_to_the_same_light(first: Session) -> None:
    first.light_field  # noqa: B018
    told: list[str] = []
    second = first.at_frame(FRAMES[0] + 0.5)
    second._say = lambda step, share: told.append(step)
    warm = second.light_field
    cold = LightField(
        second.device, second.elements, second.lookup, second.visibility, second.fixed_light
    )
    needed = len(list(cold.converge(8)))
    assert told.count("light field") - 2 < needed  # beside its begin and end
    list(cold.converge(40, 1e-6))
    exact, mine = (f.device.download(f.outgoing_d).astype(np.float64) for f in (cold, warm))
    assert np.abs(mine - exact).sum() < 4e-3 * exact.sum()


def _paint(session: Session, paths: list) -> Stroke:
    return paint_stroke(
        session.scene, session.tracer, session.camera(), paths, 0.012, tool="brighten", strength=0.6,
        name="stroke_0001",
    )  # fmt: skip


def test_a_stroke_follows_its_ball_and_finds_the_same(first: Session) -> None:
    stroke = _paint(first, [[(0.245, 0.51)], [(0.225, 0.50)], [(0.265, 0.50)], [(0.24, 0.55)]])
    assert stroke.surfaces == ("/World/ball",)
    first.strokes = [stroke]
    second = first.at_frame(FRAMES[1])
    first.strokes = []
    (followed,) = second.solve()
    assert any("moved" in w for w in second.warnings)
    assert followed.chosen.freed
    # the same stroke, laid where the ball is now
    at = locate_stroke(second.scene, stroke)
    second.strokes = [replace(stroke, points=at.position, normals=at.normal, frame=FRAMES[1])]
    second.warnings.clear()
    (laid,) = second.solve()
    assert not any("moved" in w for w in second.warnings)
    assert laid.chosen.id == followed.chosen.id
    for name, value in laid.after.items():
        np.testing.assert_allclose(followed.after[name], value, atol=1e-3)


def test_a_stroke_painted_at_the_other_frame_finds_what_it_finds_there_afresh(first: Session, path: Path) -> None:
    second, fresh = first.at_frame(FRAMES[1]), usdslf.open(str(path), frame=FRAMES[1], elements=700)
    found = []
    for session in (second, fresh):
        stroke = _paint(session, [[(0.54, 0.51)], [(0.52, 0.50)], [(0.56, 0.50)], [(0.54, 0.55)]])
        assert stroke.surfaces == ("/World/ball",)
        session.add_stroke(stroke)
        (answer,) = session.solve()
        assert answer.chosen.freed
        assert not any("moved" in w for w in session.warnings)
        found.append(answer)
    mine, other = found
    assert mine.chosen.id == other.chosen.id
    for name, value in other.after.items():
        np.testing.assert_allclose(mine.after[name], value, atol=0.05)
