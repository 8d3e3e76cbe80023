"""Pictures that the demo scene uses, computed: planks of wood and a photographer's studio."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

F32 = NDArray[np.float32]


def planks(size: int = 512, boards: int = 7) -> F32:
    """Returns a board of wooden planks (size, size, 3), sRGB encoded 0..1."""
    rng = np.random.default_rng(7)
    t = (np.arange(size) + 0.5) / size
    x, y = np.meshgrid(t, t)
    board = np.minimum((x * boards).astype(int), boards - 1)
    shift, tone = rng.random(boards)[board], rng.uniform(0.82, 1.1, boards)[board]
    # Grain: rings of a slightly bent trunk, cut lengthwise.
    across = x * boards + 0.35 * np.sin(2 * np.pi * (1.3 * y + shift)) + 3 * shift
    rings = 0.5 + 0.5 * np.sin(2 * np.pi * (3.1 * across + 0.25 * np.sin(2 * np.pi * (5 * y + 2 * shift))))
    fibre = np.repeat(rng.normal(0, 1, (size // 16, size)), 16, axis=0)[:size]
    value = tone * (0.86 + 0.14 * rings) + 0.018 * fibre
    edge = np.abs((x * boards) % 1 - 0.5) > 0.488
    color = value[..., None] * np.array([0.78, 0.60, 0.44]) * np.where(edge, 0.45, 1)[..., None]
    return np.clip(color, 0, 1).astype(np.float32)


def studio(height: int = 128) -> F32:
    """Returns a latlong environment (height, 2 height, 3), scene-linear: grey room, soft boxes, dark floor."""
    latitude = (0.5 - (np.arange(height) + 0.5) / height) * np.pi
    longitude = (0.5 - (np.arange(2 * height) + 0.5) / (2 * height)) * 2 * np.pi
    lat, lon = latitude[:, None], longitude[None, :]
    up = np.sin(lat) * np.ones_like(lon)
    sky = np.array([0.62, 0.70, 0.82]) * (0.35 + 0.65 * np.clip(up, 0, 1))[..., None]
    ground = np.array([0.16, 0.14, 0.12])
    picture = np.where((up > -0.02)[..., None], sky, ground)

    def box(centre_lon: float, centre_lat: float, width: float, tall: float, color: tuple) -> None:
        d = np.maximum(np.abs(lon - centre_lon) / width, np.abs(lat - centre_lat) / tall)
        weight = 1 / (1 + np.exp(np.clip((d - 1) * 30, -60, 60)))
        picture[:] = picture * (1 - weight[..., None]) + weight[..., None] * np.array(color)

    # Longitude 0 is +Z, the camera's side; 90 degrees is +X.
    box(0.95, 0.55, 0.22, 0.42, (5.0, 4.7, 4.2))
    box(-0.75, 0.40, 0.10, 0.55, (3.0, 3.3, 3.8))
    return picture.astype(np.float32)


def windows(height: int = 256) -> F32:
    """Returns a latlong environment (height, 2 height, 3), scene-linear: a hall, the sky and the sun in its windows."""
    lat = ((0.5 - (np.arange(height) + 0.5) / height) * np.pi)[:, None]
    lon = ((0.5 - (np.arange(2 * height) + 0.5) / (2 * height)) * 2 * np.pi)[None]
    up = np.sin(lat) * np.ones_like(lon)
    wall, floor, ceiling = np.array([0.20, 0.17, 0.14]), np.array([0.10, 0.075, 0.05]), np.array([0.26, 0.25, 0.24])
    picture = np.where((up < -0.25)[..., None], floor, np.where((up > 0.8)[..., None], ceiling, wall))
    sky = np.array([0.9, 1.5, 2.6]) + np.array([3.2, 2.6, 1.6]) * np.exp(-5 * np.abs(lat))[..., None]
    away = np.arccos(np.clip(np.cos(lat) * np.cos(0.55) * np.cos(lon + 0.95) + np.sin(lat) * np.sin(0.55), -1, 1))
    sun = np.array([160.0, 140.0, 110.0]) * (1 / (1 + np.exp(np.clip((away - 0.06) / 0.008, -60, 60))))[..., None]
    for centre in (-1.75, -0.95, -0.15, 2.4):
        across, along = np.abs(lon - centre) / 0.26, np.abs(lat - 0.38) / 0.42
        inside = 1 / (1 + np.exp(np.clip((np.maximum(across, along) - 1) * 40, -60, 60)))
        bars = (np.abs(across) < 0.05) | (np.abs(lat - 0.38) < 0.012)
        open_ = (inside * np.where(bars, 0.15, 1))[..., None]
        picture = picture * (1 - open_) + (sky + sun) * open_
    return picture.astype(np.float32)
