"""Strokes that were painted at one frame lie at another where the closed form of the animation puts their places.

The floor of oddity_stages is moved in every way that a shot moves things.  A stroke is painted at frame 1; at frame
10 each of its points is compared with the textbook's matrices, and the edit that it gives holds at every frame.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from kit.oddity_stages import AFTER, FACES, GRID, as_asset, floor_of, floor_shot, painted
from kit.stage_parts import StageBuilder
from numpy.typing import NDArray
from pxr import Gf, Sdf, Usd, UsdGeom, UsdSkel

import usdslf
from usdslf.scene.records import Scene
from usdslf.session import Session
from usdslf.strokes.anchors import locate_stroke
from usdslf.strokes.stroke import Stroke
from usdslf.usd.read.read import read_scene

FIRST, LAST = 1.0, 10.0
Points = Callable[[NDArray], NDArray]
TRAIL = [[(0.30, 0.55), (0.50, 0.62), (0.72, 0.52)], [(0.45, 0.75)]]


def turned(points: NDArray, degrees: float, axis: int = 2, about: tuple = (0, 0, 0)) -> NDArray:
    """Points (n, 3) turned about an axis, counter-clockwise seen from its tip."""
    c, s = math.cos(math.radians(degrees)), math.sin(math.radians(degrees))
    i, j = (axis + 1) % 3, (axis + 2) % 3
    m = np.eye(3)
    m[i, i], m[i, j], m[j, i], m[j, j] = c, -s, s, c
    return (points - about) @ m.T + about


# ---- the ways that things move: each returns where a place of frame 1 is at frame 10 --------------------------
def rigid(b: StageBuilder) -> Points:
    """Lifted and tilted by the transform of a parent and its own."""
    above = UsdGeom.Xform.Define(b.stage, "/World/floor_group")
    moved_below(b, "/World/floor_group")
    lift = above.AddTranslateOp()
    tilt = UsdGeom.Xformable(b.stage.GetPrimAtPath("/World/floor_group/floor")).AddRotateXOp()
    for frame, z, angle in ((FIRST, 0, 0), (LAST, 1.5, 40)):
        lift.Set(Gf.Vec3d(0, 0, z), frame)
        tilt.Set(angle, frame)
    return lambda p: np.add(turned(p, 40, axis=0), (0, 0, 1.5))


def turntable(b: StageBuilder) -> Points:
    """Turned in its own plane: each point still lies on the floor, and often on its own face, but elsewhere."""
    turn = floor_of(b).AddRotateZOp()
    turn.Set(0.0, FIRST)
    turn.Set(25.0, LAST)
    return lambda p: turned(p, 25)


def conveyor(b: StageBuilder) -> Points:
    """Points that slide in their plane, without any transform."""
    attribute = floor_of(b).GetPointsAttr()
    for frame, x in ((FIRST, 0.0), (LAST, 0.7)):
        attribute.Set([Gf.Vec3f(*map(float, p)) for p in np.add(GRID, (x, 0, 0))], frame)
    return lambda p: np.add(p, (0.7, 0, 0))


def deformed(b: StageBuilder) -> Points:
    """Sheared and squashed points."""
    m = np.array([(1.1, 0.3, 0), (-0.2, 0.8, 0), (0.25, 0.4, 1)])
    attribute = floor_of(b).GetPointsAttr()
    for frame, points in ((FIRST, GRID), (LAST, GRID @ m.T)):
        attribute.Set([Gf.Vec3f(*map(float, p)) for p in points], frame)
    return lambda p: p @ m.T


def refined(b: StageBuilder) -> Points:
    """A subdivision surface that is turned in its plane."""
    floor_of(b).GetSubdivisionSchemeAttr().Set("catmullClark")
    return turntable(b)


def moved_below(b: StageBuilder, path: str) -> None:
    root = b.stage.GetRootLayer()
    Sdf.CreatePrimInLayer(root, path)
    Sdf.CopySpec(root, "/World/floor", root, f"{path}/floor")
    b.stage.RemovePrim("/World/floor")


def scene_instance(b: StageBuilder) -> Points:
    """An instance whose root is animated, of an asset that does not move."""
    as_asset(b)
    for name in ("floor", "mtl"):
        b.stage.RemovePrim(f"/World/{name}")
    for name, x in (("a", 0.0), ("b", 30.0)):
        prim = UsdGeom.Xform.Define(b.stage, f"/World/{name}")
        place, turn = prim.AddTranslateOp(), prim.AddRotateZOp()
        place.Set(Gf.Vec3d(x, 0, 0), FIRST)
        place.Set(Gf.Vec3d(x, 0.5, 0), LAST)
        turn.Set(0.0, FIRST)
        turn.Set(-70.0, LAST)
        prim.GetPrim().GetReferences().AddReference("./asset.usda")
        prim.GetPrim().SetInstanceable(True)
    return lambda p: np.add(turned(p, -70), (0, 0.5, 0))


def point_instancer(b: StageBuilder) -> Points:
    """The second of two instances, with animated positions, orientations and scales, in its own plane."""
    moved_below(b, "/World/many/protos")
    instancer = UsdGeom.PointInstancer.Define(b.stage, "/World/many")
    instancer.CreatePrototypesRel().AddTarget("/World/many/protos/floor")
    instancer.CreateProtoIndicesAttr([0, 0])
    half = math.radians(30) / 2
    still, turn = Gf.Quatf(1, 0, 0, 0), Gf.Quatf(math.cos(half), 0, 0, math.sin(half))
    for frame, x, q, size in ((FIRST, 0, still, 1), (LAST, 0.5, turn, 1.25)):
        instancer.CreatePositionsAttr().Set([Gf.Vec3f(30, 0, 0), Gf.Vec3f(x, 0, 0)], frame)
        instancer.CreateOrientationsfAttr().Set([still, q], frame)
        instancer.CreateScalesAttr().Set([Gf.Vec3f(1), Gf.Vec3f(size)], frame)
    return lambda p: np.add(turned(1.25 * p, 30), (0.5, 0, 0))


def skinned(b: StageBuilder) -> Points:
    """Two joints: three quarters of all but the lower edge follow the one that is turned, in the floor's plane."""
    mesh = floor_of(b)
    triangles = np.concatenate([FACES[:, [0, 1, 2]], FACES[:, [0, 2, 3]]])  # so that the cut is known
    mesh.GetFaceVertexCountsAttr().Set([3] * 8)
    mesh.GetFaceVertexIndicesAttr().Set(triangles.ravel().astype(np.int32))
    UsdSkel.Root.Define(b.stage, "/World/rig")
    moved_below(b, "/World/rig")
    skeleton = UsdSkel.Skeleton.Define(b.stage, "/World/rig/skeleton")
    joints, bind = ["base", "base/tip"], [Gf.Matrix4d(1), Gf.Matrix4d().SetTranslate((0, -2, 0))]
    skeleton.CreateJointsAttr(joints)
    skeleton.CreateBindTransformsAttr(bind)
    skeleton.CreateRestTransformsAttr(bind)
    clip = UsdSkel.Animation.Define(b.stage, "/World/rig/skeleton/clip")
    clip.CreateJointsAttr(joints)
    clip.CreateTranslationsAttr([Gf.Vec3f(0), Gf.Vec3f(0, -2, 0)])
    clip.CreateScalesAttr([Gf.Vec3h(1)] * 2)
    half = math.radians(20) / 2
    still, turn = Gf.Quatf(1, 0, 0, 0), Gf.Quatf(math.cos(half), 0, 0, math.sin(half))
    clip.CreateRotationsAttr().Set([still, still], FIRST)
    clip.GetRotationsAttr().Set([still, turn], LAST)
    UsdSkel.BindingAPI.Apply(skeleton.GetPrim()).CreateAnimationSourceRel().SetTargets([clip.GetPath()])
    binding = UsdSkel.BindingAPI.Apply(b.stage.GetPrimAtPath("/World/rig/floor"))
    binding.CreateSkeletonRel().SetTargets([skeleton.GetPath()])
    weight = np.where(GRID[:, 1] > -1, 0.75, 0.0)  # of the tip
    binding.CreateJointIndicesPrimvar(False, 2).Set([0, 1] * 9)
    binding.CreateJointWeightsPrimvar(False, 2).Set(np.stack([1 - weight, weight], 1).ravel().tolist())
    posed = GRID + weight[:, None] * (turned(GRID, 20, about=(0, -2, 0)) - GRID)

    def follow(p: NDArray) -> NDArray:
        """Linear blend skinning of the corners, and their mean by the barycentrics of frame 1."""
        out = np.empty_like(p)
        for corners in triangles:
            a, e, f = GRID[corners[0], :2], GRID[corners[1], :2], GRID[corners[2], :2]
            uv = np.linalg.solve(np.stack([e - a, f - a], 1), (p[:, :2] - a).T).T
            inside = (uv >= -1e-6).all(1) & (uv.sum(1) <= 1 + 1e-6)
            w = np.stack([1 - uv.sum(1), uv[:, 0], uv[:, 1]], 1)
            out[inside] = (w @ posed[corners])[inside]
        return out

    return follow


