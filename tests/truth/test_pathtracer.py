"""The reference path tracer agrees with closed forms and float64 quadrature."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from reference.mitsuba_setup import why_no_pathtracer

if why_no_pathtracer():
    pytest.skip(why_no_pathtracer(), allow_module_level=True)

from kit.closed_radiance import MATERIAL, at, brdf, mean_radiance
from kit.stage_parts import StageBuilder, TextureInput, rectangle, write_image
from reference.pathtracer import Tracer


@pytest.fixture
def builder(tmp_path: Path) -> StageBuilder:
    return StageBuilder(tmp_path)


def test_white_furnace_gives_the_albedo(builder: StageBuilder) -> None:
    builder.sphere("ball", 1.0, builder.material("grey", **MATERIAL), (0, 0, 0))
    builder.dome_light("dome", 1.0)
    tracer = Tracer(builder.save())
    assert not tracer.warnings
    n = np.array([0, 1.0, 0])
    cos = (np.arange(800) + 0.5) / 800
    phi = 2 * np.pi * (np.arange(800) + 0.5) / 800
    c, p = (x.ravel() for x in np.meshgrid(cos, phi))
    s = np.sqrt(1 - c * c)
    l = np.stack([s * np.cos(p), c, s * np.sin(p)], -1)
    for v in at(0.0, 45.0, 70.0):
        albedo = 2 * np.pi * (brdf(n, v, l) * c[:, None]).mean(0)
        np.testing.assert_allclose(mean_radiance(tracer, (0, 1, 0), v), albedo, rtol=0.006)


def test_rect_light_on_a_plane(builder: StageBuilder) -> None:
    builder.plane("floor", 4, 4, builder.material("grey", **MATERIAL))
    builder.rect_light("lamp", (0.4, 1.5, 0.2), (0.4, 0, 0.2), 0.8, 0.5, (3, 3, 3))
    tracer = Tracer(builder.save(), max_depth=2)
    u, v = (
        x.ravel() for x in np.meshgrid((np.arange(400) + 0.5) / 400 - 0.5, (np.arange(400) + 0.5) / 400 - 0.5)
    )
    place = np.stack([0.4 + 0.8 * u, np.full_like(u, 1.5), 0.2 + 0.5 * v], -1)
    r2 = (place**2).sum(1)
    l = place / np.sqrt(r2)[:, None]
    n = np.array([0, 1.0, 0])
    for eye in at(-20.0, -60.0):
        expected = 3 * (brdf(n, eye, l) * (l[:, 1] ** 2 / r2)[:, None]).mean(0) * 0.8 * 0.5
        np.testing.assert_allclose(mean_radiance(tracer, (0, 0, 0), eye), expected, rtol=0.006)


def test_distant_light_on_a_plane(builder: StageBuilder) -> None:
    builder.plane("floor", 4, 4, builder.material("grey", **MATERIAL))
    builder.distant_light("sun", (-1.0, -1.0, 0.0), 0.5, 2.5)
    tracer = Tracer(builder.save(), max_depth=2)
    light, n = at(45.0), np.array([0, 1.0, 0])
    for eye in at(-30.0, 10.0):
        expected = 2.5 * np.cos(np.pi / 4) * brdf(n, eye, light)[0]
        np.testing.assert_allclose(mean_radiance(tracer, (0, 0, 0), eye, 50_000), expected, rtol=0.005)


def test_sphere_light_obeys_the_inverse_square(builder: StageBuilder) -> None:
    builder.plane("floor", 4, 4, builder.material("grey", **MATERIAL))
    builder.sphere_light("bulb", (0, 2, 0), 0.02, (8, 8, 8))
    tracer = Tracer(builder.save(), max_depth=2)
    eye = at(-50.0)[0]
    # normalize: power per area of the sphere is radiance; intensity towards the plane is radiance pi r^2.
    irradiance = 8 / 4 / 2**2
    expected = irradiance * brdf(np.array([0, 1.0, 0]), eye, at(0.0))[0]
    np.testing.assert_allclose(mean_radiance(tracer, (0, 0, 0), eye), expected, rtol=0.006)


def test_dome_is_oriented_as_UsdLux_says(builder: StageBuilder) -> None:
    """Row 0 is up, column 0 is longitude +180, +Z in the middle, +X at a quarter of the width."""
    image = np.zeros((8, 16, 3), np.float32)
    rows, columns = np.indices((8, 16))
    image[..., 0], image[..., 1] = rows, columns
    write_image(builder.folder / "dome.exr", image)
    builder.dome_light("dome", 1.0, texture="dome.exr")
    tracer = Tracer(builder.save())
    directions = np.array([[0, 0, 1], [1, 0, 0], [-1, 0, 0], [0, 0.999, 0.0447]])
    seen = tracer.radiance(np.zeros((4, 3)), directions)
    # Longitude 180 - 360 (column + 0.5) / 16.
    np.testing.assert_allclose(seen[:3, 1], [7.5, 3.5, 11.5], atol=0.02)
    np.testing.assert_allclose(seen[:3, 0], 3.5, atol=0.02)
    assert seen[3, 0] < 0.1


def test_texture_origin_is_lower_left(builder: StageBuilder) -> None:
    image = np.zeros((2, 2, 3), np.float32)
    image[1, 0] = 1  # lower left
    write_image(builder.folder / "t.exr", image)
    material = builder.material("m", diffuseColor=TextureInput("t.exr", (0.5, 0.4, 0.3)))
    builder.mesh("quad", rectangle((0, 0, 0), (1, 0, 0), (0, 1, 0)), material)
    tracer = Tracer(builder.save())
    xy = np.array([[0.25, 0.25], [0.75, 0.25], [0.25, 0.75]])
    origins = np.concatenate([xy, np.ones((3, 1))], 1)
    names, _, diffuse = tracer.first_hits(origins, np.broadcast_to([0, 0, -1.0], (3, 3)))
    assert list(names) == ["/World/quad"] * 3
    # EXR is linear, but the reader is told sRGB; 0 and 1 stay what they are.
    np.testing.assert_allclose(diffuse, [[0.5, 0.4, 0.3], [0, 0, 0], [0, 0, 0]], atol=1e-3)


def test_centimetres_and_z_up_change_nothing(tmp_path: Path) -> None:
    pictures = []
    for name, up, units in (("a", "Y", 1.0), ("b", "Z", 100.0)):
        (tmp_path / name).mkdir()
        builder = StageBuilder(tmp_path / name, up, units)
        builder.plane("floor", 4, 4, builder.material("grey", **MATERIAL))
        builder.sphere("ball", 0.5, builder.material("red", diffuseColor=(0.5, 0.1, 0.1)), (0, 0.5, 0))
        builder.rect_light("lamp", (1, 2, 1), (0, 0, 0), 0.8, 0.5, (3, 3, 3))
        builder.sphere_light("bulb", (-1, 1, 1), 0.1, (8, 8, 8))
        camera = builder.camera((0, 1, 3), (0, 0.4, 0))
        pictures.append(Tracer(builder.save()).render(camera, 24, 18, 256))
    np.testing.assert_allclose(pictures[0].mean((0, 1)), pictures[1].mean((0, 1)), rtol=0.02)
