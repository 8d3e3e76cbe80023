"""Odd light, composition, units and time of real stages: read, shown and solved as the plain way, or said.

The table of all oddities is in README.md.
"""

from __future__ import annotations

import json
import math
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from kit.lit_plane import FLOOR, LAMP, POWER, SIZE, dabs, places
from kit.oddity_stages import (
    GRID,
    add_floor,
    add_mesh,
    area_vectors,
    as_asset,
    authored,
    evaluate_at,
    floor_of,
    floor_shot,
    painted,
    picture,
    shown_alike,
    solved,
    solves_and_shows,
    warnings_of,
)
from kit.stage_parts import StageBuilder
from pxr import Gf, Sdf, Usd, UsdGeom, UsdLux, UsdShade, UsdSkel

import usdslf
from usdslf.usd.read.read import read_scene

Run = Callable[..., tuple[int, str, str]]
QUARTER = math.sqrt(0.5)


# ---- light --------------------------------------------------------------------------------------------------
def test_light_from_an_emissive_mesh_only(tmp_path: Path, run: Run) -> None:
    """The lamp as a glowing rectangle: the closed form is that of the lamp, and no other light is put in."""
    b = floor_shot(tmp_path)
    b.stage.RemovePrim("/World/lamp")
    glow = b.material("glow", useSpecularWorkflow=1.0, diffuseColor=(0.0,) * 3, emissiveColor=tuple(map(float, POWER)))
    x, y = SIZE[0] / 2, SIZE[1] / 2
    panel = add_mesh(
        b.stage, "/World/panel", np.add(LAMP, [(-x, -y, 0), (-x, y, 0), (x, y, 0), (x, -y, 0)]), [range(4)]
    )
    UsdShade.MaterialBindingAPI.Apply(panel.GetPrim()).Bind(UsdShade.Material(b.stage.GetPrimAtPath(glow)))
    session = solved(b.save())
    authored(session, tmp_path)
    assert not session.warnings
    assert "no light" not in run("info", b.path)[1]


def test_a_stage_without_light_gets_the_stated_one(tmp_path: Path, run: Run) -> None:
    """It is said, it is the light of two lights authored by hand, and an albedo painted in it is found."""
    b = floor_shot(tmp_path)
    b.stage.RemovePrim("/World/lamp")
    path = b.save()
    warnings_of(path, run, "the stage has no light", "irradiance 2", "dome of radiance 0.35")
    session = usdslf.open(str(path), elements=200)
    asked = np.float32([0.55, 0.15, 0.1])
    trail = [[(0.3 + 0.1 * i, 0.6)] for i in range(5)]
    session.add_stroke(
        usdslf.paint_stroke(session.scene, session.tracer, session.camera(), trail, 0.02, asked, space="reflectance")
    )
    session.solve()
    (stroke,) = session.report()["strokes"]
    assert stroke["inferred"] == "diffuse"
    np.testing.assert_allclose(stroke["after"]["diffuse"], asked, atol=0.06)  # an albedo, 5 % of it specular

    camera = session.camera().world_from_camera
    side, up, back = camera[:3, 0], camera[:3, 1], camera[:3, 2]
    lift, turn = math.radians(35), math.radians(30)  # over the left shoulder
    towards = math.cos(lift) * (math.cos(turn) * back - math.sin(turn) * side) + math.sin(lift) * up
    plain = floor_shot(tmp_path / "plain")
    plain.stage.RemovePrim("/World/lamp")
    plain.distant_light("key", tuple(-towards), math.degrees(session.lights[0].angle), 2.0)
    plain.dome_light("dome", 0.35)
    np.testing.assert_allclose(picture(path), picture(plain.save()), rtol=0.03)


def test_colour_temperature_without_a_temperature_is_6500(tmp_path: Path) -> None:
    """Normalized too: the area of the lamp divides, and 6500 K, which is not white, tints."""
    b = floor_shot(tmp_path)
    lamp = UsdLux.RectLight(b.stage.GetPrimAtPath("/World/lamp"))
    tint = np.array([1.0432, 0.9841, 1.0351])  # UsdLux's own of 6500 K
    lamp.CreateNormalizeAttr(True)
    lamp.CreateEnableColorTemperatureAttr(True)
    lamp.CreateIntensityAttr(SIZE[0] * SIZE[1])
    lamp.GetColorAttr().Set(Gf.Vec3f(*(POWER / tint)))
    session = solves_and_shows(b.save())
    np.testing.assert_allclose(session.lights[0].radiance, POWER, rtol=1e-3)


