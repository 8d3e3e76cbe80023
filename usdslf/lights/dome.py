"""Environment light: what a dome sends from each direction, filtered or drawn by brightness.

Orientation (UsdLux, OpenEXR): rows go from latitude +90 degrees (+Y) down, columns from longitude +180 to
-180; latitude 0 longitude 0 is +Z and longitude +90 is +X; then `world_from_light` turns it.  Pixels
are cells: the upper edge of row 0 is the pole.  Between pixel centres radiance is bilinear.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from usdslf.color import LUMINANCE
from usdslf.lights.large_picture import reduced, shining
from usdslf.progress import in_blocks
from usdslf.scene.records import F32, F64, Light
from usdslf.textures.images import load_light_texture

BIN_ROWS = 1024  # of a picture that is only read filtered: fifteen to a texel of the map for the bins
ROWS_AT_ONCE = 256  # of a picture that is summed up
WHITE = (1.0, 1.0, 1.0)
TABLE_ROWS = 512  # of the pixels that directions are drawn by
FILTER_TEXELS = 0.8  # side of the solid angle asked for, in texels of the filtered map: see `Dome.radiance`


class Dome:
    """A dome light with its pixels.

    The directions drawn by `sample` have a density that is constant in solid angle over each cell of a
    table, proportional to the luminance that the cell sends, so `pdf` is exact.
    """

    def __init__(self, light: Light, pixels: NDArray | None = None) -> None:
        """Prepares a dome.

        Args:
            light: of kind dome; its `radiance` multiplies the pixels.
            pixels: latlong (H, W, 3); None: white, a constant dome.
        """
        self.light = light
        image = shining(np.ones((1, 1, 3), np.float32) if pixels is None else np.asarray(pixels, np.float32)[..., :3])
        if tuple(light.radiance) != WHITE or pixels is None:  # a large picture is not copied for nothing
            image = image * np.asarray(light.radiance, np.float32)
        self.pixels: F32 = np.ascontiguousarray(image, np.float32)
        u, _, vt = np.linalg.svd(np.asarray(light.world_from_light, np.float64)[:3, :3])
        self.world_from_light: F64 = u @ vt  # the rotation (or reflection) next to the matrix
        self._filtered: dict[int, F32] = {}
        self._tables: dict[tuple[int, int], F32] = {}
        self._build_table()

    @classmethod
    def from_light(cls, light: Light, for_bins: bool = False) -> Dome:
        """Loads the texture of a dome light, if it has one.

        Args:
            light: of kind dome.
            for_bins: of a large picture keep what the bins of a hemisphere can use: `BIN_ROWS` rows or a few more.

        Raises: InputError where the texture cannot be read.
        """
        if not light.texture:
            return cls(light)
        pixels = shining(load_light_texture(light.texture))
        pixels = reduced(pixels, BIN_ROWS) if for_bins else pixels
        np.multiply(pixels, np.asarray(light.radiance, np.float32), out=pixels)  # nobody else's; it may be large
        dome = cls(replace(light, radiance=WHITE), pixels)
        dome.light = light
        return dome

    # ── radiance ─────────────────────────────────────────────────────────────────────────────────

    def radiance(self, directions: NDArray, solid_angle: float | None = None) -> F32:
        """Returns the radiance (n, 3) that arrives from unit directions (n, 3).

        Args:
            directions: towards the dome, world space.
            solid_angle: [sr] that each direction stands for; None: bilinear between pixels.  The filtered map
                has equal-area texels of 1.25 times its side and is made and read with tents, wide enough for
                the bins of a hemisphere to catch the energy of a small sun (within 5 %, one standard
                deviation; 23 % with texels of 0.8), which is why `static_light` draws suns instead.
        """
        local = np.asarray(directions, np.float32) @ self.world_from_light.astype(np.float32)
        height, width = self.pixels.shape[:2]
        if solid_angle is None or solid_angle <= 2 * np.pi**2 / (height * width) or height * width == 1:
            return _bilinear_latlong(self.pixels, local)
        return _read_map(self._filtered_map(solid_angle), square_of(local))

    def table(self, solid_angle: float, side: int = 512) -> F32:
        """Returns the filtered radiance as an octahedral table (side^2, 3), read by `table_index`."""
        rows = _map_rows(solid_angle)
        if (rows, side) not in self._tables:
            t = (np.arange(side, dtype=np.float32) + 0.5) * (2 / side) - 1
            x, y = np.meshgrid(t, t)
            z = 1 - np.abs(x) - np.abs(y)
            fold = np.maximum(-z, 0)
            local = np.stack([x - np.copysign(fold, x), y - np.copysign(fold, y), z], -1).reshape(-1, 3)
            local /= np.linalg.norm(local, axis=1, keepdims=True)
            self._tables[rows, side] = self.radiance(local @ self.world_from_light.T, solid_angle)
        return self._tables[rows, side]

    def _filtered_map(self, solid_angle: float) -> F32:
        """The dome on an equal-area octahedral square with a gutter: (rows + 2, rows + 2, 3)."""
        rows = _map_rows(solid_angle)
        if rows not in self._filtered:
            self._filtered[rows] = _with_gutter(self._splat(rows))
        return self._filtered[rows]

    def _splat(self, rows: int) -> F32:
        """Spreads the pixels over a map (rows, rows, 3), each with its solid angle, by tents."""
        pixels = reduced(self.pixels, max(BIN_ROWS, 8 * rows))
        height, width = pixels.shape[:2]
        k = max(1, int(np.ceil(np.sqrt(24 * rows * rows / (height * width)))))  # parts of a pixel, each way
        block = max(1, (1 << 19) // (width * k * k))  # rows of pixels at a time
        total = np.zeros((4, (rows + 2) ** 2))
        for band in in_blocks(height, block):
            r = np.arange(band.start * k, band.stop * k)
            local, weight = _latlong_cells(r, height * k, width * k)
            value = pixels[band]
            if k > 1:
                value = _bilinear_latlong(pixels, local)
            value = value.reshape(-1, 3)
            corner, share = _tent(square_of(local), rows)
            for dy, dx in ((0, 0), (0, 1), (1, 0), (1, 1)):
                w = share[:, dx, 0] * share[:, dy, 1] * weight
                index = corner + dy * (rows + 2) + dx
                total[3] += np.bincount(index, w, (rows + 2) ** 2)
                for c in range(3):
                    total[c] += np.bincount(index, w * value[:, c], (rows + 2) ** 2)
        total = _fold_gutter(total.reshape(4, rows + 2, rows + 2))
        image = (total[:3] / np.maximum(total[3], 1e-300)).astype(np.float64)
        # Texels differ a little in the solid angle they got: hand the energy back as a whole.
        sent, kept = total[:3].sum((1, 2)), image.sum((1, 2)) * (4 * np.pi / rows**2)
        image *= np.where(kept > 0, sent / np.where(kept > 0, kept, 1), 1)[:, None, None]
        return np.ascontiguousarray(np.moveaxis(image, 0, -1), np.float32)

    # ── drawing directions ───────────────────────────────────────────────────────────────────────

    def _build_table(self) -> None:
        height, width = self.pixels.shape[:2]
        h, w = min(height, TABLE_ROWS), min(width, 2 * TABLE_ROWS)
        row_edges, column_edges = np.arange(h + 1) * height // h, np.arange(w + 1) * width // w
        sines = np.sin(np.pi * (0.5 - np.arange(height + 1) / height))
        energy = np.empty((h, w))
        for band in in_blocks(h, max(1, h * ROWS_AT_ONCE // height)):
            top, bottom = int(row_edges[band.start]), int(row_edges[band.stop])
            first = max(top - 1, 0)  # with the rows that the outer ones are read with
            seen = self.pixels[first : min(bottom + 1, height)] @ LUMINANCE.astype(np.float32)
            luminance = _mean_of_bilinear(seen)[top - first : bottom - first].astype(np.float64)
            luminance *= (sines[top:bottom] - sines[top + 1 : bottom + 1])[:, None]
            rows = np.add.reduceat(luminance, row_edges[band.start : band.stop] - top, 0)
            energy[band.start : band.stop] = np.add.reduceat(rows, column_edges[:-1], 1)
        self._sine_edges = sines[row_edges]
        self._column_edges = column_edges / width
        solid = 2 * np.pi * np.outer(-np.diff(self._sine_edges), np.diff(self._column_edges))
        total = energy.sum()
        share = energy / total if total > 0 else solid / (4 * np.pi)
        self._density: F64 = share / solid
        rows = share.sum(1)
        self._row_cdf = np.concatenate([[0], np.cumsum(rows)])
        self._row_cdf /= self._row_cdf[-1]
        inner = np.cumsum(share / np.where(rows > 0, rows, 1)[:, None], 1)
        inner /= np.where(rows > 0, inner[:, -1], 1)[:, None]
        # One increasing list for all rows: row i's distribution runs from i to i + 1.
        self._column_cdf = (np.arange(h)[:, None] + np.concatenate([np.zeros((h, 1)), inner], 1)).ravel()

    def sample(self, u: NDArray) -> tuple[F32, F32, F32]:
        """Draws directions by luminance.

        Args:
            u: (n, 2) in [0, 1).

        Returns:
            direction (n, 3) unit, world space; radiance (n, 3); pdf (n,) [1/sr], always positive.
        """
        u = np.asarray(u, np.float64)
        w = self._density.shape[1]
        row, v = _invert(self._row_cdf, u[:, 0])
        at, s = _invert(self._column_cdf, row + np.clip(u[:, 1], 0, 1 - 1e-12))
        column = np.clip(at - row * (w + 1), 0, w - 1)
        sine = self._sine_edges[row] + v * (self._sine_edges[row + 1] - self._sine_edges[row])
        edge = self._column_edges
        local = _direction(sine, edge[column] + s * (edge[column + 1] - edge[column]))
        world = (local @ self.world_from_light.T).astype(np.float32)
        return world, self.radiance(world), self._density[row, column].astype(np.float32)

    def density_table(self) -> tuple[NDArray[np.intp], NDArray[np.intp], F64]:
        """Returns how densely `sample` draws.

        Returns: the table's row (H,) of each row of pixels, its column (W,) of each column of pixels, and the table,
        densities [1/sr].
        """
        height, width = self.pixels.shape[:2]
        h, w = self._density.shape
        row_edges, column_edges = np.arange(h + 1) * height // h, np.arange(w + 1) * width // w
        rows = np.searchsorted(row_edges, np.arange(height), "right") - 1
        columns = np.searchsorted(column_edges, np.arange(width), "right") - 1
        return rows, columns, self._density

    def without_peaks(self, solid_angle: float = 0.1, share: float = 0.01) -> tuple[Dome, Peaks | None]:
        """Splits off small bright places (a sun), which have to be drawn rather than filtered.

        Args:
            solid_angle: [sr] that the peaks may fill together.
            share: of the energy, below which nothing is split off.

        Returns:
            the dome with its brightest places cut down, and what was cut off.
        """
        height, width = self.pixels.shape[:2]
        if height * width == 1:
            return self, None
        luminance = self.pixels @ LUMINANCE.astype(np.float32)
        sines = np.sin(np.pi * (0.5 - np.arange(height + 1) / height))
        solid = np.broadcast_to(-np.diff(sines)[:, None] * (2 * np.pi / width), (height, width))
        mean = (luminance * solid).sum() / (4 * np.pi)
        order = np.argsort(luminance, axis=None)[::-1]
        filled = np.cumsum(solid.ravel()[order])
        cut = max(8 * mean, float(luminance.ravel()[order[np.searchsorted(filled, solid_angle)]]))
        over = np.maximum(1 - cut / np.maximum(luminance, 1e-30), 0)[..., None]
        if (luminance * over[..., 0] * solid).sum() <= share * mean * 4 * np.pi:
            return self, None
        plain = replace(self.light, radiance=WHITE)
        cells = np.stack([_mean_of_bilinear(c) for c in np.moveaxis(self.pixels * over, -1, 0)], -1)
        return Dome(plain, self.pixels * (1 - over)), Peaks(cells, sines, self.world_from_light)


class Peaks:
    """Few bright cells of a dome, each of even radiance, drawn by their luminous energy."""

    def __init__(self, cells: NDArray, sines: F64, world_from_light: F64) -> None:
        """Collects the cells that are not black.

        Args:
            cells: latlong radiance (H, W, 3).
            sines: (H + 1,) of the latitudes between the rows.
            world_from_light: (3, 3).
        """
        width = cells.shape[1]
        row, column = np.nonzero(cells.any(-1))
        assert len(row)
        self._world_from_light, self._width = world_from_light, width
        self._sines = np.stack([sines[row], sines[row + 1]])
        self._column = column
        self._radiance = cells[row, column].astype(np.float32)
        solid = (self._sines[0] - self._sines[1]) * 2 * np.pi / width
        energy = self._radiance.astype(np.float64) @ LUMINANCE * solid
        self.irradiance: F64 = (self._radiance.astype(np.float64) * solid[:, None]).sum(0)  # (3,) facing it
        self._cdf = np.concatenate([[0], np.cumsum(energy)]) / energy.sum()
        self._cdf[-1] = 1
        self._density = energy / energy.sum() / solid

    def sample(self, u: NDArray) -> tuple[F32, F32, F32]:
        """Draws directions: as `Dome.sample`."""
        cell, s = _invert(self._cdf, np.asarray(u, np.float64)[:, 0])
        sine = self._sines[0, cell] + u[:, 1] * (self._sines[1, cell] - self._sines[0, cell])
        local = _direction(sine, (self._column[cell] + s) / self._width)
        world = (local @ self._world_from_light.T).astype(np.float32)
        return world, self._radiance[cell], self._density[cell].astype(np.float32)


# ── latlong ──────────────────────────────────────────────────────────────────────────────────────


def _latlong_cells(rows: NDArray, height: int, width: int) -> tuple[F32, F64]:
    """Centres (n, 3) and solid angles (n,) of the cells of some rows of a latlong picture."""
    latitude = np.pi * (0.5 - (rows + 0.5) / height)
    longitude = np.pi * (1 - 2 * (np.arange(width) + 0.5) / width)
    c, s = np.cos(latitude)[:, None], np.sin(latitude)[:, None]
    local = np.stack(np.broadcast_arrays(c * np.sin(longitude), s, c * np.cos(longitude)), -1)
    # sin(top) - sin(bottom) = 2 cos(middle) sin(half a row)
    solid = 2 * np.cos(latitude) * np.sin(np.pi / (2 * height)) * (2 * np.pi / width)
    return local.reshape(-1, 3).astype(np.float32), np.repeat(solid, width)


def _direction(sine: F64, share: F64) -> F64:
    """Local directions (n, 3) from the sine of the latitude and the share of the picture's width."""
    longitude = np.pi * (1 - 2 * share)
    cosine = np.sqrt(np.maximum(1 - sine * sine, 0))
    return np.stack([cosine * np.sin(longitude), sine, cosine * np.cos(longitude)], 1)


