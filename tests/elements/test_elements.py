"""Laws of elements: areas, spacing, living sides."""

from dataclasses import replace

import numpy as np
import pytest
from kit.sampled_elements import sample
from kit.scene_records import band, box, lamp, make_mesh, make_scene, quad, sphere
from scipy.spatial import cKDTree

from usdslf.elements.elements import sample_elements, share_out
from usdslf.errors import StageError
from usdslf.rays import RayTracer, points_at
from usdslf.sampling.blue_noise import choose_blue_noise
from usdslf.scene.records import Camera, Material, PrimvarInput, constant


def test_areas_sum_to_the_surface_and_are_equal_where_it_is_flat():
    scene = make_scene(box((0, 0, 0), (2, 1, 3)), quad((5, 0, 0), (4, 0, 0), (0, 2, 1)), sphere(1.5, center=(0, 8, 0)))
    _, e = sample(scene, 1000)
    assert len(e) == 1000
    for mesh, sides in ((0, (1,)), (1, (1, -1)), (2, (1,))):
        surface = scene.triangles.areas[scene.triangles.mesh == mesh].sum()
        assert set(np.unique(e.side[e.mesh == mesh])) == set(sides)
        for side in sides:
            np.testing.assert_allclose(e.area[(e.mesh == mesh) & (e.side == side)].sum(), surface, rtol=1e-5)
    flat = e.area[e.mesh < 2]
    assert flat.max() / flat.min() < 1.03


def test_a_curved_surface_gets_more_elements_as_its_normals_turn():
    """Normals of a sphere of radius r turn by 1 / r a length: 1 + s / (0.05 r) times the share, s the spacing."""
    scene = make_scene(quad((5, 0, 0), (8, 0, 0), (0, 8, 0)), sphere(1.5, center=(0, 8, 0)))
    for count in (500, 40000):
        _, e = sample(scene, count)
        spacing = np.sqrt(scene.triangles.areas.sum() / count)
        ratio = e.area[e.mesh == 0].mean() / e.area[e.mesh == 1].mean()
        np.testing.assert_allclose(ratio, min(1 + spacing / 1.5 / 0.05, 4), rtol=0.1)


def test_elements_lie_on_their_triangles():
    scene = make_scene(sphere(1.0), box((3, 3, 3), (4, 4, 4)))
    _, e = sample(scene)
    t = scene.triangles
    np.testing.assert_allclose(points_at(t.positions, e.triangle, e.barycentric), e.position, atol=1e-5)
    np.testing.assert_allclose(t.face_normals[e.triangle] * e.side[:, None], e.geometric_normal, atol=1e-6)
    np.testing.assert_array_equal(t.mesh[e.triangle], e.mesh)
    np.testing.assert_array_equal(t.material[e.triangle], e.material)
    for value in vars(e).values():
        assert value.dtype in (np.float32, np.int32), value.dtype


def test_elements_keep_their_distance():
    scene = make_scene(quad((0, 0, 0), (10, 0, 0), (0, 10, 0)))
    _, e = sample(scene, 2000)
    front = e.position[e.side > 0]
    spacing = np.sqrt(100 / len(front))
    gap = cKDTree(front).query(front, k=2)[0][:, 1] / spacing
    dice = np.random.default_rng(0).random((len(front), 2)) * 10
    random_gap = cKDTree(dice).query(dice, k=2)[0][:, 1] / spacing
    assert gap.min() > 0.6 and gap.mean() > 0.8
    assert random_gap.min() < 0.1 and random_gap.mean() < 0.6  # what no care would give
    hole = cKDTree(front).query(np.random.default_rng(1).random((20000, 2)) @ np.eye(2, 3) * 10)[0]
    assert hole.max() < 1.3 * spacing


def test_choice_is_exact_for_each_group_whatever_the_candidates():
    rng = np.random.default_rng(0)
    x = np.concatenate([rng.random((500, 3)) * 10, np.ones((40, 3)), rng.random((3, 3))])
    x[500:540, 0] += 1000  # forty copies of one point
    x[540:, 0] += 2000
    group = np.repeat([0, 1, 2, 3], [500, 40, 3, 0])
    chosen = choose_blue_noise(x, group, np.array([100, 7, 9, 4]), rng)
    np.testing.assert_array_equal(np.bincount(group[chosen], minlength=4), [100, 7, 3, 0])
    assert len(choose_blue_noise(x[:0], group[:0], np.array([3]), rng)) == 0


