"""Laws of a bounce: furnaces, planes under lights, and independence of how it is computed."""

from __future__ import annotations

from dataclasses import fields, replace

import numpy as np
import pytest
from kit.light_field_scenes import Lit, lit, lone_elements, material, of_elements, under_sky, world_bins
from kit.scene_records import box, lamp, quad, sphere
from reference import lights as light_ref
from reference import reflectance as model_ref

from usdslf.elements.elements import Elements
from usdslf.gpu.device import Device, Kernel
from usdslf.light_field.links import BLOCKED, ESCAPES, element_of, is_link
from usdslf.light_field.static_light import static_light
from usdslf.sampling.hemisphere import D, bin_directions
from usdslf.scene.records import Light
from usdslf.surfaces.reflectance import roughness_levels

Z = bin_directions()[:, 2]
BINS = np.array([528, 300, 100, 37, 3])  # from the normal to the horizon
LEVELS = roughness_levels()


class Sky:
    """A tracer of an empty scene."""

    def offset_points(self, points: np.ndarray, *_: object) -> np.ndarray:
        return points

    def occluded(self, origins: np.ndarray, *_: object) -> np.ndarray:
        return np.zeros(len(origins), bool)


# ── one bounce ───────────────────────────────────────────────────────────────────────────────────


def test_a_furnace_returns_the_albedo_at_every_level_and_orientation(device: Device) -> None:
    """A white dome through static_light, on elements whose frames are turned at random; three kinds of surface."""
    d, f0, f90 = np.array([0.8, 0.5, 0.0]), np.array([0.0, 0.04, 0.9]), np.array([1.0, 1.0, 0.9])
    elements = lone_elements(20, roughness=LEVELS, diffuse=d[None], f0=f0[None], f90=f90[None])
    dome = Light("/sky", "dome", (1.0, 1.0, 1.0), np.eye(4))
    got = under_sky(device, elements, static_light(elements, Sky(), (dome,)).diffuse)
    for i, roughness in enumerate(LEVELS):
        x, y, a, b = model_ref.albedo("preview_surface", roughness, Z[BINS]).T[..., None]
        expected = d * ((1 - f0) * x + (1 - f90) * y) + f0 * a + f90 * b
        np.testing.assert_allclose(got[i, BINS], expected, rtol=0.01, atol=1e-3, err_msg=f"{roughness:.2f}")


def test_a_white_furnace_of_phong_returns_one(device: Device) -> None:
    diffuse = lone_elements(3, diffuse=1.0, f0=0.7, f90=1.0)  # k_d + k_s asked for: 1.7
    np.testing.assert_allclose(under_sky(device, diffuse, model="phong"), 1, rtol=0.01)
    mixed = lone_elements(
        5, diffuse=0.3, f0=0.9, f90=1.0, roughness=np.array([0.05, 0.2, 0.4, 0.6, 1.0]), clearcoat=1.0
    )
    got = under_sky(device, mixed, model="phong")
    assert got.max() < 1.002
    np.testing.assert_allclose(got[:, 528], 1, rtol=0.01)  # along the normal nothing of the lobe is cut off


def test_a_clearcoat_adds_its_lobe(device: Device) -> None:
    coat = lone_elements(
        4, diffuse=0.4, f0=0.04, f90=1.0, roughness=0.6, coat_f0=0.06,
        clearcoat=np.array([0.0, 0.3, 1.0, 1.0]), clearcoat_roughness=np.array([0.1, 0.1, 0.1, 0.425]),
    )  # fmt: skip
    got = under_sky(device, coat)[:, BINS, 0]
    a, b = (model_ref.albedo("preview_surface", 0.1, Z[BINS])[:, k] for k in (2, 3))
    np.testing.assert_allclose(got[2] - got[0], 0.06 * a + b, rtol=0.02, atol=1e-3)
    np.testing.assert_allclose(got[1] - got[0], 0.3 * (got[2] - got[0]), rtol=1e-3, atol=1e-5)
    a, b = (model_ref.albedo("preview_surface", 0.425, Z[BINS])[:, k] for k in (2, 3))
    np.testing.assert_allclose(got[3] - got[0], 0.06 * a + b, rtol=0.03, atol=1e-3)