def _bilinear_latlong(pixels: F32, local: NDArray) -> F32:
    """Reads a latlong picture (H, W, 3) along local unit directions (n, 3)."""
    height, width = pixels.shape[:2]
    flat = pixels.reshape(-1, 3)
    if len(flat) == 1:
        return np.repeat(flat, len(local), 0)
    x, y, z = np.asarray(local, np.float32).T
    s = (0.5 - np.arctan2(x, z) * np.float32(0.5 / np.pi)) * width - np.float32(0.5)
    latitude = np.arctan2(y, np.hypot(x, z))  # arcsin would lose digits at the poles
    t = np.clip((0.5 - latitude * np.float32(1 / np.pi)) * height - np.float32(0.5), 0, height - 1)
    i, j = np.floor(s).astype(np.int32), np.minimum(t.astype(np.int32), max(height - 2, 0))
    fs, ft = (s - i)[:, None], (t - j)[:, None]
    i0, i1 = i % width, (i + 1) % width
    top, bottom = j * width, np.minimum(j + 1, height - 1) * width
    upper = flat[top + i0] * (1 - fs) + flat[top + i1] * fs
    lower = flat[bottom + i0] * (1 - fs) + flat[bottom + i1] * fs
    return upper * (1 - ft) + lower * ft


def _mean_of_bilinear(image: NDArray) -> NDArray:
    """Mean over each pixel's cell of the picture (H, W) read bilinearly: weights 1/8, 3/4, 1/8 each way."""
    across = 0.75 * image + 0.125 * (np.roll(image, 1, 1) + np.roll(image, -1, 1))
    padded = np.concatenate([across[:1], across, across[-1:]], 0)
    return 0.75 * across + 0.125 * (padded[:-2] + padded[2:])


