"""Laws of rays (hits, limits of distance, offsets, surfaces seen through) and of the operator G."""

import numpy as np
import pytest
from kit.scene_records import box, lamp, make_mesh, make_scene, quad, sphere
from reference.visibility import first_hits, nearest_elements, square_cells

from usdslf.elements.elements import sample_elements
from usdslf.elements.lookup import ElementLookup
from usdslf.gpu.device import open_device
from usdslf.light_field.links import BLOCKED, ESCAPES
from usdslf.light_field.visibility import BATCH, rays_of_bins, trace_visibility
from usdslf.rays import LEAST_COSINE, RayTracer, points_at
from usdslf.sampling.hemisphere import D, bin_directions
from usdslf.scene.records import Material, Texture, constant

RNG_SEED = 7


def unit_vectors(rng, n):
    d = rng.normal(size=(n, 3))
    return (d / np.linalg.norm(d, axis=1, keepdims=True)).astype(np.float32)


def triangle_soup(rng, n):
    c = rng.uniform(-1, 1, (n, 1, 3)) + rng.normal(size=(n, 3, 3)) * 0.2
    return make_mesh(c.reshape(-1, 3), np.arange(3 * n).reshape(-1, 3))


def test_hits_are_those_of_exact_geometry():
    rng = np.random.default_rng(RNG_SEED)
    scene = make_scene(triangle_soup(rng, 100), triangle_soup(rng, 57))
    o = rng.uniform(-1, 1, (999, 3)).astype(np.float32)
    d = unit_vectors(rng, 999)
    hits = RayTracer(scene).intersect(o, d)
    triangle, bary, t = first_hits(scene.triangles.positions, o, d)
    same = hits.triangle == triangle
    assert same.mean() > 0.998  # edges are decided by rounding
    at = same & (triangle >= 0)
    np.testing.assert_allclose(hits.barycentric[at], bary[at], atol=1e-4)
    np.testing.assert_allclose(hits.distance[at], t[at], rtol=1e-4, atol=1e-5)
    assert np.isinf(hits.distance[hits.triangle < 0]).all()
    p = points_at(scene.triangles.positions, hits.triangle[at], hits.barycentric[at])
    np.testing.assert_allclose(p, o[at] + d[at] * hits.distance[at, None], atol=1e-5)


def test_many_rays_on_threads_give_what_one_thread_gives():
    rng = np.random.default_rng(RNG_SEED)
    scene = make_scene(triangle_soup(rng, 300))
    o, d = rng.uniform(-1, 1, (70001, 3)).astype(np.float32), unit_vectors(rng, 70001)
    one, two = RayTracer(scene, threads=1), RayTracer(scene, threads=2)
    a, b = one.intersect(o, d), two.intersect(o, d)
    np.testing.assert_array_equal(a.triangle, b.triangle)
    np.testing.assert_array_equal(a.barycentric, b.barycentric)
    np.testing.assert_array_equal(a.distance, b.distance)
    triangle, u, v, _ = two.intersect_columns(o, d)
    np.testing.assert_array_equal(a.triangle, triangle)
    np.testing.assert_array_equal(a.barycentric, np.stack([u, v], 1))
    far = two.occluded(o, d)
    np.testing.assert_array_equal(far, a.triangle >= 0)
    near = two.occluded(o, d, 0.3)
    np.testing.assert_array_equal(near, a.distance <= np.float32(0.3))


def test_occlusion_ends_at_its_distance():
    tracer = RayTracer(make_scene(quad((-1, -1, 2), (2, 0, 0), (0, 2, 0))))
    o, d = np.array([[0.1, 0.2, 0]] * 4), np.array([[0, 0, 1.0]] * 4)
    limit = np.array([1.9, 2.1, np.inf, 0.0])
    np.testing.assert_array_equal(tracer.occluded(o, d, limit), [False, True, True, False])
    np.testing.assert_array_equal(limit, [1.9, 2.1, np.inf, 0.0])
    assert not tracer.occluded(o, -d).any()


