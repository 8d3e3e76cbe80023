"""Light that arrives at elements from all UsdLux lights, and the light of a stage without any.

Emissive meshes are not here: they are the emission of their elements.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from usdslf.light_field.links import ESCAPES
from usdslf.light_field.visibility import Visibility
from usdslf.lights.dome import Dome, Peaks, table_index
from usdslf.lights.sampling import LightHit, LightSample, intersect_light, is_delta, sample_light
from usdslf.progress import tell
from usdslf.rays import RayTracer
from usdslf.sampling.hemisphere import (
    SIDE,
    SOLID_ANGLE,
    D,
    bin_directions,
    hemisphere_from_square,
    square_from_hemisphere,
)
from usdslf.sampling.low_discrepancy import random_shifts, sobol_points
from usdslf.scene.records import F32, Light
from usdslf.threads import map_ahead, thread_count

if TYPE_CHECKING:
    from usdslf.elements.elements import Elements

FEW, MANY = 16, 64  # samples of a light for each element
LARGE = 0.05  # solid angle [sr], about 8 bins, above which a light gets MANY samples
HUGE = 0.8  # solid angle [sr], about 130 bins, above which it gets a ray for each bin instead
WIDE = np.radians(40.0)  # a distant light's angle above which it is filtered like a dome
BATCH = 1024  # elements at a time of a light
STEP = 128  # elements at a time of a dome: their arrays stay in the second-level cache

_Draw = Callable[[NDArray, NDArray], LightSample]  # points (n, 3), u (n, 2) -> samples
_Meet = Callable[[NDArray, NDArray], LightHit]  # points (n, 3), directions (n, 3) -> hits
_Read = Callable[[slice], F32]  # elements -> radiance of their bins (n D, 3)


class _Source(NamedTuple):
    """A light that is drawn."""

    light: Light
    draw: _Draw
    meet: _Meet | None  # None: it is never huge
    is_delta: bool


class StaticLight(NamedTuple):
    """Incident radiance that no edit of a material changes, in the bins of each element."""

    diffuse: F32  # (N, D, 3) with the lights' `diffuse` factors
    specular: F32 | None  # with their `specular` factors; None: the same as diffuse


def static_light(
    elements: Elements,
    tracer: RayTracer,
    lights: Sequence[Light | Dome],
    visibility: Visibility | None = None,
    seed: int = 0,
) -> StaticLight:
    """Collects the light of all UsdLux lights at the elements, tested for occlusion.

    Lights are drawn with shadow rays, FEW or (where they are large or partly hidden) MANY for each element,
    or met by a ray through each bin where they are huge.  A sample adds its share of the irradiance to the
    bin that it falls into, so that the sum over the bins of L cos 2 pi / D is the irradiance whatever the
    size of the light.  Domes are read filtered to a bin where its ray escapes; small bright places in them (a
    sun) are drawn like lights.

    Args:
        elements: N of them; position, geometric_normal, triangle and frame are used.
        tracer: for shadow rays.
        lights: all of the stage; a loaded Dome stands for its light.
        visibility: which bins see the dome; None: all.
        seed: of the sample points.
    """
    rng = np.random.default_rng(seed)
    domes, drawn = _sources(lights)
    n = len(elements.position)
    used = [*(light for light, _ in domes), *(source.light for source in drawn)]
    is_split = any(light.diffuse != light.specular for light in used)
    diffuse = np.zeros((n, D, 3), np.float32)
    specular = np.zeros((n, D, 3), np.float32) if is_split else None

    def add(at: slice | NDArray, value: NDArray, light: Light) -> None:
        for total, factor in ((diffuse, light.diffuse), (specular, light.specular)):
            if total is not None and factor:
                total.reshape(-1, 3)[at] += value if factor == 1 else value * np.float32(factor)

    origins = tracer.offset_points(elements.position, elements.geometric_normal, elements.triangle)
    done = 0  # lights
    threads = thread_count()
    with ThreadPoolExecutor(threads) as pool:
        for light, dome in domes:
            read = _reader(elements, dome, visibility)

            def add_dome(first: int, read: _Read = read, light: Light = light) -> None:
                rows = slice(first, min(first + STEP, n))
                add(slice(rows.start * D, rows.stop * D), read(rows), light)

            done = _add_all(map_ahead(pool, add_dome, range(0, n, STEP), 2 * threads), done, len(used))
        for source in drawn:
            shifts = random_shifts(n, rng)

            def add_drawn(first: int, source: _Source = source, shifts: NDArray = shifts) -> None:
                rows = slice(first, min(first + BATCH, n))
                at, value = _drawn_light(source, origins[rows], elements.frame[rows], shifts[rows], tracer)
                add(at + first * D, value, source.light)

            done = _add_all(map_ahead(pool, add_drawn, range(0, n, BATCH), 2 * threads), done, len(used))
    return StaticLight(diffuse, specular)


def _add_all(parts: Iterator[tuple[int, None]], done: int, lights: int) -> int:
    """Waits for all parts of one more light, and tells; returns how many of the lights are done."""
    for _ in parts:
        tell()
    tell((done + 1) / lights)
    return done + 1


def _sources(lights: Sequence[Light | Dome]) -> tuple[list[tuple[Light, Dome]], list[_Source]]:
    """Sorts lights into what is filtered and what is drawn."""
    domes: list[tuple[Light, Dome]] = []
    drawn: list[_Source] = []
    for entry in lights:
        light = entry.light if isinstance(entry, Dome) else entry
        if not any(light.radiance) or light.diffuse == light.specular == 0:
            continue
        if light.kind == "dome":
            dome = entry if isinstance(entry, Dome) else Dome.from_light(light, for_bins=True)
            smooth, peaks = dome.without_peaks()
            domes.append((light, smooth))
            if peaks is not None:
                drawn.append(_source_of_peaks(light, peaks))
        elif light.kind == "distant" and light.angle > WIDE:
            domes.append((light, _dome_of_distant(light)))
        else:
            meet = partial(intersect_light, light)
            drawn.append(_Source(light, partial(sample_light, light), meet, is_delta(light)))
    return domes, drawn


def _source_of_peaks(light: Light, peaks: Peaks) -> _Source:
    def draw(points: NDArray, u: NDArray) -> LightSample:
        direction, radiance, pdf = peaks.sample(u)
        return LightSample(direction, np.full(len(u), np.inf, np.float32), radiance, pdf)

    return _Source(light, draw, None, False)


def _dome_of_distant(light: Light, rows: int = 128) -> Dome:
    """A dome with the wide cone of a distant light, as the mean of 4 x 4 rays a pixel."""
    fine = 4 * rows
    latitude = np.pi * (0.5 - (np.arange(fine) + 0.5) / fine)[:, None]
    longitude = np.pi * (1 - (np.arange(2 * fine) + 0.5) / fine)[None]
    c = np.cos(latitude)
    y = np.broadcast_to(np.sin(latitude), (fine, 2 * fine))
    towards = np.stack([c * np.sin(longitude), y, c * np.cos(longitude)], -1).reshape(-1, 3)
    radiance = intersect_light(light, np.zeros_like(towards), towards).radiance
    pixels = radiance.reshape(rows, 4, 2 * rows, 4, 3).mean((1, 3))
    return Dome(replace(light, kind="dome", radiance=(1.0, 1.0, 1.0), world_from_light=np.eye(4)), pixels)


def _reader(elements: Elements, dome: Dome, visibility: Visibility | None) -> _Read:
    """Returns a function that reads a dome, filtered to a bin, in the bins of some elements: (n D, 3)."""
    table = dome.table(SOLID_ANGLE)
    black = len(table)
    table = np.concatenate([table, np.zeros((1, 3), np.float32)])
    bins = bin_directions().astype(np.float32)
    dome_from_frame = (elements.frame @ dome.world_from_light).astype(np.float32)

    def read(rows: slice) -> F32:
        local = bins @ dome_from_frame[rows]
        index = table_index(local[..., 0], local[..., 1], local[..., 2])
        if visibility is not None:
            index[visibility.hit[rows] != ESCAPES] = black
        return np.take(table, index.ravel(), 0)

    return read


def _drawn_light(
    source: _Source, origins: F32, frames: F32, shifts: NDArray[np.uint32], tracer: RayTracer
) -> tuple[NDArray[np.int64], F32]:
    """Draws one light from n elements: distinct entries of (n D, 3), and what to add there."""
    n = len(origins)
    draw = source.draw
    if source.is_delta:
        s = _draw_samples(draw, origins, frames, np.full((n, 1, 2), 0.5), tracer)
        return _binned(s.row, s.square, s.share, np.zeros(n))
    few = _draw_samples(draw, origins, frames, sobol_points(0, FEW, shifts), tracer)
    is_huge = few.is_lit & (few.solid_angle > HUGE) & (source.meet is not None)
    is_more = few.is_partly_lit | (few.is_lit & (few.solid_angle > LARGE))
    more, huge = np.flatnonzero(is_more & ~is_huge), np.flatnonzero(is_huge)
    rest = _draw_samples(draw, origins[more], frames[more], sobol_points(FEW, MANY, shifts[more]), tracer)

    # Means over FEW become means over MANY; a sample stands for its part of the light's solid angle.
    scale, spread = np.where(is_huge, np.float32(0), np.float32(1)), np.zeros(n)
    scale[more] = FEW / MANY
    spread[more] = np.sqrt(2 * few.solid_angle[more] / (MANY * SOLID_ANGLE))
    kept = np.flatnonzero(scale[few.row])
    row = np.concatenate([few.row[kept], more[rest.row]])
    square = np.concatenate([few.square[kept], rest.square])
    share = np.concatenate(
        [few.share[kept] * scale[few.row[kept], None], rest.share * np.float32(1 - FEW / MANY)]
    )
    entry, value = _binned(row, square, share, spread)
    if source.meet is None or not len(huge):
        return entry, value
    at, met = _met_light(source.meet, origins[huge], frames[huge], shifts[huge], tracer)
    return np.concatenate([entry, huge[at // D] * D + at % D]), np.concatenate([value, met])


def _met_light(
    meet: _Meet, origins: F32, frames: F32, shifts: NDArray[np.uint32], tracer: RayTracer
) -> tuple[NDArray[np.int64], F32]:
    """Meets one light by a ray through a random place of each bin of n elements; as `_drawn_light`."""
    # Places of neighbouring bins differ as much as they can: Roberts' R2 sequence.
    step = np.arange(D)[:, None] * np.array([0.7548776662466927, 0.5698402909980532])
    place = np.modf(step + shifts[:, None] * 2.0**-32)[0]
    iy, ix = np.divmod(np.arange(D), SIDE)
    local = hemisphere_from_square((np.stack([ix, iy], -1) + place) * (2 / SIDE) - 1).astype(np.float32)
    towards = (local @ frames).reshape(-1, 3)
    start = np.repeat(origins, D, 0)
    hit = meet(start, towards)
    at = np.flatnonzero((hit.radiance > 0).any(1))
    at = at[~tracer.occluded(start[at], towards[at], hit.distance[at] * np.float32(1 - 1e-4))]
    return at, hit.radiance[at]


class _Samples(NamedTuple):
    """Samples of one light from n elements; m of them arrive."""

    row: NDArray[np.int64]  # (m,) element
    square: F32  # (m, 2) place in the square of bins, in bins
    share: F32  # (m, 3) of the element's irradiance
    solid_angle: NDArray  # (n,) [sr] of the light, estimated
    is_lit: NDArray[np.bool_]  # (n,)
    is_partly_lit: NDArray[np.bool_]  # (n,) something of the light is hidden or below the horizon


def _draw_samples(draw: _Draw, origins: F32, frames: F32, u: NDArray, tracer: RayTracer) -> _Samples:
    n, k = u.shape[:2]
    start = np.repeat(origins, k, 0)
    s = draw(start, u.reshape(-1, 2))
    local = (s.direction.reshape(n, k, 3) @ frames.transpose(0, 2, 1)).reshape(-1, 3)
    is_seen = s.pdf > 0
    at = np.flatnonzero(is_seen & (local[:, 2] > 0) & (s.radiance > 0).any(1))
    at = at[~tracer.occluded(start[at], s.direction[at], s.distance[at] * np.float32(1 - 1e-4))]
    row = at // k
    lit = np.bincount(row, minlength=n)
    seen = is_seen.reshape(n, k).sum(1)
    return _Samples(
        row,
        ((square_from_hemisphere(local[at]) + 1) * (SIDE / 2)).astype(np.float32),
        s.radiance[at] * (local[at, 2] / (s.pdf[at] * np.float32(k)))[:, None],
        np.where(is_seen, 1 / np.where(is_seen, s.pdf, 1), 0).reshape(n, k).mean(1),
        lit > 0,
        (lit > 0) & (lit < seen),
    )


def _binned(row: NDArray, square: F32, share: F32, spread: NDArray) -> tuple[NDArray[np.int64], F32]:
    """Turns shares of irradiance into radiance of bins: distinct entries of (n D, 3), values (., 3).

    A sample whose element has a spread above 0.7 bins is laid over its 3 x 3 bins with a tent that wide, so
    that large lights fill their bins evenly.  Its radiance is the same in all of them but for the tent.
    """
    cos = np.ascontiguousarray(bin_directions()[:, 2], np.float32)
    cell = np.clip(square.astype(np.int64), 0, SIDE - 1)
    near = cell[:, 1] * SIDE + cell[:, 0]
    wide = spread[row] > 0.7
    entries, values = [], []
    sharp = np.flatnonzero(~wide)
    if len(sharp):
        entries.append(row[sharp] * D + near[sharp])
        values.append(share[sharp] / (cos[near[sharp]] * np.float32(SOLID_ANGLE))[:, None])
    soft = np.flatnonzero(wide)
    if len(soft):
        reach = np.clip(spread[row[soft]], 1, 1.5).astype(np.float32)
        around = cell[soft, :, None] + np.arange(-1, 2)  # (., x | y, 3)
        off = np.abs(around.astype(np.float32) + np.float32(0.5) - square[soft, :, None])
        tent = np.where((around >= 0) & (around < SIDE), np.maximum(reach[:, None, None] - off, 0), 0)
        weight = (tent[:, 1, :, None] * tent[:, 0, None]).reshape(-1, 9)
        around = np.clip(around, 0, SIDE - 1)
        bins = (around[:, 1, :, None] * SIDE + around[:, 0, None]).reshape(-1, 9)
        weight /= (weight * cos[bins]).sum(1, keepdims=True) * np.float32(SOLID_ANGLE)
        used = weight > 0
        entries.append((row[soft, None] * D + bins)[used])
        values.append((share[soft, None] * weight[..., None])[used])
    if not entries:
        return np.zeros(0, np.int64), np.zeros((0, 3), np.float32)
    # Samples in the same bin are added up after sorting: no two entries are alike then.
    entry, value = np.concatenate(entries), np.concatenate(values)
    order = np.argsort(entry, kind="stable")
    entry = entry[order]
    first = np.flatnonzero(np.concatenate([[True], entry[1:] != entry[:-1]]))
    return entry[first], np.add.reduceat(value[order], first, 0)


# ── a stage without light ────────────────────────────────────────────────────────────────────────