WAYS = (rigid, turntable, conveyor, deformed, refined, scene_instance, point_instancer, skinned)


def moving_shot(folder: Path, move: Callable[[StageBuilder], Points]) -> tuple[Path, Points]:
    b = floor_shot(folder)
    b.stage.SetStartTimeCode(FIRST)
    b.stage.SetEndTimeCode(LAST)
    follow = move(b)
    return b.save(), follow


def paint(session: Session) -> Stroke:
    return usdslf.paint_stroke(session.scene, session.tracer, session.camera(), TRAIL, 0.03, (0.5, 0.1, 0.1))


def places_at(scene: Scene, stroke: Stroke) -> NDArray:
    located = locate_stroke(scene, stroke)
    assert len(located.row) == len(stroke.points)
    return located.position


@pytest.mark.parametrize("move", WAYS, ids=lambda f: f.__name__)
def test_places_are_where_the_animation_puts_them(tmp_path: Path, move: Callable[[StageBuilder], Points]) -> None:
    path, follow = moving_shot(tmp_path, move)
    session = usdslf.open(str(path), frame=FIRST)
    stroke = paint(session)
    expected = follow(stroke.points.astype(float))
    assert np.linalg.norm(expected - stroke.points, axis=1).max() > 0.2
    np.testing.assert_allclose(places_at(session.scene, stroke), stroke.points, atol=1e-5)
    np.testing.assert_allclose(places_at(read_scene(path, frame=LAST), stroke), expected, atol=2e-5)


