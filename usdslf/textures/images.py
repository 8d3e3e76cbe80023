"""Images: textures, environment maps and pictures, by OpenImageIO.

What is kept of textures, and within which limits, is texture_store's.  Coordinates are USD's: st (0, 0) is
the lower left corner of the picture, texel centres are at (i + 0.5) / size.
"""

from __future__ import annotations

import tempfile
from collections.abc import Iterable, Mapping
from pathlib import Path

import numpy as np
import OpenImageIO as oiio
from numpy.typing import ArrayLike, NDArray

from usdslf.color import USD_DEFAULT_SPACE, Color, color_of
from usdslf.errors import InputError
from usdslf.replacing import replacing
from usdslf.scene.records import F32, LightTexture, Texture
from usdslf.textures.declared import space_of, words_of_channels
from usdslf.textures.files import file_of, open_image
from usdslf.textures.store import Image, load_image, read_whole, say_damaged
from usdslf.textures.texels import EDGE, WRAPS, Texels, bilinear, four_channels, st_of_format


def why_unreadable(path: str) -> str:
    """Returns why an image cannot be opened, "" where it can."""
    try:
        open_image(path).close()
    except OSError as e:
        return str(e)
    return ""


def wrap_modes(path: str) -> tuple[str, str]:
    """Returns the wrap modes (s, t) that a file's metadata asks for: black where it says nothing."""
    try:
        image = open_image(path)
    except OSError:
        return "black", "black"
    modes = str(image.spec().get_string_attribute("wrapmodes")).replace("periodic", "repeat").split(",")
    image.close()
    modes = [m.strip() if m.strip() in WRAPS else "black" for m in modes]
    return modes[0], modes[-1]


def is_integer(path: str) -> bool:
    """Whether a file holds code values of 8 or 16 bits, which stand for 0..1."""
    try:
        image = open_image(path)
    except OSError:
        return False
    found = image.spec().format in (oiio.UINT8, oiio.UINT16)
    image.close()
    return found


def files_of(texture: Texture) -> list[str]:
    """Returns the files of a texture: the tiles of a UDIM set, one, or none."""
    return [path for _, path in _files(texture)]


def unreadable(texture: Texture, color: Color) -> list[tuple[str, str]]:
    """Returns the files of a texture that cannot be read, pixels included, each with the reason.

    What can be read is made ready for look-ups.  Of a large tiled file only the ends are read: a damaged
    tile between them is found when it is looked up, said then, and has the fallback too.
    """
    found = []
    for _, path in _files(texture):
        try:
            load_image(path, texture.color_space, color)
        except OSError as e:
            found.append((path, str(e)))
    return found


def declared_space(path: str) -> str:
    """Returns the colour space that an image is read in where none is asked for; "raw" where it cannot be opened."""
    try:
        image = open_image(path)
    except OSError:
        return "raw"
    space = space_of("auto", image.spec(), file_of(path))[0]
    image.close()
    return space


def what_was_taken(path: str, color_space: str) -> list[str]:
    """Returns in words what of an image was taken, and as what, where a reader may expect something else."""
    try:
        image = open_image(path)
    except OSError:
        return []
    spec = image.spec()
    said = [words_of_channels(spec), space_of(color_space, spec, file_of(path))[1]]
    image.close()
    return [s for s in said if s]


def remarks(texture: Texture, color: Color) -> tuple[list[tuple[str, str]], list[str]]:
    """Makes a texture ready for look-ups and returns what of it is `unreadable`, and what there is to say of it.

    In what is said, {} is where its shader is named.
    """
    wanting = unreadable(texture, color)
    said = [f"texture {file} of {{}} cannot be read ({why}): its fallback is used" for file, why in wanting]
    taken = {f: what_was_taken(f, texture.color_space) for f in files_of(texture)}
    said += [f"texture {file} of {{}}: {words}" for file, sentences in taken.items() for words in sentences]
    return wanting, said


def load_texture(texture: Texture, color: Color) -> dict[int, Image]:
    """Returns the readable images of a texture by UDIM tile; a plain texture is {0: texels}."""
    found = {}
    for tile, path in _files(texture):
        try:
            found[tile] = load_image(path, texture.color_space, color)
        except OSError:
            continue
    return found


def sample_texture(texture: Texture, st: ArrayLike, color: Color) -> F32:
    """Returns texel * scale + bias (n, 4) in the working space at st (n, 2), bilinear.

    Wrap mode black is decided by the coordinate, without a rim of half a texel inside the picture, as
    path tracers do.  The fallback stands for an unreadable file, a missing tile and st that is nan.
    """
    st = np.asarray(st, np.float64).reshape(-1, 2)
    out = np.tile(np.asarray(texture.fallback, np.float32), (len(st), 1))
    finite: NDArray[np.bool_] = np.asarray(np.isfinite(st).all(1))
    files = dict(_files(texture))
    if 0 in files:
        _sample_file(out, np.nonzero(finite)[0], texture, files[0], st, (texture.wrap_s, texture.wrap_t), color)
        return out
    # A point on the upper edge of a tile whose neighbour is missing belongs to the tile.
    cell: NDArray[np.int64] = np.floor(np.where(finite[:, None], st, -1.0)).astype(np.int64)
    number = 1001 + cell[:, 0] + 10 * cell[:, 1]
    back: NDArray[np.int64] = np.floor(np.where(finite[:, None], st, -1.0) - EDGE).astype(np.int64)
    near = np.unique(np.concatenate([number, 1001 + back[:, 0] + 10 * back[:, 1]]))
    there = [tile for tile in files if tile in near and _is_readable(files[tile], texture.color_space, color)]
    missing = np.nonzero(~np.isin(number, there))[0]
    cell[missing] = back[missing]
    number = np.where((cell[:, 0] >= 0) & (cell[:, 0] < 10), 1001 + cell[:, 0] + 10 * cell[:, 1], 0)
    for tile in there:
        at = np.nonzero(number == tile)[0]
        if len(at):
            _sample_file(out, at, texture, files[tile], st - cell, ("clamp", "clamp"), color)
    return out


