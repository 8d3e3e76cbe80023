"""What skeletons move, in PointInstancers and without points, stands where UsdSkel.BakeSkinning puts it."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from pxr import Gf, Sdf, Usd, UsdGeom, UsdSkel

from usdslf.usd.read.read import read_scene


def bounds(stage: Usd.Stage | Path) -> dict[str, np.ndarray]:
    scene = read_scene(stage if isinstance(stage, Usd.Stage) else str(stage))
    return {m.path: np.array([m.positions.min(0), m.positions.max(0)]) for m in scene.meshes}


def opened(path: Path) -> Usd.Stage:
    """A copy of a stage in memory, to be changed."""
    layer = Sdf.Layer.CreateAnonymous(".usda")
    layer.TransferContent(Sdf.Layer.FindOrOpen(str(path)))
    return Usd.Stage.Open(layer)


def test_skinned_characters_stand_at_their_instances(inputs: Path) -> None:
    found = bounds(inputs / "crowd/s.usda")
    assert found["/World/pi/P/guy/c[0]"] == pytest.approx(np.array([[-1.7, 0, 0], [-0.7, 1, 0]]), abs=1e-6)
    assert found["/World/pi/P/guy/c[1]"] == pytest.approx(np.array([[0.7, 0, 0], [1.7, 1, 0]]), abs=1e-6)


@pytest.mark.parametrize("specifier", [Sdf.SpecifierOver, Sdf.SpecifierClass])
def test_characters_below_an_over_or_a_class_are_skinned_too(inputs: Path, specifier: Sdf.Specifier) -> None:
    stage = opened(inputs / "crowd/s.usda")
    stage.GetRootLayer().GetPrimAtPath("/World/pi/P").specifier = specifier
    found = bounds(stage)
    assert found["/World/pi/P/guy/c[0]"] == pytest.approx(np.array([[-1.7, 0, 0], [-0.7, 1, 0]]), abs=1e-6)


def test_instances_turn_and_scale_what_is_skinned(inputs: Path) -> None:
    stage = opened(inputs / "crowd/s.usda")
    instancer = UsdGeom.PointInstancer(stage.GetPrimAtPath("/World/pi"))
    instancer.CreateScalesAttr([Gf.Vec3f(2), Gf.Vec3f(1)])
    guy = UsdGeom.Xformable(stage.GetPrimAtPath("/World/pi/P/guy"))
    guy.AddTranslateOp().Set(Gf.Vec3d(0, 0, 3))  # part of the prototype: scaled with it
    mesh = UsdGeom.Xformable(stage.GetPrimAtPath("/World/pi/P/guy/c"))
    mesh.AddTranslateOp().Set(Gf.Vec3d(9, 9, 9))  # which skinning overrules
    found = bounds(stage)
    assert found["/World/pi/P/guy/c[0]"] == pytest.approx(np.array([[-2.2, 0, 6], [-0.2, 2, 6]]), abs=1e-5)
    assert found["/World/pi/P/guy/c[1]"] == pytest.approx(np.array([[0.7, 0, 3], [1.7, 1, 3]]), abs=1e-5)


@pytest.mark.parametrize("kind", ["Cube", "Sphere", "Cylinder", "Cone", "Capsule", "Plane"])
def test_shapes_without_points_follow_their_joint(inputs: Path, kind: str) -> None:
    stage = opened(inputs / "rigid_skin/s.usda")
    cube = stage.GetPrimAtPath("/World/root/cube")
    cube.SetTypeName(kind)
    bind = Gf.Matrix4d().SetRotate(Gf.Rotation(Gf.Vec3d(0, 0, 1), 30)) * Gf.Matrix4d().SetTranslate((0.2, 0, 0))
    UsdSkel.BindingAPI(cube).CreateGeomBindTransformAttr(bind)
    found = bounds(stage)
    UsdSkel.BakeSkinning(stage.Traverse())
    baked = UsdGeom.Xformable(cube).ComputeLocalToWorldTransform(Usd.TimeCode.Default())
    stage.GetPrimAtPath("/World/root").SetTypeName("Xform")
    plain = bounds(stage)
    assert baked.ExtractTranslation() == pytest.approx((1.2, 0.5, 0))
    assert found["/World/root/cube"] == pytest.approx(plain["/World/root/cube"], abs=1e-5)
    assert found["/World/root/rigid"] == pytest.approx(np.array([[0.5, 0, 0], [1.5, 1, 0]]), abs=1e-6)


def test_a_shape_with_weights_that_vary_is_said_not_to_be_skinned(inputs: Path) -> None:
    stage = opened(inputs / "rigid_skin/s.usda")
    api = UsdSkel.BindingAPI(stage.GetPrimAtPath("/World/root/cube"))
    for primvar in (api.GetJointIndicesPrimvar(), api.GetJointWeightsPrimvar()):
        primvar.SetInterpolation("vertex")
    said = read_scene(stage).warnings
    assert any("/World/root/cube" in s and "not skinned" in s for s in said), said
