"""Bakes a change that varies over a surface into a texture: the original's texels plus the change.

    bake_texture(scene, texture, triangles, delta, place, ...) -> Baked
    plain_texture(value, uv_set) -> Texture                              the base of an input without a texture

The change is added where texels lie on the painted triangles, and goes on over the rim around their charts
as far as no other surface uses it, so that filtering does not reach unchanged texels.  All other texels are
those of the original.  Files are EXR half in the working space, tiled and mip-mapped, named by their content.
"""

from __future__ import annotations

import hashlib
import os
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import OpenImageIO as oiio
from numpy.typing import ArrayLike, NDArray

from usdslf.color import Color
from usdslf.errors import AuthorError
from usdslf.progress import tell, undisturbed
from usdslf.replacing import beside, put_in_place
from usdslf.scene.records import F32, F64, Scene, Texture
from usdslf.textures.images import load_texture
from usdslf.textures.rasterize import nearest_covered, texel_points
from usdslf.textures.store import Image
from usdslf.textures.texels import Texels

Delta = Callable[[NDArray, NDArray], NDArray]
"""(triangle (n,) of the scene, barycentric (n, 2)) -> (n, channels) what is added to the input's value."""

BORDER = 8  # texels around charts: three levels of mip maps
PLAIN_SIZE = 1024  # of a texture for an input that had none
HALF_MAX = 65504.0
_BLOCK = 256  # rows that are converted at a time
_NEEDED = {"r": 1, "g": 3, "b": 3, "a": 4, "rgb": 3}
_WRAP_MODES = {"repeat": "periodic"}


@dataclass(frozen=True)
class Baked:
    """A texture that was baked."""

    file: str  # holds <UDIM> for a tiled set
    color_space: str  # of its texels
    channels: str  # that changed: rgb | r | g | b | a
    before: tuple[float, ...]  # mean of the input over the painted texels
    after: tuple[float, ...]
    fallback: tuple[float, float, float, float]  # mean after, of all channels
    wrap_s: str
    wrap_t: str
    uv_set: str
    texels: int  # how many changed, without the rim
    like: str = ""  # prim of the texture that a new node has its coordinates from; "": reads uv_set as it is


def bake_texture(
    scene: Scene,
    texture: Texture,
    triangles: NDArray,
    delta: Delta,
    place: str | os.PathLike[str],
    color: Color,
    *,
    size: tuple[int, int] | None = None,
    warnings: list[str] | None = None,
) -> Baked:
    """Writes a texture with a change that varies over triangles of a scene.

    Args:
        texture: what drives the input now; its scale, bias and coordinates stay as they are.
        triangles: (k,) of the scene, that show the change; all others that read the texture now stay as they are.
        delta: of the input's value, which is texel * scale + bias.
        place: of the files, which have a hash after that name; its folder is made if it is missing.
        size: (width, height); None: that of the original.
        warnings: takes a sentence for each thing that is odd.

    Raises:
        AuthorError: the texture cannot be read, nothing is painted on it, or a file cannot be written.
    """
    images = load_texture(texture, color) or _plain(texture, size)
    making = _Making(scene, texture, np.unique(triangles), delta, Path(place), color)
    try:
        making.place.parent.mkdir(parents=True, exist_ok=True)
        for tile, image in sorted(images.items()):
            making.add_tile(tile, image, size)
            tell()
        with undisturbed():
            file = making.finish()
    except OSError as error:
        folder = making.place.parent
        raise AuthorError(f"{folder} cannot be written: {error.strerror or error}; choose another place") from None
    finally:
        making.drop()
    if warnings is not None:
        warnings += making.oddities()
    before, after = making.means()
    return Baked(
        file=str(file),
        color_space=making.space,
        channels=texture.channels,
        before=tuple(float(x) for x in before[making.at]),
        after=tuple(float(x) for x in after[making.at]),
        fallback=(float(after[0]), float(after[1]), float(after[2]), float(after[3])),
        wrap_s=texture.wrap_s,
        wrap_t=texture.wrap_t,
        uv_set=texture.uv_set,
        texels=making.texels,
    )