def _is_readable(path: str, color_space: str, color: Color) -> bool:
    try:
        load_image(path, color_space, color)
    except OSError:
        return False
    return True


def _sample_file(
    out: F32, at: NDArray, texture: Texture, path: str, st: NDArray, wraps: tuple[str, str], color: Color
) -> None:
    """Writes the values of one file at st[at] into out[at]; the fallback stays where it cannot be read."""
    try:
        image = load_image(path, texture.color_space, color)
    except OSError:
        return  # said when the stage was read
    scale, bias = np.asarray(texture.scale, np.float32), np.asarray(texture.bias, np.float32)
    try:
        out[at] = bilinear(image, st[at], *wraps) * scale + bias
    except OSError as e:
        say_damaged(path, str(e))


def load_latlong(
    path: str,
    format: str,
    color_space: str,
    color: Color,
) -> F32:
    """Returns an environment map as latlong pixels (H, W, 3) in the working space.

    Row 0 is latitude +90 degrees (+Y), column 0 longitude +180, longitude 0 is +Z, longitude 90 is +X
    (UsdLux).  The other formats are resampled; automatic means latlong.

    Raises:
        InputError: the file cannot be read.
    """
    try:
        values = read_whole(path, color_space, color)
    except OSError as e:
        raise InputError(f"environment map {path} cannot be read, check the file: {e}") from None
    height, width = values.shape[:2]
    if format in ("automatic", "latlong"):
        colors = values[..., :3] if values.shape[2] >= 3 else np.broadcast_to(values[..., :1], (height, width, 3))
        return np.ascontiguousarray(colors)
    rows = max(2, height // 2)
    st, inside = st_of_format(format, latlong_directions(rows, 2 * rows))
    out = bilinear(Texels(values), st, "clamp", "clamp")[:, :3] * inside[:, None]
    return out.reshape(rows, 2 * rows, 3).astype(np.float32)


def load_light_texture(texture: LightTexture) -> F32:
    """Returns the pixels (H, W, 3) of a light's picture in the working space of its scene, row 0 on top.

    Raises:
        InputError: the file cannot be read, or the config cannot be used.
    """
    color = color_of(texture.ocio, texture.working_space)
    return load_latlong(texture.path, texture.format, texture.color_space, color)


def latlong_directions(height: int, width: int) -> NDArray[np.float64]:
    """Returns the direction (height * width, 3) through the middle of each latlong pixel."""
    latitude = np.pi * (0.5 - (np.arange(height) + 0.5) / height)[:, None]
    longitude = np.pi * (1 - 2 * (np.arange(width) + 0.5) / width)[None]
    x = np.cos(latitude) * np.sin(longitude)
    y = np.broadcast_to(np.sin(latitude), x.shape)
    return np.stack([x, y, np.cos(latitude) * np.cos(longitude)], -1).reshape(-1, 3)


def read_image(path: str | Path, color_space: str, color: Color) -> F32:
    """Returns the pixels (H, W, 4) of an image in the working space, row 0 on top.

    Raises:
        InputError: the file cannot be read, or the colour space is unknown.
    """
    try:
        values = read_whole(str(path), color_space, color)
    except OSError as e:
        raise InputError(f"image {path} cannot be read, check the file: {e}") from None
    return four_channels(values.reshape(-1, values.shape[2])).reshape(*values.shape[:2], 4)


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
    with replacing(path) as temporary:
        output = oiio.ImageOutput.create(str(temporary))
        if not output or not output.open(str(temporary), spec):
            raise OSError(output.geterror() if output else oiio.geterror())
        done = output.write_image(values)
        if not output.close() or not done:
            raise OSError(output.geterror())
    return path


def png_bytes(pixels: ArrayLike) -> bytes:
    """Returns display code values (H, W, 1 or 3) of 0..1 as a PNG."""
    values = np.nan_to_num(np.clip(np.asarray(pixels, np.float32), 0, 1))
    values = np.ascontiguousarray(np.broadcast_to(values, (*values.shape[:2], 3)))
    height, width, count = values.shape
    spec = oiio.ImageSpec(width, height, count, oiio.UINT8)
    spec.attribute("oiio:ColorSpace", "srgb_rec709_scene")
    with tempfile.TemporaryDirectory(prefix="usdslf_") as folder:
        file = Path(folder) / "picture.png"
        output = oiio.ImageOutput.create(str(file))
        if not output or not output.open(str(file), spec) or not output.write_image(values) or not output.close():
            raise InputError(f"a picture of {width} x {height} cannot be encoded; give another --size")
        return file.read_bytes()


# ---- files -----------------------------------------------------------------------------------
def _files(texture: Texture) -> tuple[tuple[int, str], ...]:
    """Returns (UDIM tile, file); a plain texture has tile 0."""
    if texture.tiles or "<UDIM>" in texture.path:
        return texture.tiles
    return ((0, texture.path),) if texture.path else ()