@pytest.mark.parametrize("refine", [0, 1, 2])
def test_what_does_not_move_keeps_its_strokes_however_it_is_cut(tmp_path: Path, refine: int) -> None:
    """The frame is another, the floor is not: places are exact, although the anchors are of other triangles."""

    def lamp_moves(b: StageBuilder) -> Points:
        floor_of(b).GetSubdivisionSchemeAttr().Set("catmullClark")
        lift = UsdGeom.Xformable(b.stage.GetPrimAtPath("/World/lamp")).AddTranslateOp(opSuffix="lift")
        for frame in (FIRST, LAST):
            lift.Set(Gf.Vec3d(0, 0, 0.01 * frame), frame)
        return lambda p: p

    path, follow = moving_shot(tmp_path, lamp_moves)
    stroke = paint(usdslf.open(str(path), frame=FIRST))
    scene = read_scene(path, frame=LAST, refine=refine)
    assert not any(m.is_animated for m in scene.meshes)
    np.testing.assert_allclose(places_at(scene, stroke), follow(stroke.points), atol=1e-5)


def test_an_animated_surface_that_is_where_it_was_is_not_said_to_have_moved(tmp_path: Path) -> None:
    path, _ = moving_shot(tmp_path, turntable)
    stage = Usd.Stage.Open(str(path))
    UsdGeom.Xformable(stage.GetPrimAtPath("/World/floor")).GetOrderedXformOps()[-1].Set(0.0, LAST)
    stroke = paint(usdslf.open(str(path), frame=FIRST))
    said: list[str] = []
    assert not locate_stroke(read_scene(stage, frame=LAST), stroke, said).moved and not said


# ---- edits --------------------------------------------------------------------------------------------------
def anchored(scene: Scene, stroke: Stroke) -> Stroke:
    """A stroke of points on a scene with the anchors that painting gives."""
    located = locate_stroke(scene, stroke)
    table, mesh = scene.triangles, scene.triangles.mesh[located.triangle]
    (m,) = np.unique(mesh)
    own = scene.meshes[m]
    within = own.triangle_in_face[located.triangle - table.first_of_mesh[m]]
    return replace(
        stroke,
        surfaces=(own.path,),
        surface_index=np.zeros(len(mesh), np.int32),
        face=table.face[located.triangle],
        barycentric=located.barycentric + np.stack([within, 0 * within], 1),
        frame=scene.frame,
    )


@pytest.mark.parametrize(
    "move", [turntable, deformed, scene_instance, point_instancer, skinned], ids=lambda f: f.__name__
)
def test_an_edit_from_frame_1_holds_at_every_frame(tmp_path: Path, move: Callable[[StageBuilder], Points]) -> None:
    """Painted from the closed form at frame 1, where the floor is flat; the look has no time in it."""
    path, _ = moving_shot(tmp_path, move)
    session = usdslf.open(str(path), frame=FIRST, elements=300)
    session.add_stroke(anchored(session.scene, painted()))
    session.solve()
    (found,) = session.report()["strokes"]
    assert found["inferred"] == "diffuse"
    np.testing.assert_allclose(found["after"]["diffuse"], AFTER["diffuse"], atol=0.02)
    look = tmp_path / "look.usda"
    edits = session.author(look, review_root=tmp_path / "review.usda")
    assert edits and all(e.wins for e in edits)
    layer = Sdf.Layer.FindOrOpen(str(look))
    assert not layer.ListAllTimeSamples()
    review = Usd.Stage.Open(str(tmp_path / "review.usda"))
    surface = session.strokes[0].surfaces[0]
    for frame in (FIRST, 4.0, LAST):
        scene = read_scene(review, frame=frame)
        mesh = next(m for m in scene.meshes if m.path == surface)
        (material,) = np.unique(mesh.material_of_triangle)
        np.testing.assert_allclose(scene.materials[material].diffuse_color, AFTER["diffuse"], atol=0.02)
    # The strokes of frame 1 give the same at frame 10, read from their layer, by the anchors that it holds.
    usdslf.write_strokes(tmp_path / "strokes.usda", session.strokes, session.source)
    (read,) = usdslf.read_strokes(tmp_path / "strokes.usda")
    last = session.at_frame(LAST)
    np.testing.assert_allclose(
        locate_stroke(last.scene, read).position, locate_stroke(last.scene, session.strokes[0]).position, atol=1e-6
    )