def test_frames_are_orthonormal_and_differ():
    _, e = sample(make_scene(sphere(1.0), quad((3, 0, 0), (6, 0, 0), (0, 6, 0))))
    f = e.frame.astype(float)
    np.testing.assert_allclose(f @ f.transpose(0, 2, 1), np.broadcast_to(np.eye(3), f.shape), atol=1e-5)
    np.testing.assert_allclose(np.linalg.det(f), 1, atol=1e-5)
    np.testing.assert_allclose(f[:, 2], e.normal, atol=1e-6)
    flat = f[(e.mesh == 1) & (e.side > 0), 0]
    assert np.linalg.norm(flat.mean(0)) < 0.3


def test_same_seed_same_elements():
    scene = make_scene(sphere(1.0), box((2, 2, 2), (3, 3, 3)))
    a, b, c = sample(scene, 300, 1)[1], sample(scene, 300, 1)[1], sample(scene, 300, 2)[1]
    for x, y in zip(vars(a).values(), vars(b).values(), strict=True):
        np.testing.assert_array_equal(x, y)
    assert not np.array_equal(a.position, c.position)


def test_small_props_have_elements():
    props = [box((i, 0, 0), (i + 0.01, 0.01, 0.01), path=f"/prop{i}") for i in range(10)]
    scene = make_scene(quad((-50, -1, -50), (0, 0, 100), (100, 0, 0)), *props)
    _, e = sample(scene, 1000)
    number = np.bincount(e.mesh, minlength=11)
    assert len(e) == 1000 and (number[1:] >= 6).all()


@pytest.mark.parametrize("count", [1, 7, 50, 1000])
def test_shares_are_exact_and_by_area(count):
    area = np.random.default_rng(0).random(40) ** 8
    area[3] = 0
    share = share_out(area, count)
    assert share.sum() == count and share[3] == 0
    assert (np.diff(share[np.argsort(area)]) >= 0).all()
    if count == 1000:
        assert (share[area > 0] >= 6).all()


def test_inside_of_closed_bodies_is_dead_and_of_open_ones_alive():
    cup = box((5, 0, 0), (6, 1, 1))
    cup = make_mesh(cup.positions, cup.triangles[:-2])  # without its top in z
    scene = make_scene(box(), sphere(0.5, center=(3, 0, 0)), cup)
    _, e = sample(scene, 900)
    inside = e.side < 0
    assert not inside[e.mesh < 2].any()
    np.testing.assert_allclose(e.area[inside & (e.mesh == 2)].sum(), 5, rtol=0.02)


def test_bodies_that_cut_into_each_other_do_not_leak():
    floor = quad((-2, 0, -2), (0, 0, 4), (4, 0, 0), path="/floor")
    scene = make_scene(floor, sphere(1.0, path="/half sunk"))
    _, e = sample(scene, 2000)
    assert not ((e.mesh == 1) & (e.side < 0)).any()
    on_floor = (e.mesh == 0) & (e.side > 0)
    radius = np.linalg.norm(e.position[on_floor], axis=1)
    assert (radius < 0.9).sum() == 0
    np.testing.assert_allclose(e.area[on_floor].sum(), 16 - np.pi, rtol=0.03)


@pytest.mark.parametrize("seed", range(4))
def test_what_a_body_stands_on_has_no_elements_below_it(seed):
    """Not even where most of the floor around is lit, as below thin walls and along edges."""
    floor = quad((-1, 0, 1), (2, 0, 0), (0, 0, -2), path="/floor")
    _, e = sample(make_scene(floor, band(0.5, 0.44, 0.12), box((-0.2, 0, -0.3), (0.2, 0.2, 0.2))), 600, seed)
    below_band, below_box = 24 * np.sin(np.pi / 24) * (0.5**2 - 0.44**2), 0.4 * 0.5
    on_floor = (e.mesh == 0) & (e.side > 0)
    x, _, z = e.position[on_floor].T
    sector = 2 * np.pi / 48
    reach = np.hypot(x, z) * np.cos(np.arctan2(z, x) % sector - sector / 2) / np.cos(sector / 2)  # 48 corners
    assert not ((reach > 0.44) & (reach < 0.5)).any()
    assert not ((np.abs(x) < 0.2) & (z > -0.3) & (z < 0.2)).any()
    np.testing.assert_allclose(e.area[on_floor].sum(), 4 - below_band - below_box, rtol=0.03)