def test_between_two_levels_is_between(device: Device) -> None:
    """Also across the border of sharp and coarse kernels; beyond the ends is at the ends."""
    roughness = np.array([0.30, 0.35, 0.325, 0.31, 0.40, 0.45, 0.43, 0.05, 0.02, 1.0])
    elements = lone_elements(len(roughness), roughness=roughness, diffuse=0.3, f0=0.5, f90=1.0)
    light = np.random.default_rng(3).random((1, D, 3)) ** 4
    got = under_sky(device, elements, light)
    np.testing.assert_allclose(got[2], (got[0] + got[1]) / 2, rtol=1e-4)
    np.testing.assert_allclose(got[3], 0.8 * got[0] + 0.2 * got[1], rtol=1e-4)
    np.testing.assert_allclose(got[6], 0.4 * got[4] + 0.6 * got[5], rtol=1e-4)
    np.testing.assert_allclose(got[8], got[7], rtol=1e-5)
    assert np.isfinite(got).all()


def test_what_is_reflected_turns_with_the_light_not_with_the_frame(device: Device) -> None:
    """A sky of radiance 1 + s.w; elements of the same normal whose frames are turned reflect it alike."""
    slope = np.array([0.6, -0.3, 0.5])
    for roughness in (0.1, 0.3, 0.6, 0.9):
        elements = lone_elements(6, seed=7, roughness=roughness, f0=0.8, f90=1.0)
        sky = 1 + world_bins(elements) @ slope
        got = under_sky(device, elements, np.repeat(sky[..., None], 3, 2))[..., 0]
        error = []
        for i in range(0, 6, 2):
            turned = elements.frame[i].astype(float) @ slope
            for j in (300, 100, 555):
                columns = model_ref.integrate_columns(
                    "preview_surface", roughness, bin_directions()[j], lambda l, s=turned: 1 + l @ s, rings=80
                )
                error.append(got[i, j] / (columns @ [0, 0, 0.8, 1]) - 1)
        assert np.sqrt(np.mean(np.square(error))) < 0.025 and np.abs(error).max() < 0.06, (roughness, error)


@pytest.mark.parametrize("kind", ["rect", "disk", "sphere", "distant", "dome"])
def test_planes_under_lights_have_the_radiance_of_the_closed_form(device: Device, kind: str) -> None:
    """The whole chain with phong, k_d = 0.8: radiance in every direction is k_d / pi times the irradiance."""
    at = np.diag([1.0, 1.0, 1.0, 1.0])
    at[2, 3] = 1.2
    light = Light("/l", kind, (1.0, 2.0, 3.0), at, width=0.8, height=0.5, radius=0.3, angle=np.radians(20))
    plane = quad((-0.8, -0.6, 0), (1.6, 0, 0), (0, 1.2, 0))
    made = lit(device, [plane], [material(0.8)], (light,), 77, bounces=2)
    front = made.elements.side > 0
    position = made.elements.position[front].astype(float)
    normal = np.array([0, 0, 1.0])
    corners = np.array([[-0.4, -0.25, 1.2], [0.4, -0.25, 1.2], [0.4, 0.25, 1.2], [-0.4, 0.25, 1.2]])
    towards = np.array([0, 0, 1.2]) - position
    distance = np.linalg.norm(towards, axis=1)
    expected = {
        "rect": lambda: np.array([light_ref.polygon_irradiance(corners, p, normal) for p in position]),
        "disk": lambda: [light_ref.disk_irradiance(0.3, 1.2, float(np.hypot(*p[:2]))) for p in position],
        "sphere": lambda: [light_ref.sphere_irradiance(0.3, r, t[2] / r) for r, t in zip(distance, towards)],
        "distant": lambda: np.full(len(position), light_ref.cone_irradiance(np.radians(10), 1.0)),
        "dome": lambda: np.full(len(position), np.pi),
    }[kind]()
    expected = np.asarray(expected)[:, None] * [1, 2, 3] * 0.8 / np.pi
    got = made.outgoing[front]
    assert np.ptp(got, axis=1).max() < 1e-5 * got.max()
    np.testing.assert_allclose(got.mean((0, 1)), expected.mean(0), rtol=0.01)
    np.testing.assert_allclose(got[:, 0], expected, rtol=0.04)  # 64 samples of the light at each element


