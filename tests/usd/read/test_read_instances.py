"""Reading scene instances and point instancers: where copies lie, and where they are written to."""

from __future__ import annotations

import math

import pytest
from kit.read_meshes import SQUARE, add_mesh, read, stage
from pxr import Gf, Sdf, Usd, UsdGeom

from usdslf.usd.read import geometry


def test_scene_instances_share_and_say_where_to_write():
    s = stage()
    s.CreateClassPrim("/asset")
    add_mesh(s, "/asset/m", SQUARE, [[0, 1, 2, 3]])
    for i, name in enumerate("AB"):
        x = UsdGeom.Xform.Define(s, f"/{name}")
        x.GetPrim().GetReferences().AddInternalReference("/asset")
        x.GetPrim().SetInstanceable(True)
        x.AddTranslateOp().Set((3 * i, 0, 0))
        UsdGeom.PrimvarsAPI(x).CreatePrimvar("displayColor", Sdf.ValueTypeNames.Color3fArray).Set([(i, i, 1)])
    meshes, warnings = read(s)
    assert not warnings and [m.path for m in meshes] == ["/A/m", "/B/m"]
    assert [m.prototype for m in meshes] == ["/A", "/B"]
    assert meshes[1].positions.min(0) == pytest.approx([3, 0, 0])
    assert meshes[1].primvars["displayColor"][0, 0] == pytest.approx([1, 1, 1])


def test_instances_are_flattened_up_to_a_bound_and_said(monkeypatch):
    s = stage()
    add_mesh(s, "/square/mesh", SQUARE, [[0, 1, 2, 3]])
    for i in range(4):
        instance = s.DefinePrim(f"/instances/i{i}", "Xform")
        instance.GetReferences().AddInternalReference("/square")
        instance.SetInstanceable(True)
    meshes, warnings = read(s)
    assert [len(m.triangles) for m in meshes] == [2] * 5 and not warnings
    monkeypatch.setattr(geometry, "TRIANGLES_MAX", 7)
    meshes, warnings = read(s)
    assert [len(m.triangles) for m in meshes] == [2] * 3
    assert len(warnings) == 1 and "more than 7 triangles" in warnings[0] and "left out" in warnings[0]


def instancer(s, path="/i"):
    out = UsdGeom.PointInstancer.Define(s, path)
    ball = UsdGeom.Cube.Define(s, f"{path}/protos/cube")
    ball.AddTranslateOp().Set((0, 0, 5))
    add_mesh(s, f"{path}/protos/group/m", SQUARE, [[0, 1, 2, 3]])
    s.GetPrimAtPath(f"{path}/protos").SetSpecifier(Sdf.SpecifierOver)
    out.CreatePrototypesRel().SetTargets([f"{path}/protos/cube", f"{path}/protos/group"])
    return out


def test_point_instancer_places_prototypes():
    s = stage()
    i = instancer(s)
    i.AddTranslateOp().Set((0, 100, 0))
    i.CreateProtoIndicesAttr([0, 1, 0, 1])
    i.CreatePositionsAttr().Set([(0, 0, 0), (10, 0, 0), (20, 0, 0), (30, 0, 0)], 1)
    i.GetPositionsAttr().Set([(0, 0, 0), (11, 0, 0), (20, 0, 0), (30, 0, 0)], 3)
    turn = Gf.Quath(math.sqrt(0.5), 0, 0, math.sqrt(0.5))  # a quarter about Z
    i.CreateOrientationsAttr([turn] * 4)
    i.CreateScalesAttr([(1, 1, 1), (2, 2, 2), (1, 1, 1), (1, 1, 1)])
    i.CreateInvisibleIdsAttr([2])
    pv = UsdGeom.PrimvarsAPI(i).CreatePrimvar("displayColor", Sdf.ValueTypeNames.Color3fArray, "vertex")
    pv.Set([(j / 4, 0, 0) for j in range(4)])
    meshes, warnings = read(s, Usd.TimeCode(2))
    assert not warnings
    assert [m.path for m in meshes] == [
        "/i/protos/cube[0]",
        "/i/protos/group/m[1]",
        "/i/protos/group/m[3]",
    ]
    assert [m.prototype for m in meshes] == ["/i/protos/cube", "/i/protos/group/m", "/i/protos/group/m"]
    # The prototype's own transform comes first.
    assert meshes[0].positions.mean(0) == pytest.approx([0, 100, 5], abs=1e-3)
    # Square (0..1)^2 scaled by 2, turned to x in -2..0, moved to half way between the samples.
    low, high = meshes[1].positions.min(0), meshes[1].positions.max(0)
    assert low == pytest.approx([8.5, 100, 0], abs=0.02) and high == pytest.approx([10.5, 102, 0], abs=0.02)
    assert meshes[1].primvars["displayColor"][0, 0] == pytest.approx([0.25, 0, 0])
    i.GetProtoIndicesAttr().Set([0, 7, 0, 1])
    meshes, warnings = read(s, Usd.TimeCode(2))
    assert len(meshes) == 2 and "/i" in warnings[0]
    i.GetPositionsAttr().Set([(0, 0, 0)], 2)
    meshes, warnings = read(s, Usd.TimeCode(2))
    assert not meshes and any("/i" in w for w in warnings)


def test_nested_point_instancers_and_shared_prototypes():
    s = stage()
    inner = instancer(s, "/outer/protos/inner")
    inner.CreateProtoIndicesAttr([1, 1])
    inner.CreatePositionsAttr([(0, 0, 0), (2, 0, 0)])
    outer = UsdGeom.PointInstancer.Define(s, "/outer")
    outer.CreatePrototypesRel().SetTargets(["/outer/protos/inner"])
    outer.CreateProtoIndicesAttr([0, 0])
    outer.CreatePositionsAttr([(0, 0, 0), (0, 10, 0)])
    # A second instancer that uses the same prototype from outside.
    other = UsdGeom.PointInstancer.Define(s, "/other")
    other.CreatePrototypesRel().SetTargets(["/outer/protos/inner"])
    other.CreateProtoIndicesAttr([0])
    other.CreatePositionsAttr([(0, 0, 50)])
    meshes, warnings = read(s)
    assert not warnings and len(meshes) == 6
    assert len({m.path for m in meshes}) == 6
    assert meshes[3].positions.min(0) == pytest.approx([2, 10, 0])
    assert meshes[5].positions.min(0) == pytest.approx([2, 0, 50])
    # An instancer inside itself ends.
    outer.GetPrototypesRel().SetTargets(["/outer"])
    assert any("/outer" in w for w in read(s)[1])
