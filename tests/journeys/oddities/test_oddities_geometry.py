"""Odd geometry of real stages: each oddity gives the triangles, the picture and the solved change of the plain way.

The table of all oddities is in README.md.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from kit.lit_plane import places
from kit.oddity_stages import (
    FACES,
    GRID,
    add_mesh,
    area_vectors,
    corners,
    evaluate_at,
    floor_shot,
    picture,
    same_triangles,
    solves_and_shows,
)
from kit.stage_meshes import box
from kit.stage_parts import StageBuilder
from numpy.typing import NDArray
from pxr import Gf, Sdf, UsdGeom

import usdslf
from usdslf.usd.read.read import read_scene

Run = Callable[..., tuple[int, str, str]]
FAR = np.array([30.0, 0, 0])
CUBE = np.array([(x, y, z) for z in (-1, 1) for y in (-1, 1) for x in (-1, 1)], float)
SIDES = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]]


def mesh_of(b: StageBuilder, name: str = "floor") -> UsdGeom.Mesh:
    return UsdGeom.Mesh(b.stage.GetPrimAtPath(f"/World/{name}"))


def plain(tmp_path: Path) -> Path:
    return floor_shot(tmp_path / "plain").save()


# ---- subdivision --------------------------------------------------------------------------------------------
def test_no_scheme_is_catmull_clark(tmp_path: Path) -> None:
    """A cage of a cube shrinks to Catmull and Clark's known points; a flat cage keeps its place, and solves."""
    b = floor_shot(tmp_path)
    mesh_of(b).GetPrim().RemoveProperty("subdivisionScheme")
    add_mesh(b.stage, "/World/cube", CUBE + FAR, SIDES, scheme="")
    session = solves_and_shows(b.save())
    floor, cube = (next(m for m in session.scene.meshes if m.path == f"/World/{n}") for n in ("floor", "cube"))
    assert np.linalg.norm(area_vectors(floor), axis=1).sum() == pytest.approx(16, rel=1e-6)
    # Worked out by hand: points of the sides, of the edges (a quarter of four points), of the corners (5/9).
    known = {(0.0, 0.0, 1.0), (0.0, 0.75, 0.75), (0.5556, 0.5556, 0.5556)}
    at = np.sort(np.abs(corners(cube).reshape(-1, 3) - FAR), axis=1).round(4)
    assert len(cube.triangles) == 6 * 4 * 2 and {tuple(p) for p in at.tolist()} == known


def test_a_huge_cage_is_read_as_it_is_and_said(tmp_path: Path, run: Run) -> None:
    b = floor_shot(tmp_path)
    mesh, n = mesh_of(b), 650  # 422 500 faces
    x, y = np.meshgrid(np.linspace(-2, 2, n + 1), np.linspace(-2, 2, n + 1))
    mesh.GetPointsAttr().Set(np.stack([x.ravel(), y.ravel(), 0 * x.ravel()], 1).astype(np.float32))
    first = (np.arange(n)[:, None] * (n + 1) + np.arange(n)).ravel()
    mesh.GetFaceVertexIndicesAttr().Set((first[:, None] + (0, 1, n + 2, n + 1)).ravel().astype(np.int32))
    mesh.GetFaceVertexCountsAttr().Set(np.full(n * n, 4, np.int32))
    for name in ("subdivisionScheme", "primvars:st"):
        mesh.GetPrim().RemoveProperty(name)
    code, out, err = run("info", b.save())
    assert (code, err) == (0, "")
    assert f"meshes: 1 with {2 * n * n} triangles" in out
    assert "the cage /World/floor is not refined: more than 400000 faces" in out


def test_loop_subdivision(tmp_path: Path) -> None:
    """A triangulated floor stays where it is; a triangulated cube shrinks and stays closed."""
    b = floor_shot(tmp_path)
    mesh = mesh_of(b)
    halves = np.concatenate([FACES[:, [0, 1, 2]], FACES[:, [0, 2, 3]]])
    mesh.GetFaceVertexCountsAttr().Set([3] * 8)
    mesh.GetFaceVertexIndicesAttr().Set(halves.ravel().astype(np.int32))
    mesh.GetSubdivisionSchemeAttr().Set("loop")
    thirds = [[f[0], f[1], f[2]] for f in SIDES] + [[f[0], f[2], f[3]] for f in SIDES]
    add_mesh(b.stage, "/World/cube", CUBE + FAR, thirds, "loop")
    session = solves_and_shows(b.save())
    cube = next(m for m in session.scene.meshes if m.path == "/World/cube")
    assert len(cube.triangles) == 12 * 4
    v = area_vectors(cube)
    np.testing.assert_allclose(v.sum(0), 0, atol=1e-5)  # closed
    inside = np.einsum("ti,ti->", v, corners(cube).mean(1) - FAR) / 3
    assert 0 < inside < 8


