"""Reflections of something smooth are smooth: the places of samples in their tile do not show as a grid of dots."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from kit.scene_pictures import camera_at, ground, matte, picture
from kit.scene_records import make_scene, sphere
from numpy.typing import NDArray
from reference.reflectance import ggx, microfacets

from usdslf.gpu.device import Device
from usdslf.render.filter import TILE, LightFilter, tiles_within, worst_tiles
from usdslf.render.gather import Gatherer
from usdslf.render.lobes import ShadingPoints
from usdslf.scene.records import Material, constant

SIZE = (128, 96)
SLOPE = np.array([0.5, 0.3, -0.4])


class Slope:
    """A stand-in for a light field whose radiance is linear in the direction."""

    model = "preview_surface"

    def radiance_from_hits(self, triangle: NDArray, barycentric: NDArray, direction: NDArray) -> NDArray:
        return np.repeat(1 + direction @ SLOPE.astype(np.float32), 3).reshape(-1, 3)


def floor(device: Device, samples: int = 16, **inputs: float) -> tuple[NDArray, NDArray]:
    """Radiance (h, w) of the nearer half of a floor in a large room, and directions (h, w, 3) to the eye."""
    material = Material("", **{k: constant(*(v,) * (3 if k == "diffuse_color" else 1)) for k, v in inputs.items()})
    scene = make_scene(ground(30.0), sphere(40.0, material=1), materials=[material, matte()])
    camera = camera_at((0, 1.05, 2.9), (0, 0.35, 0), focal_length=40.0)
    names = ("color", "position")
    aovs = picture(scene, camera, device, Slope(), size=SIZE, samples=samples, element_area=1e-9, aovs=names)
    part = slice(SIZE[1] // 2, SIZE[1])
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
    radiance = 1 + np.stack([l[..., 0], l[..., 2], -l[..., 1]], -1) @ SLOPE
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
def test_a_mirror_floor_shows_no_grid(device: Device, roughness: float) -> None:
    value, to_eye = floor(device, diffuse_color=1.0, metallic=1.0, roughness=roughness)
    at = slice(5, None, 12), slice(5, None, 24)
    truth = [mirrored(e, roughness) for e in to_eye[at].reshape(-1, 3)]
    np.testing.assert_allclose(value[at].ravel(), truth, rtol=0.006)
    grid, beside = grid_and_rest(value)
    assert grid < 2e-5 + 3 * beside, (grid, beside)


@pytest.mark.parametrize(("roughness", "most"), [(0.05, 0.0045), (0.12, 0.0003)])
def test_a_glossy_floor_shows_little_of_a_grid(device: Device, roughness: float, most: float) -> None:
    """Some of its rays are for diffuse light: as many of each sample."""
    value, _ = floor(device, diffuse_color=0.3, roughness=roughness)
    assert grid_and_rest(value)[0] < most


def test_all_of_a_window_is_within_reach_and_a_larger_one_is_not() -> None:
    reach = np.geomspace(0.1, 50, 200)
    tile = tiles_within(reach, 1)
    far = np.hypot(tile // 2, tile // 2)  # to the corner of a window
    assert set(tile) == {1, 2, 4, 8}
    assert (far <= reach + 1e-9).all()
    assert (np.hypot(tile, tile)[tile < TILE] > reach[tile < TILE]).all()
    assert (tiles_within(reach, 4) == np.maximum(tile, 4)).all()


def test_a_mirror_gets_more_samples_as_a_whole_or_not_at_all(device: Device, monkeypatch: pytest.MonkeyPatch) -> None:
    """The half of it that shows stripes is uncertain, the other half is not; what divides them would be seen."""
    more, of = [], []

    def radiance(self: Slope, triangle: NDArray, barycentric: NDArray, direction: NDArray) -> NDArray:
        stripes = np.where(direction[:, 0] > 0, 1 + np.sin(150 * direction[:, 1]), 1)
        return np.repeat(stripes, 3).reshape(-1, 3).astype(np.float32)

    def gather_more(self: Gatherer, p: ShadingPoints, *rest: Any) -> tuple[NDArray, NDArray]:
        more.append(int((p.lobes[:, 2] == 1).sum()))
        return usual(self, p, *rest)

    def uncertain(self: LightFilter, *rest: Any) -> Any:
        of.append(int((self._points.lobes[:, 2] == 1).sum()))
        return judge(self, *rest)

    usual, judge = Gatherer.gather_more, LightFilter.uncertain_points
    monkeypatch.setattr(Slope, "radiance_from_hits", radiance)
    monkeypatch.setattr(Gatherer, "gather_more", gather_more)
    monkeypatch.setattr(LightFilter, "uncertain_points", uncertain)
    floor(device, diffuse_color=1.0, metallic=1.0, roughness=0.08)
    assert of and min(of) > 0  # all of them are points of the mirror
    assert more == of


def test_all_tiles_get_more_samples_where_one_more_set_is_enough() -> None:
    rows = np.arange(16 * 32)
    error = np.where(rows % 32 < 24, 0.1, 0.0).astype(np.float32)  # three quarters of them
    times, chosen = worst_tiles(error, rows, (32, 16), fewest=1)
    assert times == 1 and (chosen == np.flatnonzero(rows % 32 < 24)).all()
    times, chosen = worst_tiles(error, rows, (32, 16))
    assert times == 2 and len(chosen) == len(rows) // 2
