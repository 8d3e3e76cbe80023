"""Reading meshes that joints and blend shapes deform."""

from __future__ import annotations

import math

import numpy as np
import pytest
from kit.read_meshes import add_mesh, only, read, stage
from pxr import Gf, Usd, UsdSkel


def skinned_stage():
    """A strip of points whose upper row follows a joint that turns a quarter about Z at frame 10."""
    s = stage()
    UsdSkel.Root.Define(s, "/root")
    skeleton = UsdSkel.Skeleton.Define(s, "/root/skel")
    skeleton.AddTranslateOp().Set((0, 0, 7))
    joints = ["low", "low/high"]
    skeleton.CreateJointsAttr(joints)
    bind = [Gf.Matrix4d(1), Gf.Matrix4d().SetTranslate((0, 1, 0))]
    skeleton.CreateBindTransformsAttr(bind)
    skeleton.CreateRestTransformsAttr(bind)
    animation = UsdSkel.Animation.Define(s, "/root/skel/anim")
    animation.CreateJointsAttr(joints)
    animation.CreateTranslationsAttr([(0, 0, 0), (0, 1, 0)])
    animation.CreateScalesAttr([(1, 1, 1)] * 2)
    still = Gf.Quatf(1, 0, 0, 0)
    turned = Gf.Quatf(math.sqrt(0.5), 0, 0, math.sqrt(0.5))
    animation.CreateRotationsAttr().Set([still, still], 0)
    animation.GetRotationsAttr().Set([still, turned], 10)
    UsdSkel.BindingAPI.Apply(skeleton.GetPrim()).CreateAnimationSourceRel().SetTargets(["/root/skel/anim"])
    points = [(0, 0, 0), (1, 0, 0), (0, 1, 0), (1, 1, 0), (0, 2, 0), (1, 2, 0)]
    mesh = add_mesh(s, "/root/m", points, [[0, 1, 3, 2], [2, 3, 5, 4]])
    mesh.AddTranslateOp().Set((1000, 0, 0))  # a skinned mesh is placed by its skeleton
    mesh.CreateNormalsAttr([(1, 0, 0)] * 6)
    binding = UsdSkel.BindingAPI.Apply(mesh.GetPrim())
    binding.CreateSkeletonRel().SetTargets(["/root/skel"])
    # The mesh names the joints in its own order.
    binding.CreateJointsAttr(["low/high", "low"])
    binding.CreateJointIndicesPrimvar(False, 1).Set([1, 1, 1, 1, 0, 0])
    binding.CreateJointWeightsPrimvar(False, 1).Set([1.0] * 6)
    return s, mesh, animation


def test_skinned_points_and_normals_follow_the_joints():
    s, _, _ = skinned_stage()
    rest = only(s, time=Usd.TimeCode(0))
    assert rest.positions == pytest.approx(
        np.array([(0, 0, 7), (1, 0, 7), (0, 1, 7), (1, 1, 7), (0, 2, 7), (1, 2, 7)])
    )
    posed = only(s, time=Usd.TimeCode(10))
    # A quarter turn about (0, 1): (0, 2) -> (-1, 1), (1, 2) -> (-1, 2); what is bound to `low` stays.
    assert posed.positions[4:] == pytest.approx(np.array([(-1, 1, 7), (-1, 2, 7)]), abs=1e-5)
    assert posed.positions[:4] == pytest.approx(rest.positions[:4], abs=1e-5)
    normals = {
        v: n for v, n in zip(posed.triangles.ravel(), posed.corner_normals.reshape(-1, 3), strict=True)
    }
    assert normals[5] == pytest.approx([0, 1, 0], abs=1e-5) and normals[0] == pytest.approx(
        [1, 0, 0], abs=1e-5
    )


def test_blend_shapes_deform():
    s, mesh, animation = skinned_stage()
    animation.CreateBlendShapesAttr(["wide"])
    animation.CreateBlendShapeWeightsAttr([0.5])
    shape = UsdSkel.BlendShape.Define(s, "/root/m/wide")
    shape.CreateOffsetsAttr([(4, 0, 0)])
    shape.CreatePointIndicesAttr([1])
    binding = UsdSkel.BindingAPI(mesh.GetPrim())
    binding.CreateBlendShapesAttr(["wide"])
    binding.CreateBlendShapeTargetsRel().SetTargets(["/root/m/wide"])
    out = only(s, time=Usd.TimeCode(0))
    assert out.positions[1] == pytest.approx([3, 0, 7])


def test_skin_without_skeleton_stays_at_rest():
    s, _, _ = skinned_stage()
    s.RemovePrim("/root/skel")
    meshes, warnings = read(s, Usd.TimeCode(0))
    assert len(meshes) == 1 and meshes[0].positions.min(0) == pytest.approx([1000, 0, 0])
    assert all("/root/m" in w for w in warnings)