def test_creases_keep_a_cube_a_cube(tmp_path: Path) -> None:
    """All edges sharp for ever: the area is 24, the volume 8, and the normals are those of the sides."""
    b = floor_shot(tmp_path)
    cube = add_mesh(b.stage, "/World/cube", CUBE + FAR, SIDES, "catmullClark")
    edges = sorted({tuple(sorted((f[i], f[(i + 1) % 4]))) for f in SIDES for i in range(4)})
    cube.CreateCreaseIndicesAttr([i for e in edges for i in e])
    cube.CreateCreaseLengthsAttr([2] * 12)
    cube.CreateCreaseSharpnessesAttr([10.0] * 12)
    scene = read_scene(b.save())
    mesh = next(m for m in scene.meshes if m.path == "/World/cube")
    v = area_vectors(mesh)
    area = np.linalg.norm(v, axis=1)
    assert area.sum() == pytest.approx(24, rel=1e-5)
    assert np.einsum("ti,ti->", v, corners(mesh).mean(1) - FAR) / 3 == pytest.approx(8, rel=1e-5)
    np.testing.assert_allclose(mesh.corner_normals, np.repeat((v / area[:, None])[:, None], 3, 1), atol=1e-5)


# ---- winding and normals ------------------------------------------------------------------------------------
def test_left_handed_faces_point_outward(tmp_path: Path) -> None:
    """A cube wound the other way and said to be so: normals outward, and the picture of the plain cube."""
    shots = []
    for name, sides in (("plain", SIDES), ("odd", [f[::-1] for f in SIDES])):
        b = floor_shot(tmp_path / name)
        cube = add_mesh(b.stage, "/World/cube", 0.2 * CUBE + (0.2, -0.1, 0.2), sides)
        if name == "odd":
            cube.CreateOrientationAttr("leftHanded")
        shots.append(b.save())
        mesh = next(m for m in read_scene(shots[-1]).meshes if m.path == "/World/cube")
        outward = corners(mesh).mean(1) - (0.2, -0.1, 0.2)
        assert (np.einsum("ti,ti->t", area_vectors(mesh), outward) > 0).all()
        assert (np.einsum("tci,ti->tc", mesh.corner_normals, outward) > 0).all()
    np.testing.assert_allclose(picture(shots[1]), picture(shots[0]), rtol=0.02, atol=0.01)


def test_left_handed_floor_solves(tmp_path: Path) -> None:
    b = floor_shot(tmp_path)
    mesh_of(b).GetFaceVertexIndicesAttr().Set(FACES[:, ::-1].ravel().astype(np.int32))
    mesh_of(b).CreateOrientationAttr("leftHanded")
    session = solves_and_shows(b.save())
    assert (session.scene.triangles.face_normals[:, 2] > 0.999).all()


def test_no_normals_are_those_of_the_faces(tmp_path: Path) -> None:
    b = floor_shot(tmp_path)
    b.stage.RemovePrim("/World/floor")
    b.mesh("box", box(1.0, 1.0, 1.0), "/World/mtl/floor")
    mesh_of(b, "box").GetPrim().RemoveProperty("normals")
    scene = read_scene(b.save())
    v = area_vectors(scene.meshes[0])
    n = v / np.linalg.norm(v, axis=1, keepdims=True)
    np.testing.assert_allclose(scene.meshes[0].corner_normals, np.repeat(n[:, None], 3, 1), atol=1e-6)


def test_normals_attribute_is_used(tmp_path: Path) -> None:
    b = floor_shot(tmp_path)
    mesh_of(b).CreateNormalsAttr([Gf.Vec3f(0.6, 0, 0.8)] * 9)
    mesh_of(b).SetNormalsInterpolation("vertex")
    scene = read_scene(b.save())
    np.testing.assert_allclose(evaluate_at(scene, places()).normal, np.tile((0.6, 0, 0.8), (16, 1)), atol=1e-6)