class _Making:
    """The tiles of a texture that is being baked: files without their names yet, and what is known of all of them."""

    def __init__(
        self, scene: Scene, texture: Texture, triangles: NDArray, delta: Delta, place: Path, color: Color
    ) -> None:
        self.texture, self.triangles, self.delta, self.place = texture, triangles, delta, place
        others = np.setdiff1d(_showing(scene, texture, triangles), triangles)
        self.uv, self.uv_others = _coordinates(scene, texture, triangles), _coordinates(scene, texture, others)
        self.at = ["rgba".index(c) for c in texture.channels]
        self.gain = np.asarray(texture.scale, np.float64)[self.at]
        if (np.abs(self.gain) < 1e-6).any():
            raise AuthorError(f"{texture.prim} scales its texels by zero: set its scale to one to paint on it")
        self.space = "raw" if color.is_data(texture.color_space) else color.working_space
        self.written: list[tuple[int, Path]] = []
        self.digest, self.sums = hashlib.sha256(), np.zeros((3, 4))
        self.twice, self.shared = 0, 0  # texels on several painted places, and on others too

    @property
    def texels(self) -> int:
        """How many changed, without the rim."""
        return int(self.sums[0, 0])

    def add_tile(self, tile: int, image: Image, size: tuple[int, int] | None) -> None:
        """Changes the texels of one tile and writes them."""
        cell = np.array([(tile - 1001) % 10, (tile - 1001) // 10]) if tile else np.zeros(2)
        wraps = ("clamp", "clamp") if tile else (self.texture.wrap_s, self.texture.wrap_t)
        pixels = _pixels(image, _NEEDED[self.texture.channels], size)
        change, hits = _drawn(pixels.shape[:2], self.uv - cell, self.triangles, self.delta, wraps, len(self.at))
        used = _covered(pixels.shape[:2], self.uv_others - cell, wraps)
        self.twice += int((hits > 1).sum())
        self.shared += int((used & (hits > 0)).sum())
        self.sums += _add(pixels, change / self.gain, hits > 0, used, self.at, wraps)
        temporary = beside(self.place.parent / f"{self.place.name}.{tile}.exr")
        self.written.append((tile, temporary))
        write_texels(temporary, pixels, self.space, wraps)
        self.digest.update(f"{tile} {pixels.shape} {wraps} {self.space}".encode())
        self.digest.update(np.ascontiguousarray(pixels).data)

    def finish(self) -> Path:
        """Gives the files their names; returns that of all of them."""
        if not self.texels:
            where = self.texture.path or self.texture.prim
            raise AuthorError(f"nothing that was painted lies on {where}: check its uvs")
        name, folder = f"{self.place.name}_{self.digest.hexdigest()[:12]}", self.place.parent
        for tile, temporary in self.written:
            put_in_place(temporary, folder / (f"{name}.{tile}.exr" if tile else f"{name}.exr"))
        return folder / (f"{name}.<UDIM>.exr" if self.written[0][0] else f"{name}.exr")

    def drop(self) -> None:
        """Removes files that have not got their names."""
        for _, temporary in self.written:
            temporary.unlink(missing_ok=True)

    def oddities(self) -> list[str]:
        """Returns a sentence for each thing that is odd."""
        name, said = self.texture.path or self.place.name, []
        if self.twice:
            said.append(f"{name}: {self.twice} texels lie on several painted places: they get the mean.")
        if self.shared:
            said.append(f"{name}: {self.shared} texels also show elsewhere, and change there too.")
        return said

    def means(self) -> tuple[F64, F64]:
        """Returns the input's mean (4,) over the painted texels, before and after."""
        before, after = (s / self.sums[0, 0] * self.texture.scale + self.texture.bias for s in self.sums[1:])
        return before, after


def plain_texture(value: ArrayLike, uv_set: str = "st", channels: str = "") -> Texture:
    """Returns a texture of one colour that stands for a constant input (1,) or (3,)."""
    v = np.ravel(np.asarray(value, np.float64))
    rgb = [float(x) for x in (v if len(v) == 3 else np.repeat(v, 3))]
    fallback = (rgb[0], rgb[1], rgb[2], 1.0)
    space = "raw" if len(v) == 1 else "auto"
    named = channels or ("rgb" if len(v) == 3 else "r")
    return Texture("", "", color_space=space, fallback=fallback, channels=named, uv_set=uv_set)


# ---- the surface ---------------------------------------------------------------------------
def _showing(scene: Scene, texture: Texture, triangles: NDArray) -> NDArray:
    """The triangles whose materials read the same texture node, or will read the new one."""
    if not texture.prim:
        table = scene.triangles.material
        return np.flatnonzero(np.isin(table, np.unique(table[triangles])))
    reads = [
        any(isinstance(v, Texture) and v.prim == texture.prim for v in vars(m).values())
        for m in scene.materials
    ]
    return np.flatnonzero(np.array(reads, bool)[scene.triangles.material])


def _coordinates(scene: Scene, texture: Texture, triangles: NDArray) -> F64:
    uv = scene.corner_uvs(texture.uv_set)[triangles].astype(np.float64)
    m = np.asarray(texture.st_from_uv, np.float64)
    return uv @ m[:2, :2].T + m[:2, 2]


# ---- texels ----------------------------------------------------------------------------------
def _plain(texture: Texture, size: tuple[int, int] | None) -> dict[int, Image]:
    """One colour, where no file is named."""
    if texture.path:
        raise AuthorError(
            f"the texture {texture.path} of {texture.prim} cannot be read: restore it to paint on it"
        )
    width, height = size or (PLAIN_SIZE, PLAIN_SIZE)
    values = np.asarray(texture.fallback, np.float16)[: _NEEDED[texture.channels]]
    return {0: Texels(np.broadcast_to(values, (height, width, len(values))))}


def _pixels(image: Image, needed: int, size: tuple[int, int] | None) -> NDArray[np.float16]:
    """The texels (h, w, c) of an image in the working space, as they are stored."""
    height, width, count = image.shape
    count = max(4 if count == 2 else count, needed)
    out = np.empty((height, width, count), np.float16)
    for top in range(0, height, _BLOCK):
        rows = min(_BLOCK, height - top)
        values = image.rows(top, top + rows)[..., :count]
        out[top : top + rows] = np.clip(values, -HALF_MAX, HALF_MAX)
    if size is None or size == (width, height):
        return out
    source = oiio.ImageBuf(oiio.ImageSpec(width, height, count, oiio.HALF))
    source.set_pixels(oiio.ROI(), out)
    resized = oiio.ImageBufAlgo.resize(source, roi=oiio.ROI(0, size[0], 0, size[1], 0, 1, 0, count))
    return np.asarray(resized.get_pixels(oiio.HALF), np.float16)


def _drawn(
    shape: tuple[int, ...], uv: F64, triangles: NDArray, delta: Delta, wraps: tuple[str, str], channels: int
) -> tuple[F32, NDArray[np.uint16]]:
    """Returns the mean change (h, w, channels) of each texel, and how many places it lies on."""
    height, width = shape[:2]
    total = np.zeros((channels, height * width), np.float32)
    hits = np.zeros(height * width, np.uint16)
    for points in texel_points(uv, width, height, *wraps):
        if not len(points.x):
            continue
        at = points.y * width + points.x
        values = np.asarray(delta(triangles[points.triangle], points.barycentric), np.float32)
        for c, row in enumerate(total):
            np.add.at(row, at, values.reshape(len(at), -1)[:, c])
        np.add.at(hits, at, np.uint16(1))
        tell()
    total /= np.maximum(hits, 1)
    return np.moveaxis(total.reshape(channels, height, width), 0, -1), hits.reshape(height, width)


def _covered(shape: tuple[int, ...], uv: F64, wraps: tuple[str, str]) -> NDArray[np.bool_]:
    """Which texels (h, w) lie on any of the triangles."""
    out = np.zeros(shape[:2], bool)
    for points in texel_points(uv, shape[1], shape[0], *wraps):
        out[points.y, points.x] = True
        tell()
    return out


def _add(
    pixels: NDArray[np.float16],
    change: NDArray,
    covered: NDArray[np.bool_],
    used: NDArray[np.bool_],
    at: list[int],
    wraps: tuple[str, str],
) -> F64:
    """Adds the change to the texels, and to the rim around them; returns count and means times count (3, 4)."""
    sums = np.zeros((3, 4))
    count = pixels.shape[2]
    texels = pixels[covered]
    sums[0], sums[1:, 3] = len(texels), len(texels)  # alpha is 1 where there is none
    sums[1, :count] = texels.sum(0, dtype=np.float64)
    repeats = (wraps[1] == "repeat", wraps[0] == "repeat")
    y, x, from_y, from_x = nearest_covered(covered, ~(covered | used), BORDER, repeats)
    rim, spread = pixels[y, x].astype(np.float32), change[from_y, from_x]
    texels = texels.astype(np.float32)
    texels[:, at] += change[covered]
    rim[:, at] += spread
    pixels[covered] = np.clip(texels, -HALF_MAX, HALF_MAX)
    pixels[y, x] = np.clip(rim, -HALF_MAX, HALF_MAX)
    sums[2, :count] = pixels[covered].sum(0, dtype=np.float64)
    if count == 1:
        sums[1:, 1:3] = sums[1:, :1]
    return sums


def write_texels(path: Path, pixels: NDArray[np.float16], space: str, wraps: tuple[str, str]) -> None:
    """Writes a tiled EXR with mip maps; the same texels give the same bytes."""
    height, width, count = pixels.shape
    source = oiio.ImageBuf(oiio.ImageSpec(width, height, count, oiio.HALF))
    source.set_pixels(oiio.ROI(), np.ascontiguousarray(pixels))
    spec = oiio.ImageSpec()
    spec.format, spec.tile_width, spec.tile_height = oiio.HALF, 64, 64
    names = {"compression": "zip", "wrapmodes": ",".join(_WRAP_MODES.get(w, w) for w in wraps)}
    names["DateTime"] = "2000:01:01 00:00:00"  # else the time of writing
    names |= {"oiio:ColorSpace": space} | ({"colorInteropID": space} if space != "raw" else {})
    for name, value in names.items():
        spec.attribute(name, value)
    spec.attribute("maketx:constant_color_detect", 0)
    if not oiio.ImageBufAlgo.make_texture(oiio.MakeTxTexture, source, str(path), spec):
        raise OSError(" ".join(str(oiio.geterror()).split()))
