"""Whole set: the colours of a material as textures of their own, texel by texel, where maps say them together.

    why_no_set(material) -> str                     "" where its colours can become textures, else why not
    colored_specular(material) -> Colored           what it takes to give what is no metal a coloured specular colour
    bake_set(material, make, place, color) -> {input: Baked}

Where a texture says what is metal, diffuseColor means two things: the diffuse colour of what is none and the specular
colour of what is.  A change of one of them, and a specular colour of what is no metal, cannot be a scale of a map; but
at each texel all inputs are known, and so are the inputs that reflect as was wanted.  The new textures have the
coordinates, wrap modes and tiles of the maps that they come from, and the size of the largest of them or more.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from enum import Enum
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from usdslf.color import Color
from usdslf.edits.baked_texture import HALF_MAX, Baked, write_texels
from usdslf.errors import AuthorError
from usdslf.replacing import beside, put_in_place
from usdslf.scene.records import F64, Input, Material, PrimvarInput, Texture
from usdslf.textures.images import load_texture, sample_texture

_BLOCK = 1 << 18  # texels that are computed at a time
FINE = 1024  # texels on a side that textures are made finer up to
_NAMES = {"diffuse_color": "diffuseColor", "metallic": "metallic", "ior": "ior"}


@dataclass(frozen=True)
class Colors:
    """The inputs that say the colours of a surface in the metal workflow, at n places."""

    base: F64  # (n, 3) diffuseColor
    metallic: F64  # (n, 1)
    ior: F64  # (n, 1)

    @property
    def diffuse(self) -> F64:
        """The diffuse reflectance (n, 3)."""
        return self.base * (1 - self.metallic)

    @property
    def f0(self) -> F64:
        """The reflectance at normal incidence (n, 3); formula of previewSurface.glslfx."""
        s = 1 + (self.base - 1) * self.metallic
        r2 = ((1 - self.ior) / (1 + self.ior)) ** 2
        return r2 * s + (s - r2 * s) * self.metallic


Make = Callable[[Colors], Mapping[str, F64]]
"""The inputs (n, 3) by name that take the place of a material's own, at n places."""


def why_no_set(m: Material) -> str:
    """Says why the colours of a material cannot become textures of their own; "" where they can."""
    if m.use_specular_workflow:
        return "it is in the specular workflow already"
    driven = {name: getattr(m, name) for name in _NAMES if not isinstance(getattr(m, name), np.ndarray)}
    for name, value in driven.items():
        if isinstance(value, PrimvarInput):
            return f"a primvar drives its {_NAMES[name]}"
    textures = [v for v in driven.values() if isinstance(v, Texture)]
    if not textures:
        return "no texture drives its colours"
    if len({_coordinates(t) for t in textures}) > 1:
        return "its maps have texture coordinates or wrap modes that differ"
    return ""


class Colored(Enum):
    """What it takes to give what is no metal a coloured specular colour."""

    FREE = "free"  # one input
    MAPS = "maps"  # textures that take the place of the maps of its colours
    NEVER = "never"  # only an ior, which is grey, leaves its maps what they mean


def colored_specular(m: Material) -> Colored:
    """Returns what a coloured specular colour takes: the specular workflow knows no map of what is metal."""
    if m.use_specular_workflow or (isinstance(m.metallic, np.ndarray) and isinstance(m.ior, np.ndarray)):
        return Colored.FREE
    return Colored.NEVER if why_no_set(m) else Colored.MAPS


def bake_set(m: Material, make: Make, place: Path, color: Color) -> dict[str, Baked]:
    """Writes the textures that take the place of a material's colours.

    Args:
        m: one that `why_no_set` finds no fault with.
        make: says which inputs get textures, and what they hold.
        place: of the files: the input's name and a hash follow; its folder is made if it is missing.

    Raises: AuthorError where no map can be read, or a file cannot be written.
    """
    textures = {n: v for n in _NAMES if isinstance(v := getattr(m, n), Texture)}
    leading = next(iter(textures.values()))
    images = {t: load_texture(t, color) for t in textures.values()}
    tiles = sorted({tile for found in images.values() for tile in found})
    if not tiles:
        raise AuthorError(f"no map of {m.path} can be read: restore {leading.path or leading.prim} to change it")
    sets: dict[str, _Set] = {}
    try:
        place.parent.mkdir(parents=True, exist_ok=True)
        for tile in tiles:
            shapes = [found[tile].shape[:2] for found in images.values() if tile in found]
            size = max(s[0] for s in shapes), max(s[1] for s in shapes)
            _add_tile(sets, tile, _finer(size), (m, make, place, color))
        return {name: one.finish(leading) for name, one in sets.items()}
    except OSError as error:
        folder = place.parent
        raise AuthorError(f"{folder} cannot be written: {error.strerror or error}; choose another place") from None
    finally:
        for one in sets.values():
            one.drop()


