"""Laws of ray tracing: exactness of hits, limits of distance, offsets, surfaces seen through."""

import numpy as np
import pytest

from usdslf.scene import Material, Mesh, Scene, Texture, constant
from usdslf.visibility import RayTracer, points_at

RNG_SEED = 7


def make_mesh(positions, triangles, material=0, path="/m"):
    """One flat-shaded mesh of the given corners."""
    p = np.asarray(positions, np.float32)
    t = np.asarray(triangles, np.int32).reshape(-1, 3)
    c = np.nan_to_num(p[t].astype(float), posinf=0, neginf=0)
    n = np.cross(c[:, 1] - c[:, 0], c[:, 2] - c[:, 0])
    n /= np.maximum(np.linalg.norm(n, axis=1, keepdims=True), 1e-300)
    return Mesh(
        path=path,
        positions=p,
        triangles=t,
        corner_normals=np.repeat(n[:, None], 3, 1).astype(np.float32),
        face_of_triangle=np.arange(len(t), dtype=np.int32) // 2,
        triangle_in_face=np.arange(len(t), dtype=np.int32) % 2,
        material_of_triangle=np.full(len(t), material, np.int32),
    )


def make_scene(*meshes, materials=None, lights=()):
    return Scene("", np.nan, tuple(meshes), tuple(materials or [Material("")]), tuple(lights), ())


def quad(origin, a, b, **kw):
    o, a, b = (np.asarray(x, float) for x in (origin, a, b))
    return make_mesh([o, o + a, o + a + b, o + b], [[0, 1, 2], [0, 2, 3]], **kw)


def box(low=(0, 0, 0), high=(1, 1, 1), inward=False, **kw):
    """A box of 12 triangles, facing outwards or inwards."""
    c = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)], float)
    p = np.asarray(low, float) + c * (np.asarray(high, float) - np.asarray(low, float))
    f = [[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]]
    t = [[q[0], q[i], q[i + 1]] for q in f for i in (1, 2)]
    return make_mesh(p, [x[::-1] for x in t] if inward else t, **kw)


def unit_vectors(rng, n):
    d = rng.normal(size=(n, 3))
    return (d / np.linalg.norm(d, axis=1, keepdims=True)).astype(np.float32)


def triangle_soup(rng, n):
    c = rng.uniform(-1, 1, (n, 1, 3)) + rng.normal(size=(n, 3, 3)) * 0.2
    return make_mesh(c.reshape(-1, 3), np.arange(3 * n).reshape(-1, 3))


def brute_force(corners, o, d):
    """First hit of each ray in float64, by solving o + t d = P0 + u E1 + v E2 for all pairs."""
    c = corners.astype(float)
    m = np.stack([c[:, 1] - c[:, 0], c[:, 2] - c[:, 0]], -1)  # (T, 3, 2)
    a = np.concatenate(
        [
            np.broadcast_to(m, (len(d), *m.shape)),
            -np.broadcast_to(d.astype(float)[:, None, :, None], (len(d), len(c), 3, 1)),
        ],
        -1,
    )
    x = np.linalg.solve(a, (o.astype(float)[:, None] - c[None, :, 0])[..., None])[..., 0]
    u, v, t = x[..., 0], x[..., 1], x[..., 2]
    t = np.where((u >= 0) & (v >= 0) & (u + v <= 1) & (t > 0), t, np.inf)
    first = t.argmin(1)
    row = np.arange(len(d))
    hit = np.isfinite(t[row, first])
    return np.where(hit, first, -1), np.stack([u, v], -1)[row, first], t[row, first]


def test_hits_are_those_of_exact_geometry():
    rng = np.random.default_rng(RNG_SEED)
    scene = make_scene(triangle_soup(rng, 100), triangle_soup(rng, 57))
    o = rng.uniform(-1, 1, (999, 3)).astype(np.float32)
    d = unit_vectors(rng, 999)
    hits = RayTracer(scene).intersect(o, d)
    triangle, bary, t = brute_force(scene.triangles.positions, o, d)
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
    a, b, c = one.intersect(o, d), two.intersect(o, d), two.intersect_here(o, d)
    for other in (b, c):
        np.testing.assert_array_equal(a.triangle, other.triangle)
        np.testing.assert_array_equal(a.barycentric, other.barycentric)
        np.testing.assert_array_equal(a.distance, other.distance)
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
