"""Reading gprims: analytic stages, every rule of topology, and the real stages."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
from kit.read_meshes import DEFAULT, SQUARE, add_mesh, only, read, stage
from pxr import Sdf, Usd, UsdGeom, UsdShade, Vt

from usdslf.scene.records import Mesh
from usdslf.usd.read import geometry


def face_normals(mesh: Mesh):
    p = mesh.positions[mesh.triangles].astype(float)
    n = np.cross(p[:, 1] - p[:, 0], p[:, 2] - p[:, 0])
    return n / np.linalg.norm(n, axis=1, keepdims=True)


def area(mesh: Mesh) -> float:
    p = mesh.positions[mesh.triangles].astype(float)
    return float(np.linalg.norm(np.cross(p[:, 1] - p[:, 0], p[:, 2] - p[:, 0]), axis=1).sum() / 2)


def volume(mesh: Mesh) -> float:
    """Positive for a closed mesh wound counter-clockwise from outside."""
    p = mesh.positions[mesh.triangles].astype(float)
    return float(np.einsum("ti,ti->t", p[:, 0], np.cross(p[:, 1], p[:, 2])).sum() / 6)


IMPLICIT = {
    "Sphere": ({"radius": 2.0}, 16 * math.pi, 32 / 3 * math.pi),
    "Cube": ({"size": 3.0}, 54, 27),
    "Cylinder": ({"radius": 1.5, "height": 4.0}, 2 * math.pi * 1.5 * 5.5, math.pi * 9),
    "Cone": ({"radius": 1.5, "height": 2.0}, math.pi * 1.5 * (1.5 + 2.5), math.pi * 1.5),
    "Capsule": ({"radius": 0.5, "height": 2.0}, math.pi * 3, math.pi * (0.5 + 1 / 6)),
    "Plane": ({"width": 2.0, "length": 3.0}, 6, None),
    "Cylinder_1": (
        {"radiusBottom": 2.0, "radiusTop": 1.0, "height": 3.0},
        math.pi * (5 + 3 * math.sqrt(10)),
        math.pi * 7,
    ),
    # Volume: two sphere segments and a frustum; the bounds below check the shape.
    "Capsule_1": ({"radiusBottom": 1.0, "radiusTop": 0.5, "height": 2.0}, None, None),
}


@pytest.mark.parametrize("axis", ["X", "Y", "Z"])
@pytest.mark.parametrize("kind", IMPLICIT)
def test_implicit_gprims_have_their_area_volume_and_extent(kind, axis):
    s = stage()
    prim = s.DefinePrim("/g", kind)
    values, want_area, want_volume = IMPLICIT[kind]
    for name, value in values.items():
        prim.GetAttribute(name).Set(value)
    if prim.GetAttribute("axis"):
        prim.GetAttribute("axis").Set(axis)
    mesh = only(s)
    if want_area is not None:
        assert area(mesh) == pytest.approx(want_area, rel=3e-3)
    if want_volume is not None:
        assert volume(mesh) == pytest.approx(want_volume, rel=3e-3)
    want = np.array(UsdGeom.Boundable.ComputeExtentFromPlugins(UsdGeom.Boundable(prim), DEFAULT), float)
    used = mesh.positions[np.unique(mesh.triangles)]
    if kind == "Capsule_1":
        # OpenUSD's extent is a bound there, not tight: check the tangent spheres instead.
        along = "XYZ".index(axis)
        slope = 0.25
        assert used[:, along].max() == pytest.approx(1 - slope * 0.5 + 0.5 * math.hypot(1, slope), abs=1e-4)
        assert used[:, along].min() == pytest.approx(-1 - slope - math.hypot(1, slope), abs=1e-4)
        assert volume(mesh) > 0
    else:
        assert np.allclose([used.min(0), used.max(0)], want, atol=3e-3)
    # Shading normals look outwards, within the angle that a segment turns.
    dots = np.einsum("tci,ti->tc", mesh.corner_normals, face_normals(mesh))
    assert dots.min() > 0.99
    assert np.allclose(np.linalg.norm(mesh.corner_normals, axis=2), 1, atol=1e-5)


def test_sphere_normals_are_those_of_the_sphere_under_any_transform():
    s = stage()
    sphere = UsdGeom.Sphere.Define(s, "/s")
    sphere.AddTranslateOp().Set((5, 1, 2))
    sphere.AddRotateXYZOp().Set((20, 30, 40))
    sphere.AddScaleOp().Set((1, 2, -0.5))
    mesh = only(s)
    m = np.array(UsdGeom.XformCache().GetLocalToWorldTransform(sphere.GetPrim()))
    p = mesh.positions[mesh.triangles].astype(float).reshape(-1, 3)
    local = np.c_[p, np.ones(len(p))] @ np.linalg.inv(m)
    # Gradient of |x|^2 = 1 carried by the inverse transpose.
    want = local[:, :3] @ np.linalg.inv(m[:3, :3]).T
    want /= np.linalg.norm(want, axis=1, keepdims=True)
    got = mesh.corner_normals.reshape(-1, 3)
    poles = np.abs(local[:, 2]) > 0.999
    assert np.allclose(got[~poles], want[~poles], atol=1e-4)
    assert np.einsum("ti,ti->t", face_normals(mesh), mesh.corner_normals[:, 0]).min() > 0.98


@pytest.mark.parametrize("left", [False, True])
@pytest.mark.parametrize("mirror", [False, True])
@pytest.mark.parametrize("scheme", ["none", "catmullClark"])
def test_triangles_are_counter_clockwise_from_outside(left, mirror, scheme):
    s = stage()
    points = [(x, y, z) for z in (-1, 1) for y in (-1, 1) for x in (-1, 1)]
    faces = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]]
    mesh = add_mesh(s, "/m", points, [f[::-1] for f in faces] if left else faces, scheme)
    if left:
        mesh.CreateOrientationAttr("leftHanded")
    if mirror:
        mesh.AddScaleOp().Set((1, -2, 1))
    flat = [float(v) for f in (faces if not left else [f[::-1] for f in faces]) for v in f]
    pv = UsdGeom.PrimvarsAPI(mesh).CreatePrimvar("id", Sdf.ValueTypeNames.FloatArray, "faceVarying")
    pv.Set(flat)
    out = only(s)
    assert volume(out) > 0
    assert np.einsum("tci,ti->tc", out.corner_normals, face_normals(out)).min() > 0.4
    if scheme == "none":
        # Corner values travel with their corners.
        assert np.array_equal(out.primvars["id"][..., 0], out.triangles)


def test_subdivision_is_the_default_scheme_and_refine_chooses_the_level():
    s = stage()
    points = [(x, y, z) for z in (-1, 1) for y in (-1, 1) for x in (-1, 1)]
    faces = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]]
    mesh = add_mesh(s, "/m", points, faces, scheme=None)
    mesh.CreateNormalsAttr([(1, 0, 0)] * 8)  # ignored on a subdivision surface
    for refine, count in ((0, 12), (1, 48), (2, 192)):
        out = only(s, refine=refine)
        assert len(out.triangles) == count
        assert sorted(set(out.face_of_triangle)) == list(range(6))
        assert out.triangle_in_face.max() == count // 6 - 1
        corner = out.positions[out.triangles].reshape(-1, 3)
        normal = out.corner_normals.reshape(-1, 3)
        # Symmetry: every normal of the round cube looks along its octant.
        assert (normal * corner >= -1e-6).all()
    mesh.CreateCreaseLengthsAttr([5])
    mesh.CreateCreaseIndicesAttr([4, 5, 7, 6, 4])
    mesh.CreateCreaseSharpnessesAttr([10.0])
    out = only(s)
    top = out.positions[out.positions[:, 2] == 1]
    assert len(top) == 9  # the top face stays flat: its corners, edges and middle
    mesh.GetCreaseIndicesAttr().Set([4, 5, 7, 6, 99])
    assert "/m" in read(s)[1][0]


def test_very_large_cages_are_not_refined_and_said(monkeypatch):
    s = stage()
    add_mesh(s, "/big", SQUARE, [[0, 1, 2, 3]], "catmullClark")
    monkeypatch.setattr(geometry.build_shape, "__defaults__", (1, 2))
    meshes, warnings = read(s)
    assert len(meshes[0].triangles) == 2
    assert len(warnings) == 1 and "/big" in warnings[0]
    monkeypatch.undo()
    monkeypatch.setattr(geometry, "REFINED_TRIANGLES_MAX", 3)
    meshes, warnings = read(s)
    assert len(meshes[0].triangles) == 2 and "not refined" in warnings[0]


def test_normals_primvar_beats_attribute_in_every_interpolation():
    s = stage()
    mesh = add_mesh(s, "/m", [*SQUARE, (2, 0, 0), (2, 1, 0)], [[0, 1, 2, 3], [1, 4, 5, 2]])
    mesh.CreateNormalsAttr([(0, 1, 0)] * 6)
    mesh.SetNormalsInterpolation("vertex")
    assert np.allclose(only(s).corner_normals, [0, 1, 0])
    primvar = UsdGeom.PrimvarsAPI(mesh).CreatePrimvar("normals", Sdf.ValueTypeNames.Normal3fArray)
    for interpolation, count in (("constant", 1), ("uniform", 2), ("vertex", 6), ("faceVarying", 8)):
        values = np.array([(1, 0, 1 + i) for i in range(count)], float)
        primvar.SetInterpolation(interpolation)
        primvar.Set(Vt.Vec3fArray.FromNumpy(values.astype(np.float32)))
        out = only(s)
        at = {
            "constant": np.zeros(12, int),
            "uniform": np.repeat(out.face_of_triangle, 3),
            "vertex": out.triangles.ravel(),
            "faceVarying": np.array([0, 1, 2, 0, 2, 3, 4, 5, 6, 4, 6, 7]),
        }[interpolation]
        unit = values / np.linalg.norm(values, axis=1, keepdims=True)
        assert np.allclose(out.corner_normals.reshape(-1, 3), unit[at], atol=1e-6)
    primvar.Set([(0, 1, 0), (0, 0, 0)])
    primvar.SetInterpolation("faceVarying")
    primvar.SetIndices([0, 1, 0, 1, 0, 1, 0, 1])
    out = only(s)  # a normal of length zero gives way to the face's
    assert set(map(tuple, out.corner_normals.reshape(-1, 3).tolist())) == {(0, 1, 0), (0, 0, 1)}
    primvar.SetIndices([0, 1, 9])
    meshes, warnings = read(s)
    assert np.allclose(meshes[0].corner_normals, [0, 0, 1]) and "/m" in warnings[0]


def test_polygons_without_normals_are_flat():
    s = stage()
    add_mesh(
        s, "/m", [(0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1)], [[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]]
    )
    out = only(s)
    assert np.allclose(out.corner_normals, face_normals(out)[:, None], atol=1e-6)


@pytest.mark.parametrize(
    "type_name", ["TexCoord2fArray", "Float2Array", "TexCoord2dArray", "TexCoord2hArray"]
)
@pytest.mark.parametrize("interpolation", ["constant", "uniform", "vertex", "varying", "faceVarying"])
@pytest.mark.parametrize("indexed", [False, True])
def test_uvs_of_every_type_and_interpolation(type_name, interpolation, indexed):
    s = stage()
    mesh = add_mesh(s, "/m", [*SQUARE, (2, 0, 0), (2, 1, 0)], [[0, 1, 2, 3], [1, 4, 5, 2]])
    count = {"constant": 1, "uniform": 2, "vertex": 6, "varying": 6, "faceVarying": 8}[interpolation]
    values = [(i / 8, 1 - i / 4) for i in range(count)]
    pv = UsdGeom.PrimvarsAPI(mesh).CreatePrimvar(
        "map1", getattr(Sdf.ValueTypeNames, type_name), interpolation
    )
    pv.Set(values[::-1] if indexed else values)
    if indexed:
        pv.SetIndices(list(range(count))[::-1])
    out = only(s)
    corner = np.array([0, 1, 2, 0, 2, 3, 4, 5, 6, 4, 6, 7])
    at = {
        "constant": 0 * corner,
        "uniform": corner // 4,
        "vertex": out.triangles.ravel(),
        "varying": out.triangles.ravel(),
        "faceVarying": corner,
    }[interpolation]
    assert np.array_equal(out.uvs["map1"].reshape(-1, 2), np.array(values, np.float32)[at])
    assert "map1" not in out.primvars


def test_other_primvars_inherited_ones_and_those_that_do_not_fit():
    s = stage()
    parent = UsdGeom.Xform.Define(s, "/x")
    UsdGeom.PrimvarsAPI(parent).CreatePrimvar("displayColor", Sdf.ValueTypeNames.Color3fArray).Set(
        [(1, 0.5, 0)]
    )
    mesh = add_mesh(s, "/x/m", SQUARE, [[0, 1, 2, 3]])
    api = UsdGeom.PrimvarsAPI(mesh)
    api.CreatePrimvar("one", Sdf.ValueTypeNames.Float).Set(0.25)
    api.CreatePrimvar("vector", Sdf.ValueTypeNames.Float3).Set((1, 2, 3))
    api.CreatePrimvar("wear", Sdf.ValueTypeNames.FloatArray, "vertex").Set([0, 1, 2, 3])
    api.CreatePrimvar("label", Sdf.ValueTypeNames.StringArray, "vertex").Set(["a"] * 4)
    api.CreatePrimvar("pref", Sdf.ValueTypeNames.Point3fArray, "vertex").Set(SQUARE)
    out = only(s)
    assert set(out.primvars) == {"displayColor", "one", "vector", "wear", "pref"}  # which a material may read
    assert np.allclose(out.primvars["displayColor"], [1, 0.5, 0]) and out.primvars["one"].shape == (2, 3, 1)
    assert np.allclose(out.primvars["vector"], [1, 2, 3])
    assert np.array_equal(out.primvars["wear"][..., 0], out.triangles)
    api.CreatePrimvar("bad", Sdf.ValueTypeNames.FloatArray, "vertex").Set([0, 1])
    meshes, warnings = read(s)
    assert "bad" not in meshes[0].primvars and "/x/m.primvars:bad" in warnings[0]


def test_holes_degenerate_and_small_faces_are_left_out():
    s = stage()
    points = [*SQUARE, (2, 0, 0), (2, 1, 0)]
    faces = [[0, 1, 2, 3], [0, 0, 1], [0, 1], [1, 4, 5, 2], [3, 3, 3, 3], [0, 1, 4]]
    mesh = add_mesh(s, "/m", points, faces)
    pv = UsdGeom.PrimvarsAPI(mesh).CreatePrimvar("id", Sdf.ValueTypeNames.FloatArray, "uniform")
    pv.Set([float(i) for i in range(6)])
    out = only(s)
    assert sorted(set(out.face_of_triangle)) == [0, 3] and area(out) == pytest.approx(2)
    assert np.array_equal(out.primvars["id"][:, 0, 0], out.face_of_triangle)
    mesh.CreateHoleIndicesAttr([0])
    assert set(only(s).face_of_triangle) == {3}


@pytest.mark.parametrize("scheme", ["none", "catmullClark", "loop"])
def test_bad_points_and_topology_are_named_not_raised(scheme):
    s = stage()
    nan = float("nan")
    add_mesh(s, "/nan", [*SQUARE, (nan, 0, 0)], [[0, 1, 2], [0, 2, 4], [0, 2, 3]], scheme)
    add_mesh(s, "/allnan", [(nan, 0, 0)] * 3, [[0, 1, 2]], scheme)
    add_mesh(s, "/range", SQUARE, [[0, 1, 7]], scheme)
    add_mesh(s, "/negative", SQUARE, [[0, 1, -1]], scheme)
    add_mesh(s, "/counts", SQUARE, [[0, 1, 2]], scheme).GetFaceVertexCountsAttr().Set([4])
    add_mesh(s, "/empty", [], [], scheme)
    add_mesh(s, "/line", [(0, 0, 0), (1, 0, 0), (2, 0, 0)], [[0, 1, 2]], scheme)
    flat = add_mesh(s, "/flat", SQUARE, [[0, 1, 2]], scheme)
    flat.AddScaleOp().Set((0, 1, 1))
    UsdGeom.Mesh.Define(s, "/nothing")
    UsdGeom.Sphere.Define(s, "/ball").CreateRadiusAttr(-1.0)
    meshes, warnings = read(s)
    assert [m.path for m in meshes] == ["/nan"]
    assert set(meshes[0].face_of_triangle) == {0, 2}
    assert np.isfinite(meshes[0].positions[meshes[0].triangles]).all()
    for path in (
        "/nan",
        "/allnan",
        "/range",
        "/negative",
        "/counts",
        "/empty",
        "/line",
        "/flat",
        "/nothing",
        "/ball",
    ):
        assert sum(path in w for w in warnings) >= 1, (path, warnings)
    assert len(warnings) == len(set(warnings))


def test_what_is_not_read_is_named_once():
    s = stage()
    for i in range(5):
        UsdGeom.BasisCurves.Define(s, f"/c{i}")
    UsdGeom.Points.Define(s, "/p")
    UsdGeom.BasisCurves.Define(s, "/guide").CreatePurposeAttr("guide")
    meshes, warnings = read(s)
    assert not meshes and len(warnings) == 2
    assert "BasisCurves" in warnings[0] and "/c0" in warnings[0] and "2 more" in warnings[0]
    assert "Points" in warnings[1] and "/p" in warnings[1]


def test_visibility_and_purpose():
    s = stage()
    for purpose in ("default", "render", "proxy", "guide"):
        group = UsdGeom.Xform.Define(s, f"/{purpose}")
        group.CreatePurposeAttr(purpose)
        add_mesh(s, f"/{purpose}/m", SQUARE, [[0, 1, 2, 3]])
    UsdGeom.Xform.Define(s, "/hidden").CreateVisibilityAttr("invisible")
    add_mesh(s, "/hidden/m", SQUARE, [[0, 1, 2, 3]])
    blinks = add_mesh(s, "/blinks", SQUARE, [[0, 1, 2, 3]])
    blinks.CreateVisibilityAttr().Set("invisible", 1)
    blinks.GetVisibilityAttr().Set("inherited", 2)
    add_mesh(s, "/off", SQUARE, [[0, 1, 2, 3]]).GetPrim().SetActive(False)
    s.CreateClassPrim("/class")
    add_mesh(s, "/class/m", SQUARE, [[0, 1, 2, 3]])
    assert [m.path for m in read(s, Usd.TimeCode(1))[0]] == ["/default/m", "/render/m"]
    assert [m.path for m in read(s, Usd.TimeCode(2))[0]] == ["/default/m", "/render/m", "/blinks"]


def test_transforms_with_reset_and_time():
    s = stage()
    UsdGeom.Xform.Define(s, "/x").AddTranslateOp().Set((100, 0, 0))
    mesh = add_mesh(s, "/x/m", SQUARE, [[0, 1, 2, 3]])
    mesh.SetResetXformStack(True)
    move = mesh.AddTranslateOp()
    move.Set((0, 0, 0), 0)
    move.Set((0, 10, 0), 10)
    assert only(s, time=Usd.TimeCode(5)).positions.min(0) == pytest.approx([0, 5, 0])


def test_subsets_bind_materials_by_face():
    s = stage()
    points = [(i % 3, i // 3, 0) for i in range(9)]
    mesh = add_mesh(s, "/m", points, [[0, 1, 4, 3], [1, 2, 5, 4], [3, 4, 7, 6], [4, 5, 8, 7]], "catmullClark")
    first = UsdGeom.Subset.CreateGeomSubset(mesh, "first", "face", [0, 1], "materialBind")
    second = UsdGeom.Subset.CreateGeomSubset(mesh, "second", "face", [2, 99], "")
    UsdGeom.Subset.CreateGeomSubset(mesh, "other", "face", [3], "")  # binds nothing
    material = UsdShade.Material.Define(s, "/mtl")
    UsdShade.MaterialBindingAPI.Apply(second.GetPrim()).Bind(material)
    table = {"/m": 5, "/m/first": 6, "/m/second": 7}
    out = only(s, material=lambda prim, given: table[str(prim.GetPath())])
    assert out.subsets == ("/m/first", "/m/second")
    assert out.subset_of_triangle is not None
    of_face = dict(zip(out.face_of_triangle.tolist(), out.material_of_triangle.tolist(), strict=True))
    assert of_face == {0: 6, 1: 6, 2: 7, 3: 5}
    assert set(out.subset_of_triangle[out.face_of_triangle == 3]) == {-1}
    assert len(out.triangles) == 32
    # The mesh's own material is not asked for when subsets cover all of it.
    first.GetIndicesAttr().Set([0, 1, 3])
    del table["/m"]
    assert set(only(s, material=lambda prim, given: table[str(prim.GetPath())]).material_of_triangle) == {6, 7}


REAL = {
    "avocado/avocado.usda": (1, 682),
    "cornell_box/cornell-box.usda": (16, 32),
    "dutch_ship_polyhaven/dutch_ship_medium.usdc": (3, None),
    "living_room_godot/living_room.usda": (2, None),
    "preview_surface_mayausd/UsdPreviewSurface/LightAPI_Test.usda": (6, None),
    "preview_surface_mayausd/normals/primvars_normals.usda": (1, 760),
    "shaderball_usdwg/standard_shader_ball_scene.usda": (12, None),
    "teapot_usdwg/Teapot.usd": (1, None),
    "vehicles_usdwg/USD_Mini_Car_Kit/assets/vehicles/vehicleVariants.usda": (6, None),
}


@pytest.mark.parametrize("name", REAL)
def test_real_stages_are_finite_unit_and_unique(name, assets: Path):
    s = Usd.Stage.Open(str(assets / name))
    meshes, warnings = read(s, Usd.TimeCode.EarliestTime())
    count, triangles = REAL[name]
    assert len(meshes) == count and not warnings
    assert triangles is None or sum(len(m.triangles) for m in meshes) == triangles
    assert len({m.path for m in meshes}) == count
    for m in meshes:
        assert np.isfinite(m.positions[m.triangles]).all() and area(m) > 0
        assert np.allclose(np.linalg.norm(m.corner_normals, axis=2), 1, atol=1e-4)
        for values in [*m.uvs.values(), *m.primvars.values()]:
            assert values.shape[:2] == m.triangles.shape and np.isfinite(values).all()
        assert (m.face_of_triangle[1:] >= m.face_of_triangle[:-1]).all()
        assert m.triangles.dtype == m.face_of_triangle.dtype == m.material_of_triangle.dtype == np.int32
        assert m.positions.dtype == m.corner_normals.dtype == np.float32