def _invert(cdf: F64, u: F64) -> tuple[NDArray[np.int64], F64]:
    """Finds cell and position inside it (0..1) at which an increasing list reaches u."""
    cell = np.clip(np.searchsorted(cdf, u, "right") - 1, 0, len(cdf) - 2)
    step = cdf[cell + 1] - cdf[cell]
    return cell, np.clip((u - cdf[cell]) / np.where(step > 0, step, 1), 0, 1)


# ── equal-area octahedral map ────────────────────────────────────────────────────────────────────


def square_of(local: NDArray) -> F32:
    """Maps unit directions (n, 3) to [0, 1]^2, keeping areas: 4 pi sr fill the square.

    Source: Clarberg 2008, Fast equal-area mapping of the (hemi)sphere using SIMD.
    """
    x, y, z = np.asarray(local, np.float32).T
    across = np.hypot(x, y)
    # sqrt(1 - |z|) without cancellation near the poles
    r = across / np.sqrt(1 + np.minimum(np.abs(z), 1))
    v = np.arctan2(np.abs(y), np.abs(x)) * np.float32(2 / np.pi) * r
    u = r - v
    below = z < 0
    u, v = np.where(below, 1 - v, u), np.where(below, 1 - u, v)
    return np.clip(np.stack([np.copysign(u, x), np.copysign(v, y)], 1) * 0.5 + 0.5, 0, 1).astype(np.float32)