@pytest.mark.parametrize("scale,shift", [(1, 0), (1e-6, 0), (1e6, 0), (1, 1e4), (100, 1e6), (1e-3, 1)])
def test_rays_from_a_convex_body_never_hit_it_and_inside_always(scale, shift):
    rng = np.random.default_rng(RNG_SEED)
    rotation = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    rotation *= np.sign(np.linalg.det(rotation))
    body = box((-1, -1, -1), (1, 1, 1))
    scene = make_scene(make_mesh(body.positions @ rotation.T * scale + shift, body.triangles))
    tracer, t = RayTracer(scene), scene.triangles
    n = 4000
    triangle = rng.integers(0, 12, n)
    bary = rng.uniform(0.1, 0.4, (n, 2)).astype(np.float32)
    p, normal = points_at(t.positions, triangle, bary), t.face_normals[triangle]
    d = unit_vectors(rng, n)
    cosine = (d * normal).sum(1)
    d = np.where(cosine[:, None] < 0, -d, d)
    keep = np.abs(cosine) > 0.02  # below, the body's own rounding decides
    p, d, normal, triangle = p[keep], d[keep], normal[keep], triangle[keep]
    for o in (tracer.offset_points(p, normal, triangle), tracer.offset_points(p, normal)):
        assert not tracer.occluded(o, d).any()
        assert (np.linalg.norm(o - p, axis=1) < 1e-4 * max(scale, abs(shift))).all()
    inside = tracer.offset_points(p, -normal, triangle)
    assert tracer.occluded(inside, -d).mean() > 0.999


def test_without_offset_many_rays_would_hit_their_own_surface():
    rng = np.random.default_rng(RNG_SEED)
    scene = make_scene(triangle_soup(rng, 1))
    p = points_at(scene.triangles.positions, np.zeros(500, int), rng.uniform(0.1, 0.4, (500, 2)))
    n = scene.triangles.face_normals[[0] * 500]
    tracer = RayTracer(scene)
    assert tracer.occluded(p, n).any() and not tracer.occluded(tracer.offset_points(p, n), n).any()


def test_empty_and_degenerate_scenes_are_empty():
    o, d = np.zeros((3, 3)), np.eye(3)
    nothing = make_scene()
    degenerate = make_scene(
        make_mesh(
            [[0, 0, 1], [0, 0, 1], [1, 0, 1], [np.nan, 0, 0], [np.inf, 1, 1]],
            [[0, 0, 0], [0, 1, 2], [0, 2, 3], [0, 2, 4]],
        )
    )
    for scene in (nothing, degenerate):
        tracer = RayTracer(scene)
        hits = tracer.intersect(o, d)
        assert (hits.triangle == -1).all() and np.isinf(hits.distance).all()
        assert not tracer.occluded(o, d).any()
        assert tracer.intersect(o[:0], d[:0]).triangle.shape == (0,)
    bad = RayTracer(make_scene(box())).intersect([[np.nan, 0, 0]], [[0, 0, 0]])
    assert bad.triangle[0] == -1


def curtains(material, layers=3):
    """Parallel unit squares at z = 1, 2, ... of a see-through material and an opaque wall behind."""
    squares = [quad((0, 0, z + 1), (1, 0, 0), (0, 1, 0)) for z in range(layers)]
    wall = quad((-1, -1, layers + 1), (3, 0, 0), (0, 3, 0), material=1)
    return make_scene(*squares, wall, materials=(material, Material("")))


def test_rays_pass_half_transparent_layers_with_their_probability():
    scene = curtains(Material("", opacity=constant(0.25)))
    rng = np.random.default_rng(RNG_SEED)
    o = np.concatenate([rng.uniform(0, 1, (40000, 2)), np.zeros((40000, 1))], 1).astype(np.float32)
    tracer = RayTracer(scene, opacity=lambda triangle, bary: np.full(len(triangle), 0.25, np.float32))
    d = np.broadcast_to(np.array([0, 0, 1], np.float32), o.shape)
    hits = tracer.intersect(o, d)
    share = np.bincount(scene.triangles.mesh[hits.triangle], minlength=4) / len(o)
    expected = np.array([0.25, 0.25 * 0.75, 0.25 * 0.75**2, 0.75**3])
    assert np.abs(share - expected).max() < 5 * 0.5 / np.sqrt(len(o))
    np.testing.assert_allclose(hits.distance, 1 + scene.triangles.mesh[hits.triangle], rtol=1e-4)
    np.testing.assert_array_equal(tracer.intersect(o, d).triangle, hits.triangle)
    shadow = tracer.occluded(o, d, 3.5)
    assert abs(shadow.mean() - (1 - 0.75**3)) < 5 * 0.5 / np.sqrt(len(o))


