"""Textures of materials on the device: each texel as its file has it, and none of them kept by the host."""

from __future__ import annotations

import tracemalloc
from dataclasses import replace
from pathlib import Path

import numpy as np
import OpenImageIO as oiio
import pytest
from kit.light_field_scenes import material
from kit.scene_records import make_scene, quad

from usdslf.gpu.device import Device
from usdslf.render.live.materials import TEXEL, MaterialTable, TexturePool
from usdslf.scene.records import Material, Texture

SIZES = ((70, 200), (130, 64), (3, 5))  # (height, width): whole bands, parts of one, and less than one


def codes(number: int, height: int, width: int) -> np.ndarray:
    return np.random.default_rng(number).integers(0, 256, (height, width, 3)).astype(np.uint8)


def written(folder: Path, number: int, size: tuple[int, int]) -> Texture:
    path = str(folder / f"{number}.png")
    pixels = oiio.ImageBuf(codes(number, *size))
    assert pixels.write(path), pixels.geterror()
    return Texture(path=path, color_space="raw", channels="rgb", prim=f"/texture_{number}")


def textured(texture: Texture) -> Material:
    return replace(material(0.5), diffuse_color=texture)


def pool_of(device: Device) -> TexturePool:
    return TexturePool.of(device, make_scene(quad((0, 0, 0), (1, 0, 0), (0, 1, 0)), materials=(material(0.5),)))


@pytest.mark.parametrize("grows", [False, True])
def test_texels_are_those_of_the_files(device: Device, tmp_path: Path, grows: bool) -> None:
    """In one go, or with each material a new table that shares what is there."""
    textures = [written(tmp_path, i, size) for i, size in enumerate(SIZES)]
    pool, materials = pool_of(device), [textured(t) for t in textures]
    tables = [MaterialTable.of(pool, materials[: i + 1]) for i in (range(3) if grows else (2,))]
    for table in tables:
        assert not table.on_host.any()
        shapes, texels = (device.download(x) for x in table.pool[:2])
        assert len(shapes) == len(table.materials)
        for number, (first, width, height) in enumerate(shapes):
            assert (height, width) == SIZES[number]
            found = texels[first : first + height * width].reshape(height, width, 4)
            np.testing.assert_allclose(found[..., :3], codes(number, height, width) / 255, rtol=1e-6)
            np.testing.assert_array_equal(found[..., 3], 1)


def test_a_file_that_cannot_be_read_leaves_the_others_as_they_are(device: Device, tmp_path: Path) -> None:
    good, bad = written(tmp_path, 0, SIZES[0]), written(tmp_path, 1, SIZES[1])
    Path(bad.path).write_bytes(Path(bad.path).read_bytes()[:200])
    pool = pool_of(device)
    table = MaterialTable.of(pool, [textured(bad), textured(good)])
    shapes, texels = (device.download(x) for x in table.pool[:2])
    assert shapes.tolist() == [[0, SIZES[0][1], SIZES[0][0]]]
    np.testing.assert_allclose(texels[: 70 * 200, :3], codes(0, *SIZES[0]).reshape(-1, 3) / 255, rtol=1e-6)


def test_the_host_keeps_no_texels(device: Device, tmp_path: Path) -> None:
    size = (1024, 2048)
    texture, pool = written(tmp_path, 0, size), pool_of(device)
    tracemalloc.start()
    try:
        MaterialTable.of(pool, [textured(texture)])
        now, most = tracemalloc.get_traced_memory()
    finally:
        tracemalloc.stop()
    decoded = TEXEL * size[0] * size[1]
    assert now < 0.3 * decoded and most < 0.6 * decoded  # its 8 bit codes are three sixteenths
