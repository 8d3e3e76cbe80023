"""Textures and pictures against texels computed by hand."""

from __future__ import annotations

import os
import zipfile
from dataclasses import replace
from pathlib import Path

import numpy as np
import OpenImageIO as oiio
import pytest

from usdslf.color import USD_DEFAULT_SPACE, color_of
from usdslf.errors import InputError
from usdslf.scene.records import Texture
from usdslf.textures import images
from usdslf.textures.images import latlong_directions, load_latlong, read_image, sample_texture, write_image

COLOR = color_of(None, USD_DEFAULT_SPACE)

# As seen: upper row A B, lower row C D; values are exact in half floats.
A, B, C, D = (0.25, 0, 0), (0, 0.5, 0), (0, 0, 0.75), (1.0, 1.0, 1.0)


def save(path: Path, pixels: np.ndarray, format: str = "uint8") -> str:
    """Writes pixels as they are, in a file format that the tested code does not write itself."""
    pixels = np.atleast_3d(pixels)
    spec = oiio.ImageSpec(pixels.shape[1], pixels.shape[0], pixels.shape[2], format)
    spec.attribute("oiio:UnassociatedAlpha", 1)
    if format == "uint16":
        spec.attribute("oiio:ColorSpace", "lin_rec709_scene")
    out = oiio.ImageOutput.create(str(path))
    assert out.open(str(path), spec)
    assert out.write_image(pixels)
    out.close()
    return str(path)


@pytest.fixture
def four(tmp_path: Path) -> Texture:
    path = save(tmp_path / "four.exr", np.array([[A, B], [C, D]], np.float32), "float")
    return Texture(prim="/tex", path=path, color_space="raw", wrap_s="clamp", wrap_t="clamp")


def rgb(texture: Texture, *st: tuple[float, float]) -> np.ndarray:
    return sample_texture(texture, np.array(st), COLOR)[:, :3]


def test_st_0_0_is_the_lower_left_corner(four: Texture) -> None:
    found = rgb(four, (0, 0), (1, 0), (0, 1), (1, 1))
    assert found == pytest.approx(np.array([C, D, A, B]))


def test_texel_centres_give_texels_and_between_is_linear(four: Texture) -> None:
    found = rgb(four, (0.25, 0.25), (0.75, 0.75), (0.5, 0.25), (0.5, 0.5))
    middle = np.mean([A, B, C, D], 0)
    assert found == pytest.approx(np.array([C, B, np.mean([C, D], 0), middle]))


@pytest.mark.parametrize(
    ("wrap", "at_minus_quarter", "at_one_and_three_quarters", "at_0"),
    [
        ("clamp", C, D, C),
        ("repeat", D, D, tuple(np.mean([C, D], 0))),
        ("mirror", C, C, C),
        ("black", (0, 0, 0), (0, 0, 0), C),
    ],
)
def test_wrap_modes(
    four: Texture, wrap: str, at_minus_quarter: tuple, at_one_and_three_quarters: tuple, at_0: tuple
) -> None:
    found = rgb(replace(four, wrap_s=wrap), (-0.25, 0.25), (1.75, 0.25), (0, 0.25))
    assert found == pytest.approx(np.array([at_minus_quarter, at_one_and_three_quarters, at_0]))


def test_wrap_t_is_independent_of_wrap_s(four: Texture) -> None:
    found = rgb(replace(four, wrap_s="repeat", wrap_t="black"), (1.25, 0.25), (0.25, 1.25))
    assert found == pytest.approx(np.array([C, (0, 0, 0)]))


def test_scale_and_bias_apply_to_texels_but_not_to_the_fallback(four: Texture) -> None:
    scaled = replace(four, scale=(2, 2, 2, 1), bias=(-1, -1, -1, 0), fallback=(0.1, 0.2, 0.3, 0.4))
    assert rgb(scaled, (0.25, 0.25))[0] == pytest.approx([-1, -1, 0.5])
    missing = replace(scaled, path=four.path + ".none")
    assert sample_texture(missing, [[0.5, 0.5]], COLOR)[0] == pytest.approx([0.1, 0.2, 0.3, 0.4])
    assert sample_texture(scaled, [[np.nan, 0.5]], COLOR)[0] == pytest.approx([0.1, 0.2, 0.3, 0.4])


def test_8_bit_colour_is_srgb_and_its_alpha_linear(tmp_path: Path) -> None:
    path = save(tmp_path / "c.png", np.full((2, 2, 4), (188, 100, 20, 51), np.uint8))
    expected = [*(((np.array([188, 100, 20]) / 255 + 0.055) / 1.055) ** 2.4), 0.2]
    for space in ("auto", "sRGB"):
        found = sample_texture(Texture("/t", path, color_space=space), [[0.5, 0.5]], COLOR)[0]
        assert found == pytest.approx(expected, abs=1e-6)
    raw = sample_texture(Texture("/t", path, color_space="raw"), [[0.5, 0.5]], COLOR)[0]
    assert raw == pytest.approx(np.array([188, 100, 20, 51]) / 255)