def test_cut_outs_are_decided_by_the_opacity_at_the_hit():
    leaf = Material("", opacity=Texture("/leaf", ""), opacity_threshold=0.5)
    scene = curtains(leaf, layers=1)

    def opacity(triangle, bary):  # holes where x < 1/2
        x = points_at(scene.triangles.positions, triangle, bary)[:, 0]
        return np.where(x < 0.5, 0.49, 0.5).astype(np.float32)

    rng = np.random.default_rng(RNG_SEED)
    o = np.concatenate([rng.uniform(0, 1, (5000, 2)), np.zeros((5000, 1))], 1).astype(np.float32)
    hits = RayTracer(scene, opacity=opacity).intersect(o, [[0, 0, 1]] * len(o))
    np.testing.assert_array_equal(scene.triangles.mesh[hits.triangle], np.where(o[:, 0] < 0.5, 1, 0))


def test_a_stack_of_more_layers_than_the_limit_ends():
    scene = curtains(Material("", opacity=constant(0.0)), layers=40)
    tracer = RayTracer(scene, opacity=lambda triangle, bary: np.zeros(len(triangle), np.float32))
    hits = tracer.intersect([[0.4, 0.3, 0]], [[0, 0, 1]])
    assert 30 <= scene.triangles.mesh[hits.triangle[0]] < 40


def trace(scene, count=200, seed=1, see=None):
    tracer = RayTracer(scene)
    e = sample_elements(scene, tracer, count, np.random.default_rng(seed))
    return e, trace_visibility(e, ElementLookup(scene, tracer, e), tracer, see or open_device()).hit


def closed_room():
    """A room with a lamp, a leaning box and a ball in it."""
    turn = np.linalg.qr(np.random.default_rng(2).normal(size=(3, 3)))[0]
    block = box((-0.3, -0.3, -0.3), (0.3, 0.3, 0.3))
    block = make_mesh(block.positions @ (turn * np.linalg.det(turn)).T + 0.35, block.triangles, path="/block")
    room = box((-1, -1, -1), (1, 1, 1), inward=True, path="/room")
    return make_scene(room, block, lights=[lamp(height=0.95)])


def test_links_are_those_of_exact_geometry():
    scene = closed_room()
    e, hit = trace(scene, 700)
    chosen = np.random.default_rng(0).choice(len(e), 30, replace=False)
    d = bin_directions() @ e.frame[chosen].astype(float)  # (30, D, 3)
    o = np.repeat(e.position[chosen].astype(float) + 1e-6 * e.geometric_normal[chosen], D, 0)
    triangle, _, distance = first_hits(scene.triangles.positions, o, d.reshape(-1, 3))
    assert (triangle >= 0).all()
    p = o + d.reshape(-1, 3) * distance[:, None]
    towards = d.reshape(-1, 3)
    normal = scene.triangles.face_normals[triangle].astype(float)
    normal *= -np.sign((normal * towards).sum(1, keepdims=True))
    nearest, gap = nearest_elements(p, normal, scene.triangles.mesh[triangle], e)
    link = hit[chosen].ravel()
    assert (link < BLOCKED).all()
    named, cell = (link >> 10).astype(int), (link & 1023).astype(int)
    assert (named == nearest).mean() > 0.99
    row = np.arange(len(p))
    assert np.quantile(gap[row, named] - gap[row, nearest], 0.999) < 0.25 * np.sqrt(e.area.max())

    # Every ray comes from the bin that it arrives in, but for rounding at the borders of bins.
    local = np.einsum("nij,nj->ni", e.frame[named].astype(float), -towards)
    local[:, 2] = np.maximum(local[:, 2], 0)
    local /= np.linalg.norm(local, axis=1, keepdims=True)
    assert (cell == square_cells(local)).mean() > 0.999
    within = (bin_directions()[cell] * local).sum(1)
    assert within.min() > np.cos(0.12)


def test_links_do_not_depend_on_batches(monkeypatch):
    scene = closed_room()
    hit = trace(scene, 2 * BATCH + 7)[1]
    assert hit.shape == (2 * BATCH + 7, D) and hit.dtype == np.uint32
    monkeypatch.setattr("usdslf.light_field.visibility.BATCH", 5)
    again = trace(scene, 2 * BATCH + 7)[1]
    np.testing.assert_array_equal(hit, again)


def test_in_a_closed_room_nothing_escapes_and_nothing_is_dead():
    e, hit = trace(closed_room(), 300)
    assert (e.side > 0).all() and (hit < BLOCKED).all()
    assert (hit >> 10).max() < len(e)


def test_from_a_sheet_in_the_open_all_rays_escape():
    e, hit = trace(make_scene(quad((0, 0, 0), (1, 0.2, 0), (0, 1, 0.3))), 100)
    assert set(np.unique(e.side)) == {-1, 1} and (hit == ESCAPES).all()


