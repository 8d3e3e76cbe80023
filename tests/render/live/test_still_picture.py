"""The final picture by the live picture's kernels: layers that add up, light that lies where it falls."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from kit.live_pictures import lit_scene
from kit.scene_pictures import camera_at, ground, matte
from kit.scene_records import make_scene, quad, sphere

from usdslf.gpu.device import Device
from usdslf.render.picture import PictureOptions, render
from usdslf.scene.records import Light, Material, constant


def test_layers_add_up_to_the_picture(device: Device) -> None:
    materials = [
        Material("/ground", diffuse_color=constant(0.5, 0.45, 0.4), roughness=constant(0.6)),
        Material("/ball", diffuse_color=constant(0.8, 0.6, 0.3), metallic=constant(1.0), roughness=constant(0.3)),
        replace(matte((0.2, 0.6, 0.2)), emissive_color=constant(0.5, 0.2, 0.1)),
    ]
    above = np.eye(4)
    above[:3, 3] = (0.5, 2.0, 1.0)
    lamp = Light("/lamp", "sphere", (9.0,) * 3, above, radius=0.2)
    scene = make_scene(
        ground(3.0), sphere(0.5, (-0.6, 0.5, 0), material=1), sphere(0.4, (0.5, 0.4, 0.2), material=2),
        materials=materials, lights=[lamp],
    )  # fmt: skip
    lit, camera = lit_scene(scene, device, 200), camera_at((0, 1.4, 4.2), (0, 0.4, 0))
    names = ("direct", "indirect", "emission", "alpha", "albedo", "roughness")
    options = PictureOptions(elements=200, hide_lights=True)
    apart = render(lit, camera, (48, 32), names, options)
    whole = render(lit, camera, (48, 32), options=options)["color"]
    np.testing.assert_allclose(apart["direct"] + apart["indirect"] + apart["emission"], whole, rtol=1e-4, atol=1e-5)
    np.testing.assert_allclose(apart["color"], whole, rtol=1e-4, atol=1e-5)
    assert apart["indirect"].mean() > 0.02 * whole.mean() and apart["direct"].min() >= 0
    assert set(np.unique(apart["roughness"][16, 17].round(3))) <= {np.float32(0.3)}


@pytest.mark.parametrize("samples", [4, 16])
def test_light_lies_where_it_falls(device: Device, samples: int) -> None:
    wall = quad((-2, -2, 0), (4, 0, 0), (0, 4, 0))
    before = np.eye(4)
    before[:3, 3] = (0, 0, 0.3)
    lamp = Light("/lamp", "sphere", (9.0,) * 3, before, radius=0.05)
    lit = lit_scene(make_scene(wall, materials=[matte((0.5,) * 3)], lights=[lamp]), device, 100)
    options = PictureOptions(samples, 100, hide_lights=True)
    picture = render(lit, camera_at((0, 0, 4), (0, 0, 0)), (64, 64), options=options)["color"][..., 1]
    away = np.arange(64) - 31.5
    middle = [(picture.sum(axis) * away).sum() / picture.sum() for axis in (0, 1)]  # of all light [pixels]
    np.testing.assert_allclose(middle, 0, atol=0.05)
