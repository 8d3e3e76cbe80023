"""Baked textures: the original plus the change where it was painted, the original elsewhere."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import OpenImageIO as oiio
import pytest
from kit.scene_records import make_mesh, make_scene
from numpy.testing import assert_allclose, assert_array_equal
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter

from usdslf.color import USD_DEFAULT_SPACE, Color, color_of
from usdslf.edits.baked_texture import Baked, bake_texture, plain_texture
from usdslf.errors import AuthorError
from usdslf.scene.records import Material, Scene, Texture
from usdslf.textures.images import load_texture, sample_texture, write_image
from usdslf.textures.rasterize import texel_points

LEFT = np.array([[0, 0], [0.45, 0], [0.45, 1], [0, 1]])  # st of the corners of a square
RIGHT = LEFT + np.array([0.55, 0])


def squares(*charts: NDArray, material: Material) -> Scene:
    """A row of unit squares of two triangles each, of one mesh; charts (4, 2) are their st."""
    positions = np.concatenate([np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]]) + np.array([2 * i, 0, 0])
                                for i in range(len(charts))]).astype(np.float32)  # fmt: skip
    triangles = np.concatenate([np.array([[0, 1, 2], [0, 2, 3]]) + 4 * i for i in range(len(charts))])
    st = {"st": np.concatenate(charts)[triangles].astype(np.float32)}
    return make_scene(replace(make_mesh(positions, triangles, path="/row"), uvs=st), materials=[material])


def texture_of(path: Path, **more: Any) -> Texture:
    return Texture("/mtl/map", str(path), **({"color_space": "raw"} | more))


def random_image(path: Path, height: int = 70, width: int = 90, channels: int = 3) -> NDArray:
    pixels = np.random.default_rng(3).uniform(0.2, 0.6, (height, width, channels)).astype(np.float16)
    write_image(path, pixels)
    return pixels


def read(path: str) -> NDArray:
    pixels = oiio.ImageInput.open(path).read_image(0, 0, 0, 4, oiio.HALF)
    return np.asarray(pixels)


def constant_delta(*value: float) -> Any:
    return lambda triangle, barycentric: np.tile(value, (len(triangle), 1))


def bake(scene: Scene, texture: Texture, faces: list[int], delta: Any, folder: Path, **more: Any) -> Baked:
    triangles = np.flatnonzero(np.isin(scene.triangles.face, faces))
    color = color_of(scene.ocio, scene.working_space)
    return bake_texture(scene, texture, triangles, delta, folder / "map", color, **more)


# ---- texels and the points they lie on -----------------------------------------------------------------
@pytest.mark.parametrize(("height", "width"), [(1, 1), (7, 13), (64, 64), (65, 130)])
def test_a_square_covers_each_texel_once_and_says_where(height: int, width: int) -> None:
    uv = np.array([[[0, 0], [1, 0], [1, 1]], [[0, 0], [1, 1], [0, 1]]], float)
    count = np.zeros((height, width), int)
    for p in texel_points(uv, width, height, "clamp", "clamp"):
        np.add.at(count, (p.y, p.x), 1)
        u, v = p.barycentric.T[..., None]
        st = uv[p.triangle, 0] * (1 - u - v) + uv[p.triangle, 1] * u + uv[p.triangle, 2] * v
        assert_allclose(st, np.stack([(p.x + 0.5) / width, 1 - (p.y + 0.5) / height], -1), atol=1e-12)
    assert (count == 1).all()


@pytest.mark.parametrize(("wrap", "expected"), [("clamp", [0, 0, 0, 1]), ("repeat", [1, 1, 0, 1]),
                                                ("mirror", [0, 0, 1, 2])])  # fmt: skip
def test_texels_outside_of_the_image_follow_its_wrap(wrap: str, expected: list[int]) -> None:
    corners = np.array([[0.75, 0], [1.5, 0], [1.5, 1], [0.75, 1]])
    uv = corners[[[0, 1, 2], [0, 2, 3]]]
    count = np.zeros(4, int)
    for p in texel_points(uv, 4, 1, wrap, wrap):
        np.add.at(count, p.x, 1)
    assert count.tolist() == expected


def test_the_area_of_small_triangles_is_kept() -> None:
    """Triangles of any size and place take as many texels as their area, on the whole."""
    uv = np.random.default_rng(1).uniform(0.1, 0.9, (400, 1, 2))
    uv = uv + np.random.default_rng(2).uniform(-0.03, 0.03, (400, 3, 2))
    e1, e2 = uv[:, 1] - uv[:, 0], uv[:, 2] - uv[:, 0]
    area = np.abs(e1[:, 0] * e2[:, 1] - e1[:, 1] * e2[:, 0]).sum() / 2 * 500 * 300
    assert sum(len(p.x) for p in texel_points(uv, 500, 300, "clamp", "clamp")) == pytest.approx(
        area, rel=0.02
    )


# ---- what is baked ----------------------------------------------------------------------------------------
def test_painted_texels_get_the_change_and_the_others_are_the_original(tmp_path: Path) -> None:
    original = random_image(tmp_path / "a.exr")
    texture = texture_of(tmp_path / "a.exr")
    scene = squares(LEFT, RIGHT, material=Material("/mtl", diffuse_color=texture))
    baked = bake(scene, texture, [0], constant_delta(0.25, 0, -0.125), tmp_path / "out")
    got = read(baked.file)
    s = (np.arange(90) + 0.5) / 90
    painted, other = s < 0.45, s >= 0.55
    assert_array_equal(got[:, other], original[:, other])
    assert_array_equal(got[..., 1], original[..., 1])
    change = got[:, painted].astype(np.float32) - original[:, painted]
    assert_allclose(change, np.broadcast_to([0.25, 0, -0.125], change.shape), atol=5e-4)
    # The gap between the charts is the rim of the painted one, 8 texels of it.
    rim = (got != original).any((0, 2)) & ~painted
    assert rim.sum() == 8 and not rim[other].any()
    assert_allclose(baked.after, np.add(baked.before, [0.25, 0, -0.125]), atol=1e-3)
    assert_allclose(baked.before, original[:, painted].astype(float).mean((0, 1)), rtol=1e-3)
    assert baked.texels == painted.sum() * 70
    assert (baked.wrap_s, baked.uv_set, baked.color_space) == ("repeat", "st", "raw")


def test_files_are_tiled_mip_mapped_and_named_by_content(tmp_path: Path) -> None:
    random_image(tmp_path / "a.exr")
    texture = texture_of(tmp_path / "a.exr")
    scene = squares(LEFT, material=Material("/mtl", diffuse_color=texture))
    one, again, other = (
        bake(scene, texture, [0], constant_delta(x, 0, 0), tmp_path / name)
        for x, name in ((0.1, "one"), (0.1, "two"), (0.2, "one"))
    )
    assert Path(one.file).name == Path(again.file).name != Path(other.file).name
    assert Path(one.file).read_bytes() == Path(again.file).read_bytes()
    image = oiio.ImageInput.open(one.file)
    spec = image.spec()
    assert (str(spec.format), spec.tile_width, spec.tile_height) == ("half", 64, 64)
    assert (spec.width, spec.height, spec.nchannels) == (90, 70, 3)
    assert spec.get_string_attribute("wrapmodes") == "periodic,periodic"
    assert image.seek_subimage(0, 6) and image.spec().width == 1
    assert sorted(p.name for p in (tmp_path / "one").iterdir()) == sorted(
        Path(b.file).name for b in (one, other)
    )


@pytest.mark.parametrize("channel", ["r", "g", "b", "a"])
def test_a_packed_map_changes_in_its_channel_only(tmp_path: Path, channel: str) -> None:
    original = random_image(tmp_path / "a.exr", channels=4)
    texture = texture_of(tmp_path / "a.exr", channels=channel)
    scene = squares(LEFT, material=Material("/mtl", roughness=texture))
    got = read(bake(scene, texture, [0], constant_delta(0.25), tmp_path).file)
    changed = (got != original).any((0, 1))
    assert [c for c, x in zip("rgba", changed) if x] == [channel]


def test_scale_and_bias_of_the_node_stay_and_the_value_changes(tmp_path: Path) -> None:
    random_image(tmp_path / "a.exr")
    texture = texture_of(tmp_path / "a.exr", scale=(0.5, 0.5, 0.5, 1), bias=(0.1, 0.1, 0.1, 0))
    scene = squares(LEFT, material=Material("/mtl", diffuse_color=texture))
    baked = bake(scene, texture, [0], constant_delta(0.1, 0.1, 0.1), tmp_path)
    st = np.random.default_rng(0).uniform(0.1, 0.4, (50, 2))
    new = texture_of(Path(baked.file), scale=texture.scale, bias=texture.bias)
    color = Color(None, USD_DEFAULT_SPACE)
    assert_allclose(sample_texture(new, st, color)[:, :3], sample_texture(texture, st, color)[:, :3] + 0.1, atol=1e-3)
    with pytest.raises(AuthorError, match="scales its texels by zero"):
        bake(
            scene, texture_of(tmp_path / "a.exr", scale=(0, 1, 1, 1)), [0], constant_delta(0, 0, 0), tmp_path
        )


def test_a_tiled_set_is_baked_as_one(tmp_path: Path) -> None:
    originals = {}
    for tile, seed in ((1001, 0), (1012, 1)):
        pixels = np.random.default_rng(seed).uniform(0.2, 0.6, (32, 48, 3)).astype(np.float16)
        write_image(tmp_path / f"a.{tile}.exr", pixels)
        originals[tile] = pixels
    tiles = tuple((t, str(tmp_path / f"a.{t}.exr")) for t in originals)
    texture = texture_of(tmp_path / "a.<UDIM>.exr", tiles=tiles)
    scene = squares(LEFT, RIGHT + np.array([1, 1]), material=Material("/mtl", diffuse_color=texture))
    baked = bake(scene, texture, [1], constant_delta(0.25, 0.25, 0.25), tmp_path / "out")
    assert Path(baked.file).name.endswith(".<UDIM>.exr")
    assert_array_equal(read(baked.file.replace("<UDIM>", "1001")), originals[1001])
    got = read(baked.file.replace("<UDIM>", "1012"))
    assert_allclose(got[:, 28:].astype(float) - originals[1012][:, 28:], 0.25, atol=5e-4)
    assert_array_equal(got[:, :17], originals[1012][:, :17])


def test_an_input_without_a_texture_gets_one(tmp_path: Path) -> None:
    scene = squares(LEFT, RIGHT, material=Material("/mtl"))
    texture = plain_texture((0.5, 0.25, 0.125))
    baked = bake(scene, texture, [0], constant_delta(0.25, 0, 0), tmp_path, size=(40, 20))
    got = read(baked.file)
    assert got.shape == (20, 40, 3)
    assert_array_equal(got[3, 3], np.float16([0.75, 0.25, 0.125]))
    assert_array_equal(got[3, 30], np.float16([0.5, 0.25, 0.125]))


def test_texels_of_two_places_and_no_texels_are_said(tmp_path: Path) -> None:
    random_image(tmp_path / "a.exr")
    texture = texture_of(tmp_path / "a.exr")
    scene = squares(LEFT, LEFT, RIGHT + np.array([0, 3]), material=Material("/mtl", diffuse_color=texture))
    for faces, said in (([0, 1], "several painted places"), ([0], "show elsewhere")):
        warnings: list[str] = []
        bake(scene, texture, faces, constant_delta(0.1, 0, 0), tmp_path, warnings=warnings)
        assert len(warnings) == 1 and said in warnings[0].replace("also show", "show")
    outside = texture_of(tmp_path / "a.exr", wrap_s="clamp", wrap_t="clamp")
    with pytest.raises(AuthorError, match="nothing that was painted"):
        bake(scene, outside, [2], constant_delta(0, 0, 0), tmp_path / "none")
    assert not list((tmp_path / "none").iterdir())


def test_the_detail_of_a_real_texture_is_kept(assets: Path, tmp_path: Path) -> None:
    """Where the change is smooth, what is finer than it is that of the original."""
    file = assets / "dutch_ship_polyhaven/textures/dutch_ship_medium_hull_diff_1k.jpg"
    texture = texture_of(file, color_space="sRGB")
    whole = np.array([[0, 0], [1, 0], [1, 1], [0, 1]], float)
    scene = squares(whole, material=Material("/mtl", diffuse_color=texture))

    def smooth(triangle: NDArray, barycentric: NDArray) -> NDArray:
        return np.repeat(0.1 * np.sin(6 * barycentric[:, :1]), 3, 1)

    baked = bake(scene, texture, [0], smooth, tmp_path)
    assert baked.color_space == "lin_rec709_scene"
    y, x = np.indices((1024, 1024)).reshape(2, -1)
    before = load_texture(texture, Color(None, USD_DEFAULT_SPACE))[0].at(y, x)[:, 1].reshape(1024, 1024)
    after = read(baked.file)[..., 1].astype(np.float32)
    assert np.abs(after - before).max() > 0.09
    fine = [image - gaussian_filter(image, 3) for image in (before, after)]
    assert np.corrcoef(fine[0].ravel(), fine[1].ravel())[0, 1] > 0.99
