"""Seven painters: what each would have said where the truth is known.

    exact    the true colours
    uneven   times a smooth error of brightness (10 % RMS over the stroke) and one tint (5 % RMS)
    few      six dabs of the uneven paint, spread over the stroke
    swatch   24 dabs from three colours: k-means of the exact ones in log space
    dark     the uneven paint, the whole stroke times one factor from .7 to 1
    flat     one colour, the mean of all dabs
    display  8-bit picks of the picture as it is displayed, taken back to scene-linear light

All follow from the exact colours that are saved; what is drawn is seeded by the name of the case.
"""

from __future__ import annotations

import zlib
from typing import Any

import numpy as np
from numpy.typing import NDArray

from usdslf.color import BUILT_IN, USD_DEFAULT_SPACE, color_of
from usdslf.strokes.colors import DISPLAY_LIMIT

PAINTERS = ("exact", "uneven", "few", "swatch", "dark", "flat", "display")
FEW = 6
SWATCHES = 3
DARKEST = 0.7
ASPECT = 4 / 3  # of all pictures of the suite
SMALLEST = 1e-5  # [radiance] of a channel whose logarithm is taken


def painted(truth: dict[str, Any], way: str) -> tuple[NDArray, NDArray]:
    """Returns the numbers of the dabs that are painted (k,) and their colours (k, 3).

    Args:
      truth: saved truth of a case: `name`, `xy`, and `colors` with at least `exact`.
      way: one of PAINTERS.  What is saved in `colors` is taken as it is.
    """
    if way not in PAINTERS:
        raise ValueError(f"no painter {way}, one of {', '.join(PAINTERS)}")
    exact, xy = np.array(truth["colors"]["exact"], float), np.array(truth["xy"], float)
    everywhere = np.arange(len(xy))
    if way in truth["colors"]:
        return everywhere, np.array(truth["colors"][way], float)
    if way == "flat":
        return everywhere, np.broadcast_to(exact.mean(0), exact.shape).copy()
    if way == "swatch":
        return everywhere, swatches(exact, generator(truth["name"], way))
    if way == "display":
        return everywhere, display_picks(exact)
    if "uneven" in truth["colors"]:
        paint = np.array(truth["colors"]["uneven"], float)
    else:
        paint = uneven(exact, xy, generator(truth["name"], "uneven"))
    if way == "few":
        chosen = np.unique(np.linspace(0, len(xy) - 1, FEW).round().astype(int))
        return chosen, paint[chosen]
    if way == "dark":
        paint = paint * generator(truth["name"], way).uniform(DARKEST, 1.0)
    return everywhere, paint


def generator(name: str, way: str) -> np.random.Generator:
    """Returns the random numbers of a painter in a case."""
    return np.random.default_rng(zlib.crc32(f"{name} {way}".encode()))


def uneven(colors: NDArray, xy: NDArray, rng: np.random.Generator) -> NDArray:
    """Returns colours (n, 3) with a smooth error of brightness and a tint."""
    place = xy * [ASPECT, 1]
    size = max(float(np.ptp(place, axis=0).max()), 0.1)
    turn, phase = rng.uniform(0, 2 * np.pi, 2)
    wave = np.sin(2 * np.pi * 0.75 * (place @ [np.cos(turn), np.sin(turn)]) / size + phase)
    wave = 0.10 * wave / max(float(np.sqrt(np.mean(wave**2))), 0.3)
    tint = rng.normal(size=3)
    tint = 0.05 * (tint - tint.mean()) / np.sqrt(np.mean((tint - tint.mean()) ** 2))
    return colors * (1 + wave[:, None]) * (1 + tint)


def swatches(colors: NDArray, rng: np.random.Generator, count: int = SWATCHES) -> NDArray:
    """Returns each colour (n, 3) replaced by the nearest of `count`, the best of ten k-means in log space."""
    logs = np.log(np.maximum(colors, SMALLEST))
    best, least = logs, np.inf
    for _ in range(10):
        centers = logs[rng.choice(len(logs), min(count, len(logs)), replace=False)]
        for _ in range(50):
            nearest = ((logs[:, None] - centers) ** 2).sum(2).argmin(1)
            means = [logs[nearest == k].mean(0) if (nearest == k).any() else c for k, c in enumerate(centers)]
            centers = np.array(means)
        cost = float(((logs - centers[nearest]) ** 2).sum())
        if cost < least:
            best, least = centers[nearest], cost
    return np.exp(best)


def display_picks(colors: NDArray) -> NDArray:
    """Returns scene-linear colours (n, 3) as picked in 8 bit from the default view of the built-in config."""
    color = color_of(BUILT_IN, USD_DEFAULT_SPACE)
    shown = color.display(np.ascontiguousarray(colors, np.float32))
    codes = np.round(np.clip(shown, 0, 1) * 255) / 255
    linear = color.display(codes.astype(np.float32), invert=True)
    return np.clip(linear, 0, DISPLAY_LIMIT).astype(float)
