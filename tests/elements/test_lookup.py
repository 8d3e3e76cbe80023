"""Laws of the look-up of elements: what is near, blending, no leaks, host and device, sizes of tables."""

from dataclasses import replace

import numpy as np
from kit.sampled_elements import sample
from kit.scene_records import box, corrugated, lamp, make_mesh, make_scene, quad, sphere
from reference.visibility import square_cells
from scipy.spatial import cKDTree

from usdslf.elements.cells import cell_centres, cell_of
from usdslf.elements.lookup import ElementLookup, blend_weights
from usdslf.gpu.device import open_device
from usdslf.light_field.links import BLOCKED, ESCAPES, link_rays
from usdslf.rays import points_at
from usdslf.scene.records import Material


def random_points(scene, n, seed=5):
    """Points on triangles, by area."""
    rng = np.random.default_rng(seed)
    area = scene.triangles.areas
    triangle = rng.choice(len(area), n, p=area / area.sum())
    b = rng.random((n, 2))
    b = np.where(b.sum(1, keepdims=True) > 1, 1 - b, b).astype(np.float32)
    return triangle, b, points_at(scene.triangles.positions, triangle, b)


def test_more_gprims_than_elements_share_by_material():
    rng = np.random.default_rng(0)
    leaves = [
        quad(rng.uniform(-5, 5, 3), (0.3, 0, 0), (0, 0.3, 0), material=i % 2, path=f"/leaf{i}") for i in range(700)
    ]
    scene = make_scene(*leaves, materials=[Material("/a"), Material("/b")])
    tracer, e = sample(scene, 200)
    assert len(e) == 200
    lookup = ElementLookup(scene, tracer, e)
    triangle, bary, _ = random_points(scene, 2000)
    for side in (1, -1):
        element, weight = lookup.nearest(triangle, bary, np.full(2000, side))
        assert (weight.sum(1) > 0.999).mean() > 0.95
        live = weight > 0
        material = np.broadcast_to(scene.triangles.material[triangle][:, None], element.shape)
        np.testing.assert_array_equal(e.material[element][live], material[live])
        assert (e.side[element][live] == side).all()


def test_far_flung_gprims_that_share_elements_find_them():
    """Of a few elements that small things share, the nearest may be hundreds of spacings away."""
    rng = np.random.default_rng(3)
    places = rng.uniform(-500, 500, (300, 3))
    things = [quad(p, (1, 0, 0), (0, 1, 0), path=f"/m{i}", material=i % 3) for i, p in enumerate(places)]
    scene = make_scene(*things, materials=[Material(f"/m{k}") for k in range(3)])
    tracer, e = sample(scene, 60)
    lookup = ElementLookup(scene, tracer, e)
    triangle = np.arange(len(scene.triangles.mesh))
    for side in (1, -1):
        element, weight = lookup.nearest(triangle, np.full((len(triangle), 2), 0.3), np.full(len(triangle), side))
        alive = weight.sum(1) > 0
        assert alive.mean() > 0.9
        np.testing.assert_array_equal(e.material[element[alive, 0]], scene.triangles.material[alive])


def test_cells_are_numbered_without_gaps_and_found_again():
    for n in (1, 2, 3, 7, 64, 333, 4096):
        number = np.arange(n * n) if n < 1000 else np.random.default_rng(0).integers(0, n * n, 9999)
        centres = cell_centres(number, np.full(len(number), n))
        assert (centres > 0).all() and (centres.sum(1) < 1).all()
        if n < 1000:
            np.testing.assert_array_equal(cell_of(centres.astype(np.float32), np.full(len(number), n)), number)
        corners = np.array([[0, 0], [1, 0], [0, 1], [0.5, 0.5], [1.0001, -1e-5], [-1e-6, 1]], np.float32)
        cell = cell_of(corners, np.full(len(corners), n)).astype(np.int64)
        assert (cell >= 0).all() and (cell < n * n).all()


