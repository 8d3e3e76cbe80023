"""Domes: orientation, energy under any filter, densities."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from reference import lights as ref

from usdslf.color import USD_DEFAULT_SPACE
from usdslf.lights import dome as dome_module
from usdslf.lights.dome import Dome, square_of, table_index
from usdslf.sampling.hemisphere import SOLID_ANGLE, D, bin_directions
from usdslf.scene.records import Light, LightTexture
from usdslf.textures.images import write_image

SPHERE, EACH = ref.fibonacci_cone(200_000)


def rotation(seed: int) -> np.ndarray:
    q, _ = np.linalg.qr(np.random.default_rng(seed).normal(size=(3, 3)))
    return q * np.sign(np.linalg.det(q))


def dome_of(
    pixels: np.ndarray | None, linear: np.ndarray | None = None, radiance: tuple = (1.0, 1.0, 1.0)
) -> Dome:
    m = np.eye(4)
    m[:3, :3] = np.eye(3) if linear is None else linear
    m[:3, 3] = (5, -3, 2)  # a dome is infinitely far: its place does not matter
    return Dome(Light("/sky", "dome", radiance, m), pixels)


def noise_picture(height: int = 16, seed: int = 0) -> np.ndarray:
    return np.random.default_rng(seed).random((height, 2 * height, 3)).astype(np.float32)


def total(dome: Dome, solid_angle: float | None = None) -> np.ndarray:
    return dome.radiance(SPHERE, solid_angle).astype(float).sum(0) * EACH


def test_the_picture_is_oriented_as_usdlux_says() -> None:
    height, width = 32, 64
    row, column = np.indices((height, width))
    picture = np.stack([row, column, 0 * row], -1).astype(float)
    dome = dome_of(picture)
    for direction, at_row, at_column in (
        ((0, 1, 0), 0, None),  # latitude +90: row 0
        ((0, -1, 0), height - 1, None),
        ((0, 0, 1), None, width / 2 - 0.5),  # longitude 0: the middle
        ((1, 0, 0), None, width / 4 - 0.5),  # longitude +90: left of it, as column 0 is +180
        ((-1, 0, 0), None, 3 * width / 4 - 0.5),
    ):
        r = dome.radiance(np.array([direction], float))[0]
        if at_row is not None:
            assert r[0] == pytest.approx(at_row, abs=1e-3), direction
        else:
            assert r[0] == pytest.approx(height / 2 - 0.5, abs=1e-3), direction
            assert r[1] == pytest.approx(at_column, abs=1e-3), direction


@pytest.mark.parametrize(
    "linear", [np.eye(3), rotation(3), 4 * rotation(3), rotation(3) @ np.diag([-1, 1, 1])]
)
def test_every_pixel_is_met_in_its_direction(linear: np.ndarray) -> None:
    picture = noise_picture(8)
    dome = dome_of(picture, linear, (2.0, 1.0, 0.5))
    for row in range(8):
        for column in range(16):
            local = ref.latlong_direction(row + 0.5, column + 0.5, 8, 16)
            world = linear @ local / np.linalg.norm(linear @ local)
            np.testing.assert_allclose(
                dome.radiance(world[None])[0], picture[row, column] * [2, 1, 0.5], rtol=1e-4
            )


def test_between_pixels_radiance_is_bilinear_and_goes_round_the_seam() -> None:
    picture = noise_picture(8)
    dome = dome_of(picture)
    across = dome.radiance(ref.latlong_direction(3.5, 0.0, 8, 16)[None])[0]  # longitude +180 = -180
    np.testing.assert_allclose(across, (picture[3, 0] + picture[3, 15]) / 2, rtol=1e-4)
    down = dome.radiance(ref.latlong_direction(4.0, 5.5, 8, 16)[None])[0]
    np.testing.assert_allclose(down, (picture[3, 5] + picture[4, 5]) / 2, rtol=1e-4)


@pytest.mark.parametrize("solid_angle", [1e-3, SOLID_ANGLE, 0.05, 0.5, 6.0])
def test_a_filter_keeps_energy_and_constants(solid_angle: float) -> None:
    noisy = dome_of(noise_picture(64), rotation(1))
    np.testing.assert_allclose(total(noisy, solid_angle), total(noisy), rtol=4e-3)
    flat = dome_of(np.full((32, 64, 3), 0.7))
    np.testing.assert_allclose(flat.radiance(SPHERE[::100], solid_angle), 0.7, rtol=2e-3)


@pytest.mark.parametrize("row", [0, 1, 20, 63, 127])
def test_a_filter_keeps_the_energy_of_a_sun_of_one_pixel(row: int) -> None:
    picture = np.zeros((128, 256, 3), np.float32)
    picture[row, 77] = 1e6
    dome = dome_of(picture, rotation(row))
    fine = dome_of(picture)  # its energy by a lattice in its pixel and the pixels around
    t = (np.arange(40) + 0.5) / 40
    rows, columns = (
        (np.array([row - 1, row, row + 1])[:, None] + t).ravel(),
        (np.array([76, 77, 78])[:, None] + t).ravel(),
    )
    rows = rows[(rows > 0) & (rows < 128)]
    weight = np.sin(np.pi * rows / 128) * (np.pi / 128 / 40) * (2 * np.pi / 256 / 40)
    local = ref.latlong_direction(*np.meshgrid(rows, columns, indexing="ij"), 128, 256).reshape(-1, 3)
    exact = (fine.radiance(local)[:, 0].reshape(len(rows), -1).sum(1) * weight).sum()
    for solid_angle in (0.003, SOLID_ANGLE, 0.1):
        # Near a pole, where pixels are needles, bilinear reading of their centres costs a little.
        assert total(dome, solid_angle)[0] == pytest.approx(exact, rel=0.01 if 1 < row < 126 else 0.3)


def test_bins_of_any_hemisphere_catch_a_small_sun() -> None:
    """Both hemispheres of random frames: every sun is in one of them, whatever bin or border it falls on."""
    both = np.concatenate([bin_directions(), -bin_directions()])
    caught = []
    for seed in range(60):
        picture = np.zeros((128, 256, 3), np.float32)
        at = np.random.default_rng(seed)
        picture[at.integers(8, 120), at.integers(0, 256)] = 1e6
        dome = dome_of(picture)
        energy = dome.radiance(both @ rotation(seed).T, SOLID_ANGLE)[:, 0].astype(float).sum() * SOLID_ANGLE
        even = SPHERE[::10]
        sent = dome.radiance(even, SOLID_ANGLE)[:, 0].astype(float).mean() * 4 * np.pi
        caught.append(energy / sent)
    assert np.mean(caught) == pytest.approx(1, abs=0.02)
    assert np.std(caught) < 0.08


def test_irradiance_of_a_gradient_is_its_closed_form() -> None:
    slope = np.array([0.3, 0.5, -0.4])
    rows, columns = np.indices((64, 128)).reshape(2, -1) + 0.5
    local = ref.latlong_direction(rows, columns, 64, 128)
    turned = rotation(4)
    dome = dome_of(np.repeat((1 + local @ slope).reshape(64, 128, 1), 3, 2), turned)
    for normal in rotation(6):
        s = np.cross(normal, [0.1, 0.2, 0.97])
        s /= np.linalg.norm(s)
        world = bin_directions() @ np.array([s, np.cross(normal, s), normal])
        for solid_angle in (None, SOLID_ANGLE):
            e = (dome.radiance(world, solid_angle)[:, 0] * bin_directions()[:, 2]).sum() * SOLID_ANGLE
            assert e == pytest.approx(ref.gradient_irradiance(turned @ slope, normal), rel=5e-3)


def test_the_table_holds_the_filtered_radiance_of_all_directions() -> None:
    dome = dome_of(noise_picture(64), rotation(2))
    world = SPHERE[::97]
    local = world @ dome.world_from_light * np.random.default_rng(0).uniform(0.5, 2, (len(world), 1))
    read = dome.table(SOLID_ANGLE)[table_index(*local.T.astype(np.float32))]
    direct = dome.radiance(world, SOLID_ANGLE)
    assert np.abs(read - direct).max() < 0.2 * direct.std()
    assert len(dome.table(SOLID_ANGLE)) == 512**2 and table_index(*np.eye(3)).max() < 512**2


def test_the_square_has_equal_areas() -> None:
    at = square_of(SPHERE)
    count, _, _ = np.histogram2d(*at.T, bins=16, range=((0, 1), (0, 1)))
    np.testing.assert_allclose(count, len(SPHERE) / 256, rtol=0.05)


# ── drawing ──────────────────────────────────────────────────────────────────────────────────────


def density(dome: Dome, directions: np.ndarray) -> np.ndarray:
    """The density (n,) [1/sr] of world directions (n, 3), by the table that all who draw from it share."""
    rows, columns, values = dome.density_table()
    local = directions.astype(float) @ dome.world_from_light
    y = (0.5 - np.arcsin(np.clip(local[:, 1], -1, 1)) / np.pi) * len(rows)
    x = (0.5 - np.arctan2(local[:, 0], local[:, 2]) / (2 * np.pi)) * len(columns)
    at = (np.clip(v.astype(int), 0, n - 1) for v, n in ((y, len(rows)), (x, len(columns))))
    return values[rows[next(at)], columns[next(at)]]


def sun_and_sky() -> np.ndarray:
    picture = 0.2 * noise_picture(64)
    picture[12, 30] = (5e3, 4e3, 2e3)
    return picture


@pytest.mark.parametrize("picture", [None, noise_picture(4), sun_and_sky(), np.zeros((4, 8, 3))])
def test_directions_follow_their_density(picture: np.ndarray | None) -> None:
    dome = dome_of(picture, rotation(5))
    # The density is constant in each pixel: a lattice of 4 x 4 places in the finest picture's is exact.
    rows = 256
    places = (np.arange(n) + 0.5 for n in (rows, 2 * rows))
    local = ref.latlong_direction(*np.meshgrid(*places, indexing="ij"), rows, 2 * rows).reshape(-1, 3)
    solid = np.repeat(-np.diff(np.sin(np.pi * (0.5 - np.arange(rows + 1) / rows))) * np.pi / rows, 2 * rows)
    assert density(dome, local @ rotation(5).T).astype(float) @ solid == pytest.approx(1, abs=1e-5)
    direction, radiance, pdf = dome.sample(np.random.default_rng(1).random((40_000, 2)))
    np.testing.assert_allclose(np.linalg.norm(direction, axis=1), 1, rtol=1e-5)
    np.testing.assert_allclose(radiance, dome.radiance(direction), rtol=1e-5)
    assert (pdf > 0).all() and (np.abs(density(dome, direction) / pdf - 1) > 1e-3).mean() < 1e-3
    assert (1 / pdf).mean() == pytest.approx(4 * np.pi, rel=0.03 if picture is not None else 1e-5)
    np.testing.assert_allclose((radiance / pdf[:, None]).mean(0), total(dome), rtol=0.02)
    axis = rotation(9)[0]
    edges = np.linspace(-1, 1, 9)
    expected, _ = np.histogram(
        local @ rotation(5).T @ axis, edges, weights=density(dome, local @ rotation(5).T) * solid
    )
    counts, _ = np.histogram(direction @ axis, edges)
    np.testing.assert_allclose(counts / 40_000, expected, atol=0.02)


def test_more_pixels_than_table_cells_are_drawn_without_bias() -> None:
    picture = np.random.default_rng(0).random((600, 1300, 3)).astype(np.float32)
    picture[401:404, 700] = 3e4
    dome = dome_of(picture)
    direction, radiance, pdf = dome.sample(np.random.default_rng(1).random((200_000, 2)))
    lit = (radiance / pdf[:, None]).mean(0)
    np.testing.assert_allclose(lit, dome.radiance(SPHERE, 0.02).astype(float).sum(0) * EACH, rtol=0.03)
    assert (np.abs(density(dome, direction) / pdf - 1) > 1e-3).mean() < 2e-3


def test_every_direction_that_shines_can_be_drawn() -> None:
    """Bilinear reading carries light into black neighbours."""
    picture = np.zeros((16, 32, 3), np.float32)
    picture[5, 8] = 1
    dome = dome_of(picture)
    shines = dome.radiance(SPHERE).any(1)
    assert shines.any() and (density(dome, SPHERE[shines]) > 0).all()


# ── peaks ────────────────────────────────────────────────────────────────────────────────────────


def test_peaks_and_the_rest_are_the_dome() -> None:
    dome = dome_of(sun_and_sky(), rotation(7), (1.0, 2.0, 1.0))
    rest, peaks = dome.without_peaks()
    assert peaks is not None
    direction, radiance, pdf = peaks.sample(np.random.default_rng(0).random((5000, 2)))
    energy = (radiance / pdf[:, None]).mean(0)
    np.testing.assert_allclose(energy, peaks.irradiance, rtol=0.02)
    np.testing.assert_allclose(energy + total(rest), total(dome), rtol=0.01)
    towards = rotation(7) @ ref.latlong_direction(12.5, 30.5, 64, 128)
    assert (direction @ towards).min() > np.cos(np.radians(7))
    assert rest.pixels.max() < 0.1 * dome.pixels.max()
    # One colour, even cells: every sample says the same.
    luminous = (radiance / pdf[:, None]) @ [0.2126, 0.7152, 0.0722]
    assert luminous.std() < 1e-3 * luminous.mean()


def test_even_skies_have_no_peaks() -> None:
    for picture in (None, noise_picture(16), np.zeros((8, 16, 3)), np.full((8, 16, 3), 1e4)):
        dome = dome_of(picture)
        rest, peaks = dome.without_peaks()
        assert peaks is None and rest is dome


# ── input ────────────────────────────────────────────────────────────────────────────────────────


def test_a_dome_loads_its_texture(tmp_path: Path) -> None:
    path = write_image(tmp_path / "sky.exr", noise_picture(8), half=False)
    picture = LightTexture(str(path), "automatic", "auto", "", USD_DEFAULT_SPACE)
    light = Light("/sky", "dome", (2.0, 2.0, 2.0), np.eye(4), texture=picture)
    world = ref.latlong_direction(2.5, 3.5, 8, 16)[None]
    np.testing.assert_allclose(
        Dome.from_light(light).radiance(world)[0], 2 * noise_picture(8)[2, 3], rtol=2e-3
    )
    np.testing.assert_allclose(Dome.from_light(replace(light, texture=None)).radiance(world), [[2, 2, 2]])


def test_broken_pixels_are_black_and_constants_are_exact() -> None:
    picture = noise_picture(8)
    picture[0, 0], picture[1, 1], picture[2, 2] = np.nan, np.inf, -1
    dome = dome_of(picture)
    assert np.isfinite(dome.radiance(SPHERE[::50], SOLID_ANGLE)).all() and dome.pixels.min() == 0
    np.testing.assert_array_equal(dome_of(None).radiance(SPHERE[:9], SOLID_ANGLE), np.ones((9, 3)))
    assert dome_of(None).radiance(np.zeros((0, 3))).shape == (0, 3)
    assert len(bin_directions()) == D


@pytest.mark.parametrize("shape", [(96, 192), (90, 180), (64, 128), (97, 193)])
def test_blocks_of_a_large_picture_hold_its_light(shape: tuple[int, int]) -> None:
    pixels = np.random.default_rng(3).random((*shape, 3)).astype(np.float32) ** 4
    small = dome_module.reduced(pixels, 16)
    assert 16 <= len(small) <= len(pixels) and small.shape[1] == small.shape[0] * shape[1] / shape[0]

    def flux(picture: np.ndarray) -> np.ndarray:
        edge = np.sin(np.pi * (0.5 - np.arange(len(picture) + 1) / len(picture)))
        return (picture.mean(1) * -np.diff(edge)[:, None]).sum(0) * 2 * np.pi

    np.testing.assert_allclose(flux(small), flux(pixels), rtol=2e-4)


def test_the_filtered_map_of_a_large_picture_is_that_of_all_its_pixels(monkeypatch: pytest.MonkeyPatch) -> None:
    pixels = noise_picture(256)
    directions = np.random.default_rng(1).normal(size=(400, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    light = Light("/sky", "dome", (1.0, 1.0, 1.0), np.eye(4))
    full = Dome(light, pixels).radiance(directions, 2 * np.pi / 16)
    monkeypatch.setattr(dome_module, "BIN_ROWS", 64)
    assert len(dome_module.reduced(pixels, 64)) == 64
    np.testing.assert_allclose(Dome(light, pixels).radiance(directions, 2 * np.pi / 16), full, rtol=0.01)
