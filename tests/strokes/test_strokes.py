"""Strokes without USD: a painted path lands where the camera sees it, and follows its surface."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from kit.scene_records import make_mesh, make_scene, quad
from numpy.testing import assert_allclose

from usdslf.errors import StrokeError
from usdslf.geometry.closest_point import nearest_on_triangles
from usdslf.rays import RayTracer
from usdslf.scene.cameras import project_points
from usdslf.scene.records import Camera, Mesh, Scene
from usdslf.strokes.anchors import locate_stroke, painted_faces
from usdslf.strokes.paint import paint_stroke, sample_picture
from usdslf.strokes.stroke import Stroke, dab_rows, validate_stroke


def quad_mesh(path: str, offset: tuple[float, float, float] = (0, 0, 0), scale: float = 1) -> Mesh:
    """A square of one face and two triangles, facing +Z."""
    return quad(np.array(offset) - [scale, scale, 0], (2 * scale, 0, 0), (0, 2 * scale, 0), path=path)


def make_camera(distance: float = 4.0, perspective: bool = True) -> Camera:
    """Sees 2 units of height at a perspective distance of 4: vertical aperture / focal length = 0.5."""
    matrix = np.eye(4)
    matrix[2, 3] = distance
    return Camera("/camera", matrix, 40.0, 20.0, 40.0, perspective=perspective)


def paint(scene: Scene, paths: list, radius: float = 0.05, **options: object) -> Stroke:
    return paint_stroke(scene, RayTracer(scene), make_camera(), paths, radius, **options)


def test_a_dab_in_the_middle_is_a_point_twice_with_the_brush_diameter() -> None:
    stroke = paint(make_scene(quad_mesh("/a")), [[(0.5, 0.5)]], 0.1)
    assert stroke.counts == (2,)
    assert_allclose(stroke.points, np.zeros((2, 3)), atol=1e-6)
    assert_allclose(stroke.widths, 2 * 0.1 * 2.0, rtol=1e-5)  # the picture is 2 units high there
    assert_allclose(stroke.normals, [[0, 0, 1]] * 2, atol=1e-6)
    assert_allclose(stroke.eye, [[0, 0, 4]] * 2, atol=1e-6)
    assert list(dab_rows(stroke)) == [0]
    assert np.isnan(stroke.frame)


def test_origin_of_the_picture_is_top_left() -> None:
    stroke = paint(make_scene(quad_mesh("/a")), [[(0.4, 0.25)]])
    assert_allclose(stroke.points[0], [-0.4, 0.5, 0], atol=1e-5)  # the picture is 4 wide, 2 high


@pytest.mark.parametrize("count", [2, 3, 50])
def test_points_lie_at_brush_spacing_however_often_the_pen_was_read(count: int) -> None:
    path = np.stack([np.linspace(0.4, 0.6, count), np.full(count, 0.5)], -1)
    stroke = paint(make_scene(quad_mesh("/a")), [path], 0.05)
    at, _ = project_points(make_camera(), stroke.points, 2.0)
    assert_allclose(np.diff(at[:, 0]) * 2, 0.025, rtol=1e-4)  # half the radius, in picture heights
    assert_allclose(at[[0, -1], 0], [0.4, 0.6], atol=1e-6)


def test_widths_grow_with_depth_so_that_the_brush_keeps_its_size_in_the_picture() -> None:
    scene = make_scene(quad_mesh("/near", (-1, 0, 0)), quad_mesh("/far", (3, 0, -4), 2))
    stroke = paint(scene, [[(0.4, 0.5)], [(0.7, 0.5)]])
    assert_allclose(stroke.widths[2] / stroke.widths[0], 2.0, rtol=1e-5)
    assert [stroke.surfaces[i] for i in stroke.surface_index] == ["/near"] * 2 + ["/far"] * 2


def test_a_disc_along_the_film_is_round_on_the_picture() -> None:
    turned = np.array([[0.8, 0.0, 0.6], [0.0, 1.0, 0.0], [-0.6, 0.0, 0.8]])
    camera = make_camera()
    matrix = camera.world_from_camera.copy()
    matrix[:3, :3], matrix[:3, 3] = turned, [1.5, 0.0, 4.0]
    camera = replace(camera, world_from_camera=matrix)
    scene = make_scene(quad_mesh("/a", (-3.5, 0, 0), 2))
    stroke = paint_stroke(scene, RayTracer(scene), camera, [[(0.35, 0.7)]], 0.05)
    assert_allclose(stroke.film_normal, turned[:, 2], atol=1e-6)
    angle = np.linspace(0, 2 * np.pi, 16)[:, None]
    rim = np.cos(angle) * turned[:, 0] + np.sin(angle) * turned[:, 1]
    at, _ = project_points(camera, stroke.points[0] + 0.5 * stroke.widths[0] * rim, 2.0)
    assert_allclose(np.hypot(*((at - [0.35, 0.7]) * [2, 1]).T), 0.05, rtol=1e-4)


def test_the_pen_is_lifted_between_surfaces_and_off_them() -> None:
    scene = make_scene(quad_mesh("/a", (-1.2, 0, 0)), quad_mesh("/b", (1.2, 0, 0)))
    stroke = paint(scene, [[(0.3, 0.5), (0.7, 0.5)]])
    assert len(stroke.counts) == 2  # 0.4 units of nothing between the squares
    behind = make_scene(quad_mesh("/a", (-1, 0, 0)), quad_mesh("/b", (0, 0, -4), 5))
    assert len(paint(behind, [[(0.3, 0.5), (0.7, 0.5)]]).counts) == 2


def test_anchors_give_back_the_points() -> None:
    scene = make_scene(quad_mesh("/a"))
    stroke = paint(scene, [[(0.35, 0.2), (0.65, 0.8), (0.4, 0.7)]])
    located = locate_stroke(scene, stroke)
    assert not located.moved
    assert_allclose(located.position, stroke.points, atol=1e-5)
    assert set(np.floor(stroke.barycentric[:, 0])) == {0, 1}  # both triangles of the face


def test_a_stroke_follows_a_surface_that_moved_and_says_so() -> None:
    before = make_scene(quad_mesh("/a"), quad_mesh("/floor", (0, 0, -1), 4))
    stroke = paint(before, [[(0.4, 0.4), (0.6, 0.6)]])
    shift = np.float32([0.5, -0.25, 0.75])
    after = make_scene(quad_mesh("/a", tuple(shift)), quad_mesh("/floor", (0, 0, -1), 4))
    warnings: list[str] = []
    located = locate_stroke(after, stroke, warnings)
    assert located.moved and len(warnings) == 1 and "/SlfStrokes/stroke_0001" in warnings[0]
    assert_allclose(located.position, stroke.points + shift, atol=1e-5)


def test_another_cut_of_the_same_face_is_not_a_move() -> None:
    scene = make_scene(quad_mesh("/a"))
    stroke = paint(scene, [[(0.4, 0.3), (0.6, 0.6)]])
    mesh = quad_mesh("/a")
    fan = np.vstack([mesh.positions, np.float32([[0, 0, 0]])])
    cut = replace(
        mesh,
        positions=fan,
        triangles=np.array([[0, 1, 4], [1, 2, 4], [2, 3, 4], [3, 0, 4]], np.int32),
        corner_normals=np.broadcast_to(np.float32([0, 0, 1]), (4, 3, 3)).copy(),
        face_of_triangle=np.zeros(4, np.int32),
        triangle_in_face=np.arange(4, dtype=np.int32),
        material_of_triangle=np.zeros(4, np.int32),
    )
    warnings: list[str] = []
    located = locate_stroke(make_scene(cut), stroke, warnings)
    assert not located.moved and not warnings
    assert_allclose(located.position, stroke.points, atol=1e-5)


def test_without_anchors_points_go_to_the_nearest_surface() -> None:
    scene = make_scene(quad_mesh("/a"), quad_mesh("/b", (0, 0, -3)))
    points = np.float32([[0.2, 0.1, 0.004], [-0.3, 0.9, -3.004]])
    stroke = Stroke("s", points, np.ones(2, np.float32), np.ones((2, 3)), np.float32([[0, 0, 5]] * 2))
    located = locate_stroke(scene, stroke)
    assert_allclose(located.position, points * [1, 1, 0] + [[0, 0, 0], [0, 0, -3]], atol=1e-5)
    assert list(scene.triangles.mesh[located.triangle]) == [0, 1]


def test_normals_turn_towards_the_eye_on_either_side() -> None:
    scene = make_scene(quad_mesh("/a"))
    for z in (4.0, -4.0):
        eye = np.float32([[0, 0, z]] * 2)
        stroke = Stroke("s", np.zeros((2, 3), np.float32), np.ones(2), np.ones((2, 3)), eye)
        assert_allclose(locate_stroke(scene, stroke).normal[:, 2], np.sign(z), atol=1e-6)


def test_points_off_every_surface_are_left_out_with_a_word() -> None:
    scene = make_scene(quad_mesh("/a"))
    points = np.float32([[0, 0, 0], [0, 0, 50], [0.5, 0, 0]])
    stroke = Stroke("s", points, np.full(3, 0.1), np.ones((3, 3)), np.float32([[0, 0, 5]] * 3))
    warnings: list[str] = []
    assert list(locate_stroke(scene, stroke, warnings).row) == [0, 2]
    assert len(warnings) == 1
    with pytest.raises(StrokeError, match="off every surface"):
        locate_stroke(scene, replace(stroke, points=points + np.float32([0, 0, 90])))


def test_a_stroke_of_another_stage_is_refused() -> None:
    stroke = paint(make_scene(quad_mesh("/a")), [[(0.5, 0.5)]])
    with pytest.raises(StrokeError, match=r"/a, which test\.usda does not show"):
        locate_stroke(replace(make_scene(quad_mesh("/other")), stage="test.usda"), stroke)


def test_a_path_off_every_surface_is_refused() -> None:
    with pytest.raises(StrokeError, match="off every surface"):
        paint(make_scene(quad_mesh("/a")), [[(0.01, 0.5)]])


@pytest.mark.parametrize("radius", [0.0, -1.0, np.nan, np.inf])
def test_a_brush_without_size_is_refused(radius: float) -> None:
    with pytest.raises(StrokeError, match="radius"):
        paint(make_scene(quad_mesh("/a")), [[(0.5, 0.5)]], radius)


@pytest.mark.parametrize("paths", [[], [[]], [np.zeros((0, 2))], [[(0.5, np.nan)]]])
def test_a_path_that_says_nothing_is_refused(paths: list) -> None:
    with pytest.raises(StrokeError, match="path"):
        paint(make_scene(quad_mesh("/a")), paths)


@pytest.mark.parametrize(
    ("change", "word"),
    [
        ({"tool": "smudge"}, "tool"),
        ({"mode": "x"}, "mode"),
        ({"space": "x"}, "space"),
        ({"norm": "l1"}, "norm"),
        ({"scope": "world"}, "scope"),
        ({"strength": 1.5}, "strength"),
        ({"strength": np.nan}, "strength"),
        ({"widths": np.float32([1, 0])}, "width"),
        ({"widths": np.float32([1, -1])}, "width"),
        ({"points": np.float32([[0, 0, np.nan], [0, 0, 0]])}, "points"),
        ({"colors": np.float32([[0, 0, np.inf], [0, 0, 0]])}, "colors"),
        ({"points": np.zeros((0, 3), np.float32)}, "empty"),
        ({"curve_counts": (1, 1)}, "curves"),
        ({"tool": "clone"}, "clone"),
        ({"name": "9 lives"}, "name"),
        ({"eye": np.zeros((1, 3))}, "eye"),
    ],
)
def test_impossible_strokes_are_refused_by_name(change: dict, word: str) -> None:
    good = Stroke("s", np.zeros((2, 3), np.float32), np.ones(2), np.ones((2, 3)), np.ones((2, 3)))
    validate_stroke(good)
    with pytest.raises(StrokeError, match=word):
        validate_stroke(replace(good, **change))


def test_colours_are_read_bilinearly_from_the_picture() -> None:
    image = np.zeros((4, 8, 3), np.float32)
    image[..., 0] = (np.arange(8) + 0.5) / 8
    image[..., 1] = ((np.arange(4) + 0.5) / 4)[:, None]
    stroke = paint(make_scene(quad_mesh("/a")), [[(0.3, 0.3), (0.7, 0.6)]], image=image)
    at, _ = project_points(make_camera(), stroke.points, 2.0)
    assert_allclose(stroke.colors[:, :2], at, atol=1e-5)
    assert_allclose(sample_picture(image[:1, :1], [(0.9, 0.1)]), image[0, :1], atol=1e-7)


def test_nearest_point_agrees_with_dense_sampling_of_triangles() -> None:
    rng = np.random.default_rng(5)
    corners, points = rng.normal(size=(37, 3, 3)), rng.normal(size=(65, 3)) * 2
    found = nearest_on_triangles(corners, points)
    u, v = np.meshgrid(np.linspace(0, 1, 60), np.linspace(0, 1, 60))
    u, v = u[u + v <= 1 + 1e-9], v[u + v <= 1 + 1e-9]
    weights = np.stack([1 - u - v, u, v], -1)
    dense = np.einsum("sk,tkc->tsc", weights, corners).reshape(-1, 3)
    brute = np.linalg.norm(points[:, None] - dense[None], axis=2).min(1)
    assert (found.distance <= brute + 1e-9).all()
    assert_allclose(found.distance, brute, atol=0.05)
    u, v = found.barycentric.T
    assert (u >= 0).all() and (v >= 0).all() and (u + v <= 1 + 1e-12).all()
    foot = np.einsum("nk,nkc->nc", np.stack([1 - u - v, u, v], -1), corners[found.triangle])
    assert_allclose(np.linalg.norm(foot - points, axis=1), found.distance, atol=1e-9)


def test_corners_lie_on_the_first_triangle_that_has_them() -> None:
    """As the points of a mesh do; beside them others, whose nearest places are within triangles, and a centre."""
    rng = np.random.default_rng(6)
    mesh = rng.normal(size=(30, 3)).astype(np.float32)
    corners = mesh[rng.integers(0, 30, (40, 3))]
    corners[3] = np.nan
    asked = rng.permutation(np.unique(corners[np.isfinite(corners).all((1, 2))].reshape(-1, 3), axis=0)).astype(float)
    others = rng.normal(size=(5, 3))
    corners[7] = corners[9].mean(0) + np.float32([[0, 0, 0], [9, 0, 0], [0, 9, 0]])
    points = np.concatenate([asked[:10], others, asked[10:], corners[7, :1]]).astype(float)
    found = nearest_on_triangles(corners, points)
    alone = [nearest_on_triangles(corners, p[None]) for p in points[10:15]]
    np.testing.assert_array_equal(found.triangle[10:15], [one.triangle[0] for one in alone])
    for i in [*range(10), *range(15, len(points))]:
        has = np.flatnonzero((corners == points[i]).all(2).any(1))
        if not len(has):  # a corner of what was moved
            continue
        assert found.distance[i] == 0 and found.triangle[i] == has[0], i
        u, v = found.barycentric[i]
        assert_allclose(np.array([1 - u - v, u, v]) @ corners[has[0]], points[i], atol=1e-7)


def test_a_point_that_is_there_twice_is_nearest_to_what_it_is_nearest_to_alone() -> None:
    rng = np.random.default_rng(8)
    corners, points = rng.normal(size=(30, 3, 3)), rng.normal(size=(6, 3))
    points[4] = corners[3, 1]
    alone = nearest_on_triangles(corners, points)
    twice = nearest_on_triangles(corners, points[[0, 0, 1, 2, 2, 2, 3, 4, 4, 5]])
    for name, found in vars(twice).items():
        np.testing.assert_array_equal(found, getattr(alone, name)[[0, 0, 1, 2, 2, 2, 3, 4, 4, 5]])


def test_degenerate_and_broken_triangles_do_not_disturb_the_nearest_point() -> None:
    corners = np.array([[[0, 0, 0]] * 3, [[np.nan] * 3] * 3, [[0, 0, 0], [1, 0, 0], [2, 0, 0]]])
    found = nearest_on_triangles(corners, np.array([[1.5, 1, 0], [-1, 0, 0]]))
    assert_allclose(found.distance, [1, 1], atol=1e-12)
    assert nearest_on_triangles(np.zeros((0, 3, 3)), np.zeros((2, 3))).distance.tolist() == [np.inf, np.inf]


def grid_mesh(path: str, n: int, z: float = 0, flip: bool = False) -> Mesh:
    """n x n squares over -1..1, one face of two triangles each."""
    i, j = np.meshgrid(np.arange(n), np.arange(n), indexing="ij")
    low = (np.stack([i, j], -1).reshape(-1, 1, 2) + np.array([[0, 0], [1, 0], [1, 1], [0, 1]])) * 2 / n - 1
    corners = np.concatenate([low, np.full((*low.shape[:2], 1), z)], -1).astype(np.float32)
    first = 4 * np.arange(n * n)[:, None]
    triangles = np.concatenate([first + np.array([0, 1, 2]), first + np.array([0, 2, 3])], 1).reshape(-1, 3)
    triangles = triangles[:, ::-1] if flip else triangles
    return make_mesh(corners.reshape(-1, 3), triangles, path=path)


def test_painted_faces_are_those_that_the_brush_touches() -> None:
    n = 10
    scene = make_scene(grid_mesh("/a", n))
    stroke = paint(scene, [[(0.5 + 0.05 / 4, 0.5 - 0.15 / 2)]], 0.15)  # a ball of 0.3 about (0.05, 0.15)
    faces = painted_faces(scene, stroke, locate_stroke(scene, stroke))["/a"]
    i, j = np.meshgrid(np.arange(n), np.arange(n), indexing="ij")
    low = np.stack([i, j], -1).reshape(-1, 2) * 2 / n - 1
    gap = np.maximum(0, np.maximum(low - [0.05, 0.15], [0.05, 0.15] - low - 2 / n))
    assert list(faces) == np.flatnonzero(np.linalg.norm(gap, axis=1) <= 0.3).tolist()


def test_the_back_of_a_thin_wall_is_not_painted() -> None:
    scene = make_scene(grid_mesh("/a", 4, 0.01), grid_mesh("/b", 4, 0.0, flip=True))
    stroke = paint(scene, [[(0.5, 0.5)]], 0.1)
    assert set(painted_faces(scene, stroke, locate_stroke(scene, stroke))) == {"/a"}
    both = grid_mesh("/a", 4, 0.01)
    back = grid_mesh("/a", 4, 0.0, flip=True)
    wall = replace(
        both,
        positions=np.concatenate([both.positions, back.positions]),
        triangles=np.concatenate([both.triangles, back.triangles + len(both.positions)]),
        corner_normals=np.concatenate([both.corner_normals, back.corner_normals]),
        face_of_triangle=np.concatenate([both.face_of_triangle, back.face_of_triangle + 16]),
        triangle_in_face=np.tile(both.triangle_in_face, 2),
        material_of_triangle=np.tile(both.material_of_triangle, 2),
    )
    scene = make_scene(wall)
    stroke = paint(scene, [[(0.5, 0.5)]], 0.1)
    faces = painted_faces(scene, stroke, locate_stroke(scene, stroke))["/a"]
    assert faces and max(faces) < 16
