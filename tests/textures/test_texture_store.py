"""Textures larger than memory allows: the same texels, tile by tile, within limits."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import textwrap
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
import OpenImageIO as oiio
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from pxr import Gf, Sdf, Usd, UsdGeom, UsdLux, UsdShade

from usdslf.color import USD_DEFAULT_SPACE, Color
from usdslf.scene.records import Texture
from usdslf.textures import images
from usdslf.textures import store as texture_store
from usdslf.textures.files import folder
from usdslf.textures.images import sample_texture
from usdslf.textures.store import PagedTexels, load_image

WIDTH, HEIGHT = 203, 131  # no multiple of a tile
TEXTURES, UDIMS, SIDE = 46, (1001, 1002, 1011, 1012), 4096
COLOR = Color(None, USD_DEFAULT_SPACE)
LIMIT = 4 * (1 << 20)  # [KiB]


def save(path: Path, pixels: np.ndarray, format: str, tile: int = 0) -> str:
    """Writes pixels (H, W, C) as they are."""
    spec = oiio.ImageSpec(pixels.shape[1], pixels.shape[0], pixels.shape[2], format)
    spec.tile_width = spec.tile_height = tile
    spec.attribute("oiio:UnassociatedAlpha", 1)
    if format == "uint16":
        spec.attribute("oiio:ColorSpace", "lin_rec709_scene")
    if path.suffix == ".exr":
        spec.attribute("compression", "rle")
    out = oiio.ImageOutput.create(str(path))
    assert out.open(str(path), spec), out.geterror()
    assert out.write_image(np.ascontiguousarray(pixels)), out.geterror()
    out.close()
    return str(path)


def noise(channels: int, integer: bool) -> np.ndarray:
    rng = np.random.default_rng(channels)
    shape = (HEIGHT, WIDTH, channels)
    return rng.integers(0, 256, shape, np.uint8) if integer else rng.random(shape, np.float32)


@pytest.fixture
def everything_is_large(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(texture_store, "SMALL", 0)


# ---- the same values ------------------------------------------------------------------------------
@pytest.mark.usefixtures("everything_is_large")
@pytest.mark.parametrize("space", ["auto", "raw", "lin_ap1_scene"])
@pytest.mark.parametrize("channels", [1, 2, 3, 4])
@pytest.mark.parametrize(
    ("suffix", "format", "tile"),
    [("png", "uint8", 0), ("png", "uint16", 0), ("exr", "half", 0), ("exr", "float", 32), ("tif", "uint8", 64)],
)
def test_tiles_hold_the_texels_of_the_file(
    tmp_path: Path, suffix: str, format: str, tile: int, channels: int, space: str
) -> None:
    pixels = noise(channels, format == "uint8")
    path = save(tmp_path / f"t.{suffix}", pixels, format, tile)
    image = load_image(path, space, Color(None, USD_DEFAULT_SPACE))
    assert isinstance(image, PagedTexels)
    assert image.shape == (HEIGHT, WIDTH, channels)
    y, x = np.random.default_rng(1).permutation(np.indices((HEIGHT, WIDTH)).reshape(2, -1), axis=1)
    found = image.at(y, x)
    assert_allclose(found, image.rows(0, HEIGHT)[y, x], rtol=1e-6)
    # What the file says: codes, sRGB decoded by its own formula where that is what they mean.
    stored = pixels[y, x].astype(np.float64) / (255 if format == "uint8" else 1)
    colors = 1 if channels < 3 else 3
    expected = np.ones((len(y), 4))
    expected[:, :3] = stored[:, :colors]
    expected[:, 3:] = stored[:, colors:] if channels in (2, 4) else 1
    if space == "auto" and format == "uint8" and channels >= 3:
        c = expected[:, :3]
        expected[:, :3] = np.where(c <= 0.04045, c / 12.92, ((c + 0.055) / 1.055) ** 2.4)
    if space == "lin_ap1_scene":
        expected[:, :3] = Color(None, USD_DEFAULT_SPACE).to_working(expected[:, :3], space)
        if channels < 3:
            expected[:, 1:3] = expected[:, :1]
    assert_allclose(found, expected, atol=1e-3 if format == "half" else 2e-5)


@pytest.mark.usefixtures("everything_is_large")
@pytest.mark.parametrize("wrap", ["repeat", "mirror", "clamp", "black"])
def test_look_ups_across_tiles_are_those_of_a_whole_image(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, wrap: str
) -> None:
    st = np.random.default_rng(2).uniform(-1.5, 2.5, (5000, 2))
    found = []
    for size in (0, 1 << 30):
        monkeypatch.setattr(texture_store, "SMALL", size)
        path = save(tmp_path / f"{size}.png", noise(4, True), "uint8")
        found.append(sample_texture(Texture("/t", path, wrap_s=wrap, wrap_t=wrap), st, COLOR))
    assert_array_equal(*found)


@pytest.mark.usefixtures("everything_is_large")
def test_a_data_window_that_begins_elsewhere(tmp_path: Path) -> None:
    pixels = noise(3, False)
    for tile in (0, 32):
        spec = oiio.ImageSpec(WIDTH, HEIGHT, 3, "float")
        spec.x, spec.y, spec.tile_width, spec.tile_height = 17, -9, tile, tile
        out = oiio.ImageOutput.create(str(tmp_path / f"{tile}.exr"))
        assert out.open(str(tmp_path / f"{tile}.exr"), spec)
        assert out.write_image(pixels)
        out.close()
        image = load_image(str(tmp_path / f"{tile}.exr"), "raw", Color(None, USD_DEFAULT_SPACE))
        assert_array_equal(image.rows(0, HEIGHT)[..., :3], pixels)


@pytest.mark.usefixtures("everything_is_large")
def test_threads_get_the_same_and_load_once(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = save(tmp_path / "t.png", noise(3, True), "uint8")
    loads, load = [], texture_store._load
    monkeypatch.setattr(texture_store, "_load", lambda *a: loads.append(a) or load(*a))
    st = np.random.default_rng(3).random((2000, 2))
    with ThreadPoolExecutor(8) as pool:
        results = list(pool.map(lambda _: sample_texture(Texture("/t", path), st, COLOR), range(24)))
    assert len(loads) == 1
    for result in results:
        assert_array_equal(result, results[0])


# ---- files that are odd ---------------------------------------------------------------------------
@pytest.mark.usefixtures("everything_is_large")
def test_a_changed_file_is_read_again_and_its_copy_goes(tmp_path: Path) -> None:
    for tile, suffix in ((0, "png"), (32, "tif")):
        path, seen = tmp_path / f"c.{suffix}", set()
        for value in (10, 200):
            save(path, np.full((HEIGHT, WIDTH, 3), value, np.uint8), "uint8", tile)
            os.utime(path, ns=(0, value))
            found = sample_texture(Texture("/t", str(path), color_space="raw"), [[0.5, 0.5]], COLOR)[0, 0]
            assert found == pytest.approx(value / 255)
            seen |= set(Path(folder()).glob("texture_*"))
        assert sum(p.exists() for p in seen) <= len(seen) - (tile == 0)


@pytest.mark.usefixtures("everything_is_large")
@pytest.mark.parametrize(("suffix", "tile"), [("png", 0), ("exr", 0), ("exr", 32), ("tif", 32)])
def test_a_truncated_file_says_why_once_and_has_its_fallback(tmp_path: Path, suffix: str, tile: int) -> None:
    integer = suffix != "exr"
    path = tmp_path / f"cut.{suffix}"
    save(path, noise(3, integer), "uint8" if integer else "float", tile)
    path.write_bytes(path.read_bytes()[: path.stat().st_size // 2])
    texture = Texture("/t", str(path), fallback=(0.5, 0, 0, 1))
    assert len(images.unreadable(texture, COLOR)) == 1
    assert_allclose(sample_texture(texture, np.random.default_rng(4).random((99, 2)), COLOR), [(0.5, 0, 0, 1)] * 99)
    assert len(images.unreadable(texture, COLOR)) == 1


@pytest.mark.usefixtures("everything_is_large")
def test_a_damaged_tile_in_the_middle_is_said_when_it_is_met(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    path = tmp_path / "damaged.exr"
    save(path, noise(3, False), "float", 32)
    data = bytearray(path.read_bytes())
    middle = len(data) // 2
    data[middle - 9000 : middle + 9000] = b"\xff" * 18000
    path.write_bytes(bytes(data))
    texture = Texture("/t", str(path), fallback=(0.5, 0, 0, 1), color_space="raw")
    assert images.unreadable(texture, COLOR) == []
    st = np.random.default_rng(5).random((500, 2))
    for _ in range(3):
        assert_allclose(sample_texture(texture, st, COLOR), [(0.5, 0, 0, 1)] * 500)
    assert sum("is damaged" in r.getMessage() for r in caplog.records) == 1


@pytest.mark.usefixtures("everything_is_large")
def test_without_room_for_a_copy_the_file_itself_is_read(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    pixels = noise(3, True)
    path = save(tmp_path / "t.png", pixels, "uint8")
    monkeypatch.setattr(texture_store, "write_tiled_copy", lambda image, channels: ("", 0))
    found = load_image(path, "raw", Color(None, USD_DEFAULT_SPACE)).rows(0, HEIGHT)[..., :3]
    assert_array_equal(np.rint(found * 255).astype(np.uint8), pixels)
    assert "no room" in caplog.text


def test_small_images_are_kept_up_to_a_limit(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    kept = texture_store._Kept(3 * HEIGHT * WIDTH * 3)
    monkeypatch.setattr(texture_store, "_small", kept)
    paths = [save(tmp_path / f"{i}.png", noise(3, True) // (i + 1), "uint8") for i in range(6)]
    first = [load_image(p, "raw", Color(None, USD_DEFAULT_SPACE)).rows(0, 1) for p in paths]
    assert kept.total <= kept.limit
    assert len(kept.images) == 3
    for path, rows in zip(paths, first, strict=True):
        assert_array_equal(load_image(path, "raw", Color(None, USD_DEFAULT_SPACE)).rows(0, 1), rows)
    assert kept.total <= kept.limit


# ---- a stage of fifty 4k textures -----------------------------------------------------------------
def color_of_texture(i: int) -> tuple[int, int, int]:
    """Codes of texture i: each is another one."""
    return 20 + 4 * i, 230 - 4 * i, 40 + (i * 53) % 200


def value_of_texture(i: int) -> np.ndarray:
    """What a look-up of texture i gives in the working space."""
    code = np.array(color_of_texture(i)) / 255
    return code if i % 2 else ((code + 0.055) / 1.055) ** 2.4


@pytest.fixture
def large_stage(tmp_path: Path) -> Iterator[Path]:
    """Squares of a wall, each with a 4k texture of its own; the last one has a UDIM set of four.

    JPEG and PNG without tiles by turns with tiled half floats (RGBA).
    """
    files = []
    for i in range(TEXTURES + len(UDIMS)):
        rgb = color_of_texture(i)
        name = f"t{i}" if i < TEXTURES else f"u.{UDIMS[i - TEXTURES]}"
        if i % 2 or i >= TEXTURES:
            rgba = np.array([*(value_of_texture(i)), 1], np.float16)
            pixels = np.broadcast_to(rgba, (SIDE, SIDE, 4))
            files.append(save(tmp_path / f"{name}.exr", pixels, "half", 64))
        else:
            pixels = np.broadcast_to(np.array(rgb, np.uint8), (SIDE, SIDE, 3))
            suffix = "png" if i % 8 == 0 else "tif"
            files.append(save(tmp_path / f"{name}.{suffix}", pixels, "uint8"))
    stage = Usd.Stage.CreateNew(str(tmp_path / "shot.usda"))
    stage.SetDefaultPrim(UsdGeom.Xform.Define(stage, "/w").GetPrim())
    UsdGeom.SetStageUpAxis(stage, UsdGeom.Tokens.y)
    for i in range(TEXTURES + 1):
        x, y, udim = i % 8, i // 8, i == TEXTURES
        mesh = UsdGeom.Mesh.Define(stage, f"/w/m{i}")
        mesh.CreatePointsAttr([(x, y, 0), (x + 1, y, 0), (x + 1, y + 1, 0), (x, y + 1, 0)])
        mesh.CreateFaceVertexCountsAttr([4])
        mesh.CreateFaceVertexIndicesAttr([0, 1, 2, 3])
        mesh.CreateSubdivisionSchemeAttr("none")
        end = 2 if udim else 1
        st = UsdGeom.PrimvarsAPI(mesh).CreatePrimvar("st", Sdf.ValueTypeNames.TexCoord2fArray, "vertex")
        st.Set([(0, 0), (end, 0), (end, end), (0, end)])
        material = UsdShade.Material.Define(stage, f"/w/looks/m{i}")
        shader = UsdShade.Shader.Define(stage, f"/w/looks/m{i}/surface")
        shader.CreateIdAttr("UsdPreviewSurface")
        reader = UsdShade.Shader.Define(stage, f"/w/looks/m{i}/st")
        reader.CreateIdAttr("UsdPrimvarReader_float2")
        reader.CreateInput("varname", Sdf.ValueTypeNames.String).Set("st")
        texture = UsdShade.Shader.Define(stage, f"/w/looks/m{i}/map")
        texture.CreateIdAttr("UsdUVTexture")
        file = "./u.<UDIM>.exr" if udim else f"./{Path(files[i]).name}"
        texture.CreateInput("file", Sdf.ValueTypeNames.Asset).Set(file)
        for wrap in ("wrapS", "wrapT"):
            texture.CreateInput(wrap, Sdf.ValueTypeNames.Token).Set("repeat")
        texture.CreateInput("st", Sdf.ValueTypeNames.Float2).ConnectToSource(reader.ConnectableAPI(), "result")
        shader.CreateInput("diffuseColor", Sdf.ValueTypeNames.Color3f).ConnectToSource(
            texture.ConnectableAPI(), "rgb"
        )
        material.CreateSurfaceOutput().ConnectToSource(shader.ConnectableAPI(), "surface")
        UsdShade.MaterialBindingAPI.Apply(mesh.GetPrim()).Bind(material)
    UsdLux.DomeLight.Define(stage, "/w/dome")
    camera = UsdGeom.Camera.Define(stage, "/w/camera")
    camera.AddTranslateOp().Set(Gf.Vec3d(4, 3, 15))
    camera.CreateHorizontalApertureAttr(32)
    camera.CreateVerticalApertureAttr(24)
    camera.CreateFocalLengthAttr(50)
    stage.Save()
    yield tmp_path / "shot.usda"
    for file in files:
        os.unlink(file)


SCRIPT = textwrap.dedent(
    """
    import json, sys
    from pathlib import Path
    import numpy as np
    from usdslf.cli.main import main
    from usdslf.session import Session
    shot, picture = sys.argv[1:]
    codes = [main(["info", shot, "--json"])]
    session = Session(shot, elements=1500, bounces=1)
    elements = session.elements
    seen = {}
    for i, mesh in enumerate(session.scene.meshes):
        values = np.asarray(elements.base_color)[np.asarray(elements.mesh) == i]
        seen[mesh.path] = [values.min(0).tolist(), values.max(0).tolist(), len(values)]
    codes.append(main(["render", shot, "-o", picture, "--size", "160x120", "--elements", "600"]))
    # not getrusage: its peak outlives exec, so that a child starts with that of the tests before this one
    line = next(x for x in Path("/proc/self/status").read_text().splitlines() if x.startswith("VmHWM"))
    peak = int(line.split()[1])
    print(json.dumps({"codes": codes, "seen": seen, "peak": peak, "warnings": session.warnings}))
    """
)


@pytest.mark.divided
def test_a_stage_of_fifty_4k_textures_stays_under_4_gib(large_stage: Path, tmp_path: Path) -> None:
    picture = tmp_path / "o.exr"
    temporary = tmp_path / "temporary"
    temporary.mkdir()
    run = subprocess.run(
        [sys.executable, "-c", SCRIPT, str(large_stage), str(picture)],
        capture_output=True,
        text=True,
        check=False,
        env=os.environ | {"TMPDIR": str(temporary)},
    )
    assert run.returncode == 0, run.stderr
    found = json.loads(run.stdout.splitlines()[-1])
    print(f"peak {found['peak'] / 1024:.0f} MiB")
    assert found["codes"] == [0, 0]
    assert found["peak"] < LIMIT
    assert not [w for w in found["warnings"] if "texture" in w]
    assert picture.exists()
    for i in range(TEXTURES):
        low, high, count = found["seen"][f"/w/m{i}"]
        assert count > 0
        assert_allclose([low, high], [value_of_texture(i)] * 2, atol=2e-3)
    low, high, _ = found["seen"][f"/w/m{TEXTURES}"]
    tiles = np.array([value_of_texture(TEXTURES + i) for i in range(len(UDIMS))])
    assert_allclose(low, tiles.min(0), atol=0.05)
    assert_allclose(high, tiles.max(0), atol=0.05)
    assert not list(temporary.iterdir())  # copies are gone with the process


def test_the_limit_is_read_from_the_environment(monkeypatch: pytest.MonkeyPatch) -> None:
    for value, expected in (("", 1024.0), ("200", 200.0), ("0", 16.0), ("many", 1024.0)):
        monkeypatch.setenv("USDSLF_TEXTURE_MB", value)
        assert texture_store.memory_mb() == expected