def test_normals_primvar_wins(tmp_path: Path) -> None:
    """`normals` that lean and `primvars:normals` that stand: the floor is the plain one, and solves."""
    b = floor_shot(tmp_path)
    mesh_of(b).CreateNormalsAttr([Gf.Vec3f(0.6, 0, 0.8)] * 9)
    primvar = UsdGeom.PrimvarsAPI(mesh_of(b)).CreatePrimvar("normals", Sdf.ValueTypeNames.Normal3fArray, "vertex")
    primvar.Set([Gf.Vec3f(0, 0, 1)] * 9)
    solves_and_shows(b.save())
    np.testing.assert_array_equal(picture(b.path), picture(plain(tmp_path)))


def test_thousands_of_degenerate_triangles(tmp_path: Path, run: Run) -> None:
    """Faces without area, of three kinds: the floor is the plain one, and one line at most is said."""
    b = floor_shot(tmp_path)
    slivers = [[0, 0, 1], [0, 1, 2], [4, 4, 4]] * 2000  # a point twice, three in a row, one point
    mesh_of(b).GetFaceVertexCountsAttr().Set([4] * 4 + [3] * len(slivers))
    mesh_of(b).GetFaceVertexIndicesAttr().Set([*FACES.ravel().tolist(), *np.ravel(slivers).tolist()])
    session = solves_and_shows(b.save())
    same_triangles(session.scene, read_scene(plain(tmp_path)))
    assert len(session.scene.warnings) <= 1
    code, out, _ = run("info", b.path)
    assert code == 0 and "meshes: 1 with 8 triangles" in out


# ---- transforms ---------------------------------------------------------------------------------------------
def turn_about_z(degrees: float) -> NDArray:
    c, s = math.cos(math.radians(degrees)), math.sin(math.radians(degrees))
    return np.array([[c, -s, 0, 0], [s, c, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]])


def moved_by(*t: float) -> NDArray:
    m = np.eye(4)
    m[:3, 3] = t
    return m


def test_pivots_inverses_and_suffixes(tmp_path: Path) -> None:
    """Maya's stack, turned about a pivot and back elsewhere: the matrices multiplied by hand, and a solve."""
    b = floor_shot(tmp_path)
    mesh = mesh_of(b)
    pivot, angle = (0.5, -0.25, 0.0), 30.0
    place = mesh.AddTranslateOp(opSuffix="layout")
    place.Set(Gf.Vec3d(0.1, 0.2, 0.0))
    at = mesh.AddTranslateOp(opSuffix="pivot")
    at.Set(Gf.Vec3d(*pivot))
    mesh.AddRotateZOp(opSuffix="spin").Set(angle)
    mesh.AddScaleOp(opSuffix="grow").Set(Gf.Vec3f(1.5, 1.25, 1))
    mesh.AddTranslateOp(opSuffix="pivot", isInverseOp=True)
    assert list(mesh.GetXformOpOrderAttr().Get())[-1] == "!invert!xformOp:translate:pivot"
    session = solves_and_shows(b.save())
    world = moved_by(0.1, 0.2, 0) @ moved_by(*pivot) @ turn_about_z(angle) @ np.diag([1.5, 1.25, 1, 1])
    world = world @ moved_by(*(-np.array(pivot)))
    expected = GRID @ world[:3, :3].T + world[:3, 3]
    np.testing.assert_allclose(session.scene.meshes[0].positions, expected, atol=1e-6)


def test_reset_xform_stack(tmp_path: Path) -> None:
    """What is above it counts no more."""
    b = floor_shot(tmp_path)
    group = UsdGeom.Xform.Define(b.stage, "/World/group")
    group.AddTranslateOp().Set(Gf.Vec3d(7, 8, 9))
    group.AddScaleOp().Set(Gf.Vec3f(-3, 2, 5))
    root = b.stage.GetRootLayer()
    Sdf.CopySpec(root, "/World/floor", root, "/World/group/floor")
    b.stage.RemovePrim("/World/floor")
    mesh = UsdGeom.Mesh(b.stage.GetPrimAtPath("/World/group/floor"))
    mesh.AddTranslateOp().Set(Gf.Vec3d(0.25, 0, 0))
    mesh.SetResetXformStack(True)
    session = solves_and_shows(b.save())
    np.testing.assert_allclose(session.scene.meshes[0].positions, GRID + np.array([0.25, 0, 0]), atol=1e-6)


