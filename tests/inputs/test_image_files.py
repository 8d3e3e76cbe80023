"""What of an image file is taken, and as what: channels by their names, colour space by what the file says."""

from __future__ import annotations

import struct
import zlib
from pathlib import Path

import numpy as np
import OpenImageIO as oiio
import pytest

from usdslf.color import USD_DEFAULT_SPACE, color_of
from usdslf.scene.records import Texture
from usdslf.surfaces.surface_points import evaluate_opacity, evaluate_surface
from usdslf.textures.images import sample_texture, what_was_taken
from usdslf.textures.store import SMALL
from usdslf.usd.read.read import read_scene

COLOR = color_of(None, USD_DEFAULT_SPACE)
CODES = (188, 100, 50)
LINEAR = [0.503, 0.127, 0.032]  # of these codes, by the sRGB curve


def save(path: Path, names: tuple[str, ...], values: tuple[float, ...], side: int = 4, kind: str = "float") -> str:
    spec = oiio.ImageSpec(side, side, len(names), kind)
    spec.channelnames = names
    output = oiio.ImageOutput.create(str(path))
    assert output.open(str(path), spec), output.geterror()
    assert output.write_image(np.broadcast_to(np.array(values, np.float32), (side, side, len(names))).copy())
    output.close()
    return str(path)


def texel(path: str, space: str = "auto") -> list[float]:
    return list(sample_texture(Texture("/t", path, color_space=space), [[0.5, 0.5]], COLOR)[0])


def test_a_depth_is_no_alpha(inputs: Path) -> None:
    scene = read_scene(inputs / "rgbz/s4.usda")
    triangles = np.arange(len(scene.triangles.mesh))
    opacity, presence = evaluate_opacity(scene, triangles, np.full((len(triangles), 2), 0.3))
    assert (opacity * presence).min() == 1
    assert any("Z" in w and "alpha is 1" in w and "/World/m/t" in w for w in scene.warnings)


def test_a_layer_of_normals_is_not_red(inputs: Path) -> None:
    path = str(inputs / "rgbz/t2.exr")
    pixels = oiio.ImageInput.open(path).read_image(0, 0, 0, 4, "float").reshape(-1, 4)
    assert texel(path, "raw") == pytest.approx([*pixels[0, 1:4], 1], abs=1e-3)
    assert any("N.X" in w for w in read_scene(inputs / "rgbz/s2.usda").warnings)


@pytest.mark.parametrize(
    ("names", "expected", "is_said"),
    [
        (("R", "G", "B", "A"), [0.1, 0.2, 0.3, 0.4], False),
        (("R", "G", "B", "id"), [0.1, 0.2, 0.3, 1], True),
        (("R", "G", "B", "Z", "A"), [0.1, 0.2, 0.3, 0.5], True),
        (("r", "g", "b"), [0.1, 0.2, 0.3, 1], False),
        (("N.X", "N.Y", "N.Z"), [0.1, 0.2, 0.3, 1], False),
        (("a.R", "a.G", "a.B", "a.A", "R", "G", "B"), [0.5, 0.6, 0.7, 1], True),
        (("Z", "diffuse.R", "diffuse.G", "diffuse.B", "diffuse.A"), [0.2, 0.3, 0.4, 0.5], True),
        (("Y",), [0.1, 0.1, 0.1, 1], False),
        (("Y", "A"), [0.1, 0.1, 0.1, 0.2], False),
        (("Y", "Z"), [0.1, 0.1, 0.1, 1], True),
        (("A",), [0.1, 0.1, 0.1, 1], False),
    ],
)
@pytest.mark.parametrize("side", [4, 1060])
def test_channels_go_by_their_names(
    tmp_path: Path, names: tuple[str, ...], expected: list[float], is_said: bool, side: int
) -> None:
    if side > 4 and len(names) < 4:
        return  # small in memory all the same
    values = tuple(0.1 * (i + 1) for i in range(len(names)))
    path = save(tmp_path / "a.exr", names, values, side)
    assert side == 4 or side * side * 3 * 4 > SMALL
    assert texel(path, "raw") == pytest.approx(expected, abs=1e-3)
    assert bool(what_was_taken(path, "raw")) == is_said


@pytest.mark.parametrize(
    ("name", "expected"),
    [("t16_srgb", LINEAR), ("t16_none", [c / 255 for c in CODES]), ("t8_none", LINEAR)],
)
def test_metadata_first_then_depth(inputs: Path, name: str, expected: list[float]) -> None:
    scene = read_scene(inputs / f"png16/{name}.usda")
    shown = evaluate_surface(scene, np.zeros(1, np.int32), np.full((1, 2), 0.3)).emission[0]
    assert shown == pytest.approx(expected, abs=1e-3)
    said = [w for w in scene.warnings if "16 bit" in w]
    assert len(said) == (name == "t16_srgb") and all("sRGB" in w and "/World/m/t" in w for w in said)


def png(path: Path, depth: int, *chunks: tuple[bytes, bytes]) -> str:
    """Writes a PNG of one colour with these chunks before its pixels."""
    code = struct.pack(">3B" if depth == 8 else ">3H", *(c * (1 if depth == 8 else 257) for c in CODES))
    head = (b"IHDR", struct.pack(">2I5B", 2, 2, depth, 2, 0, 0, 0))
    pixels = (b"IDAT", zlib.compress((b"\0" + code * 2) * 2))
    data = b"\x89PNG\r\n\x1a\n"
    for kind, body in (head, *chunks, pixels, (b"IEND", b"")):
        data += struct.pack(">I", len(body)) + kind + body + struct.pack(">I", zlib.crc32(kind + body))
    path.write_bytes(data)
    return str(path)


PLAIN = [c / 255 for c in CODES]
SRGB_PROFILE = (b"iCCP", b"sRGB IEC61966-2.1\0\0" + zlib.compress(b"\0" * 200))
LINEAR_PROFILE = (b"iCCP", b"Linear sRGB\0\0" + zlib.compress(b"\0" * 200))


@pytest.mark.parametrize(
    ("depth", "chunks", "expected"),
    [
        (16, [(b"sRGB", b"\0")], LINEAR),
        (16, [SRGB_PROFILE], LINEAR),
        (16, [LINEAR_PROFILE], PLAIN),
        (16, [(b"gAMA", struct.pack(">I", 45455))], LINEAR),
        (16, [(b"gAMA", struct.pack(">I", 100000))], PLAIN),
        (16, [(b"cICP", bytes([1, 13, 0, 1]))], LINEAR),
        (16, [], PLAIN),
        (8, [], LINEAR),
        (8, [(b"gAMA", struct.pack(">I", 100000))], PLAIN),
        (8, [(b"cICP", bytes([1, 8, 0, 1])), (b"sRGB", b"\0")], PLAIN),
    ],
)
def test_what_a_png_says_of_its_colours(tmp_path: Path, depth: int, chunks: list, expected: list[float]) -> None:
    path = png(tmp_path / "a.png", depth, *chunks)
    assert texel(path)[:3] == pytest.approx(expected, abs=2e-3)
    assert bool(what_was_taken(path, "auto")) == ((expected == LINEAR) != (depth == 8))
    assert texel(path, "raw")[:3] == pytest.approx(PLAIN, abs=1e-4) and not what_was_taken(path, "raw")
