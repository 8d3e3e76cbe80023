"""Pictures of ground below lights of every kind are the closed forms."""

from __future__ import annotations

import numpy as np
import pytest
from kit.scene_pictures import camera_at, ground, looking_down, matte, picture, white_dome
from kit.scene_records import make_scene, quad
from numpy.typing import NDArray
from reference import lights as closed
from reference.reflectance import preview_surface

from usdslf.gpu.device import Device
from usdslf.scene.records import Light, Material, constant


def disk_directions(radius: float, height: float, count: int = 20000) -> tuple[NDArray, NDArray]:
    """Directions (n, 3) from the origin to a disk above it, and their solid angles (n,)."""
    i = np.arange(count) + 0.5
    r, phi = radius * np.sqrt(i / count), np.pi * (1 + 5**0.5) * i
    p = np.stack([r * np.cos(phi), r * np.sin(phi), np.full(count, height)], -1)
    d2 = (p * p).sum(1)
    return p / np.sqrt(d2)[:, None], np.pi * radius**2 / count * height / d2**1.5


def test_ground_below_a_point_and_a_parallel_light_is_exact(device: Device) -> None:
    """Lights without extent: f cos I / d^2 at the foot point, f cos E; no noise at all."""
    point = Light("/p", "sphere", (10.0,) * 3, looking_down((0, 2, 0)), radius=0.1, treat_as_point=True)
    sun_frame = np.eye(4)
    sun_frame[:3, 2] = np.array([1, 2, 0.5]) / np.linalg.norm([1, 2, 0.5])
    sun_frame[:3, 0] = np.cross([0, 1, 0], sun_frame[:3, 2])
    sun_frame[:3, 0] /= np.linalg.norm(sun_frame[:3, 0])
    sun_frame[:3, 1] = np.cross(sun_frame[:3, 2], sun_frame[:3, 0])
    sun = Light("/s", "distant", (3.0,) * 3, sun_frame)
    eye = np.array([1.5, 2.0, 0])
    e = np.array([1.5, 0, 2.0]) / 2.5  # z up, in the local frame with x along world x and y along -z
    for light, towards, irradiance in (
        (point, np.array([0, 0, 1.0]), 10.0 * np.pi * 0.1**2 / 4),
        (sun, np.array([1, -0.5, 2]) / np.linalg.norm([1, 2, 0.5]), 3.0),
    ):
        scene = make_scene(ground(), materials=[matte()], lights=[light])
        out = picture(scene, camera_at(eye, focal_length=5000.0), device, size=(4, 4))["color"]
        f = preview_surface([0.5] * 3, [0.0] * 3, [1.0] * 3, 1.0, e, towards)
        np.testing.assert_allclose(out, np.broadcast_to(f * towards[2] * irradiance, out.shape), rtol=2e-3)


@pytest.mark.parametrize("roughness", [0.25, 1.0])
@pytest.mark.parametrize("kind", ["disk", "rect", "sphere", "distant"])
def test_ground_below_an_area_light_agrees_with_quadrature(device: Device, kind: str, roughness: float) -> None:
    height, radius = 1.5, 0.8
    common = dict(path="/l", kind=kind, radiance=(2.0, 1.0, 0.5), world_from_light=looking_down((0, height, 0)))
    if kind == "rect":
        light = Light(**common, width=1.2, height=0.8)
        x, y = np.meshgrid((np.arange(200) + 0.5) / 200 * 1.2 - 0.6, (np.arange(200) + 0.5) / 200 * 0.8 - 0.4)
        p = np.stack([x.ravel(), y.ravel(), np.full(x.size, height)], -1)
        d2 = (p * p).sum(1)
        l, omega = p / np.sqrt(d2)[:, None], 1.2 * 0.8 / x.size * height / d2**1.5
    elif kind == "distant":
        light = Light(**common, angle=2 * np.arctan(radius / height))
        l, omega = disk_directions(radius, height)
    elif kind == "sphere":
        light = Light(**common, radius=radius)
        half = np.arcsin(radius / height)
        l, omega = disk_directions(np.tan(half), 1.0)
    else:
        light = Light(**common, radius=radius)
        l, omega = disk_directions(radius, height)
    material = Material("", diffuse_color=constant(0.5, 0.5, 0.5), roughness=constant(roughness))
    scene = make_scene(ground(5.0), materials=[material], lights=[light])
    e = np.array([0.6, 0, 0.8])
    f = preview_surface([0.5] * 3, [0.04] * 3, [1.0] * 3, roughness, e, l)
    expected = (f * (l[:, 2] * omega)[:, None]).sum(0) * light.radiance
    camera = camera_at((1.8, 2.4, 0), focal_length=3000.0)
    out = picture(scene, camera, device, size=(8, 8), hide_lights=True)["color"].mean((0, 1))
    np.testing.assert_allclose(out, expected, rtol=0.01)


