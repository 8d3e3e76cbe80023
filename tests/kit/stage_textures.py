"""Small procedural textures and environments of test stages."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from kit.stage_meshes import Triple
from numpy.typing import NDArray


def checker(a: Triple, b: Triple, squares: int = 8, size: int = 64) -> NDArray:
    """A checker board (size, size, 3), sRGB-encoded values in 0..1."""
    i = np.arange(size) * squares // size
    mask = ((i[:, None] + i[None]) % 2)[..., None]
    return np.where(mask == 1, np.array(a), np.array(b)).astype(np.float32)


def noise(a: Triple, b: Triple, seed: int = 0, size: int = 96) -> NDArray:
    """Smooth noise that tiles, between two colours (size, size, 3)."""
    rng = np.random.default_rng(seed)
    f = np.fft.fftfreq(size) * size
    falloff = np.exp(-((np.hypot(f[:, None], f[None]) / 5.0) ** 2))
    field = np.fft.ifft2(np.fft.fft2(rng.normal(size=(size, size))) * falloff).real
    field = np.clip(0.5 + 0.28 * field / field.std(), 0, 1)[..., None]
    return (np.array(a) * (1 - field) + np.array(b) * field).astype(np.float32)


def sky(seed: int = 0, height: int = 64, sun: float = 60.0) -> NDArray:
    """An outdoor environment (height, 2 height, 3): a gradient, a soft sun, bright windows, ground."""
    rng = np.random.default_rng(seed)
    latitude = np.radians(90 - (np.arange(height) + 0.5) * 180 / height)[:, None, None]
    longitude = np.radians(180 - (np.arange(2 * height) + 0.5) * 180 / height)[None, :, None]
    up = np.maximum(np.sin(latitude), 0) ** 0.5
    image = (1 - up) * np.array([0.9, 0.85, 0.8]) + up * np.array([0.25, 0.45, 0.9])
    image = np.where(latitude < 0, np.array([0.22, 0.18, 0.13]) * (1 + 0.3 * np.cos(3 * longitude)), image)

    def direction(lat: NDArray | float, lon: NDArray | float) -> NDArray:
        parts = np.broadcast_arrays(np.cos(lat) * np.sin(lon), np.sin(lat), np.cos(lat) * np.cos(lon))
        return np.stack([np.squeeze(p) for p in parts], -1)

    d = direction(latitude, longitude)
    azimuth = rng.uniform(-2.4, 0.6)
    sun_direction = direction(rng.uniform(0.5, 0.9), azimuth)
    image = image + np.exp((d @ sun_direction - 1) * 180)[..., None] * sun * np.array([1, 0.9, 0.75])
    for _ in range(4):
        center, strength = direction(rng.uniform(-0.1, 0.8), rng.uniform(-3.1, 3.1)), rng.uniform(1.5, 5)
        side = np.cross(center, [0, 1, 0])
        side /= np.linalg.norm(side)
        inside = np.maximum(np.abs(d @ side) / 0.25, np.abs(d @ np.cross(side, center)) / 0.35)
        window = ((inside < 1) & (d @ center > 0))[..., None]
        image = image + window * strength * rng.uniform(0.6, 1.0, 3)
    return image.astype(np.float32)


def write_image(path: Path, pixels: NDArray) -> None:
    """Writes (h, w, 3): 8 bit for .png, half float for .exr."""
    import OpenImageIO as oiio

    kind = oiio.UINT8 if path.suffix == ".png" else oiio.HALF
    output = oiio.ImageOutput.create(str(path))
    output.open(str(path), oiio.ImageSpec(pixels.shape[1], pixels.shape[0], 3, kind))
    output.write_image(np.ascontiguousarray(pixels, np.float32))
    output.close()
