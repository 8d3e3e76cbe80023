"""What moves: visibility is traced again where that can have changed it, and comes out as a trace of everything."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from pxr import Gf, UsdGeom, UsdLux
from stage_parts import StageBuilder, ball, box, rectangle

import usdslf
from usdslf.anchors import locate_stroke
from usdslf.elements import ElementLookup
from usdslf.motion import move_elements, moved_meshes, retrace
from usdslf.session import Session
from usdslf.strokes import paint_stroke
from usdslf.visibility import trace_visibility

FRAMES = (1.0, 5.0)


def write_shot(folder: Path) -> Path:
    """A ball that rolls over a table past a box, turning, at frames 1 to 5; a lamp, a dome."""
    b = StageBuilder(folder)
    wood = b.material("wood", diffuseColor=(0.5, 0.4, 0.3), roughness=0.7)
    red = b.material("red", diffuseColor=(0.5, 0.1, 0.1), roughness=0.4)
    b.mesh("table", rectangle((-1, 0, 1), (2, 0, 0), (0, 0, -2)), wood)
    b.mesh("box", box(0.3, 0.4, 0.3), wood, (0.35, 0, -0.3), 20.0)
    b.mesh("ball", ball(0.2), red)
    prim = UsdGeom.Xformable(b.stage.GetPrimAtPath("/World/ball"))
    prim.ClearXformOpOrder()
    move, turn = prim.AddTranslateOp(UsdGeom.XformOp.PrecisionDouble, "roll"), prim.AddRotateYOp()
    for frame, x in zip(FRAMES, (-0.5, 0.1)):
        move.Set(Gf.Vec3d(x, 0, 0.25), frame)
        turn.Set(5.0 * frame, frame)
    light = UsdLux.SphereLight.Define(b.stage, "/World/lamp")
    light.CreateRadiusAttr(0.2)
    light.CreateIntensityAttr(30.0)
    light.AddTranslateOp().Set(Gf.Vec3d(-0.6, 1.5, 0.8))
    b.dome_light("sky", 0.3, (1, 1, 1))
    b.camera((0.0, 1.2, 2.0), (0.0, 0.1, 0.0))
    b.stage.SetStartTimeCode(FRAMES[0])
    b.stage.SetEndTimeCode(FRAMES[1])
    return b.save()


@pytest.fixture(scope="module")
def path(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_shot(tmp_path_factory.mktemp("roll"))


@pytest.fixture(scope="module")
def first(path: Path) -> Session:
    return usdslf.open(str(path), frame=FRAMES[0], elements=700)


def test_the_links_are_those_of_a_trace_of_everything(first: Session) -> None:
    second = first.at_frame(FRAMES[1])
    whole = trace_visibility(second.elements, second.lookup, second.tracer, second.device)
    assert not np.array_equal(first.visibility.hit, whole.hit)
    np.testing.assert_array_equal(second.visibility.hit, whole.hit)
    assert second.visibility.rays < 0.5 * whole.rays  # the ball's own rays and those that meet it


def test_there_and_back_is_where_it_was(first: Session) -> None:
    back = first.at_frame(FRAMES[1]).at_frame(FRAMES[0])
    np.testing.assert_allclose(back.elements.position, first.elements.position, atol=1e-5)
    np.testing.assert_allclose(back.elements.normal, first.elements.normal, atol=1e-5)
    assert (back.visibility.hit >> 10 == first.visibility.hit >> 10).mean() > 0.98  # rounding at edges


def test_only_what_moved_moves(first: Session, path: Path) -> None:
    after = usdslf.open(str(path), frame=FRAMES[1]).scene
    moved = moved_meshes(first.scene, after)
    assert moved is not None
    assert [m.path for m, is_moved in zip(after.meshes, moved) if is_moved] == ["/World/ball"]
    elements = move_elements(first.elements, after, moved)
    on = moved[elements.mesh]
    np.testing.assert_array_equal(elements.position[~on], first.elements.position[~on])
    centre = np.array([0.1, 0.2, 0.25])
    assert np.abs(np.linalg.norm(elements.position[on] - centre, axis=1) - 0.2).max() < 0.02
    f = elements.frame
    np.testing.assert_allclose(f @ f.transpose(0, 2, 1), np.tile(np.eye(3), (len(f), 1, 1)), atol=1e-4)
    np.testing.assert_allclose(np.linalg.det(f), 1, atol=1e-4)
    np.testing.assert_allclose(f[:, 2], elements.normal, atol=1e-5)
    assert moved_meshes(first.scene, replace(after, meshes=after.meshes[:-1])) is None
    clear = tuple(replace(m, opacity=np.float32([0.2])) for m in after.materials)
    assert moved_meshes(first.scene, replace(after, materials=clear)) is None


def test_a_missed_ray_would_be_found(first: Session) -> None:
    """With the ball said not to have moved, the links are wrong."""
    second = first.at_frame(FRAMES[1])
    nothing = np.zeros(len(second.scene.meshes), bool)
    try:
        stale = retrace(
            first.visibility, first.lookup, second.elements, second.lookup, second.tracer, second.device, nothing
        )
    except ValueError:
        return
    lookup: ElementLookup = second.lookup
    whole = trace_visibility(second.elements, lookup, second.tracer, second.device)
    if stale.rays < whole.rays:
        assert not np.array_equal(stale.hit, whole.hit)


def test_a_stroke_follows_its_ball_and_finds_the_same(first: Session) -> None:
    camera = first.camera()
    paths = [[(0.245, 0.51)], [(0.225, 0.50)], [(0.265, 0.50)], [(0.24, 0.55)]]
    stroke = paint_stroke(
        first.scene, first.tracer, camera, paths, 0.012, tool="brighten", strength=0.6, name="stroke_0001"
    )
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
