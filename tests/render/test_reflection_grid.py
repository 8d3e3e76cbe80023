"""Reflections of something smooth are smooth: the places of samples in their tile do not show as a grid of dots."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from kit.scene_pictures import camera_at, ground, matte, picture
from kit.scene_records import make_scene, quad
from numpy.typing import NDArray
from reference.lights import latlong_direction
from reference.reflectance import ggx, microfacets

from usdslf.color import USD_DEFAULT_SPACE
from usdslf.gpu.device import Device
from usdslf.render.live.noise import BUDGET, Noise, worst_units
from usdslf.render.live.records import G_TILE, MATERIAL, TILE
from usdslf.scene.records import Light, LightTexture, Material, constant
from usdslf.textures.images import write_image

SIZE = (128, 96)
SLOPE = np.array([0.5, 0.3, -0.4])
ROWS = 128  # of the sky's picture


def linear(direction: NDArray) -> NDArray:
    """Radiance (...) that is linear in the direction (..., 3)."""
    return 1 + direction @ SLOPE


def sky(folder: Path, radiance: Callable[[NDArray], NDArray]) -> Light:
    """A dome of radiance (...) by world directions (..., 3)."""
    places = np.meshgrid(np.arange(ROWS) + 0.5, np.arange(2 * ROWS) + 0.5, indexing="ij")
    pixels = np.repeat(radiance(latlong_direction(*places, ROWS, 2 * ROWS))[..., None], 3, 2)
    write_image(folder / "sky.exr", pixels.astype(np.float32), half=False)
    of = LightTexture(str(folder / "sky.exr"), "latlong", "raw", "", USD_DEFAULT_SPACE)
    return Light("/sky", "dome", (1.0,) * 3, np.eye(4), texture=of)


def floor(
    device: Device, light: Light, size: tuple[int, int] = SIZE, samples: int = 16, **inputs: float
) -> tuple[NDArray, NDArray]:
    """Radiance (h, w) of the nearer half of a floor below a sky, and directions (h, w, 3) to the eye."""
    material = Material("", **{k: constant(*(v,) * (3 if k == "diffuse_color" else 1)) for k, v in inputs.items()})
    scene = make_scene(ground(30.0), materials=[material], lights=[light])
    camera = camera_at((0, 1.05, 2.9), (0, 0.35, 0), focal_length=40.0)
    aovs = picture(scene, camera, device, size=size, samples=samples, aovs=("color", "position"))
    part = slice(size[1] // 2, size[1])
    to_eye = camera.world_from_camera[:3, 3] - aovs["position"][part].astype(float)
    return aovs["color"][part].mean(-1).astype(float), to_eye / np.linalg.norm(to_eye, axis=-1, keepdims=True)


def mirrored(to_eye: NDArray, roughness: float) -> float:
    """Radiance of a white metal floor by quadrature over half vectors, float64."""
    alpha = roughness**2
    u, phi = np.meshgrid((np.arange(400) + 0.5) / 400, (np.arange(128) + 0.5) / 128 * 2 * np.pi)
    theta = np.arctan(alpha * np.sqrt(u / (1 - u)))  # as many of them as D cos has
    h = np.stack([np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta)], -1)
    e = np.array([to_eye[0], -to_eye[2], to_eye[1]])  # normal +z
    eh = h @ e
    l = 2 * eh[..., None] * h - e
    density = ggx(alpha, h) * h[..., 2]  # of h
    radiance = linear(np.stack([l[..., 0], l[..., 2], -l[..., 1]], -1))
    each = np.where((eh > 0) & (l[..., 2] > 0), microfacets(alpha, e, l) * l[..., 2] * radiance * 4 * eh / density, 0)
    return float(each.mean())


def grid_and_rest(value: NDArray) -> tuple[float, float]:
    """Returns how strong waves of 4 and 2 pixels are, and the usual wave beside them: rms, of the mean.

    What is smooth is taken off first, as a polynomial.
    """
    h, w = value.shape
    y, x = np.meshgrid(np.linspace(-1, 1, h), np.linspace(-1, 1, w), indexing="ij")
    terms = np.stack([x**i * y**j for i in range(7) for j in range(7 - i)], -1).reshape(h * w, -1)
    rest = value.ravel() - terms @ np.linalg.lstsq(terms, value.ravel(), rcond=None)[0]
    window = np.hanning(h)[:, None] * np.hanning(w)
    wave = np.abs(np.fft.fft2(rest.reshape(h, w) * window)) / window.sum() / value.mean()
    grid = np.zeros((h, w), bool)
    grid[:: h // 4, :: w // 4] = True
    grid[0, 0] = False
    beside = (np.roll(grid, 3, 1) | np.roll(grid, 3, 0) | np.roll(grid, (-3, -3), (0, 1))) & ~grid
    return float(np.sqrt((wave[grid] ** 2).sum())), float(np.sqrt((wave[beside] ** 2).mean() * grid.sum()))


@pytest.mark.parametrize("roughness", [0.02, 0.05, 0.1, 0.12])
def test_a_mirror_floor_shows_no_grid(device: Device, roughness: float, tmp_path: Path) -> None:
    value, _ = floor(device, sky(tmp_path, linear), diffuse_color=1.0, metallic=1.0, roughness=roughness)
    grid, beside = grid_and_rest(value)
    assert grid < 2e-5 + 3 * beside, (grid, beside)
    about = (np.roll(value, 1, 1) + np.roll(value, -1, 1) + np.roll(value, 1, 0) + np.roll(value, -1, 0)) / 4
    rest = (value - about)[4:-4, 8:-8]
    h, w = (n // 4 * 4 for n in rest.shape)
    of_place = rest[:h, :w].reshape(h // 4, 4, w // 4, 4).mean((0, 2))  # by where a pixel lies in its tile
    assert np.abs(of_place).max() < 2e-4 * value.mean()
    assert np.abs(rest).max() < 0.02 * value.mean()


@pytest.mark.parametrize("roughness", [0.02, 0.05, 0.1, 0.12])
def test_a_mirror_floor_shows_the_sky_by_its_lobe(device: Device, roughness: float, tmp_path: Path) -> None:
    inputs = dict(diffuse_color=1.0, metallic=1.0, roughness=roughness)
    value, to_eye = floor(device, sky(tmp_path, linear), (32, 24), 256, **inputs)
    at = slice(2, None, 4), slice(2, None, 7)
    truth = [mirrored(e, roughness) for e in to_eye[at].reshape(-1, 3)]
    np.testing.assert_allclose(value[at].ravel(), truth, rtol=0.004)


@pytest.mark.parametrize(("roughness", "most"), [(0.05, 0.0045), (0.12, 0.0003)])
def test_a_glossy_floor_shows_little_of_a_grid(device: Device, roughness: float, most: float, tmp_path: Path) -> None:
    """Some of its rays are for diffuse light: as many of each sample."""
    value, _ = floor(device, sky(tmp_path, linear), diffuse_color=0.3, roughness=roughness)
    assert grid_and_rest(value)[0] < most


def test_a_mirror_gets_more_samples_as_a_whole_or_not_at_all(
    device: Device, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The half of it that shows stripes is uncertain, the other half is not; what divides them would be seen."""
    chosen: list[tuple[int, int]] = []
    judge = Noise.uncertain

    def uncertain(self: Noise) -> Any:
        times, some = judge(self)
        is_mirror = self._rows.guide.host[self._there, G_TILE] < TILE  # its samples share less than a tile
        assert (self._rows.surface.host[self._there[is_mirror], MATERIAL] == 1).all()
        chosen.append((int(is_mirror[some].sum()), int(is_mirror.sum())))
        return times, some

    def striped(direction: NDArray) -> NDArray:
        return np.where(direction[..., 0] > 0, 1 + np.sin(80 * direction[..., 1]), 1)

    metal = Material("", constant(1.0, 1.0, 1.0), metallic=constant(1.0), roughness=constant(0.08))
    plate = quad((-0.5, 0.01, 0.3), (1, 0, 0), (0, 0, -0.6), material=1)
    camera = camera_at((0, 1.05, 2.9), (0, 0.0, 0), focal_length=40.0)
    monkeypatch.setattr(Noise, "uncertain", uncertain)
    for radiance, half, expects_more in ((striped, 0.5, True), (striped, 40.0, False), (linear, 0.5, False)):
        mirror = replace(plate, positions=plate.positions * np.float32([2 * half, 1, 2 * half]))
        scene = make_scene(ground(60.0), mirror, materials=[matte(), metal], lights=[sky(tmp_path, radiance)])
        chosen.clear()
        picture(scene, camera, device, size=SIZE)
        assert len(chosen) == 1 and chosen[0][1] > 500
        assert chosen[0][0] == (chosen[0][1] if expects_more else 0), (chosen, half)