@dataclass
class _Set:
    """The texture of one input while it is written: files without their names yet, and means."""

    place: Path
    space: str
    written: list[tuple[int, Path]] = field(default_factory=list)
    digest: hashlib._Hash = field(default_factory=hashlib.sha256)
    total: F64 = field(default_factory=lambda: np.zeros((2, 3)))  # before, after
    texels: int = 0

    def add(self, tile: int, pixels: NDArray[np.float16], was: F64, wraps: tuple[str, str]) -> None:
        temporary = beside(self.place.parent / f"{self.place.name}.{tile}.exr")
        self.written.append((tile, temporary))
        write_texels(temporary, pixels, self.space, wraps)
        self.digest.update(f"{tile} {pixels.shape} {wraps} {self.space}".encode())
        self.digest.update(np.ascontiguousarray(pixels).data)
        self.total += [was, pixels.sum((0, 1), dtype=np.float64)]
        self.texels += pixels.shape[0] * pixels.shape[1]

    def finish(self, like: Texture) -> Baked:
        """Gives the files their names."""
        name, folder = f"{self.place.name}_{self.digest.hexdigest()[:12]}", self.place.parent
        for tile, temporary in self.written:
            put_in_place(temporary, folder / (f"{name}.{tile}.exr" if tile else f"{name}.exr"))
        file = folder / (f"{name}.<UDIM>.exr" if self.written[0][0] else f"{name}.exr")
        before, (r, g, b) = (self.total / max(self.texels, 1)).tolist()
        return Baked(
            str(file), self.space, "rgb", tuple(before), (r, g, b), (r, g, b, 1.0), like.wrap_s, like.wrap_t,
            like.uv_set, self.texels, like.prim,
        )  # fmt: skip

    def drop(self) -> None:
        """Removes files that have not got their names."""
        for _, temporary in self.written:
            temporary.unlink(missing_ok=True)


def _finer(size: tuple[int, int]) -> tuple[int, int]:
    """The size (height, width) for maps of a size, with room for what lies between two texels of each.

    Values between texels are products of what maps have there, which texels of the products are not: twice as many
    are off by a quarter of it.
    """
    times = next((n for n in (8, 4, 2) if n * max(size) <= FINE), 1)
    return size[0] * times, size[1] * times


def _add_tile(
    sets: dict[str, _Set], tile: int, size: tuple[int, int], source: tuple[Material, Make, Path, Color]
) -> None:
    """Computes one tile of all textures, a few rows at a time."""
    m, make, place, color = source
    height, width = size
    first = np.array([(tile - 1001) % 10, (tile - 1001) // 10]) if tile else np.zeros(2)
    pixels: dict[str, NDArray[np.float16]] = {}
    was: dict[str, F64] = {}
    rows = max(1, _BLOCK // width)
    s = (np.arange(width) + 0.5) / width
    for top in range(0, height, rows):
        t = 1 - (np.arange(top, min(top + rows, height)) + 0.5) / height  # row 0 is on top
        st = np.stack(np.broadcast_arrays(s[None], t[:, None]), -1).reshape(-1, 2) + first
        colors = _colors_at(m, st, color)
        for name, values in make(colors).items():
            if name not in pixels:
                pixels[name], was[name] = np.empty((height, width, 3), np.float16), np.zeros(3)
            was[name] += (colors.base if name == "diffuseColor" else colors.f0).sum(0)
            pixels[name][top : top + rows] = np.clip(values, -HALF_MAX, HALF_MAX).reshape(-1, width, 3)
    wraps = ("clamp", "clamp")
    if not tile:
        leading = next(v for n in _NAMES if isinstance(v := getattr(m, n), Texture))
        wraps = (leading.wrap_s, leading.wrap_t)
    for name, found in pixels.items():
        if name not in sets:
            sets[name] = _Set(place.parent / f"{place.name}_{name}", color.working_space)
        sets[name].add(tile, found, was[name], wraps)


def _colors_at(m: Material, st: F64, color: Color) -> Colors:
    """The inputs at texture coordinates (n, 2) that are those of all maps."""

    def read(value: Input, size: int) -> F64:
        if isinstance(value, Texture):
            rgba = sample_texture(value, st, color)
            found = rgba[:, ["rgba".index(c) for c in value.channels]].astype(np.float64)
            return np.broadcast_to(found[:, :size], (len(st), size))
        return np.broadcast_to(np.asarray(value, np.float64), (len(st), size))

    base, metallic = np.maximum(read(m.diffuse_color, 3), 0), np.clip(read(m.metallic, 1), 0, 1)
    return Colors(base, metallic, np.maximum(read(m.ior, 1), 1e-3))


def _coordinates(t: Texture) -> tuple:
    """What says which texel of a map a place shows."""
    tiles = tuple(number for number, _ in t.tiles)
    return t.uv_set, t.st_from_uv, t.st_fallback, t.wrap_s, t.wrap_t, bool(tiles or "<UDIM>" in t.path)