# ---- gprims and n-gons --------------------------------------------------------------------------------------
def test_a_stage_of_implicit_gprims_only(tmp_path: Path) -> None:
    """Areas are those of the catalogue, and the Plane solves."""
    b = floor_shot(tmp_path)
    b.stage.RemovePrim("/World/floor")
    floor = UsdGeom.Plane.Define(b.stage, "/World/floor")
    floor.CreateAxisAttr("Z")
    floor.CreateWidthAttr(4)
    floor.CreateLengthAttr(4)
    b._place(floor, "/World/mtl/floor", (0, 0, 0), 0)
    kinds = {"Sphere": 4 * math.pi, "Cube": 24, "Cylinder": 6 * math.pi, "Cone": math.pi * (1 + math.sqrt(5)),
             "Capsule": 4 * math.pi}  # fmt: skip
    for i, kind in enumerate(kinds):
        prim = b.stage.DefinePrim(f"/World/{kind}", kind)
        if kind == "Capsule":
            prim.GetAttribute("height").Set(0.0)
            prim.GetAttribute("radius").Set(1.0)
        UsdGeom.Xformable(prim).AddTranslateOp().Set(Gf.Vec3d(30 + 4 * i, 0, 0))
    session = solves_and_shows(b.save())
    areas = {m.path: np.linalg.norm(area_vectors(m), axis=1).sum() for m in session.scene.meshes}
    for kind, area in kinds.items():
        assert areas[f"/World/{kind}"] == pytest.approx(area, rel=0.005), kind


def test_a_concave_polygon_covers_its_area_once(tmp_path: Path) -> None:
    """A U of one face: its area, nothing over its notch, and the floor seen through there."""
    b = floor_shot(tmp_path)
    outline = [(0, 0), (3, 0), (3, 3), (2, 3), (2, 1), (1, 1), (1, 3), (0, 3)]
    points = [(0.2 * x - 0.3, 0.2 * y - 0.3, 0.2) for x, y in outline]
    add_mesh(b.stage, "/World/u", points, [range(8)])
    session = usdslf.open(str(b.save()), elements=150)
    u = next(m for m in session.scene.meshes if m.path == "/World/u")
    v = area_vectors(u)
    assert (v[:, 2] > 0).all() and v[:, 2].sum() == pytest.approx(7 * 0.04, rel=1e-6)
    down = np.tile(np.float32([0, 0, -1]), (2, 1))
    over = np.float32([(0.2 * 1.5 - 0.3, 0.2 * 2 - 0.3, 1), (0.2 * 0.5 - 0.3, 0.2 * 2 - 0.3, 1)])
    hits = session.tracer.intersect(over, down)
    names = [session.scene.meshes[session.scene.triangles.mesh[t]].path for t in hits.triangle]
    assert names == ["/World/floor", "/World/u"]


def test_a_polygon_that_is_not_flat_keeps_its_corners(tmp_path: Path) -> None:
    """However it is cut, the sum of area vectors is Newell's of its outline, and its corners are the points."""
    b = floor_shot(tmp_path)
    points = np.array([(0, 0, 0), (2, 0, 0.5), (3, 1, -0.2), (2, 2, 0.6), (0, 2, 0), (-1, 1, 0.7)])
    add_mesh(b.stage, "/World/bent", points + FAR, [range(6)])
    scene = read_scene(b.save())
    bent = next(m for m in scene.meshes if m.path == "/World/bent")
    newell = np.cross(points, np.roll(points, -1, 0)).sum(0) / 2
    np.testing.assert_allclose(area_vectors(bent).sum(0), newell, atol=1e-5)
    assert len(bent.triangles) == 4
    np.testing.assert_allclose(np.unique(corners(bent).reshape(-1, 3), axis=0),
                               np.unique(np.float32(points + FAR), axis=0), atol=1e-6)  # fmt: skip
    assert np.isfinite(bent.corner_normals).all() and (bent.corner_normals[..., 2] > 0).all()


def test_holes_are_seen_through(tmp_path: Path) -> None:
    b = floor_shot(tmp_path)
    mesh_of(b).CreateHoleIndicesAttr([3])  # x > 0, y > 0
    session = usdslf.open(str(b.save()), elements=150)
    hits = session.tracer.intersect(np.float32([(1, 1, 1), (-1, 1, 1)]), np.tile(np.float32([0, 0, -1]), (2, 1)))
    assert hits.triangle[0] < 0 <= hits.triangle[1]
    alpha = session.render("/World/camera", size=(32, 24), samples=4, aovs=("alpha",))["alpha"]
    assert alpha.min() == 0 and alpha.max() == 1
