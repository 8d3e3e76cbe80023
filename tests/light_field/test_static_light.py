"""Light that no edit changes: what arrives in the bins of elements, against closed forms."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from kit.placed_lights import SPHERE, corners_of, expected_irradiance, light_of, rotation, scene_of
from kit.scene_records import make_mesh
from reference import lights as ref

from usdslf.light_field.links import ESCAPES
from usdslf.light_field.static_light import static_light
from usdslf.lights.dome import Dome
from usdslf.rays import RayTracer
from usdslf.sampling.hemisphere import SOLID_ANGLE, D, bin_directions
from usdslf.scene.records import Light


class Nothing:
    """A tracer of an empty scene."""

    def offset_points(self, points: np.ndarray, *_: object) -> np.ndarray:
        return points

    def occluded(self, origins: np.ndarray, directions: np.ndarray, distance: np.ndarray) -> np.ndarray:
        assert np.isfinite(origins).all() and len(origins) == len(directions) == len(distance)
        return np.zeros(len(origins), bool)


def elements_at(points: np.ndarray, normals: np.ndarray, seed: int = 0) -> SimpleNamespace:
    normals = np.broadcast_to(normals, points.shape) / np.linalg.norm(normals, axis=-1, keepdims=True)
    random = np.random.default_rng(seed).normal(size=points.shape)
    s = np.cross(random, normals)
    s /= np.linalg.norm(s, axis=1, keepdims=True)
    return SimpleNamespace(
        position=points.astype(np.float32),
        geometric_normal=normals.astype(np.float32),
        triangle=np.zeros(len(points), np.int32),
        frame=np.stack([s, np.cross(normals, s), normals], 1).astype(np.float32),
    )


def irradiance(radiance: np.ndarray) -> np.ndarray:
    return (radiance.astype(float) * bin_directions()[:, 2:]).sum(1) * SOLID_ANGLE


@pytest.mark.parametrize("kind", ["rect", "disk", "sphere", "cylinder", "distant", "wide", "dome"])
def test_bins_of_a_plane_hold_the_irradiance_of_the_closed_form(kind: str) -> None:
    """77 elements: not a multiple of any batch."""
    grid = np.random.default_rng(2).uniform(-1, 1, (77, 3)) * [1, 1, 0] - [0, 0, 1.5]
    elements = elements_at(grid, np.array([0.0, 0.0, 1.0]))
    normal = np.array([0, 0, 1.0])
    light = light_of(
        "distant" if kind == "wide" else kind, rotation(3) if kind == "dome" else None, (0, 0, 0)
    )
    if kind == "wide":
        light = replace(light, angle=np.radians(100))
    r = static_light(elements, Nothing(), (light,))
    assert r.diffuse.shape == (77, D, 3) and r.diffuse.dtype == np.float32 and r.specular is None
    expected = np.array([np.pi if kind == "dome" else expected_irradiance(light, p, normal) for p in grid])
    got = irradiance(r.diffuse)
    np.testing.assert_allclose(got, expected[:, None] * [[1, 2, 3]], rtol=0.03)
    np.testing.assert_allclose(got.mean(0), expected.mean() * np.array([1, 2, 3]), rtol=0.005)
    assert (got[:, 0] / expected).std() < 0.01


def test_delta_lights_bring_their_irradiance_at_every_angle() -> None:
    normals = SPHERE[::300]
    elements = elements_at(np.zeros((len(normals), 3)), normals)
    sun = replace(light_of("distant", rotation(3)), angle=0.0)
    point = replace(light_of("sphere", at=(0, 3, 0)), treat_as_point=True)
    r = static_light(elements, Nothing(), (sun, point))
    towards = rotation(3) @ [0, 0, 1]
    expected = np.maximum(normals @ towards, 0) + np.pi * 0.4**2 / 9 * np.maximum(normals @ [0, 1, 0], 0)
    np.testing.assert_allclose(irradiance(r.diffuse), expected[:, None] * [[1, 2, 3]], rtol=1e-4, atol=1e-5)


def test_light_lies_in_the_bins_of_its_directions_and_large_lights_fill_theirs_evenly() -> None:
    light = replace(light_of("rect", at=(0, 0, 0)), width=3.0, height=3.0, radiance=(1.0, 1.0, 1.0))
    elements = elements_at(np.repeat([[0.2, 0.1, -1.0]], 50, 0), np.array([0, 0, 1.0]))
    got = static_light(elements, Nothing(), (light,)).diffuse[..., 0]
    towards = bin_directions() @ elements.frame.astype(float)
    hit = elements.position[:, None] + towards * (1 / towards[..., 2:])
    beyond = np.abs(hit[..., :2]).max(-1)
    inside, outside = beyond < 1.2, beyond > 2.2
    assert np.median(got[inside]) == pytest.approx(1, abs=0.05)
    assert np.std(got[inside]) < 0.1  # the light's 2.4 sr are about 400 bins, each met by a ray
    assert got[outside].max() == 0
    far = elements_at(np.repeat([[0.2, 0.1, -2.8]], 50, 0), np.array([0, 0, 1.0]))
    filled = static_light(far, Nothing(), (light,)).diffuse[..., 0]
    solid = ref.polygon_solid_angle(corners_of(light), [0.2, 0.1, -2.8])
    within = np.sort(filled, 1)[:, -int(0.7 * solid / SOLID_ANGLE) :]
    assert within.min() > 0.2 and within.max() < 3  # 64 samples for 110 bins


def test_a_small_light_is_in_the_bin_of_its_direction() -> None:
    towards = SPHERE[SPHERE[:, 2] > 0.1][::90]
    normal = np.array([0, 0, 1.0])
    for angle in (0.0, np.radians(0.53)):
        elements = elements_at(np.zeros((4, 3)), normal)
        for w in towards:
            x = np.cross(w, [0.3, 0.4, 0.5])
            x /= np.linalg.norm(x)
            light = replace(light_of("distant", np.stack([x, np.cross(w, x), w], 1)), angle=angle)
            got = static_light(elements, Nothing(), (light,)).diffuse[..., 0]
            for one, frame in zip(got, elements.frame, strict=True):
                nearest = bin_directions()[one.argmax()] @ frame
                assert nearest @ w > np.cos(np.radians(5.5)), (w, nearest)  # a bin's half diagonal
                assert (one > 0).sum() <= 4


def test_large_and_small_lights_have_less_than_two_percent_of_noise() -> None:
    lights = [
        light_of("rect", at=(0, 0, 0)),
        light_of("disk", at=(0, 0, 0)),
        light_of("sphere", at=(0, 0, 0)),
    ]
    for light in lights:
        for place, normal in (
            ((0.3, 0.2, -0.5), (0, 0, 1.0)),
            ((0, 0, -0.9), (0.95, 0, 0.3)),
            ((2, 1, -3), (0, 0, 1)),
        ):
            elements = elements_at(np.repeat([place], 150, 0).astype(float), np.array(normal, float))
            got = irradiance(static_light(elements, Nothing(), (light,), seed=4).diffuse)[:, 0]
            assert got.std() / got.mean() < 0.02, (light.kind, place)


def test_the_same_seed_gives_the_same_light() -> None:
    elements = elements_at(np.zeros((5, 3)) - [0, 0, 1], np.array([0, 0, 1.0]))
    a, b = (static_light(elements, Nothing(), (light_of("rect"),), seed=s).diffuse for s in (7, 7))
    np.testing.assert_array_equal(a, b)


def test_diffuse_and_specular_factors_are_kept_apart() -> None:
    elements = elements_at(np.zeros((3, 3)) - [0, 0, 1], np.array([0, 0, 1.0]))
    light, sky = light_of("rect", at=(0, 0, 0)), light_of("dome")
    plain = static_light(elements, Nothing(), (light, sky)).diffuse
    r = static_light(elements, Nothing(), (replace(light, diffuse=0.5, specular=0.0), sky))
    only_sky = static_light(elements, Nothing(), (sky,)).diffuse
    assert r.specular is not None
    np.testing.assert_allclose(r.diffuse, (plain + only_sky) / 2, rtol=1e-5, atol=1e-6)
    np.testing.assert_allclose(r.specular, only_sky, rtol=1e-5)
    same = static_light(elements, Nothing(), (replace(light, diffuse=0.5, specular=0.5), sky))
    assert same.specular is None or np.allclose(same.specular, same.diffuse)


def test_a_dome_arrives_where_rays_escape_only() -> None:
    elements = elements_at(np.zeros((9, 3)), np.array([0, 1.0, 0]))
    hit = np.random.default_rng(0).integers(0, 9 << 10, (9, D)).astype(np.uint32)
    free = np.random.default_rng(1).random((9, D)) < 0.3
    hit[free] = ESCAPES
    hit[0] = 0xFFFFFFFE  # a black inside is not the sky
    free[0] = False
    r = static_light(elements, Nothing(), (Dome(light_of("dome")),), SimpleNamespace(hit=hit))
    np.testing.assert_allclose(r.diffuse, free[..., None] * np.array([1, 2, 3.0]), rtol=1e-6)


def test_a_sun_in_the_dome_is_exact_for_every_element_and_hidden_by_what_is_in_its_way() -> None:
    """The ray of the sun's bin may escape where the sun itself is hidden."""
    pixels = np.full((128, 256, 3), 0.1, np.float32)
    pixels[30, 40] = 5e4
    row, column = 30.5, 40.5
    towards = ref.latlong_direction(row, column, 128, 256)
    energy = 5e4 * (np.sin(np.pi * (0.5 - 30 / 128)) - np.sin(np.pi * (0.5 - 31 / 128))) * 2 * np.pi / 256
    normals = np.array([n for n in SPHERE[::200] if n @ towards > 0.3])
    elements = elements_at(np.zeros((len(normals), 3)), normals)
    dome = Light("/sky", "dome", (1.0, 1.0, 1.0), np.eye(4))
    got = irradiance(static_light(elements, Nothing(), (Dome(dome, pixels),)).diffuse)[:, 0]
    expected = 0.1 * np.pi + energy * (normals @ towards)
    np.testing.assert_allclose(got, expected, rtol=0.01)

    side = np.cross(towards, [0, 1, 0])
    up = np.cross(side, towards)
    board = np.array(
        [2 * towards + 0.2 * (a * side + b * up) for a, b in ((-1, -1), (1, -1), (0, 1.5))], np.float32
    )
    tracer = RayTracer(scene_of((make_mesh(board, [[0, 1, 2]]),)))
    shadowed = irradiance(static_light(elements, tracer, (Dome(dome, pixels),)).diffuse)[:, 0]
    np.testing.assert_allclose(shadowed, 0.1 * np.pi, rtol=0.1)


