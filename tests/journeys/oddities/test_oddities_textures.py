"""Odd textures and texture coordinates of real stages: closed forms of what shows, and solves through them.

The table of all oddities is in README.md.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from kit.lit_plane import FLOOR, places
from kit.oddity_stages import (
    AFTER,
    FACES,
    GRID,
    as_2f,
    evaluate_at,
    floor_of,
    floor_shot,
    painted,
    shader_of,
    shown_alike,
    solves_and_shows,
    textured,
    warnings_of,
)
from kit.stage_parts import StageBuilder
from kit.stage_textures import write_image
from numpy.typing import NDArray
from pxr import Gf, Sdf, UsdGeom, UsdShade

import usdslf
from usdslf.scene.records import Texture
from usdslf.usd.read.read import read_scene

Run = Callable[..., tuple[int, str, str]]
F = Sdf.ValueTypeNames


def ramp_image(size: int = 8) -> NDArray:
    """Red from left to right and green from below, linear between texels' centres."""
    at = (np.arange(size) + 0.5) / size
    u, v = np.meshgrid(at, at[::-1])
    return np.stack([0.8 * u, 0.8 * v, 0 * u + 0.25], -1).astype(np.float32)


def of_ramp(points: NDArray) -> NDArray:
    """What the ramp shows on the floor."""
    return np.stack([0.2 * points[:, 0] + 0.4, 0.2 * points[:, 1] + 0.4, 0 * points[:, 0] + 0.25], 1)


def set_uvs(b: StageBuilder, name: str, kind: str, interpolation: str, is_indexed: bool) -> None:
    floor_of(b).GetPrim().RemoveProperty("primvars:st")
    values = GRID[:, :2] / 4 + 0.5
    if interpolation == "faceVarying":
        values = values[FACES.ravel()]
    primvar = UsdGeom.PrimvarsAPI(floor_of(b)).CreatePrimvar(name, getattr(F, kind), interpolation)
    primvar.Set(as_2f(values[::-1] if is_indexed else values))
    if is_indexed:
        primvar.SetIndices(list(range(len(values)))[::-1])


def shows_the_ramp(path: Path) -> None:
    scene = read_scene(path)
    assert not scene.warnings
    np.testing.assert_allclose(evaluate_at(scene, places()).base_color, of_ramp(places()), atol=2e-3)


@pytest.mark.parametrize("name", ["map1", "UVMap", "st_faceVarying"])
@pytest.mark.parametrize("kind", ["Float2Array", "TexCoord2fArray"])
@pytest.mark.parametrize("interpolation", ["vertex", "faceVarying"])
@pytest.mark.parametrize("is_indexed", [False, True])
def test_texture_coordinates_of_any_name_and_kind(
    tmp_path: Path, name: str, kind: str, interpolation: str, is_indexed: bool
) -> None:
    b = floor_shot(tmp_path)
    write_image(tmp_path / "floor.exr", ramp_image())
    textured(b, uv_set=name)
    set_uvs(b, name, kind, interpolation, is_indexed)
    shows_the_ramp(b.save())


def floor_image(path: Path) -> None:
    """The floor's own colour as a picture."""
    write_image(path, np.tile(np.float32(FLOOR["diffuse"]), (64, 64, 1)))


@pytest.mark.parametrize("name", ["map1", "UVMap", "st_faceVarying"])
def test_odd_texture_coordinates_solve_to_a_scale(tmp_path: Path, name: str) -> None:
    b = floor_shot(tmp_path)
    floor_image(tmp_path / "floor.exr")
    textured(b, uv_set=name)
    set_uvs(b, name, "Float2Array", "faceVarying", True)
    session = solves_and_shows(b.save())
    assert {e.representation for e in session.edits} == {"scale"}


def test_a_texture_without_st_input_reads_st(tmp_path: Path) -> None:
    b = floor_shot(tmp_path)
    write_image(tmp_path / "floor.exr", ramp_image())
    textured(b, uv_set=None)
    shows_the_ramp(b.save())


def test_absent_texture_coordinates_show_one_texel_and_are_named(tmp_path: Path, run: Run) -> None:
    """The texel at (0, 0), the lower left; the floor still solves, to a scale."""
    b = floor_shot(tmp_path)
    write_image(tmp_path / "floor.exr", ramp_image())
    textured(b, uv_set="map1")
    path = b.save()
    warnings_of(path, run, "map1", "/World/floor", "it has st", "one texel")
    np.testing.assert_allclose(
        evaluate_at(read_scene(path), places()).base_color, np.tile((0.05, 0.05, 0.25), (16, 1)), atol=1e-3
    )
    floor_image(tmp_path / "floor.exr")
    solves_and_shows(path)


