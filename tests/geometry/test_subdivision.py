"""Subdivision against the textbook form, known points, and the invariants of topology and limits."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from reference import subdivide as reference

from usdslf.geometry.normals import corner_normals, limit_normals
from usdslf.geometry.shape import Polygons, Values, build_shape
from usdslf.geometry.subdivision import face_varying_net, make_net, refine_corner_values, refine_net
from usdslf.geometry.triangulation import triangulate

CUBE = np.array([[x, y, z] for z in (-1, 1) for y in (-1, 1) for x in (-1, 1)], float)
CUBE_FACES = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]]
TETRAHEDRON = np.array([[1, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1]], float)
TETRAHEDRON_FACES = [[0, 1, 2], [0, 2, 3], [0, 3, 1], [1, 3, 2]]


def net_of(points, faces, creases=None, corners=None, boundary="edgeAndCorner"):
    counts = np.array([len(f) for f in faces])
    tags = None
    if creases:
        tags = (np.array(list(creases)), np.array(list(creases.values()), float))
    sharp = (np.array(list(corners)), np.array(list(corners.values()), float)) if corners else None
    return make_net(counts, np.concatenate(faces), len(points), tags, sharp, boundary)


def lattice(n):
    """n x n quads on z = x^2 - y^2 / 2."""
    x, y = np.meshgrid(np.arange(n + 1.0), np.arange(n + 1.0), indexing="ij")
    points = np.stack([x, y, x**2 - y**2 / 2], axis=2).reshape(-1, 3)
    i, j = np.meshgrid(np.arange(n), np.arange(n), indexing="ij")
    a = (i * (n + 1) + j).ravel()
    return points, [list(f) for f in np.stack([a, a + n + 1, a + n + 2, a + 1], axis=1)]


def pentagonal_prism():
    """Vertices of three edges; after one level the pentagons' middles have five."""
    turn = 2 * np.pi * np.arange(5) / 5
    ring = np.stack([np.cos(turn), np.sin(turn)], axis=1)
    points = np.concatenate([np.c_[ring, -np.ones(5)], np.c_[ring, np.ones(5)]])
    sides = [[i, (i + 1) % 5, 5 + (i + 1) % 5, 5 + i] for i in range(5)]
    return points, [[4, 3, 2, 1, 0], [5, 6, 7, 8, 9], *sides]


def octahedron():
    """Vertices of four edges, and of six after one level."""
    points = np.concatenate([np.eye(3), -np.eye(3)])
    upper = [[0, 1, 2], [1, 3, 2], [3, 4, 2], [4, 0, 2]]
    return points, [*upper, [1, 0, 5], [3, 1, 5], [4, 3, 5], [0, 4, 5]]


def open_box():
    """A cube without its top, with a triangle and a pentagon added on one rim."""
    points = np.concatenate([CUBE, [[2.0, -1, 1], [2.2, 0, 1.5], [2.0, 1, 1]]])
    faces = [f for f in CUBE_FACES if f != [4, 5, 7, 6]]
    return points, [*faces, [5, 8, 9, 10, 7], [10, 9, 8]]


def test_cube_has_its_known_points():
    net = net_of(CUBE, CUBE_FACES)
    child, stencil = refine_net(net, "catmullClark")
    points = stencil @ CUBE
    assert len(points) == 8 + 12 + 6
    # Vertex: Q/3 + 2R/3 with face points at 1/3 of the corner and edge middles at 2/3.
    assert np.allclose(points[:8], CUBE * 5 / 9)
    assert np.allclose(np.sort(np.abs(points[8:20]), axis=1), [0, 0.75, 0.75])
    assert np.allclose(np.sort(np.abs(points[20:]), axis=1), [0, 0, 1])
    assert (child.counts == 4).all()