# ── how it is computed does not matter ───────────────────────────────────────────────────────────


def varied(made: Lit, seed: int = 5) -> Elements:
    """The elements with every kind of reflectance."""
    rng, n = np.random.default_rng(seed), len(made.elements)
    return replace(
        made.elements,
        diffuse=rng.random((n, 3)).astype(np.float32),
        f0=rng.random((n, 3)).astype(np.float32),
        roughness=rng.choice(np.float32([0.02, 0.1, 0.325, 0.6]), n),
        clearcoat=(rng.random(n) < 0.3).astype(np.float32),
        clearcoat_roughness=rng.choice(np.float32([0.1, 0.3]), n),
        emission=rng.random((n, 3)).astype(np.float32),
    )


@pytest.fixture(scope="module")
def small(device: Device) -> Lit:
    """77 varied elements of a box and a ball in it, after three bounces."""
    meshes = [box((0, 0, 0), (2, 2, 2), inward=True, path="/room"), sphere(0.4, (1, 1, 0.8), rows=12, path="/ball")]
    made = lit(device, meshes, [material(0.5)], (lamp(1.9, (1, 1), 0.6),), 77, bounces=1)
    return of_elements(device, made.scene, made.tracer, varied(made), "preview_surface", 3, 0.0)


@pytest.mark.parametrize("size", [None, 1, 128])
def test_results_do_not_depend_on_the_size_of_work_groups(
    small: Lit, monkeypatch: pytest.MonkeyPatch, size: int | None
) -> None:
    call = Kernel.__call__

    def resized(self: Kernel, global_size: tuple, local_size: tuple | None, *args: object) -> None:
        fits = size is not None and global_size[0] % size == 0
        return call(self, global_size, (size, *[1] * (len(global_size) - 1)) if fits else None, *args)

    monkeypatch.setattr(Kernel, "__call__", resized)
    again = of_elements(small.field.device, small.scene, small.tracer, small.elements, "preview_surface", 3, 0.0)
    assert (again.visibility.hit != small.visibility.hit).mean() < 1e-4  # rounding decides on borders of bins
    same = of_hits(again, small)
    np.testing.assert_allclose(same, small.outgoing, rtol=2e-5, atol=1e-6)


def of_hits(made: Lit, like: Lit) -> np.ndarray:
    """Outgoing light of one lit field with the links of another."""
    field = type(made.field)(
        made.field.device, made.elements, made.lookup, like.visibility, like.fixed, "preview_surface"
    )
    for _ in range(3):
        field.bounce()
    return field.device.download(field.outgoing_d)