# ---- instances ----------------------------------------------------------------------------------------------
def test_the_painted_instance_changes_alone(tmp_path: Path) -> None:
    b = floor_shot(tmp_path)
    as_asset(b)
    for name in ("floor", "mtl"):
        b.stage.RemovePrim(f"/World/{name}")
    for name, x in (("near", 0.0), ("far", 30.0)):
        prim = UsdGeom.Xform.Define(b.stage, f"/World/{name}")
        prim.AddTranslateOp().Set(Gf.Vec3d(x, 0, 0))
        prim.GetPrim().GetReferences().AddReference("./asset.usda")
        prim.GetPrim().SetInstanceable(True)
    path = b.save()
    scene = read_scene(path)
    assert [m.path for m in scene.meshes] == ["/World/near/floor", "/World/far/floor"]
    session = usdslf.open(str(path), elements=300)
    session.add_stroke(painted())
    session.solve()
    edits = authored(session, tmp_path, mode="new")
    assert {p for e in edits for p in e.affects} == {"/World/near/floor"}
    review = read_scene(tmp_path / "review.usda")
    far = evaluate_at(review, np.add(places(), (30, 0, 0)))
    np.testing.assert_allclose(far.base_color, np.tile(FLOOR["diffuse"], (16, 1)), atol=1e-6)


def instanced_floors(b: StageBuilder, prototype: Usd.Prim) -> UsdGeom.PointInstancer:
    instancer = UsdGeom.PointInstancer.Define(b.stage, "/World/many")
    instancer.CreatePrototypesRel().AddTarget(prototype.GetPath())
    return instancer


def test_a_point_instancer_with_animated_points(tmp_path: Path) -> None:
    """At frame 10 the first instance lies where the floor is; between frames, on the way there."""
    b = floor_shot(tmp_path)
    root = b.stage.GetRootLayer()
    Sdf.CreatePrimInLayer(root, "/World/many/protos")
    Sdf.CopySpec(root, "/World/floor", root, "/World/many/protos/floor")
    b.stage.RemovePrim("/World/floor")
    instancer = instanced_floors(b, b.stage.GetPrimAtPath("/World/many/protos/floor"))
    instancer.CreateProtoIndicesAttr([0, 0])
    instancer.CreatePositionsAttr().Set([Gf.Vec3f(0, 0, -9), Gf.Vec3f(30, 0, 0)], 1)
    instancer.GetPositionsAttr().Set([Gf.Vec3f(0, 0, 0), Gf.Vec3f(30, 9, 0)], 10)
    b.stage.SetStartTimeCode(1)
    b.stage.SetEndTimeCode(10)
    for frame, share in ((1, 0.0), (4, 1 / 3), (10, 1.0)):
        first, second = read_scene(b.save(), frame=frame).meshes
        np.testing.assert_allclose(first.positions, np.add(GRID, (0, 0, 9 * share - 9)), atol=1e-5)
        np.testing.assert_allclose(second.positions, np.add(GRID, (30, 9 * share, 0)), atol=1e-5)
    session = solved(b.path, frame=10)
    edits = session.author(tmp_path / "look.usda")
    assert edits and all(e.wins for e in edits)


def test_hundreds_of_thousands_of_instanced_triangles(tmp_path: Path) -> None:
    """49 balls of a PointInstancer: their areas add up, and the floor beside them solves."""
    b = floor_shot(tmp_path)
    ball = UsdGeom.Sphere.Define(b.stage, "/World/many/ball")
    ball.CreateRadiusAttr(0.5)
    instancer = instanced_floors(b, ball.GetPrim())
    instancer.CreateProtoIndicesAttr([0] * 49)
    instancer.CreatePositionsAttr([Gf.Vec3f(30 + 2 * i, 2 * j, 0) for i in range(7) for j in range(7)])
    session = solves_and_shows(b.save())
    balls = [m for m in session.scene.meshes if "many" in m.path]
    assert len(balls) == 49 and len(session.scene.triangles.mesh) > 300_000
    area = sum(np.linalg.norm(area_vectors(m), axis=1).sum() for m in balls)
    assert area == pytest.approx(49 * math.pi, rel=1e-3)


