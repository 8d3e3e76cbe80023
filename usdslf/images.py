"""Images: textures, environment maps and pictures, by OpenImageIO.

A texture keeps its texels as they are in the file where a table converts them (8 bit), else converted to
the working space in half floats: a shot's textures are its largest data.  Coordinates are USD's: st (0, 0)
is the lower left corner of the picture, texel centres are at (i + 0.5) / size.
"""

from __future__ import annotations

import os
import tempfile
import zipfile
from collections.abc import Iterable, Mapping
from functools import lru_cache
from pathlib import Path

import numpy as np
import OpenImageIO as oiio
from numpy.typing import ArrayLike, NDArray

from usdslf.color import USD_DEFAULT_SPACE, Color, color_of
from usdslf.errors import InputError
from usdslf.scene import F32, Texture
from usdslf.texels import EDGE, WRAPS, Texels, bilinear, st_of_format

_RAW_PIXELS = {"oiio:UnassociatedAlpha": 1}  # rgb as stored, not multiplied by alpha


def why_unreadable(path: str) -> str:
    """Returns why an image cannot be opened, "" where it can."""
    try:
        _open(path).close()
    except OSError as e:
        return str(e)
    return ""


def wrap_modes(path: str) -> tuple[str, str]:
    """Returns the wrap modes (s, t) that a file's metadata asks for: black where it says nothing."""
    try:
        image = _open(path)
    except OSError:
        return "black", "black"
    modes = str(image.spec().get_string_attribute("wrapmodes")).replace("periodic", "repeat").split(",")
    image.close()
    modes = [m.strip() if m.strip() in WRAPS else "black" for m in modes]
    return modes[0], modes[-1]


def is_integer(path: str) -> bool:
    """Whether a file holds code values of 8 or 16 bits, which stand for 0..1."""
    try:
        image = _open(path)
    except OSError:
        return False
    found = image.spec().format in (oiio.UINT8, oiio.UINT16)
    image.close()
    return found


def files_of(texture: Texture) -> list[str]:
    """Returns the files of a texture: the tiles of a UDIM set, one, or none."""
    return [path for _, path in _files(texture)]


def unreadable(texture: Texture, color: Color | None = None) -> list[tuple[str, str]]:
    """Returns the files of a texture that cannot be read, pixels included, each with the reason.

    What can be read is kept, so that sampling finds it in memory.
    """
    color, found = color or color_of(), []
    for _, path in _files(texture):
        try:
            _load(path, _stamp(path), texture.color_space, color)
        except OSError as e:
            found.append((path, str(e)))
    return found


def load_texture(texture: Texture, color: Color | None = None) -> dict[int, Texels]:
    """Returns the readable images of a texture by UDIM tile; a plain texture is {0: texels}."""
    color = color or color_of()
    found = {}
    for tile, path in _files(texture):
        try:
            found[tile] = _load(path, _stamp(path), texture.color_space, color)
        except OSError:
            continue
    return found


def sample_texture(texture: Texture, st: ArrayLike, color: Color | None = None) -> F32:
    """Returns texel * scale + bias (n, 4) in the working space at st (n, 2), bilinear.

    Wrap mode black is decided by the coordinate, without a rim of half a texel inside the picture, as
    path tracers do.  The fallback stands for an unreadable file, a missing tile and st that is nan.
    """
    st = np.asarray(st, np.float64).reshape(-1, 2)
    tiles = load_texture(texture, color)
    out = np.tile(np.asarray(texture.fallback, np.float32), (len(st), 1))
    scale, bias = np.asarray(texture.scale, np.float32), np.asarray(texture.bias, np.float32)
    if not tiles:
        return out
    finite: NDArray[np.bool_] = np.asarray(np.isfinite(st).all(1))
    if 0 in tiles:
        ok = np.nonzero(finite)[0]
        out[ok] = bilinear(tiles[0], st[ok], texture.wrap_s, texture.wrap_t) * scale + bias
        return out
    # A point on the upper edge of a tile whose neighbour is missing belongs to the tile.
    cell: NDArray[np.int64] = np.floor(np.where(finite[:, None], st, -1.0)).astype(np.int64)
    number = 1001 + cell[:, 0] + 10 * cell[:, 1]
    back: NDArray[np.int64] = np.floor(np.where(finite[:, None], st, -1.0) - EDGE).astype(np.int64)
    missing = np.nonzero(~np.isin(number, list(tiles)))[0]
    cell[missing] = back[missing]
    number = np.where((cell[:, 0] >= 0) & (cell[:, 0] < 10), 1001 + cell[:, 0] + 10 * cell[:, 1], 0)
    for tile, texels in tiles.items():
        ok = np.nonzero(number == tile)[0]
        if len(ok):
            out[ok] = bilinear(texels, st[ok] - cell[ok], "clamp", "clamp") * scale + bias
    return out