def test_the_worst_units_get_more_samples_as_the_budget_allows() -> None:
    unit = np.repeat(np.arange(40), 64)  # a hundredth of all would be 25
    error = np.where(unit < 3, 0.1, 0.0).astype(np.float32)
    times, chosen = worst_units(error, unit)
    assert (chosen == np.flatnonzero(unit < 3)).all() and times * len(chosen) <= BUDGET * len(unit) < 8 * len(chosen)
    whole = np.where(unit < 20, 0, unit)  # a mirror, too large
    assert (worst_units(error, whole)[1] >= 20 * 64).all()
    assert not len(worst_units(np.where(whole == 0, error, 0).astype(np.float32), whole, 1)[1])
    many = np.where(unit < 30, 0.1 + 0.001 * unit, 0.0).astype(np.float32)
    times, chosen = worst_units(many, unit, 1)
    assert times == 1 and set(unit[chosen]) == set(range(20, 30))  # the worst


@pytest.mark.parametrize("roughness", [0.05, 0.1])
def test_a_mirror_loses_no_light_to_the_tail_of_its_lobe(device: Device, roughness: float, tmp_path: Path) -> None:
    """All tiles share few numbers: one that is drawn too far out would darken the whole of a mirror alike."""
    even = sky(tmp_path, lambda direction: np.ones(direction.shape[:-1]))
    value, _ = floor(device, even, (64, 48), diffuse_color=1.0, metallic=1.0, roughness=roughness)
    assert value.mean() == pytest.approx(1, abs=0.004)