# ---- textures -----------------------------------------------------------------------------------------------
def test_a_missing_texture_shows_its_fallback_and_is_named(tmp_path: Path, run: Run) -> None:
    b = floor_shot(tmp_path)
    textured(b, "./gone.exr").CreateInput("fallback", F.Float4).Set(Gf.Vec4f(*FLOOR["diffuse"], 1))
    path = b.save()
    warnings_of(path, run, "gone.exr", "/World/mtl/floor/texture", "fallback")
    shown_alike(path, floor_shot(tmp_path / "plain").save())
    solves_and_shows(path)


def test_ptex_shows_its_fallback_and_is_named(tmp_path: Path, run: Run) -> None:
    b = floor_shot(tmp_path)
    (tmp_path / "floor.ptx").write_bytes(b"Ptex" + bytes(200))
    textured(b, "./floor.ptx").CreateInput("fallback", F.Float4).Set(Gf.Vec4f(*FLOOR["diffuse"], 1))
    path = b.save()
    warnings_of(path, run, "floor.ptx", "/World/mtl/floor/texture", "fallback")
    solves_and_shows(path)


def test_a_ptex_node_is_named_and_its_input_has_the_fallback(tmp_path: Path, run: Run) -> None:
    """RenderMan's node is none of UsdPreviewSurface's: 0.18 shows."""
    b = floor_shot(tmp_path)
    node = UsdShade.Shader.Define(b.stage, "/World/mtl/floor/ptex")
    node.CreateIdAttr("PxrPtexture")
    shader_of(b).GetInput("diffuseColor").ConnectToSource(node.CreateOutput("resultRGB", F.Color3f))
    path = b.save()
    warnings_of(path, run, "/World/mtl/floor/ptex", "PxrPtexture", "diffuseColor has its fallback")
    np.testing.assert_allclose(evaluate_at(read_scene(path), places()).base_color, 0.18, atol=1e-6)


def test_udim_tiles_lie_side_by_side(tmp_path: Path) -> None:
    """Two tiles left and right of x = 0; where both are the floor's own colour it solves to a scale."""
    b = floor_shot(tmp_path)
    for tile, color in ((1001, (0.1, 0.2, 0.3)), (1002, (0.6, 0.5, 0.4))):
        write_image(tmp_path / f"floor.{tile}.exr", np.tile(np.float32(color), (64, 64, 1)))
    textured(b, "./floor.<UDIM>.exr")
    st = UsdGeom.PrimvarsAPI(floor_of(b)).GetPrimvar("st")
    st.Set(as_2f(GRID[:, :2] * (0.5, 0.25) + (1, 0.5)))
    scene = read_scene(b.save())
    right = (places()[:, 0] > 0)[:, None]
    expected = np.where(right, (0.6, 0.5, 0.4), (0.1, 0.2, 0.3))
    np.testing.assert_allclose(evaluate_at(scene, places()).base_color, expected, atol=1e-3)
    for tile in (1001, 1002):
        floor_image(tmp_path / f"floor.{tile}.exr")
    session = solves_and_shows(b.path)
    assert {e.representation for e in session.edits} == {"scale"}


def test_an_absolute_path_is_read_and_not_written(tmp_path: Path) -> None:
    b = floor_shot(tmp_path)
    floor_image(tmp_path / "floor.exr")
    textured(b, str(tmp_path / "floor.exr"))
    session = solves_and_shows(b.save())
    (texture,) = (m.diffuse_color for m in session.scene.materials)
    assert isinstance(texture, Texture) and texture.path == str(tmp_path / "floor.exr")
    assert str(tmp_path) not in (tmp_path / "look.usda").read_text()


def test_strokes_of_a_layer_are_solved_over_a_missing_texture(tmp_path: Path, run: Run) -> None:
    """From the command line: the texture is named, and the look holds its new fallback."""
    b = floor_shot(tmp_path)
    textured(b, "./gone.exr").CreateInput("fallback", F.Float4).Set(Gf.Vec4f(*FLOOR["diffuse"], 1))
    path, strokes, look = b.save(), tmp_path / "strokes.usda", tmp_path / "look.usda"
    usdslf.write_strokes(strokes, [painted()], b.stage)
    code, _, err = run("solve", path, strokes, "-o", look, "--elements", "150")
    assert code == 0 and "gone.exr" in err
    layer = Sdf.Layer.FindOrOpen(str(look))
    fallback = layer.GetAttributeAtPath("/World/mtl/floor/texture.inputs:fallback").default
    np.testing.assert_allclose(list(fallback)[:3], AFTER["diffuse"], atol=0.02)