# ---- units, axes, roots -------------------------------------------------------------------------------------
def test_no_meters_per_unit_is_a_centimetre(tmp_path: Path, run: Run) -> None:
    b = floor_shot(tmp_path)
    b.stage.ClearMetadata("metersPerUnit")
    path = b.save()
    assert "metersPerUnit" not in path.read_text()
    assert json.loads(run("info", path, "--json")[1])["meters_per_unit"] == 0.01
    solves_and_shows(path)
    shown_alike(path, floor_shot(tmp_path / "plain").save())


@pytest.mark.parametrize("units", [1e9, 1e-12, 0.0, -1.0])
def test_absurd_meters_per_unit_change_nothing(tmp_path: Path, run: Run, units: float) -> None:
    b = floor_shot(tmp_path)
    UsdGeom.SetStageMetersPerUnit(b.stage, units)
    path = b.save()
    code, out, _ = run("info", path)
    assert code == 0 and f"{units:g} m a unit" in out
    solves_and_shows(path)


@pytest.mark.parametrize("up", ["Y", "Z"])
def test_both_up_axes(tmp_path: Path, run: Run, up: str) -> None:
    """The same numbers with another axis up are the same floor; the light of a viewer comes from above in both."""
    b = floor_shot(tmp_path)
    UsdGeom.SetStageUpAxis(b.stage, up)
    path = b.save()
    assert f"{up} up" in run("info", path)[1]
    solves_and_shows(path)
    for prim in ("/World/lamp", "/World/camera"):
        b.stage.RemovePrim(prim)
    b.save()
    towards = usdslf.open(str(path)).lights[0].world_from_light[:3, 2]
    assert towards["XYZ".index(up)] == pytest.approx(math.sin(math.radians(35)), abs=1e-6)


def test_no_default_prim(tmp_path: Path) -> None:
    b = floor_shot(tmp_path)
    b.stage.ClearDefaultPrim()
    solves_and_shows(b.save())


def test_a_camera_outside_the_default_prim(tmp_path: Path, run: Run) -> None:
    """Another root prim: it is listed and rendered through, and the picture is that of the one inside."""
    b = floor_shot(tmp_path)
    root = b.stage.GetRootLayer()
    Sdf.CopySpec(root, "/World/camera", root, "/shot_cam")
    b.stage.RemovePrim("/World/camera")
    path = b.save()
    assert json.loads(run("info", path, "--json")[1])["cameras"] == ["/shot_cam"]
    inside = picture(floor_shot(tmp_path / "plain").save())
    np.testing.assert_array_equal(picture(path, "/shot_cam"), inside)
    solves_and_shows(path)


# ---- files and time -----------------------------------------------------------------------------------------
def old_crate(path: Path) -> Path:
    """A floor in a crate file that says it is of version 0.0.1."""
    stage = Usd.Stage.CreateNew(str(path))
    add_floor(stage, "/floor", "")
    stage.SetDefaultPrim(stage.GetPrimAtPath("/floor"))
    stage.GetRootLayer().Save()
    data = bytearray(path.read_bytes())
    assert data[:8] == b"PXR-USDC"
    data[8:11] = bytes((0, 0, 1))
    path.with_name("old.usdc").write_bytes(data)
    return path.with_name("old.usdc")


@pytest.mark.parametrize("command", ["info", "render", "solve"])
def test_a_crate_that_is_too_old_is_one_sentence(tmp_path: Path, run: Run, command: str) -> None:
    old = old_crate(tmp_path / "new.usdc")
    usdslf.write_strokes(tmp_path / "strokes.usda", [dabs(places(), np.ones((16, 3)))], Usd.Stage.CreateInMemory())
    more = {"info": (), "render": ("-o", "p.exr"), "solve": (tmp_path / "strokes.usda", "-o", tmp_path / "look.usda")}
    code, out, err = run(command, old, *more[command])
    assert (code, out) == (2, "")
    (line,) = err.strip().splitlines()
    assert line.startswith("usdslf: ") and "old.usdc" in line and "0.0.1" in line and "export it again" in line