def test_a_half_hidden_light_gives_the_irradiance_of_the_visible_half() -> None:
    """A wall at x < 0 halfway to the light hides the part of it that lies behind, seen from each element."""
    light = replace(light_of("rect", at=(0, 0, 2)), width=1.0, height=1.0, radiance=(1.0, 1.0, 1.0))
    wall = make_mesh([[-9, -9, 1], [0, -9, 1], [0, 9, 1], [-9, 9, 1]], [[0, 1, 2], [0, 2, 3]])
    tracer = RayTracer(scene_of((wall,)))
    x = np.repeat([-0.3, -0.1, 0.0, 0.2, 0.45, 0.8, -0.8], 30)
    points = np.stack([x, 0 * x, 0 * x], 1)
    elements = elements_at(points, np.array([0, 0, 1.0]))
    got = irradiance(static_light(elements, tracer, (light,)).diffuse)[:, 0]
    for value in np.unique(x):
        edge = np.clip(-value, -0.5, 0.5)  # the edge of the wall seen on the light: twice as far, from x
        visible = [[edge, -0.5, 2], [0.5, -0.5, 2], [0.5, 0.5, 2], [edge, 0.5, 2]]
        expected = ref.polygon_irradiance(visible, [value, 0, 0], [0, 0, 1.0]) if edge < 0.5 else 0.0
        here = got[x == value]
        whole = ref.polygon_irradiance(corners_of(light), [value, 0, 0], [0, 0, 1.0])
        assert here.mean() == pytest.approx(expected, rel=0.02, abs=1e-6), value
        assert here.std() <= 0.015 * whole, value


def test_no_light_no_elements_and_black_lights_are_fine() -> None:
    none = elements_at(np.zeros((0, 3)), np.zeros((0, 3)))
    assert static_light(none, Nothing(), (light_of("rect"), light_of("dome"))).diffuse.shape == (0, D, 3)
    one = elements_at(np.zeros((1, 3)), np.array([0, 0, 1.0]))
    assert not static_light(one, Nothing(), ()).diffuse.any()
    assert not static_light(
        one, Nothing(), (replace(light_of("rect"), radiance=(0.0, 0.0, 0.0)),)
    ).diffuse.any()