def test_form_factor_of_parallel_squares():
    # Unit squares at distance 1, Howell C-11: F = 2/pi (ln sqrt(4/3) + 2 sqrt 2 atan(1/sqrt 2) - 2 atan 1).
    s = np.sqrt(2)
    exact = 2 / np.pi * (np.log(np.sqrt(4 / 3)) + 2 * s * np.arctan(1 / s) - 2 * np.arctan(1))
    low, high = quad((0, 0, 0), (1, 0, 0), (0, 1, 0)), quad((0, 0, 1), (0, 1, 0), (1, 0, 0))
    e, hit = trace(make_scene(low, high), 1200)
    cosine = bin_directions()[:, 2] / (D / 2)  # dw cos / pi
    inner = np.flatnonzero(e.geometric_normal[:, 2] * (0.5 - e.position[:, 2]) > 0)
    factor = ((hit[inner] < BLOCKED) * cosine).sum(1).mean()
    np.testing.assert_allclose(factor, exact, rtol=0.01)
    # Only the inner sides of the two see each other.
    seen = hit[hit < BLOCKED] >> 10
    assert np.isin(seen, inner).all() and (hit[e.side < 0] == ESCAPES).all()


def test_back_to_back_plates_and_thin_boxes_hide_what_is_behind():
    slab = box((-2, -2, 0), (2, 2, 0.002), path="/slab")
    twin = quad((-2, -2, -1), (4, 0, 0), (0, 4, 0), path="/up")
    behind = quad((-2, -2, -1.001), (0, 4, 0), (4, 0, 0), path="/down")
    scene = make_scene(slab, twin, behind, quad((-2, -2, 1), (0, 4, 0), (4, 0, 0), path="/lid"))
    e, hit = trace(scene, 900)
    i, _ = np.nonzero(hit < BLOCKED)
    j = hit[hit < BLOCKED] >> 10
    way = e.position[j] - e.position[i]
    z, up = e.position[i, 2], e.geometric_normal[i, 2]
    faces = np.abs(up) > 0.5
    # What an element sees is on its side of its own plane, and of both plates of the pair.
    assert ((way[:, 2] * up)[faces] > 0).all()
    assert not ((z > -0.99) & (e.position[j, 2] < -1.0005)).any()
    assert (e.geometric_normal[j, 2] * way[:, 2] <= 0)[faces & (np.abs(e.geometric_normal[j, 2]) > 0.5)].all()


def test_the_inside_of_a_body_is_blocked():
    scene = make_scene(sphere(1.0, rows=12), lights=[lamp(height=5)])
    tracer = RayTracer(scene)
    e = sample_elements(scene, tracer, 200)
    lookup = ElementLookup(scene, tracer, e)
    into = type(e)(
        **{**vars(e), "geometric_normal": -e.geometric_normal, "frame": -e.frame, "normal": -e.normal}
    )
    hit = trace_visibility(into, lookup, tracer, open_device()).hit
    assert (hit == BLOCKED).mean() > 0.999


def test_rays_never_start_into_the_surface():
    # A coarse ball, smooth-shaded: bins of the shading frame lie up to 20 degrees below the triangle.
    scene = make_scene(sphere(1.0, rows=6))
    e, hit = trace(scene, 300)
    _, d = rays_of_bins(e, RayTracer(scene), open_device(), slice(0, len(e)))
    d = d.reshape(-1, D, 3)
    cosine = (d * e.geometric_normal[:, None]).sum(2)
    assert cosine.min() > LEAST_COSINE * 0.9
    assert (bin_directions() @ e.frame[:, :, :].astype(float) * e.geometric_normal[:, None]).sum(
        2
    ).min() < -0.05
    np.testing.assert_allclose(np.linalg.norm(d, axis=2), 1, atol=1e-5)
    assert (hit == ESCAPES).mean() > 0.995


def test_half_transparent_sheets_let_half_of_the_rays_through():
    veil = quad((-20, -20, 0.2), (0, 40, 0), (40, 0, 0), material=1)
    floor = quad((0, 0, 0), (1, 0, 0), (0, 1, 0))
    materials = [Material("/floor"), Material("/veil", opacity=constant(0.5), opacity_mode="presence")]
    e, hit = trace(make_scene(floor, veil, materials=materials), 500)
    up = (e.mesh == 0) & (e.side > 0)
    assert abs((hit[up] == ESCAPES).mean() - 0.5) < 0.02