def table_index(x: NDArray, y: NDArray, z: NDArray, side: int = 512) -> NDArray[np.int32]:
    """Returns the entries of `Dome.table` for local directions with these coordinates, of any length."""
    half = np.float32(side / 2)
    scale = half / (np.abs(x) + np.abs(y) + np.abs(z))
    u, v = x * scale, y * scale
    below = z < 0
    fold_u, fold_v = np.copysign(half - np.abs(v), u), np.copysign(half - np.abs(u), v)
    i = (np.where(below, fold_u, u) + half).astype(np.int32)
    j = (np.where(below, fold_v, v) + half).astype(np.int32)
    return np.minimum(j, side - 1) * side + np.minimum(i, side - 1)


def _map_rows(solid_angle: float) -> int:
    """Rows of the filtered map; in steps of a quarter of an octave above 64, so that few are kept."""
    rows = FILTER_TEXELS * np.sqrt(4 * np.pi / solid_angle)
    return max(4, int(np.ceil(rows if rows < 64 else 2 ** (np.ceil(4 * np.log2(rows)) / 4))))


def _tent(square: F32, rows: int) -> tuple[NDArray[np.int64], NDArray[np.float32]]:
    """Index of the first of four texels in the map with gutter, and the shares (n, first | second, x | y)."""
    at = square * rows + np.float32(0.5)
    low = np.minimum(at.astype(np.int64), rows)
    f = at - low
    return low[:, 1] * (rows + 2) + low[:, 0], np.stack([1 - f, f], 1)


