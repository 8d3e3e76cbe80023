"""Lights: densities, irradiance against closed forms, shaping."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from kit.placed_lights import (
    SPHERE,
    corners_of,
    estimate,
    expected_irradiance,
    light_of,
    placed,
    rotation,
    scene_of,
    world,
)
from reference import lights as ref

from usdslf.color import USD_DEFAULT_SPACE
from usdslf.lights.defaults import default_lights
from usdslf.lights.sampling import intersect_light, is_delta, sample_light
from usdslf.scene.records import Camera, Light, LightTexture
from usdslf.textures.images import write_image

KINDS = ("rect", "disk", "sphere", "cylinder", "distant")


TRANSFORMS = {
    "rigid": rotation(3),
    "mirrored": rotation(3) @ np.diag([-1, 1, 1]),
    "uneven": rotation(4) @ np.diag([2, 0.7, 0.5]),
    "sheared": rotation(4) @ np.array([[1, 0.4, 0.2], [0, 0.8, 0.1], [0.1, 0, 1.5]]),
}
PLACES = [
    (0.1, 0.05, -0.9),
    (0.35, 0.2, -0.5),
    (0.3, 0.1, -0.05),
    (0.41, 0.0, -0.03),
    (1.2, 0.9, -1),
    (0, -0.6, 0.3),
]


def lattice_towards(light: Light, point: np.ndarray) -> tuple[np.ndarray, float]:
    """Even directions that cover all of a light, and the solid angle of each."""
    to = light.world_from_light[:3, 3] - point
    reach = np.linalg.norm(light.world_from_light[:3, :3], 2) / np.linalg.norm(to)
    cone = np.pi if light.kind == "distant" or reach >= 1 else np.arcsin(reach)
    directions, solid = ref.fibonacci_cone(60_000, cone)
    z = to / np.linalg.norm(to)
    x = np.cross(z, [0.3, 0.4, 0.5])
    x /= np.linalg.norm(x)
    return directions @ np.array([x, np.cross(z, x), z]), solid


@pytest.mark.parametrize("transform", TRANSFORMS)
@pytest.mark.parametrize("kind", KINDS)
def test_the_density_of_a_light_integrates_to_one_and_sampling_follows_it(kind: str, transform: str) -> None:
    light = light_of(kind, TRANSFORMS[transform])
    rng = np.random.default_rng(5)
    seen_somewhere = False
    for place in PLACES:
        point = world(light, place)
        lattice, each = lattice_towards(light, point)
        met = intersect_light(light, np.broadcast_to(point, lattice.shape), lattice)
        u = rng.random((8_000, 2))
        drawn = sample_light(light, np.broadcast_to(point, (len(u), 3)), u)
        if not (met.pdf > 0).any():
            assert not (drawn.pdf > 0).any() and not drawn.radiance.any(), place
            continue
        seen_somewhere = True
        density = met.pdf.astype(float)
        assert density.sum() * each == pytest.approx(1, abs=0.01), place

        # Chi-square of the drawn directions over cells of equal expectation, from the density alone.
        axis = rotation(12)[0]
        t = lattice @ axis
        order = np.argsort(t)
        share = np.cumsum(density[order])
        edges = t[order][np.searchsorted(share, share[-1] * np.arange(1, 16) / 16)]
        counts = np.bincount(np.searchsorted(edges, drawn.direction @ axis), minlength=16)
        expected = np.bincount(np.searchsorted(edges, t), density, 16) / density.sum() * len(u)
        chi2 = ((counts - expected) ** 2 / expected).sum()
        assert chi2 < 45, (place, counts, expected)  # 15 degrees of freedom, and the lattice is not exact

        # E[1 / pdf] is the solid angle, for every channel's radiance too.
        solid = (met.pdf > 0).sum() * each
        weight = np.where(drawn.pdf > 0, 1 / np.maximum(drawn.pdf, 1e-30), 0)
        tolerance = 0.01 * solid + 4 * weight.std() / np.sqrt(len(u))
        assert weight.mean() == pytest.approx(solid, abs=tolerance), place
        np.testing.assert_allclose(drawn.radiance[drawn.pdf > 0], [[1, 2, 3]] * (drawn.pdf > 0).sum())
    assert seen_somewhere


@pytest.mark.parametrize("transform", TRANSFORMS)
@pytest.mark.parametrize("kind", KINDS)
def test_meeting_a_light_is_the_inverse_of_sampling_it(kind: str, transform: str) -> None:
    light = light_of(kind, TRANSFORMS[transform])
    rng = np.random.default_rng(6)
    point = np.repeat([world(light, p) for p in PLACES], 500, 0)
    s = sample_light(light, point, rng.random((len(point), 2)))
    m = intersect_light(light, point, s.direction)
    both = (s.pdf > 0) & (m.pdf > 0)
    assert ((s.pdf > 0) == (m.pdf > 0)).mean() > 0.999  # the rim may be missed by a rounding of the direction
    np.testing.assert_allclose(m.pdf[both], s.pdf[both], rtol=2e-3)
    np.testing.assert_allclose(m.radiance[both], s.radiance[both], rtol=1e-6)
    if kind != "distant":
        # Where rays graze the rim, rounding moves the point of meeting along the ray.
        apart = np.abs(m.distance[both] / s.distance[both] - 1)
        assert np.quantile(apart, 0.99) < 1e-4 and apart.max() < 1e-2


@pytest.mark.parametrize("kind", KINDS)
def test_irradiance_is_the_closed_form(kind: str) -> None:
    light = light_of(kind, rotation(9))
    turned = rotation(9)
    for place in ((0.0, 0.0, -0.8), (0.3, 0.45, -1.5), (1.0, 0.5, -2), (0.1, 0.2, -30)):
        point = world(light, place)
        for tilt in ((0, 0, 1), (0.3, 0.2, 1)):
            normal = turned @ (np.array(tilt) / np.linalg.norm(tilt))
            value, noise = estimate(light, point, normal)
            expected = expected_irradiance(light, point, normal)
            assert value == pytest.approx(expected, rel=2e-3), (place, tilt)
            assert noise < 0.02, (place, tilt)


@pytest.mark.parametrize("kind", ["rect", "disk"])
def test_noise_stays_low_close_to_a_flat_light_and_across_the_horizon(kind: str) -> None:
    light = light_of(kind)
    for place in ((0.1, 0.05, -0.02), (0.38, 0.0, -0.01), (0.0, 0.0, -0.3)):
        for normal in ((0.0, 0.0, 1.0), (0.8, 0.0, 0.6)):
            value, noise = estimate(light, world(light, place), np.array(normal))
            assert value == pytest.approx(
                expected_irradiance(light, world(light, place), np.array(normal)), rel=5e-3
            )
            assert noise < 0.03, (place, normal)


def test_a_disk_is_the_catalogued_form_factor() -> None:
    light = replace(light_of("disk", at=(0, 0, 0)), radius=0.7)
    for height, offset in ((0.5, 0.0), (0.5, 0.6), (0.3, 0.7), (2.0, 3.0), (0.05, 0.3)):
        value, _ = estimate(light, np.array([offset, 0, -height]), np.array([0, 0, 1.0]))
        assert value == pytest.approx(ref.disk_irradiance(0.7, height, offset), rel=3e-3), (height, offset)


def test_a_rect_is_drawn_evenly_in_solid_angle() -> None:
    light = light_of("rect", rotation(2))
    point = world(light, (0.5, -0.2, -0.4))
    s = sample_light(light, np.broadcast_to(point, (100, 3)), np.random.default_rng(0).random((100, 2)))
    np.testing.assert_allclose(1 / s.pdf, ref.polygon_solid_angle(corners_of(light), point), rtol=1e-6)


@pytest.mark.parametrize("distance", [3e2, 2.4e3, 2.7e3, 1e5])
def test_a_far_rect_loses_no_digits(distance: float) -> None:
    light = replace(light_of("rect", at=(0, 0, 0)), width=2.0, height=1.0)
    point = np.array([0, 0, -distance])
    u = np.random.default_rng(0).random((4000, 2))
    s = sample_light(light, np.broadcast_to(point, (len(u), 3)), u)
    np.testing.assert_allclose(s.pdf, distance**2 / 2, rtol=1e-4)
    at = s.direction[:, :2] * s.distance[:, None]
    assert np.abs(at / [1, 0.5]).max() <= 1.001
    np.testing.assert_allclose(np.abs(at).mean(0), [0.5, 0.25], rtol=0.05)


def test_light_leaves_rects_and_disks_along_minus_z_and_spheres_outward() -> None:
    u = np.random.default_rng(0).random((50, 2))
    for kind, dark in (
        ("rect", (0, 0, 1)),
        ("disk", (0, 0, 1)),
        ("sphere", (0.1, 0, 0)),
        ("cylinder", (0.2, 0.1, 0)),
    ):
        light = light_of(kind)
        point = np.broadcast_to(world(light, dark), (50, 3))
        s = sample_light(light, point, u)
        assert not s.radiance.any() and not s.pdf.any(), kind
        around = SPHERE[::5]
        assert not intersect_light(light, np.broadcast_to(point[0], around.shape), around).pdf.any(), kind
    # The caps of a cylinder are dark: along its axis nothing is seen.
    light = light_of("cylinder", at=(0, 0, 0))
    assert not intersect_light(light, np.array([[3.0, 0.1, 0]]), np.array([[-1.0, 0, 0]])).pdf.any()


def test_a_distant_light_shines_along_minus_z_whatever_its_angle() -> None:
    for angle in (0.0, np.radians(0.53), np.radians(170)):
        light = replace(light_of("distant", rotation(7)), angle=angle)
        s = sample_light(light, np.zeros((200, 3)), np.random.default_rng(0).random((200, 2)))
        along = s.direction @ (rotation(7) @ [0, 0, 1])
        assert (along >= np.cos(angle / 2) - 1e-6).all() and np.isinf(s.distance).all()


def test_parallel_rays_bring_their_radiance_as_irradiance() -> None:
    light = replace(light_of("distant"), angle=0.0)
    s = sample_light(light, np.zeros((3, 3)), np.zeros((3, 2)))
    assert s.delta and is_delta(light)
    np.testing.assert_allclose(s.radiance, [[1, 2, 3]] * 3)
    assert not intersect_light(light, np.zeros((1, 3)), np.array([[0, 0, 1.0]])).pdf.any()


def test_the_default_distant_light_of_usd_gives_its_irradiance() -> None:
    light = replace(light_of("distant"), radiance=(50000.0,) * 3, angle=np.radians(0.53))
    value, _ = estimate(light, np.zeros(3), np.array([0, 0, 1.0]))
    assert value == pytest.approx(50000 * np.pi * np.sin(np.radians(0.265)) ** 2, rel=1e-4)


def test_a_distant_light_of_360_degrees_is_all_around() -> None:
    light = replace(light_of("distant", rotation(1)), angle=2 * np.pi)
    m = intersect_light(light, np.zeros(SPHERE.shape), SPHERE)
    np.testing.assert_allclose(m.pdf, 1 / (4 * np.pi), rtol=1e-6)
    value, _ = estimate(light, np.zeros(3), np.array([0.6, 0, 0.8]))
    assert value == pytest.approx(np.pi, rel=5e-3)


def test_a_point_is_the_sphere_from_afar() -> None:
    for linear in (rotation(2), rotation(2) @ np.diag([2, 0.5, 1])):
        sphere = replace(light_of("sphere", linear, at=(0, 0, 0)), radius=0.01)
        for towards in rotation(8):
            point = 20 * towards
            s = sample_light(replace(sphere, treat_as_point=True), point[None], np.zeros((1, 2)))
            value, _ = estimate(sphere, point, -towards)
            assert s.delta and s.radiance[0, 0] == pytest.approx(value, rel=2e-3)
            assert s.distance[0] == pytest.approx(20)
    at_the_light = sample_light(replace(sphere, treat_as_point=True), np.zeros((1, 3)), np.zeros((1, 2)))
    assert not at_the_light.radiance.any() and not at_the_light.pdf.any()


def test_scale_of_the_transform_is_scale_of_the_size() -> None:
    u = np.random.default_rng(3).random((200, 2))
    point = np.broadcast_to([0.4, 0.6, -2.5], (200, 3))
    for kind in ("rect", "disk", "sphere", "cylinder"):
        small = light_of(kind, 2 * rotation(5))
        big = replace(
            light_of(kind, rotation(5)),
            width=2.6, height=1.2, radius=0.8, length=3.4,
        )  # fmt: skip
        a, b = sample_light(small, point, u), sample_light(big, point, u)
        np.testing.assert_allclose(a.pdf, b.pdf, rtol=1e-5)
        np.testing.assert_allclose(a.direction, b.direction, atol=1e-6)


def test_an_uneven_disk_is_an_ellipse_and_a_sheared_rect_a_parallelogram() -> None:
    disk = light_of("disk", np.diag([2, 0.5, 3]), at=(0, 0, 0))
    phi = 2 * np.pi * np.arange(720) / 720
    ellipse = np.stack([0.8 * np.cos(phi), 0.2 * np.sin(phi), 0 * phi], 1)
    normal = np.array([0.6, 0, 0.8])
    for point in ([0.3, 0.1, -0.7], [-1.0, 0.5, -0.5]):
        value, _ = estimate(disk, np.array(point), normal)
        assert value == pytest.approx(ref.polygon_irradiance(ellipse, point, normal), rel=1e-2)
    rect = light_of("rect", TRANSFORMS["sheared"])
    point = world(rect, (0.2, 0.1, -0.8))
    normal = TRANSFORMS["sheared"] @ [0, 0, 1] / np.linalg.norm(TRANSFORMS["sheared"][:, 2])
    value, _ = estimate(rect, point, normal)
    assert value == pytest.approx(ref.polygon_irradiance(corners_of(rect), point, normal), rel=1e-2)


@pytest.mark.parametrize("kind", ["rect", "disk", "sphere", "cylinder"])
def test_a_light_without_area_is_dark_not_nan(kind: str) -> None:
    for light in (light_of(kind, np.zeros((3, 3))), replace(light_of(kind), radius=0.0, width=0.0)):
        s = sample_light(light, np.array([[0, 0, -2.0]]), np.full((1, 2), 0.5))
        m = intersect_light(light, np.array([[0, 0, -2.0]]), np.array([[0, 0, 1.0]]))
        assert not s.radiance.any() and not s.pdf.any() and not m.pdf.any()
        assert np.isfinite(s.direction).all()


@pytest.mark.parametrize(
    "shape",
    [
        {"cone_angle": 40.0},
        {"cone_angle": 40.0, "cone_softness": 0.5},
        {"cone_angle": 60.0, "cone_softness": 1.0, "focus": 3.0},
        {"cone_angle": 120.0, "cone_softness": 0.2},
        {"focus": 8.0, "focus_tint": (0.2, 0.0, 1.0)},
        {"focus": 8.0, "focus_tint": (1.0, 1.0, 1.0)},
    ],
)
def test_shaping_is_that_of_usdlux(shape: dict) -> None:
    settings = {
        "cone_angle": 180.0,
        "cone_softness": 0.0,
        "focus": 0.0,
        "focus_tint": (0.0, 0.0, 0.0),
    } | shape
    for linear in (np.eye(3), rotation(4)):
        light = replace(light_of("sphere", linear, at=(0, 0, 0)), radius=1e-4, **settings)
        for off in np.radians([0, 10, 21, 35, 39, 41, 58, 61, 89, 100, 119, 121, 170]):
            towards = linear @ [np.sin(off), 0, -np.cos(off)]  # from the light; its axis is -Z
            s = sample_light(light, 5 * towards[None], np.full((1, 2), 0.5))
            np.testing.assert_allclose(
                s.radiance[0], np.array([1, 2, 3]) * ref.shaping(off, **settings), atol=2e-3
            )
            m = intersect_light(light, 5 * towards[None], -towards[None])
            np.testing.assert_allclose(m.radiance, s.radiance, atol=2e-3)
            point = sample_light(replace(light, treat_as_point=True), 5 * towards[None], np.zeros((1, 2)))
            full = np.pi * light.radius**2 / 25
            np.testing.assert_allclose(point.radiance / full, s.radiance, rtol=1e-3, atol=2e-3)


def test_a_cone_of_90_degrees_is_the_unauthored_default() -> None:
    behind = sample_light(light_of("sphere", at=(0, 0, 0)), np.array([[0, 0, 5.0]]), np.full((1, 2), 0.5))
    assert behind.radiance.all()


def test_a_rect_texture_is_upright_for_whom_it_shines_on(tmp_path: Path) -> None:
    # Red at the upper left, green at the upper right, blue at the lower left, black at the lower right.
    corner = np.array([[[1, 0, 0], [0, 1, 0]], [[0, 0, 1], [0, 0, 0]]], np.float32)
    path = write_image(tmp_path / "corners.exr", np.repeat(np.repeat(corner, 8, 0), 8, 1), half=False)
    picture = LightTexture(str(path), "latlong", "auto", "", USD_DEFAULT_SPACE)
    light = replace(
        light_of("rect", at=(0, 0, 0)), width=2.0, height=2.0, radiance=(2.0, 2.0, 2.0), texture=picture
    )
    # Seen from -Z looking along +Z with +Y up, +X is on the left: UsdLux puts the first pixel at (+X, +Y).
    for x, y, color in (
        (0.5, 0.5, (2, 0, 0)),
        (-0.5, 0.5, (0, 2, 0)),
        (0.5, -0.5, (0, 0, 2)),
        (-0.5, -0.5, (0, 0, 0)),
    ):
        m = intersect_light(light, np.array([[x, y, -1.0]]), np.array([[0, 0, 1.0]]))
        np.testing.assert_allclose(m.radiance[0], color, atol=1e-3)
    u = np.random.default_rng(0).random((4000, 2))
    s = sample_light(light, np.broadcast_to([0, 0, -1.0], (4000, 3)), u)
    m = intersect_light(light, np.broadcast_to([0, 0, -1.0], (4000, 3)), s.direction)
    np.testing.assert_allclose(s.radiance, m.radiance, atol=2e-3)
    np.testing.assert_allclose((s.radiance / s.pdf[:, None]).mean(0) * s.pdf[0], [0.5, 0.5, 0.5], atol=0.05)


def test_default_lights_come_over_the_shoulder_and_light_white_to_about_one() -> None:
    turn = rotation(11)
    camera = Camera("/shot/cam", placed(turn, (1, 2, 3)), 20.955, 15.2908, 50)
    for scene, right, up, back in (
        (scene_of(cameras=(camera,)), *turn.T),
        (scene_of(), *np.eye(3)),
        (scene_of(up_axis="Z"), (1, 0, 0), (0, 0, 1), (0, -1, 0)),
    ):
        (key, dome), sentence = default_lights(scene)
        s = sample_light(key, np.zeros((1, 3)), np.full((1, 2), 1e-9))
        towards = s.direction[0]
        assert (
            towards @ np.asarray(up) > 0.4
            and towards @ np.asarray(back) > 0.4
            and towards @ np.asarray(right) < -0.2
        )
        value, _ = estimate(key, np.zeros(3), towards)
        assert (value + np.pi * dome.radiance[0]) / np.pi == pytest.approx(1, abs=0.05)
        assert "no light" in sentence and f"{dome.radiance[0]:g}" in sentence and "\n" not in sentence
        assert sentence.count("/shot/cam") == len(scene.cameras)