def test_lookup_on_a_plane_finds_the_nearest_and_blends_smoothly():
    scene = make_scene(quad((0, 0, 0), (10, 0, 0), (0, 10, 0)))
    tracer, e = sample(scene, 1500)
    lookup = ElementLookup(scene, tracer, e)
    triangle, bary, point = random_points(scene, 5000)
    front = np.flatnonzero(e.side > 0)
    tree = cKDTree(e.position[front])
    element, weight = lookup.nearest(triangle, bary, np.ones(5000))
    np.testing.assert_allclose(weight.sum(1), 1, rtol=1e-5)
    assert (weight >= 0).all()
    truth = front[tree.query(point, k=4)[1]]
    assert (element[:, 0] == truth[:, 0]).mean() > 0.999
    assert (np.sort(element, 1) == np.sort(truth, 1)).all(1).mean() > 0.99

    # Along a line the blend has no jumps: a thousandth of the way changes it by about a thousandth.
    x = np.linspace(0.5, 9.5, 60001)
    v = np.full_like(x, 0.0037)
    line = np.stack([x / 10 - v, v], 1)
    element, weight = lookup.nearest(np.zeros(len(x), int), line, np.ones(len(x)))
    value = (np.random.default_rng(0).random(len(e))[element] * weight).sum(1)
    assert np.abs(np.diff(value)).max() < 0.01


def test_blend_weights_at_the_edges():
    inf = np.inf
    w = blend_weights(
        np.array([[0, 1, 1, 1, 2], [1, 1, 1, 1, 1], [1, inf, inf, inf, inf], [0, inf, inf, inf, inf], [0] * 5])
    )
    np.testing.assert_allclose(w.sum(1), 1, rtol=1e-6)
    np.testing.assert_allclose(w[0, 0] / w[0, 1], 1 / (1 - 0.25) ** 2, rtol=1e-5)
    assert w[2, 0] == w[3, 0] == 1


def names_only(scene, tracer, elements, allowed, seed=5, n=4000):
    """Checks that what the look-up names with any weight is `allowed(point, normal, element)`."""
    lookup = ElementLookup(scene, tracer, elements)
    triangle, bary, point = random_points(scene, n, seed)
    for side in (1, -1):
        element, weight = lookup.nearest(triangle, bary, np.full(n, side))
        normal = scene.triangles.face_normals[triangle] * side
        row, column = np.nonzero(weight > 0)
        ok = allowed(point[row], normal[row], element[row, column])
        assert ok.all(), f"{(~ok).sum()} of {len(ok)}: from {point[row][~ok][:3]} side {side}"


def test_thin_walls_do_not_leak():
    slab = box((0, 0, 0), (4, 4, 0.001), path="/slab")
    sheet = quad((0, 0, 1), (4, 0, 0), (0, 4, 0), path="/sheet")
    back_to_back = quad((0, 0, 1.0005), (0, 4, 0), (4, 0, 0), path="/other")
    scene = make_scene(slab, sheet, back_to_back)
    tracer, e = sample(scene, 800)
    # The slab's rim, a thousandth wide, has no elements of its own.
    names_only(scene, tracer, e, lambda p, n, k: (np.abs(n[:, 2]) < 0.5) | ((e.normal[k] * n).sum(1) > 0.5))


def test_two_rooms_of_one_mesh_do_not_leak_through_their_wall():
    left = box((-2, 0, 0), (-0.01, 2, 2), inward=True)
    right = box((0.01, 0, 0), (2, 2, 2), inward=True)
    both = make_mesh(
        np.concatenate([left.positions, right.positions]),
        np.concatenate([left.triangles, right.triangles + 8]),
    )
    lights = [lamp(height=1.9, at=(-1, 1)), lamp(height=1.9, at=(1, 1))]
    scene = make_scene(both, lights=lights)
    tracer, e = sample(scene, 800)
    assert (e.side > 0).all()
    names_only(scene, tracer, e, lambda p, n, k: e.position[k][:, 0] * p[:, 0] > 0)