def test_srgb_is_decoded_before_it_is_interpolated(tmp_path: Path) -> None:
    path = save(tmp_path / "bw.png", np.array([[[0, 0, 0], [255, 255, 255]]], np.uint8))
    assert rgb(Texture("/t", path), (0.5, 0.5))[0] == pytest.approx(0.5)


def test_one_and_two_channels_are_grey_and_data(tmp_path: Path) -> None:
    grey = save(tmp_path / "g.png", np.full((2, 2, 1), 128, np.uint8))
    assert sample_texture(Texture("/t", grey), [[0.5, 0.5]], COLOR)[0] == pytest.approx([128 / 255] * 3 + [1])
    both = save(tmp_path / "ga.png", np.full((2, 2, 2), (64, 51), np.uint8))
    assert sample_texture(Texture("/t", both), [[0.5, 0.5]], COLOR)[0] == pytest.approx([64 / 255] * 3 + [0.2])


@pytest.mark.parametrize("format", ["uint16", "half", "float"])
def test_deeper_pixels_are_linear(tmp_path: Path, format: str) -> None:
    suffix = "png" if format == "uint16" else "exr"
    path = save(tmp_path / f"d.{suffix}", np.full((2, 2, 3), 0.5, np.float32), format)
    assert rgb(Texture("/t", path), (0.5, 0.5))[0] == pytest.approx(0.5, abs=1e-4)


def test_bright_texels_survive(tmp_path: Path) -> None:
    path = save(tmp_path / "sun.exr", np.full((2, 2, 3), 3e6, np.float32), "float")
    assert rgb(Texture("/t", path), (0.5, 0.5))[0] == pytest.approx(3e6)


def test_udim_tiles_meet_at_whole_numbers(tmp_path: Path) -> None:
    tiles = []
    for tile, value in ((1001, 0.25), (1002, 0.5), (1011, 0.75)):
        pixels = np.full((2, 2, 3), value, np.float32)
        tiles.append((tile, save(tmp_path / f"u.{tile}.exr", pixels, "float")))
    texture = Texture("/t", str(tmp_path / "u.<UDIM>.exr"), tuple(tiles), fallback=(9, 9, 9, 9))
    st = [(0.5, 0.5), (0.99, 0.01), (1.01, 0.5), (0.5, 1.5), (1.5, 1.5), (2.0, 0.5), (-0.5, 0.5), (10.5, 0)]
    expected = [0.25, 0.25, 0.5, 0.75, 9, 0.5, 9, 9]
    assert rgb(texture, *st)[:, 0] == pytest.approx(expected)


def test_a_changed_file_is_read_again(tmp_path: Path) -> None:
    path = tmp_path / "c.exr"
    for value in (0.25, 0.5):
        save(path, np.full((2, 2, 3), value, np.float32), "float")
        os.utime(path, ns=(0, int(value * 1e9)))
        assert rgb(Texture("/t", str(path)), (0.5, 0.5))[0] == pytest.approx(value)


def test_textures_inside_a_package_are_read(tmp_path: Path, four: Texture) -> None:
    package = tmp_path / "shot.usdz"
    with zipfile.ZipFile(package, "w") as archive:
        archive.write(four.path, "maps/four.exr")
    inside = replace(four, path=f"{package}[maps/four.exr]")
    assert rgb(inside, (0, 0))[0] == pytest.approx(C)
    assert images.unreadable(replace(four, path=f"{package}[maps/none.exr]"), COLOR)


