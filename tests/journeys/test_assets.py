"""`info` and `render` on every real stage beside the repository.

No traceback, the right exit code, warnings that name prims and do not flood, light where there is none, and
pictures: finite, neither black nor blown out, the object whole and as large as the picture lets it be.
"""

from __future__ import annotations

import json
import re
from collections.abc import Callable
from pathlib import Path

import numpy as np
import OpenImageIO
import pytest
from kit.real_stages import CAR, LAYERS, LIT, MAYA, UNLIT
from numpy.typing import NDArray

import usdslf
from usdslf.gpu.device import Device
from usdslf.session import Session

Run = Callable[..., tuple[int, str, str]]

NOTHING_TO_SHOW = (
    "shaderball_usdwg/layers/camera.usda",
    "shaderball_usdwg/layers/example_materials.usda",
    "shaderball_usdwg/material_surface_geo/subdiv.usda",  # an over without a gprim
    "shaderball_usdwg/material_surface_geo/triangulated.usda",
    "teapots_instanced_usdwg/assets/teapot/teapot_animCycle.usd",
    "teapots_instanced_usdwg/scenes/teapotScene_animCycle.usd",
    "teapots_instanced_usdwg/scenes/teapotScene_camera.usd",
    "teapots_instanced_usdwg/scenes/teapotScene_layoutOverrides.usd",
    *(f"{CAR}/materials/{m}.usda" for m in ("backLight", "blue", "green", "lightGrey", "red", "white", "window")),
    "hdri/studio_1k.hdr",
    "hdri/LICENSE.txt",
    "avocado",
)
TRIANGLES = {  # faces of the files, n-gons as triangles, four times as many where a level of refinement is asked for
    "avocado/avocado.usda": 682,
    "cornell_box/cornell-box.usda": 32,
    f"{MAYA}/UsdPreviewSurface/DisplayColorCube.usda": 6 * 4 * 2,
    "teapots_instanced_usdwg/scenes/teapotScene.usd": 1000 * 2472,
}
DEFAULT_LIGHT = "the stage has no light"


@pytest.mark.divided
@pytest.mark.parametrize("entry", [*LIT, *UNLIT])
def test_a_real_stage_is_read_and_shown(
    entry: str, assets: Path, device: Device, run: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    session = usdslf.open(assets / entry, device=device, elements=500, bounces=3)
    monkeypatch.setattr("usdslf.cli.shot_options.Reading.open", lambda *_, **__: session)  # the largest are read once
    code, out, err = run("info", assets / entry)
    assert (code, err) == (0, "")
    assert len(out.splitlines()) < 40 and "warnings: " in out
    code, out, _ = run("info", assets / entry, "--json")
    found = json.loads(out)
    assert code == 0 and found["meshes"]
    if entry in TRIANGLES:
        assert sum(m["triangles"] for m in found["meshes"]) == TRIANGLES[entry]
    check_warnings(found["warnings"], session, entry in UNLIT)

    picture = tmp_path / "picture.exr"
    arguments = ("--size", "64x36", "--samples", "4", "--aov", "alpha", "direct")
    code, out, err = run("render", assets / entry, "-o", picture, *arguments)
    assert (code, out.strip()) == (0, str(picture)), err
    said = [line.removeprefix("warning: ") for line in err.splitlines()]
    assert all(line.startswith("warning: ") for line in err.splitlines())
    check_warnings(said, session, entry in UNLIT)
    pixels = OpenImageIO.ImageBuf(str(picture)).get_pixels(OpenImageIO.FLOAT)
    assert pixels.shape == (36, 64, 7)
    check_picture(pixels, entry)


def check_warnings(warnings: list[str], session: Session, is_unlit: bool) -> None:
    """Each is said once and names a prim of the stage or a file; the default light is among them where it shines."""
    assert len(warnings) == len(set(warnings)) < 10
    assert [DEFAULT_LIGHT in w for w in warnings].count(True) == is_unlit
    for warning in warnings:
        assert len(warning) < 600
        if DEFAULT_LIGHT not in warning:
            named = re.findall(r"/[\w/.-]+\w", warning)
            assert any(Path(n).exists() or session.stage.GetPrimAtPath(n) for n in named if ".." not in n), warning


def check_picture(pixels: NDArray, entry: str) -> None:
    """Channels R, G, B, alpha, and of what lights shine on."""
    color, alpha, direct = pixels[..., :3], pixels[..., 3], pixels[..., 4:7]
    assert np.isfinite(pixels).all() and pixels.min() >= 0
    on = alpha > 0.999
    assert on.mean() > 0.01 and np.ptp(color) > 0.02
    if entry in UNLIT:
        assert 0.01 < color[on].mean() < 1.2
        assert (direct[on].max(-1) > 0.003).mean() > 0.5  # the key light is on the side of the camera
        assert np.quantile(color, 0.99) < 4
    else:
        assert direct[on].max() > 0.05


def overview_entries() -> list[str]:
    """Those that have no camera."""
    with_camera = ("cornell", "living_room", "standard_shader_ball", "DrawModes", "teapotScene.usd", "environment")
    return [e for e in (*UNLIT, *LIT) if not any(name in e for name in with_camera) and "_layout" not in e]


@pytest.mark.parametrize("entry", overview_entries())
def test_the_overview_shows_all_of_the_object_and_little_else(entry: str, assets: Path) -> None:
    """Every vertex projects into the picture, and they reach from side to side, or from top to bottom."""
    session = usdslf.open(assets / entry)
    camera = session.camera()
    assert camera.path == ""
    vertices = np.concatenate([m.positions for m in session.scene.meshes]).astype(np.float64)
    local = (vertices - camera.world_from_camera[:3, 3]) @ camera.world_from_camera[:3, :3]
    assert (local[:, 2] < 0).all()
    at = local[:, :2] / -local[:, 2:] * camera.focal_length
    at /= (camera.horizontal_aperture / 2, camera.vertical_aperture / 2)
    assert np.abs(at).max() < 0.96
    assert np.ptp(at, axis=0).max() > 1.7
    up = camera.world_from_camera[:3, 1]
    assert up[2 if session.scene.up_axis == "Z" else 1] > 0.8


def test_a_lit_room_is_seen_from_within(assets: Path) -> None:
    session = usdslf.open(assets / "shaderball_usdwg/layers/environment.usda")
    low, high = session.scene.bounds
    eye = session.camera().world_from_camera[:3, 3]
    assert (eye > low).all() and (eye < high).all()


@pytest.mark.parametrize("entry", LAYERS)
def test_a_layer_with_geometry_is_read(entry: str, assets: Path, run: Run) -> None:
    code, out, err = run("info", assets / entry)
    assert (code, err) == (0, "")
    assert "meshes: " in out and DEFAULT_LIGHT in out


@pytest.mark.parametrize("command", ["info", "render"])
@pytest.mark.parametrize("entry", NOTHING_TO_SHOW)
def test_a_layer_with_nothing_to_show_is_one_line(
    command: str, entry: str, assets: Path, run: Run, tmp_path: Path
) -> None:
    output = ("-o", tmp_path / "picture.png") if command == "render" else ()
    code, out, err = run(command, assets / entry, *output)
    assert (code, out) == (2, "")
    assert len(err.strip().splitlines()) == 1 and err.startswith("usdslf: ") and Path(entry).name in err
    assert "internal error" not in err and len(err) < 600
    assert not list(tmp_path.iterdir())