def test_the_closed_form_of_the_disk_agrees_too(device: Device) -> None:
    """Without the quadrature above: irradiance of a disk, on a surface whose BRDF is d / pi head-on but for Fresnel."""
    light = Light("/l", "disk", (1.0,) * 3, looking_down((0, 30.0, 0)), radius=3.0)
    scene = make_scene(ground(1.0), materials=[matte()], lights=[light])
    out = picture(scene, camera_at((0, 3, 0), focal_length=3000.0), device, size=(8, 8))["color"].mean()
    np.testing.assert_allclose(out, 0.5 / np.pi * closed.disk_irradiance(3.0, 30.0, 0.0), rtol=3e-3)


def test_what_stands_in_between_throws_a_shadow(device: Device) -> None:
    light = Light("/l", "disk", (1.0,) * 3, looking_down((0, 3, 0)), radius=0.1)
    blocker = quad((-9, 1.5, 9), (9, 0, 0), (0, 0, -18))  # over x < 0
    scene = make_scene(ground(5.0), blocker, materials=[matte()], lights=[light])
    out = picture(scene, camera_at((0, 1.2, 0)), device, size=(30, 20), aovs=("direct",))["direct"].mean((0, 2))
    assert out[:10].max() == 0 and out[-10:].min() > 1e-4
    assert (np.diff(out[12:18]) > -1e-4).all()  # the penumbra rises


def test_emissive_surfaces_light_as_area_lights_do(device: Device) -> None:
    e = np.array([0.6, 0, 0.8])
    lamp = quad((-0.6, 1.5, -0.4), (1.2, 0, 0), (0, 0, 0.8), material=1)  # faces down
    glow = Material("/glow", diffuse_color=constant(0.0, 0.0, 0.0), emissive_color=constant(2.0, 1.0, 0.5))
    scene = make_scene(ground(5.0), lamp, materials=[matte(), glow])
    x, y = np.meshgrid((np.arange(100) + 0.5) / 100 * 1.2 - 0.6, (np.arange(100) + 0.5) / 100 * 0.8 - 0.4)
    p = np.stack([x.ravel(), y.ravel(), np.full(x.size, 1.5)], -1)
    d2 = (p * p).sum(1)
    l, omega = p / np.sqrt(d2)[:, None], 1.2 * 0.8 / x.size * 1.5 / d2**1.5
    f = preview_surface([0.5] * 3, [0.0] * 3, [1.0] * 3, 1.0, e, l)
    expected = (f * (l[:, 2] * omega)[:, None]).sum(0) * [2.0, 1.0, 0.5]
    out = picture(scene, camera_at((1.8, 2.4, 0), focal_length=3000.0), device, size=(8, 8), depth=0)["color"]
    np.testing.assert_allclose(out.mean((0, 1)), expected, rtol=0.015)
    glowing = picture(scene, camera_at((0, 0.5, 0), (0, 1.5, 0), focal_length=200.0), device, size=(4, 4), depth=0)
    np.testing.assert_allclose(glowing["color"], np.broadcast_to([2.0, 1.0, 0.5], (4, 4, 3)), rtol=1e-3)


def test_lights_that_leave_out_a_lobe_do_so(device: Device) -> None:
    metal = Material("", diffuse_color=constant(0.9, 0.9, 0.9), metallic=constant(1.0), roughness=constant(0.4))
    for light in (white_dome(), Light("/l", "disk", (1.0,) * 3, looking_down((0, 2, 0)), radius=1.0)):
        whole = make_scene(ground(), materials=[metal], lights=[light])
        without = make_scene(ground(), materials=[metal], lights=[Light(**{**vars(light), "specular": 0.0})])
        halved = make_scene(ground(), materials=[metal], lights=[Light(**{**vars(light), "specular": 0.5})])
        camera = camera_at((0.5, 2, 0.2), focal_length=3000.0)
        a, b, c = (
            picture(s, camera, device, size=(8, 8), hide_lights=True)["color"].mean() for s in (whole, without, halved)
        )
        assert b == 0
        np.testing.assert_allclose(c, a / 2, rtol=0.03)


def test_lights_are_seen_by_the_camera_unless_hidden(device: Device) -> None:
    light = Light("/l", "disk", (7.0, 5.0, 3.0), looking_down((0, 2, 0)), radius=0.5)
    scene = make_scene(ground(), materials=[matte()], lights=[light])
    up = camera_at((0, 0.5, 0), (0, 2, 0), focal_length=400.0)
    np.testing.assert_allclose(picture(scene, up, device, size=(4, 4))["color"][1, 1], [7, 5, 3], rtol=1e-5)
    assert picture(scene, up, device, size=(4, 4), hide_lights=True)["color"].max() == 0
    from_behind = camera_at((0, 4, 0), focal_length=400.0)
    assert picture(scene, from_behind, device, size=(4, 4))["color"].max() < 3  # it shines to one side