def test_results_do_not_depend_on_the_order_of_elements(small: Lit) -> None:
    order = np.random.default_rng(2).permutation(len(small.elements))
    arrays = {f.name: getattr(small.elements, f.name) for f in fields(Elements)}
    shuffled = Elements(**{k: v if k == "part_of_triangle" else v[order] for k, v in arrays.items()})
    device, scene = small.field.device, small.scene
    again = of_elements(device, scene, small.tracer, shuffled, "preview_surface", 3, 0.0)

    hit = small.visibility.hit[order]
    place = np.argsort(order).astype(np.uint32)
    linked = hit < 0xFFFFFFFE
    moved = np.where(linked, place[np.where(linked, hit >> 10, 0)] << 10 | (hit & 1023), hit)
    assert (again.visibility.hit == moved).mean() > 0.999  # equally near elements may change places
    apart = np.abs(again.outgoing - small.outgoing[order]).sum() / small.outgoing.sum()
    assert apart < 0.02  # the samples of the lamp are others
    fixed = small.fixed[order]
    field = type(again.field)(
        device, shuffled, again.lookup, replace(again.visibility, hit=moved.astype(np.uint32)), fixed, "preview_surface"
    )
    for _ in range(3):
        field.bounce()
    np.testing.assert_allclose(device.download(field.outgoing_d), small.outgoing[order], rtol=1e-4, atol=1e-5)


def test_an_edit_that_is_taken_back_leaves_no_trace(small: Lit) -> None:
    field = small.field
    original = field.surface
    for _ in field.converge(60, 1e-6):
        pass
    before = small.outgoing
    rows = np.arange(len(original.roughness)) % 3 == 0
    field.set_surface(original.with_rows(rows, diffuse=np.float32([0.9, 0.1, 0.1]), roughness=np.float32(0.1)))
    changes = list(field.converge(60, 1e-6))
    assert np.abs(small.outgoing - before).sum() > 0.02 * before.sum()
    assert changes[-1] < 1e-5 and changes[-1] < changes[0]
    np.testing.assert_array_equal(original.roughness, small.elements.roughness)  # records do not change
    field.set_surface(original)
    for _ in field.converge(60, 1e-6):
        pass
    # light between mirrors dies slowly: what is left of it is below 1e-6 a bounce
    assert np.abs(small.outgoing - before).sum() < 1e-4 * before.sum()
    np.testing.assert_allclose(small.outgoing, before, rtol=1e-2, atol=1e-3)


def test_light_arrives_from_where_the_links_say(small: Lit) -> None:
    """Incident light is the fixed light and what the linked element sends into the linked bin."""
    rows = np.array([3, 70, 11])
    got = small.field.incident(rows)
    hit = small.visibility.hit[rows]
    out = small.outgoing.reshape(-1, 3)
    expected = small.fixed[rows] + np.where((hit < 0xFFFFFFFE)[..., None], out[np.where(hit < 0xFFFFFFFE, hit, 0)], 0)
    np.testing.assert_allclose(got, expected, rtol=1e-6)
    assert (hit != ESCAPES).mean() > 0.9


def test_a_ray_that_meets_a_side_without_light_is_tied_to_nothing(device: Device) -> None:
    """The inside of a closed box has no elements: not even one of weight zero is named there."""
    boxes = [box((0, 0, 0), (1, 1, 1), path="/box")]
    made = lit(device, boxes, [material(0.5)], (lamp(1.9, (1, 1), 0.6),), 77, bounces=1)
    way = np.random.default_rng(3).normal(size=(201, 3))
    way = (way / np.linalg.norm(way, axis=1, keepdims=True)).astype(np.float32)
    for origin, is_dark in ((np.full(3, 0.5), True), (np.array([0.5, 0.5, 1.3]), False)):
        hits = made.tracer.intersect(np.broadcast_to(origin, way.shape), way)
        links_d, weights_d = made.field.link_hits(hits.triangle, hits.barycentric, way)
        links, weights = device.download(links_d), device.download(weights_d)
        met = hits.triangle >= 0
        assert met.sum() > 10 and (links[~met] == ESCAPES).all() and not weights[~met].any()
        if is_dark:
            assert met.all() and (links == BLOCKED).all() and not weights.any()
        else:
            assert is_link(links[met]).all()
            np.testing.assert_allclose(weights[met].sum(1), 1, rtol=1e-5)
            facing = np.einsum("nkj,nj->nk", made.elements.geometric_normal[element_of(links[met])], way[met])
            assert (facing < 0).all()