def test_a_reference_to_a_crate_that_is_too_old_is_a_warning(tmp_path: Path, run: Run) -> None:
    b = floor_shot(tmp_path)
    old_crate(tmp_path / "new.usdc")
    b.stage.DefinePrim("/World/prop").GetReferences().AddReference("./old.usdc")
    path = b.save()
    warnings_of(path, run, "old.usdc", "/World/prop", "0.0.1")
    solves_and_shows(path)


def test_time_samples_outside_the_range_of_the_stage(tmp_path: Path) -> None:
    """Frames 1 to 24 show the first sample, which is of frame 101; frame 106 can be asked for."""
    b = floor_shot(tmp_path)
    move = floor_of(b).AddTranslateOp()
    move.Set(Gf.Vec3d(0, 0, 0), 101)
    move.Set(Gf.Vec3d(0, 0, -5), 111)
    b.stage.SetStartTimeCode(1)
    b.stage.SetEndTimeCode(24)
    path = b.save()
    for frame, z in ((None, 0), (24, 0), (106, -2.5), (500, -5)):
        np.testing.assert_allclose(
            read_scene(path, frame=frame).meshes[0].positions, np.add(GRID, (0, 0, z)), atol=1e-6
        )
    solves_and_shows(path)


def test_a_skinned_floor_solves_in_its_pose(tmp_path: Path) -> None:
    """Bound on its side; at frame 10 a joint has turned it flat, and there it is painted."""
    b = floor_shot(tmp_path)
    root = b.stage.GetRootLayer()
    UsdSkel.Root.Define(b.stage, "/World/rig")
    Sdf.CopySpec(root, "/World/floor", root, "/World/rig/floor")
    b.stage.RemovePrim("/World/floor")
    mesh = UsdGeom.Mesh(b.stage.GetPrimAtPath("/World/rig/floor"))
    on_its_side = GRID[:, [0, 2, 1]]  # (x, 0, y): a quarter turn about x away
    mesh.GetPointsAttr().Set([Gf.Vec3f(*map(float, p)) for p in on_its_side])
    skeleton = UsdSkel.Skeleton.Define(b.stage, "/World/rig/skeleton")
    skeleton.CreateJointsAttr(["hinge"])
    skeleton.CreateBindTransformsAttr([Gf.Matrix4d(1)])
    skeleton.CreateRestTransformsAttr([Gf.Matrix4d(1)])
    turn = UsdSkel.Animation.Define(b.stage, "/World/rig/skeleton/turn")
    turn.CreateJointsAttr(["hinge"])
    turn.CreateTranslationsAttr([Gf.Vec3f(0)])
    turn.CreateScalesAttr([Gf.Vec3h(1)])
    turn.CreateRotationsAttr().Set([Gf.Quatf(1, 0, 0, 0)], 1)
    turn.GetRotationsAttr().Set([Gf.Quatf(QUARTER, -QUARTER, 0, 0)], 10)
    UsdSkel.BindingAPI.Apply(skeleton.GetPrim()).CreateAnimationSourceRel().SetTargets([turn.GetPath()])
    binding = UsdSkel.BindingAPI.Apply(mesh.GetPrim())
    binding.CreateSkeletonRel().SetTargets([skeleton.GetPath()])
    binding.CreateJointIndicesPrimvar(False, 1).Set([0] * 9)
    binding.CreateJointWeightsPrimvar(False, 1).Set([1.0] * 9)
    b.stage.SetStartTimeCode(1)
    b.stage.SetEndTimeCode(10)
    path = b.save()
    np.testing.assert_allclose(read_scene(path, frame=1).meshes[0].positions, on_its_side, atol=1e-5)
    np.testing.assert_allclose(read_scene(path, frame=10).meshes[0].positions, GRID, atol=1e-5)
    session = solved(path, frame=10)
    edits = session.author(tmp_path / "look.usda")
    assert edits and all(e.wins for e in edits)