def test_round_surfaces_name_what_is_near():
    scene = make_scene(sphere(1.0), corrugated())
    tracer, e = sample(scene, 1000)

    def near(p, n, k):
        return np.linalg.norm(e.position[k] - p, axis=1) < 3.5 * np.sqrt(e.area[k])

    names_only(scene, tracer, e, near)


def test_materials_of_one_gprim_are_kept_apart():
    sheet = quad((0, 0, 0), (2, 0, 0), (0, 1, 0))
    wide = quad((2, 0, 0), (2, 0, 0), (0, 1, 0))
    mesh = make_mesh(
        np.concatenate([sheet.positions, wide.positions]),
        np.concatenate([sheet.triangles, wide.triangles + 4]),
    )
    mesh = replace(mesh, material_of_triangle=np.array([0, 0, 1, 1], np.int32))
    scene = make_scene(mesh, materials=[Material("/a"), Material("/b")])
    tracer, e = sample(scene, 300)
    names_only(scene, tracer, e, lambda p, n, k: e.material[k] == (p[:, 0] > 2))


def test_device_finds_what_the_host_finds():
    scene = make_scene(sphere(1.0), box((2, 0, 0), (3, 1, 1)), quad((0, 3, 0), (1, 0, 0), (0, 0, 1)))
    tracer, e = sample(scene, 150)
    lookup, device, n = ElementLookup(scene, tracer, e), open_device(), 1001
    triangle, bary, _ = random_points(scene, n)
    direction = np.random.default_rng(9).normal(size=(n, 3))
    direction /= np.linalg.norm(direction, axis=1, keepdims=True)
    side = np.where((direction * scene.triangles.face_normals[triangle]).sum(1) > 0, -1, 1)
    element, weight = lookup.nearest(triangle, bary, side)
    missed = np.arange(n) % 10 == 0
    link_d, weight_d = link_rays(device, lookup.upload(device), np.where(missed, -1, triangle), bary, direction)
    link, weight_there = device.download(link_d), device.download(weight_d)
    assert (link[missed] == ESCAPES).all() and (weight_there[missed] == 0).all()
    dead = weight.sum(1) == 0
    assert (link[dead & ~missed] == BLOCKED).all() and (weight_there[dead] == 0).all() and dead.any()

    live = np.flatnonzero(~missed & ~dead)
    host, there = np.zeros((2, n, len(e)))
    np.add.at(host, (live[:, None], element[live]), weight[live])
    np.add.at(there, (live[:, None], link[live] >> 10), weight_there[live])
    assert (np.abs(host - there).max(1) < 1e-3).mean() > 0.998
    frame = e.frame[link[live] >> 10].astype(float)
    bins = square_cells(np.einsum("nkij,nj->nki", frame, -direction[live]).reshape(-1, 3))
    above = (np.einsum("nkj,nj->nk", frame[:, :, 2], direction[live]) < -0.01).ravel()
    assert (bins == (link[live] & 1023).ravel())[above].mean() > 0.998


def test_tables_stay_small_for_many_triangles():
    scene = make_scene(corrugated(n=220), quad((0, 5, 0), (1e-4, 0, 0), (100, 0, 0.01)))
    tracer, e = sample(scene, 100)
    lookup = ElementLookup(scene, tracer, e)
    triangles = len(scene.triangles.areas)
    assert triangles > 90_000
    assert lookup.nbytes < 16 * triangles + 72 * (2 * 4200 + 30 * len(e))


def test_empty_lookup_answers_nothing():
    scene = make_scene(box())
    tracer, e = sample(scene, 60)
    none = type(e)(**{k: v if k == "part_of_triangle" else v[:0] for k, v in vars(e).items()})
    lookup = ElementLookup(scene, tracer, none)
    element, weight = lookup.nearest(np.array([0, 5]), np.full((2, 2), 0.2), np.array([1, -1]))
    assert element.shape == (2, 4) and (weight == 0).all()