def _read_map(image: F32, square: F32) -> F32:
    """Reads a map with gutter (rows + 2, rows + 2, 3) bilinearly."""
    rows = len(image) - 2
    corner, share = _tent(square, rows)
    flat = image.reshape(-1, 3)
    out = np.zeros((len(square), 3), np.float32)
    for dy, dx in ((0, 0), (0, 1), (1, 0), (1, 1)):
        out += flat[corner + dy * (rows + 2) + dx] * (share[:, dx, 0] * share[:, dy, 1])[:, None]
    return out


def _with_gutter(image: F32) -> F32:
    """Adds the texels across the borders of the square: each border is glued to itself, turned round."""
    rows = len(image)
    out = np.zeros((rows + 2, rows + 2, *image.shape[2:]), image.dtype)
    out[1:-1, 1:-1] = image
    out[0, 1:-1], out[-1, 1:-1] = image[0, ::-1], image[-1, ::-1]
    out[1:-1, 0], out[1:-1, -1] = image[::-1, 0], image[::-1, -1]
    out[0, 0], out[0, -1], out[-1, 0], out[-1, -1] = image[-1, -1], image[-1, 0], image[0, -1], image[0, 0]
    return out


def _fold_gutter(total: NDArray) -> NDArray:
    """Adds what fell on the gutter of (c, rows + 2, rows + 2) to the texels that it stands for."""
    inner = total[:, 1:-1, 1:-1].copy()
    inner[:, 0] += total[:, 0, -2:0:-1]
    inner[:, -1] += total[:, -1, -2:0:-1]
    inner[:, :, 0] += total[:, -2:0:-1, 0]
    inner[:, :, -1] += total[:, -2:0:-1, -1]
    inner[:, -1, -1] += total[:, 0, 0]
    inner[:, -1, 0] += total[:, 0, -1]
    inner[:, 0, -1] += total[:, -1, 0]
    inner[:, 0, 0] += total[:, -1, -1]
    return inner