@pytest.mark.parametrize("scheme", ["catmullClark", "loop"])
@pytest.mark.parametrize("tagged", [False, True])
def test_equals_the_textbook_form(scheme, tagged):
    rng = np.random.default_rng(3)
    shapes = (
        [
            (TETRAHEDRON, TETRAHEDRON_FACES),
            (CUBE, [t for a, b, c, d in CUBE_FACES for t in ([a, b, c], [a, c, d])]),
        ]
        if scheme == "loop"
        else [(CUBE, CUBE_FACES), (TETRAHEDRON, TETRAHEDRON_FACES), open_box(), lattice(3)]
    )
    for points, faces in shapes:
        points = points + rng.normal(size=points.shape) * 0.1
        edges = list(reference._edges(faces))
        creases, corners = {}, {}
        if tagged:
            chosen = rng.choice(len(edges), len(edges) // 2, replace=False)
            creases = {
                edges[i]: float(s) for i, s in zip(chosen, rng.uniform(0.2, 3, len(edges)), strict=False)
            }
            corners = {0: 0.4, 2: 1.7}
        net = net_of(points, faces, creases, corners, "edgeOnly")
        want = (points, faces, creases, corners)
        for level in range(3):
            net, stencil = refine_net(net, scheme)
            points = stencil @ points
            want = reference.subdivide(*want, scheme)
            assert np.allclose(points, want[0], atol=1e-12), (scheme, tagged, level)
            assert np.array_equal(net.indices, np.concatenate(want[1]))


@pytest.mark.parametrize("scheme", ["catmullClark", "bilinear", "loop"])
def test_refining_keeps_euler_characteristic_and_affine_maps(scheme):
    if scheme == "loop":
        points, faces = TETRAHEDRON, TETRAHEDRON_FACES
    else:
        points, faces = CUBE, CUBE_FACES
    net = net_of(points, faces, {(0, 1): 1.3})
    for _ in range(3):
        net, stencil = refine_net(net, scheme)
        assert net.vertex_count - len(net.links.ends) + len(net.counts) == 2
        assert np.allclose(stencil @ np.ones(stencil.shape[1]), 1)
        assert net.links.faces_of_edge.max() == net.links.faces_of_edge.min() == 2


def test_regular_lattice_reproduces_a_paraboloid():
    """The limit of a regular lattice is the bicubic B-spline of its points: x^2 -> x^2 + 1/3."""
    points, faces = lattice(9)
    net = net_of(points, faces)
    at = 5 * 10 + 4
    x, y = points[at, :2]
    for _ in range(5):
        net, stencil = refine_net(net, "catmullClark")
        points = stencil @ points
    assert np.allclose(points[at, :2], [x, y])
    # Refined k times the spline's control point is 1/3 (1 - 4^-k) above its parabola.
    assert points[at, 2] == pytest.approx(x**2 - y**2 / 2 + (1 / 3 - 1 / 6) * (1 - 4.0**-5), abs=1e-9)
    normals = limit_normals(net, points, "catmullClark")
    normal = normals[np.flatnonzero(net.indices == at)[0]]
    want = np.array([-2 * x, y, 1]) / math.sqrt(4 * x**2 + y**2 + 1)
    assert np.allclose(normal, want, atol=1e-12)


@pytest.mark.parametrize("scheme", ["catmullClark", "loop"])
def test_limit_normals_of_a_coarse_level_are_those_of_a_fine_one(scheme):
    points, faces = pentagonal_prism() if scheme == "catmullClark" else octahedron()
    points = points + np.random.default_rng(5).normal(size=points.shape) * 0.15
    net = net_of(points, faces)
    net, stencil = refine_net(net, scheme)
    points = stencil @ points
    coarse = np.zeros((net.vertex_count, 3))
    coarse[net.indices] = limit_normals(net, points, scheme)
    coarse_net, coarse_points = net, points
    count = net.vertex_count
    for _ in range(5):
        net, stencil = refine_net(net, scheme)
        points = stencil @ points
    fine = np.zeros((net.vertex_count, 3))
    fine[net.indices] = corner_normals(net, points)
    assert (coarse * fine[:count]).sum(1).min() > 1 - 1e-6
    # The mean of the faces at the coarse level is not good enough.
    mean = np.zeros_like(coarse)
    mean[coarse_net.indices] = corner_normals(coarse_net, coarse_points)
    assert (mean * fine[:count]).sum(1).min() < 0.9995


def test_infinitely_sharp_cube_stays_a_cube_with_parted_normals():
    creases = {e: math.inf for e in reference._edges(CUBE_FACES)}
    shape = build_shape(
        Polygons(
            CUBE,
            np.full(6, 4),
            np.concatenate(CUBE_FACES),
            np.arange(6),
            "catmullClark",
            creases=(np.array(list(creases)), np.array(list(creases.values()))),
        ),
        refine=2,
    )
    p = shape.positions[shape.triangles]
    assert np.allclose(np.abs(p).max(2), 1)
    assert np.allclose(np.abs(shape.corner_normals).max(2), 1)
    area = np.linalg.norm(np.cross(p[:, 1] - p[:, 0], p[:, 2] - p[:, 0]), axis=1).sum() / 2
    assert area == pytest.approx(24)


def test_boundary_rules():
    points, faces = lattice(2)
    sharp = refine_net(net_of(points, faces), "catmullClark")[1] @ points
    round_ = refine_net(net_of(points, faces, boundary="edgeOnly"), "catmullClark")[1] @ points
    assert np.allclose(sharp[0], points[0])
    # A boundary is a cubic B-spline of its own: 1/8 6/8 1/8 at the corner too.
    assert np.allclose(round_[0], 0.75 * points[0] + (points[1] + points[3]) / 8)
    assert np.allclose(sharp[1], 0.75 * points[1] + (points[0] + points[2]) / 8)
    hidden = build_shape(
        Polygons(
            lattice(4)[0],
            np.full(16, 4),
            np.concatenate(lattice(4)[1]),
            np.arange(16),
            "catmullClark",
            "none",
        )
    )
    assert sorted(set(hidden.face)) == [5, 6, 9, 10]


def test_smooth_face_varying_values_move_like_points():
    """Values with the topology of the points (no seam) are refined as the points are."""
    points, faces = lattice(4)
    net = net_of(points, faces)
    values = face_varying_net(net, net.indices, len(points), "cornersPlus1")
    assert np.allclose(
        refine_net(values, "catmullClark")[1].toarray(), refine_net(net, "catmullClark")[1].toarray()
    )


def test_seams_of_face_varying_values_stay_seams():
    """On two quads that share an edge but no values, each side's values stay in its own square."""
    points = np.array([[x, y, 0.0] for y in (0, 1) for x in (0, 1, 2)])
    net = net_of(points, [[0, 1, 4, 3], [1, 2, 5, 4]])
    uv = np.array([[0, 0], [1, 0], [1, 1], [0, 1], [5, 0], [6, 0], [6, 1], [5, 1]], float)
    values = face_varying_net(net, np.arange(8), 8, "cornersPlus1")
    child, stencil = refine_net(values, "catmullClark")
    linear = refine_corner_values(net, "catmullClark", uv)
    assert np.allclose((stencil @ uv)[child.indices], linear)


@pytest.mark.parametrize("scheme", ["catmullClark", "loop", "bilinear"])
def test_corners_carry_their_values_through_refinement(scheme):
    """Linear values of the position stay so where the surface is flat: points, corners and faces agree."""
    points, faces = lattice(3)
    points[:, 2] = 0
    if scheme == "loop":
        faces = [t for a, b, c, d in faces for t in ([a, b, c], [a, c, d])]
    flat = np.concatenate(faces)
    uv = points[:, :2] * 2 + 1
    polygons = Polygons(
        points,
        np.array([len(f) for f in faces]),
        flat,
        np.arange(len(faces)),
        scheme,
        face_varying_rule="all",
        primvars={
            "varying": Values("varying", uv),
            "corner": Values("faceVarying", uv[flat]),
            "face": Values("uniform", np.arange(len(faces))[:, None].astype(float)),
        },
    )
    shape = build_shape(polygons, refine=2)
    # Bilinear refinement of a flat lattice moves nothing; smooth schemes move boundary points only along it.
    assert np.allclose(shape.primvars["varying"], shape.primvars["corner"])
    assert np.array_equal(shape.primvars["face"][:, 0, 0].astype(int), shape.face)
    if scheme == "bilinear":
        assert np.allclose(shape.positions[shape.triangles][:, :, :2] * 2 + 1, shape.primvars["corner"])
    assert np.allclose(shape.corner_normals, [0, 0, 1])
    for f in range(len(faces)):
        assert np.array_equal(shape.within[shape.face == f], np.arange((shape.face == f).sum()))


def shoelace(p):
    q = np.roll(p, -1, axis=0)
    return (p[:, 0] * q[:, 1] - p[:, 1] * q[:, 0]).sum() / 2


@settings(max_examples=60, deadline=None)
@given(st.integers(4, 40), st.integers(0, 10_000))
def test_triangles_of_concave_polygons_cover_them_once(n, seed):
    """Star-shaped polygons in any plane: all triangles wind like the polygon and their areas add up."""
    rng = np.random.default_rng(seed)
    angle = 2 * np.pi * (np.arange(n) + rng.uniform(0, 0.8, n)) / n
    flat = rng.uniform(0.2, 1, n)[:, None] * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    turn = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    points = flat @ turn[:2]
    corners, face, within = triangulate(points, np.array([n]), np.arange(n))
    normal = np.cross(turn[0], turn[1])
    p = points[corners]
    areas = np.cross(p[:, 1] - p[:, 0], p[:, 2] - p[:, 0]) @ normal / 2
    assert len(corners) == n - 2 and (face == 0).all() and np.array_equal(within, np.arange(n - 2))
    assert areas.min() > -1e-9
    assert areas.sum() == pytest.approx(shoelace(flat))


def test_polygon_with_a_bridge_to_its_hole_keeps_the_hole():
    outer = np.array([[0, 0], [4, 0], [4, 4], [0, 4]], float)
    inner = np.array([[1, 1], [1, 3], [3, 3], [3, 1]], float)
    p = np.concatenate([outer, outer[:1], inner, inner[:1]])
    points = np.concatenate([p, np.zeros((len(p), 1))], axis=1)
    corners, _, _ = triangulate(points, np.array([len(p)]), np.arange(len(p)))
    t = points[corners]
    areas = np.cross(t[:, 1] - t[:, 0], t[:, 2] - t[:, 0])[:, 2] / 2
    assert areas.min() > -1e-12 and areas.sum() == pytest.approx(12)
    centre = t.mean(1)[areas > 0]
    assert not ((np.abs(centre[:, 0] - 2) < 1) & (np.abs(centre[:, 1] - 2) < 1)).any()


def test_convex_faces_are_fans_and_many_faces_keep_their_order():
    points, faces = lattice(5)
    corners, face, within = triangulate(points, np.full(25, 4), np.concatenate(faces))
    assert np.array_equal(corners[:2], [[0, 1, 2], [0, 2, 3]])
    assert np.array_equal(face, np.repeat(np.arange(25), 2)) and np.array_equal(within, np.tile([0, 1], 25))
