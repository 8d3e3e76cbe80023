"""The final picture by the live picture's kernels: no grid in mirrors, layers that add up."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from kit.live_pictures import lit_scene
from kit.scene_pictures import camera_at, ground, matte, picture
from kit.scene_records import make_scene, sphere

from usdslf.color import USD_DEFAULT_SPACE
from usdslf.gpu.device import Device
from usdslf.render.picture import PictureOptions, render
from usdslf.scene.records import Light, LightTexture, Material, constant
from usdslf.textures.images import write_image

SIZE = (128, 96)


@pytest.mark.parametrize("roughness", [0.05, 0.12])
def test_a_mirror_floor_below_a_sky_shows_no_grid(device: Device, roughness: float, tmp_path: Path) -> None:
    """The sky is smooth; what few numbers would be wrong by may not differ from place to place in a tile."""
    y, x = np.meshgrid(np.linspace(0, np.pi, 32), np.linspace(0, 2 * np.pi, 64, endpoint=False), indexing="ij")
    write_image(tmp_path / "sky.exr", np.repeat((1 + 0.5 * np.cos(y) + 0.3 * np.sin(y) * np.cos(x))[..., None], 3, 2))
    of = LightTexture(str(tmp_path / "sky.exr"), "latlong", "raw", "", USD_DEFAULT_SPACE)
    sky = Light("/sky", "dome", (1.0,) * 3, np.eye(4), texture=of)
    metal = Material("", diffuse_color=constant(1, 1, 1), metallic=constant(1.0), roughness=constant(roughness))
    scene = make_scene(ground(30.0), materials=[metal], lights=[sky])
    camera = camera_at((0, 1.05, 2.9), (0, 0.35, 0), focal_length=40.0)
    shown = picture(scene, camera, device, size=SIZE)["color"][SIZE[1] // 2 :].mean(-1).astype(float)
    beside = (np.roll(shown, 1, 1) + np.roll(shown, -1, 1) + np.roll(shown, 1, 0) + np.roll(shown, -1, 0)) / 4
    rest = (shown - beside)[4:-4, 8:-8]
    h, w = (n // 4 * 4 for n in rest.shape)
    of_place = rest[:h, :w].reshape(h // 4, 4, w // 4, 4).mean((0, 2))  # by where a pixel lies in its tile
    assert np.abs(of_place).max() < 2e-4 * shown.mean()
    assert np.abs(rest).max() < 0.02 * shown.mean()


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