def load_latlong(
    path: str,
    format: str = "automatic",
    color_space: str = "auto",
    color: Color | None = None,
) -> F32:
    """Returns an environment map as latlong pixels (H, W, 3) in the working space.

    Row 0 is latitude +90 degrees (+Y), column 0 longitude +180, longitude 0 is +Z, longitude 90 is +X
    (UsdLux).  The other formats are resampled; automatic means latlong.

    Raises:
        InputError: the file cannot be read.
    """
    color = color or color_of()
    try:
        texels = _load(path, _stamp(path), color_space, color)
    except OSError as e:
        raise InputError(f"environment map {path} cannot be read, check the file: {e}") from None
    height, width = texels.values.shape[:2]
    if format in ("automatic", "latlong"):
        y, x = np.indices((height, width)).reshape(2, -1)
        return texels.at(y, x)[:, :3].reshape(height, width, 3)
    rows = max(2, height // 2)
    st, inside = st_of_format(format, latlong_directions(rows, 2 * rows))
    out = bilinear(texels, st, "clamp", "clamp")[:, :3] * inside[:, None]
    return out.reshape(rows, 2 * rows, 3).astype(np.float32)


def latlong_directions(height: int, width: int) -> NDArray[np.float64]:
    """Returns the direction (height * width, 3) through the middle of each latlong pixel."""
    latitude = np.pi * (0.5 - (np.arange(height) + 0.5) / height)[:, None]
    longitude = np.pi * (1 - 2 * (np.arange(width) + 0.5) / width)[None]
    x = np.cos(latitude) * np.sin(longitude)
    y = np.broadcast_to(np.sin(latitude), x.shape)
    return np.stack([x, y, np.cos(latitude) * np.cos(longitude)], -1).reshape(-1, 3)


def read_image(path: str | Path, color_space: str = "auto", color: Color | None = None) -> F32:
    """Returns the pixels (H, W, 4) of an image in the working space, row 0 on top.

    Raises:
        InputError: the file cannot be read, or the colour space is unknown.
    """
    try:
        texels = _load(str(path), _stamp(str(path)), color_space, color or color_of())
    except OSError as e:
        raise InputError(f"image {path} cannot be read, check the file: {e}") from None
    y, x = np.indices(texels.values.shape[:2]).reshape(2, -1)
    return texels.at(y, x).reshape(*texels.values.shape[:2], 4)


def write_image(
    path: str | Path,
    pixels: ArrayLike,
    color_space: str = USD_DEFAULT_SPACE,
    channels: Iterable[str] = (),
    half: bool = True,
    metadata: Mapping[str, str | float] | None = None,
) -> Path:
    """Writes an image through a temporary file, so that a failed run leaves the earlier one untouched.

    Args:
        path: .exr (scene-linear, half or float) or .png, .jpg, .tif (8 bit, pixels already display-referred).
        pixels: (H, W, C) or (H, W), row 0 on top.
        color_space: name recorded in an EXR.
        channels: channel names, R G B A where none are given.
        half: 16 bit floats in an EXR, else 32 bit.
        metadata: further attributes of the header.

    Raises:
        InputError: the place cannot be written or the format is unknown.
    """
    path = Path(path)
    values = np.ascontiguousarray(pixels, np.float32)
    values = values[..., None] if values.ndim == 2 else values
    height, width, count = values.shape
    suffix = path.suffix.lower()
    is_exr = suffix == ".exr"
    if suffix not in (".exr", ".png", ".jpg", ".jpeg", ".tif", ".tiff"):
        raise InputError(f"{path} has no known image format, use .exr or .png")
    spec = oiio.ImageSpec(width, height, count, (oiio.HALF if half else oiio.FLOAT) if is_exr else oiio.UINT8)
    names = tuple(channels) or {1: ("Y",), 2: ("Y", "A"), 3: tuple("RGB"), 4: tuple("RGBA")}.get(count)
    if names:
        spec.channelnames = names
    if is_exr:
        spec.attribute("compression", "zip")
        spec.attribute("oiio:ColorSpace", color_space)
        spec.attribute("colorInteropID", color_space)
        values = np.clip(values, -65504, 65504) if half else values
    else:
        spec.attribute("oiio:ColorSpace", "srgb_rec709_scene")
        spec.attribute("oiio:UnassociatedAlpha", 1)
        values = np.nan_to_num(np.clip(values, 0, 1))
    for name, value in (metadata or {}).items():
        spec.attribute(name, value)
    temporary = path.with_name(f".{path.stem}.{os.getpid()}{suffix}")
    try:
        output = oiio.ImageOutput.create(str(temporary))
        if not output or not output.open(str(temporary), spec):
            raise OSError(output.geterror() if output else oiio.geterror())
        done = output.write_image(values)
        if not output.close() or not done:
            raise OSError(output.geterror())
        os.replace(temporary, path)
    except OSError as e:
        temporary.unlink(missing_ok=True)
        reason = " ".join(str(e).split())
        raise InputError(f"{path} cannot be written, check the folder and its rights: {reason}") from None
    return path


# ---- loading ---------------------------------------------------------------------------------
def _files(texture: Texture) -> tuple[tuple[int, str], ...]:
    """Returns (UDIM tile, file); a plain texture has tile 0."""
    if texture.tiles or "<UDIM>" in texture.path:
        return texture.tiles
    return ((0, texture.path),) if texture.path else ()


def _stamp(path: str) -> int:
    """Time of last change, so that a changed file is read again."""
    try:
        return os.stat(path.partition("[")[0] if path.endswith("]") else path).st_mtime_ns
    except OSError:
        return 0


@lru_cache(maxsize=256)
def _unpacked(package: str, inner: str, stamp: int) -> str:
    """Returns a file that holds what lies inside a .usdz package."""
    try:
        with zipfile.ZipFile(package) as archive:
            data = archive.read(inner)
    except (KeyError, zipfile.BadZipFile) as e:
        raise OSError(f"{inner} is not in {package}: {e}") from None
    folder = tempfile.mkdtemp(prefix="usdslf_")
    target = Path(folder) / Path(inner).name
    target.write_bytes(data)
    return str(target)


def _open(path: str) -> oiio.ImageInput:
    """Opens an image, or raises OSError with the reason."""
    if path.endswith("]") and ".usdz[" in path:
        package, _, inner = path[:-1].rpartition("[")
        path = _unpacked(package, inner, _stamp(path))
    if not os.path.isfile(path):
        raise OSError("no such file")
    config = oiio.ImageSpec()
    for name, value in _RAW_PIXELS.items():
        config.attribute(name, value)
    image = oiio.ImageInput.open(path, config)
    if image is None:
        raise OSError(" ".join(str(oiio.geterror()).split()) or "unknown format")
    return image


@lru_cache(maxsize=512)
def _load(path: str, stamp: int, color_space: str, color: Color) -> Texels:
    """Reads an image; `stamp` is part of the key only."""
    image = _open(path)
    spec = image.spec()
    eight = bool(spec.format == oiio.UINT8)
    used = min(spec.nchannels, 4)
    values = image.read_image(0, 0, 0, used, oiio.UINT8 if eight else oiio.FLOAT)
    error = image.geterror() if values is None or image.has_error else ""
    image.close()
    if values is None or error:
        raise OSError(" ".join(str(error).split()) or "the pixels cannot be read")
    values = np.asarray(values).reshape(spec.height, spec.width, used)
    space = _space_of(color_space, spec, eight)
    if not color.knows(space):
        raise OSError(f"its colour space {space!r} is unknown to {color.config_name}")
    if eight:
        if color.acts_per_channel(space) or used < 3:
            return Texels(values, _table(space, used, color))
        values = values.astype(np.float32) / np.float32(255)
    if used >= 3:
        values = color.to_working(values, space)
    elif not color.is_data(space):
        grey = color.to_working(np.repeat(values[..., :1], 3, -1), space)
        values = np.concatenate([grey[..., :1], values[..., 1:]], -1)
    fits_half = np.abs(values).max(initial=0.0) < 6e4
    return Texels(values.astype(np.float16) if fits_half else values.astype(np.float32))


def _space_of(color_space: str, spec: oiio.ImageSpec, eight: bool) -> str:
    """Returns the space of pixels; auto as UsdPreviewSurface says: 8 bit colour is sRGB, the rest linear."""
    if color_space not in ("auto", ""):
        return color_space
    if spec.nchannels < 3:
        return "raw"
    declared = spec.get_string_attribute("colorInteropID")
    if declared and not eight:
        return str(declared)
    linear_8_bit = spec.get_string_attribute("oiio:ColorSpace") in ("linear", "lin_rec709_scene")
    return "srgb_rec709_scene" if eight and not linear_8_bit else USD_DEFAULT_SPACE


def _table(space: str, channels: int, color: Color) -> F32:
    """Returns working-space values (256, channels) of all 8 bit codes; alpha is linear."""
    code = np.arange(256, dtype=np.float32) / np.float32(255)
    table = np.repeat(code[:, None], channels, 1)
    colors = 1 if channels < 3 else 3
    table[:, :colors] = color.to_working(np.repeat(code[:, None], 3, 1), space)[:, :colors]
    return table