def test_in_a_closed_room_the_inside_lives_by_its_lamp():
    room = box((-1, -1, -1), (1, 1, 1), inward=True)
    _, e = sample(make_scene(room, lights=[lamp(height=0.9)]), 300)
    assert (e.side > 0).all()
    _, e = sample(make_scene(room), 300)  # the default light comes from outside
    assert (e.side < 0).all()
    glowing = make_mesh(room.positions, room.triangles, material=0)
    material = Material("", emissive_color=constant(1, 1, 1))
    _, e = sample(make_scene(glowing, materials=[material], lights=[lamp(height=50)]), 300)
    assert set(np.unique(e.side)) == {-1, 1}


def test_each_of_many_closed_rooms_lives_by_a_lamp_of_its_own():
    at = np.arange(12) * 3.0
    rooms = [box((x - 1, -1, -1), (x + 1, 1, 1), inward=True, path=f"/room_{x:.0f}") for x in at]
    _, e = sample(make_scene(*rooms, lights=[lamp(height=0.9, at=(x, 0)) for x in at]), 480)
    assert (e.side > 0).all()
    assert np.bincount(e.mesh, minlength=12).min() > 30  # of 40


def test_what_a_camera_sees_has_elements_even_unlit():
    scene = make_scene(box(inward=True), lights=[lamp(height=9, up=True)])
    look = np.eye(4)
    look[:3, 3] = 0.5
    scene = replace(scene, cameras=(Camera("/cam", look, 20.0, 20.0, 50.0),))
    _, e = sample(scene, 300)
    assert (e.side > 0).all()


def test_a_scene_that_no_light_reaches_has_elements_everywhere():
    _, e = sample(make_scene(box(), lights=[lamp(height=9, up=True)]), 300)
    assert set(np.unique(e.side)) == {-1, 1}


def test_no_surface_is_a_stage_error():
    for scene in (make_scene(), make_scene(make_mesh(np.zeros((3, 3)), [[0, 1, 2]]))):
        with pytest.raises(StageError, match="no surface"):
            sample_elements(scene, RayTracer(scene))


def test_reflectance_is_the_mean_around_the_element():
    plain = quad((0, 0, 0), (4, 0, 0), (0, 1, 0))
    color = np.repeat((plain.positions[plain.triangles][..., :1] / 4) ** 1, 3, 2)  # red = green = blue = x / 4
    mesh = replace(plain, primvars={"displayColor": color.astype(np.float32)})
    scene = make_scene(mesh, materials=[Material("", diffuse_color=PrimvarInput("displayColor", (0, 0, 0)))])
    _, e = sample(scene, 800)
    whole = (e.area[:, None] * e.diffuse).sum(0) / e.area.sum()
    direct = points_at(color, e.triangle, e.barycentric)
    slope = np.polyfit(direct[:, 0], e.diffuse[:, 0], 1)[0]
    assert abs(slope - 1) < 0.02 and np.abs(e.diffuse - direct).max() < 0.03
    np.testing.assert_allclose(whole, direct.mean(0), rtol=0.02)


def test_cut_out_holes_have_no_elements():
    plain = quad((0, 0, 0), (4, 0, 0), (0, 1, 0))
    x = plain.positions[plain.triangles][..., :1]
    mesh = replace(plain, primvars={"leaf": (x / 4).astype(np.float32)})
    leaf = Material("", opacity=PrimvarInput("leaf", (1,)), opacity_threshold=0.5)
    _, e = sample(make_scene(mesh, materials=[leaf]), 400)
    assert (e.position[:, 0] >= 2).all()
    np.testing.assert_allclose(e.area[e.side > 0].sum(), 2, rtol=0.05)