def test_unreadable_files_say_why(tmp_path: Path) -> None:
    text = tmp_path / "text.png"
    text.write_text("no picture")
    noise = np.random.default_rng(1).integers(0, 255, (64, 64, 3), np.uint8)
    whole = Path(save(tmp_path / "whole.png", noise)).read_bytes()
    cut = tmp_path / "cut.png"
    cut.write_bytes(whole[: len(whole) // 2])
    for path in (text, cut, tmp_path / "none.png", tmp_path):
        texture = Texture("/t", str(path), fallback=(0.5, 0, 0, 1))
        ((file, why),) = images.unreadable(texture, COLOR)
        assert file == str(path)
        assert why
        assert "\n" not in why
        assert rgb(texture, (0.5, 0.5))[0] == pytest.approx([0.5, 0, 0])


def test_wrap_modes_in_metadata(tmp_path: Path) -> None:
    spec = oiio.ImageSpec(4, 4, 3, "half")
    spec.attribute("wrapmodes", "periodic,clamp")
    out = oiio.ImageOutput.create(str(tmp_path / "w.exr"))
    out.open(str(tmp_path / "w.exr"), spec)
    out.write_image(np.zeros((4, 4, 3), np.float32))
    out.close()
    assert images.wrap_modes(str(tmp_path / "w.exr")) == ("repeat", "clamp")
    assert images.wrap_modes(str(tmp_path / "none.exr")) == ("black", "black")


# ---- environment maps ----------------------------------------------------------------------------
def test_latlong_directions_follow_usdlux() -> None:
    d = latlong_directions(180, 360).reshape(180, 360, 3)
    near = {"abs": 0.02}
    assert d[0, 7] == pytest.approx([0, 1, 0], **near)  # row 0 is the +Y pole
    assert d[90, 180] == pytest.approx([0, 0, 1], **near)  # longitude 0 in the middle
    assert d[90, 90] == pytest.approx([1, 0, 0], **near)  # longitude 90
    assert d[90, 0] == pytest.approx([0, 0, -1], **near)  # longitude 180 on the left edge


def test_latlong_pixels_are_those_of_the_file(tmp_path: Path) -> None:
    pixels = np.random.default_rng(2).random((8, 16, 3)).astype(np.float16).astype(np.float32)
    found = load_latlong(save(tmp_path / "l.exr", pixels, "half"), "automatic", "auto", COLOR)
    np.testing.assert_array_equal(found, pixels)


@pytest.mark.parametrize("format", ["mirroredBall", "angular"])
def test_ball_formats_put_plus_z_in_the_middle_and_plus_x_on_the_right(tmp_path: Path, format: str) -> None:
    y, x = np.indices((256, 256))
    u, v = (x + 0.5) / 128 - 1, 1 - (y + 0.5) / 128
    r = np.hypot(u, v)
    angle = np.pi * r if format == "angular" else 2 * np.arcsin(np.clip(r, 0, 1))
    s = np.sin(angle) / np.maximum(r, 1e-9)
    direction = np.stack([s * u, s * v, np.cos(angle)], -1) * (r <= 1)[..., None]
    path = save(tmp_path / "b.exr", direction.astype(np.float32), "float")
    found = load_latlong(path, format, "auto", COLOR)
    expected = latlong_directions(*found.shape[:2]).reshape(found.shape)
    ahead = expected[..., 2] > -0.9  # the picture's rim holds everything behind
    assert np.abs(found - expected)[ahead].max() < 0.05


def test_vertical_cross_faces_join_without_a_step(tmp_path: Path) -> None:
    cross = np.full((4, 3), -1)
    cross[0, 1], cross[1], cross[2, 1], cross[3, 1] = 0, (1, 2, 3), 4, 5
    path = save(tmp_path / "x.exr", np.repeat(np.kron(cross, np.ones((8, 8)))[..., None], 3, 2), "float")
    found = load_latlong(path, "cubeMapVerticalCross", "auto", COLOR)[..., 0]
    d = latlong_directions(*found.shape)
    face = {(1, 1): 0, (0, -1): 1, (2, 1): 2, (0, 1): 3, (1, -1): 4, (2, -1): 5}
    axis = np.abs(d).argmax(1)
    clear = np.sort(np.abs(d), 1)[:, 2] > 1.3 * np.sort(np.abs(d), 1)[:, 1]
    expected = [face[a, int(np.sign(v[a]))] for a, v in zip(axis, d, strict=True)]
    np.testing.assert_allclose(found.reshape(-1)[clear], np.array(expected)[clear])


def test_a_missing_environment_is_an_error(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"none\.hdr"):
        load_latlong(str(tmp_path / "none.hdr"), "automatic", "auto", COLOR)


# ---- writing -------------------------------------------------------------------------------------
def test_exr_keeps_linear_values_and_names_its_space(tmp_path: Path) -> None:
    pixels = np.random.default_rng(3).random((5, 7, 3)).astype(np.float32) * 50
    path = write_image(tmp_path / "o.exr", pixels, half=False, metadata={"usdslf:frame": 7.0})
    assert read_image(path, "auto", COLOR)[..., :3] == pytest.approx(pixels, rel=1e-3)
    spec = oiio.ImageInput.open(str(path)).spec()
    assert spec.get_string_attribute("colorInteropID") == "lin_rec709_scene"
    assert spec.getattribute("usdslf:frame") == 7.0


def test_png_keeps_codes(tmp_path: Path) -> None:
    codes = np.arange(60).reshape(4, 5, 3)
    path = write_image(tmp_path / "o.png", codes / 255)
    found = read_image(path, "raw", COLOR)[..., :3]
    np.testing.assert_array_equal(np.round(found * 255), codes)


def test_channels_can_be_named(tmp_path: Path) -> None:
    write_image(tmp_path / "o.exr", np.zeros((2, 2, 2)), channels=("depth.Z", "id.Y"))
    assert oiio.ImageInput.open(str(tmp_path / "o.exr")).spec().channelnames == ("depth.Z", "id.Y")


def test_a_failed_write_leaves_the_earlier_file(tmp_path: Path) -> None:
    path = write_image(tmp_path / "o.exr", np.ones((2, 2, 3)))
    before = path.read_bytes()
    for bad in (tmp_path / "none" / "o.exr", tmp_path / "o.jp3"):
        with pytest.raises(InputError, match=bad.name):
            write_image(bad, np.zeros((2, 2, 3)))
    (tmp_path / "folder.exr").mkdir()
    with pytest.raises(InputError, match=r"folder\.exr"):
        write_image(tmp_path / "folder.exr", np.zeros((2, 2, 3)))
    assert path.read_bytes() == before
    assert sorted(p.name for p in tmp_path.iterdir()) == ["folder.exr", "o.exr"]
