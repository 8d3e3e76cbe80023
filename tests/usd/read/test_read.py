"""Stages as a whole: what opens, what does not, and every real stage."""

from __future__ import annotations

import math
import os
import shutil
from pathlib import Path

import numpy as np
import pytest
from pxr import Usd

from usdslf.errors import InputError, StageError
from usdslf.surfaces.surface_points import evaluate_surface
from usdslf.textures.images import write_image
from usdslf.usd.read.read import open_stage, read_scene, time_code, working_space_of

SQUARE = """def Mesh "square" {
    point3f[] points = [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)]
    int[] faceVertexCounts = [4]
    int[] faceVertexIndices = [0, 1, 2, 3]
    uniform token subdivisionScheme = "none"
    texCoord2f[] primvars:st = [(0, 0), (1, 0), (1, 1), (0, 1)] ( interpolation = "vertex" )
    %s
}
"""
TEXTURED = """def Material "m" {
    token outputs:surface.connect = </m/s.outputs:surface>
    def Shader "s" {
        uniform token info:id = "UsdPreviewSurface"
        color3f inputs:diffuseColor.connect = </m/t.outputs:rgb>
        token outputs:surface
    }
    def Shader "t" {
        uniform token info:id = "UsdUVTexture"
        asset inputs:file = @./%s@
        float4 inputs:fallback = (0.5, 0.25, 0, 1)
        float3 outputs:rgb
    }
}
"""


def write(path: Path, body: str, head: str = "") -> Path:
    path.write_text(f"#usda 1.0\n( {head}\n)\n{body}" if head else f"#usda 1.0\n{body}")
    return path


def sentence(error: pytest.ExceptionInfo[InputError]) -> str:
    assert error.value.exit_code == 2
    assert "\n" not in str(error.value)
    return str(error.value)


# ---- what cannot be opened -----------------------------------------------------------------------
def test_a_missing_stage(tmp_path: Path) -> None:
    with pytest.raises(StageError) as e:
        read_scene(tmp_path / "none.usda")
    assert "none.usda does not exist" in sentence(e)


def test_a_folder(tmp_path: Path) -> None:
    with pytest.raises(StageError) as e:
        open_stage(tmp_path)
    assert "folder" in sentence(e)


@pytest.mark.parametrize("name", ["text.usd", "text.usda", "text.usdc", "text.usdz", "text.txt", "empty.usd"])
def test_a_file_that_is_not_usd(tmp_path: Path, name: str) -> None:
    path = tmp_path / name
    path.write_text("" if name.startswith("empty") else "dear diary\n")
    with pytest.raises(StageError) as e:
        open_stage(path)
    assert name in sentence(e)


@pytest.mark.parametrize("share", [0.05, 0.5, 0.97])
def test_a_truncated_crate(tmp_path: Path, share: float) -> None:
    stage = Usd.Stage.CreateNew(str(tmp_path / "whole.usdc"))
    stage.GetRootLayer().ImportFromString("#usda 1.0\n" + SQUARE % "")
    stage.Save()
    data = (tmp_path / "whole.usdc").read_bytes()
    (tmp_path / "cut.usdc").write_bytes(data[: int(len(data) * share)])
    with pytest.raises(StageError) as e:
        read_scene(tmp_path / "cut.usdc")
    assert "cut.usdc" in sentence(e)


@pytest.mark.parametrize(
    "body",
    [
        "",
        'def Xform "x" {}',
        'def Sphere "s" { token visibility = "invisible"\n}',
        SQUARE % 'uniform token purpose = "guide"',
        'def Mesh "m" {}',
    ],
)
def test_a_stage_without_geometry(tmp_path: Path, body: str) -> None:
    with pytest.raises(StageError) as e:
        read_scene(write(tmp_path / "bare.usda", body))
    assert "no renderable geometry" in sentence(e)


def test_a_bad_ocio_config(tmp_path: Path) -> None:
    with pytest.raises(InputError) as e:
        read_scene(write(tmp_path / "a.usda", SQUARE % ""), ocio=str(tmp_path / "none.ocio"))
    assert "none.ocio" in sentence(e)


def test_a_missing_layer_is_a_warning_that_names_it(
    tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    body = SQUARE % "" + 'def "r" ( references = @./gone_too.usda@ ) {}\n'
    path = write(tmp_path / "a.usda", body, "subLayers = [@./gone.usda@]")
    scene = read_scene(path)
    assert sum("gone.usda" in w for w in scene.warnings) == 1
    assert sum("/r" in w and "gone_too.usda" in w for w in scene.warnings) == 1
    assert capfd.readouterr() == ("", "")  # USD's own talk is kept off the terminal


# ---- what is read --------------------------------------------------------------------------------
def test_a_textured_square(tmp_path: Path) -> None:
    write_image(tmp_path / "a.exr", np.array([[[0.5, 0, 0], [0, 0.5, 0]]]), half=False)
    body = SQUARE % "rel material:binding = </m>" + TEXTURED % "a.exr"
    scene = read_scene(write(tmp_path / "a.usda", body))
    assert scene.warnings == ()
    assert len(scene.triangles.mesh) == 2
    centre = np.array([[1 / 3, 1 / 3]] * 2)
    points = evaluate_surface(scene, [0, 1], centre)
    x = points.position[:, 0]
    mix = np.clip(2 * x - 0.5, 0, 1)
    assert points.base_color[:, 1] == pytest.approx(0.5 * mix, abs=1e-5)
    assert points.geometric_normal == pytest.approx(np.array([[0, 0, 1]] * 2))


@pytest.mark.parametrize("content", [None, "no picture"])
def test_an_unreadable_texture_is_named_once_and_has_its_fallback(
    tmp_path: Path, content: str | None
) -> None:
    if content:
        (tmp_path / "a.png").write_text(content)
    body = SQUARE % "rel material:binding = </m>" + TEXTURED % "a.png"
    scene = read_scene(write(tmp_path / "a.usda", body))
    assert sum("/m/t" in w and "a.png" in w for w in scene.warnings) == 1
    found = evaluate_surface(scene, [0], [[0.3, 0.3]])
    assert found.base_color[0] == pytest.approx([0.5, 0.25, 0])


def test_many_missing_references_are_one_warning(tmp_path: Path) -> None:
    body = SQUARE % "" + "".join(f'def "r{i}" ( references = @./gone_{i % 5}.usda@ ) {{}}\n' for i in range(40))
    body += 'def "m" ( references = @./a.mtlx@</MaterialX> ) {}\n'
    (tmp_path / "a.mtlx").write_text("<materialx/>")
    warnings = read_scene(write(tmp_path / "s.usda", body)).warnings
    gone = [w for w in warnings if "gone_" in w]
    assert len(gone) == 1 and "/r0, " in gone[0] and "37 more" in gone[0] and "no such file" in gone[0]
    assert any("a.mtlx" in w and "MaterialX" in w and "/m" in w for w in warnings)
    assert all(len(w) < 300 for w in warnings)


def test_missing_texture_coordinates_name_the_gprim(tmp_path: Path) -> None:
    write_image(tmp_path / "a.exr", np.ones((2, 2, 3)))
    body = SQUARE.replace("primvars:st", "primvars:uv") % "rel material:binding = </m>" + TEXTURED % "a.exr"
    scene = read_scene(write(tmp_path / "a.usda", body))
    assert [w for w in scene.warnings if "/square" in w and "st" in w]


def test_coordinates_outside_a_texture_without_wrap_mode_are_noted(tmp_path: Path) -> None:
    write_image(tmp_path / "a.exr", np.ones((2, 2, 3)))
    outside = SQUARE.replace("(0, 0), (1, 0), (1, 1), (0, 1)]", "(0, -1), (1, -1), (1, 0), (0, 0)]")
    body = outside % "rel material:binding = </m>" + TEXTURED % "a.exr"
    scene = read_scene(write(tmp_path / "a.usda", body))
    assert sum("/square" in w and "wrap" in w for w in scene.warnings) == 1
    assert evaluate_surface(scene, [0], [[0.3, 0.3]]).base_color[0] == pytest.approx([0, 0, 0])
    wrapped = body.replace(
        "float4 inputs:fallback", 'token inputs:wrapT = "repeat"\n        float4 inputs:fallback'
    )
    scene = read_scene(write(tmp_path / "b.usda", wrapped))
    assert scene.warnings == ()
    assert evaluate_surface(scene, [0], [[0.3, 0.3]]).base_color[0] == pytest.approx([1, 1, 1])


def test_the_frame_is_the_start_of_the_stage_unless_given(tmp_path: Path) -> None:
    moving = (SQUARE % "").replace(
        "point3f[] points = [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)]",
        "point3f[] points.timeSamples = {\n 1: [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)],\n"
        "11: [(0, 0, 9), (1, 0, 9), (1, 1, 9), (0, 1, 9)],\n}",
    )
    path = write(tmp_path / "a.usda", moving, "startTimeCode = 11\n endTimeCode = 20")
    for frame, z, recorded in ((None, 9, 11), (math.nan, 9, 11), (1.0, 0, 1), (6.0, 4.5, 6)):
        scene = read_scene(path, frame)
        assert scene.bounds[1][2] == pytest.approx(z)
        assert scene.frame == recorded
    scene = read_scene(write(tmp_path / "b.usda", moving))
    assert math.isnan(scene.frame)
    assert scene.bounds[1][2] == 0
    assert time_code(Usd.Stage.Open(str(path)), None).GetValue() == 11


def test_stage_metadata_and_working_space(tmp_path: Path) -> None:
    body = SQUARE % "" + 'def RenderSettings "r" {\n uniform token renderingColorSpace = "lin_ap1_scene"\n}\n'
    head = 'upAxis = "Z"\n metersPerUnit = 1\n renderSettingsPrimPath = "/r"'
    scene = read_scene(write(tmp_path / "a.usda", body, head))
    assert (scene.up_axis, scene.meters_per_unit, scene.working_space) == ("Z", 1, "lin_ap1_scene")
    plain = open_stage(write(tmp_path / "b.usda", SQUARE % ""))
    assert working_space_of(plain) == "lin_rec709_scene"


def test_a_package_is_read_with_its_textures(tmp_path: Path) -> None:
    from pxr import UsdUtils

    write_image(tmp_path / "a.png", np.full((2, 2, 3), 1.0))
    write(tmp_path / "a.usda", SQUARE % "rel material:binding = </m>" + TEXTURED % "a.png")
    assert UsdUtils.CreateNewUsdzPackage(str(tmp_path / "a.usda"), str(tmp_path / "a.usdz"))
    os.remove(tmp_path / "a.png")
    scene = read_scene(tmp_path / "a.usdz")
    assert scene.warnings == ()
    assert evaluate_surface(scene, [0], [[0.3, 0.3]]).base_color[0] == pytest.approx([1, 1, 1])


def test_reading_changes_nothing(tmp_path: Path) -> None:
    path = write(tmp_path / "a.usda", SQUARE % "rel material:binding = </m>" + TEXTURED % "a.png")
    before = path.read_bytes()
    stage = open_stage(path)
    read_scene(stage)
    assert not stage.GetRootLayer().dirty
    assert not stage.GetSessionLayer().dirty
    assert path.read_bytes() == before


# ---- real stages ---------------------------------------------------------------------------------
REAL = [
    "avocado/avocado.usda",
    "cornell_box/cornell-box.usda",
    "cornell_box/cornell-box_displayColor.usda",
    "preview_surface_mayausd/UsdPreviewSurface/DisplayColorCube.usda",
    "preview_surface_mayausd/UsdPreviewSurface/F0_is_base.usda",
    "preview_surface_mayausd/UsdPreviewSurface/LightAPI_Test.usda",
    "preview_surface_mayausd/UsdPreviewSurface/TestFallbackColor.usda",
    "preview_surface_mayausd/UsdPreviewSurface/TestOpacityThreshold.usda",
    "preview_surface_mayausd/UsdPreviewSurface/UsdTransform2dTest.usda",
    "preview_surface_mayausd/UsdPreviewSurface/UseSpecularWorkflowTest.usda",
    "preview_surface_mayausd/multipleMaterialsAssignment/MultipleMaterialsAssignment.usda",
    "preview_surface_mayausd/normals/primvars_normals.usda",
    "shaderball_usdwg/standard_shader_ball_scene.usda",
    "teapot_usdwg/Teapot.usd",
    "vehicles_usdwg/USD_Mini_Car_Kit/assets/vehicles/vehicleVariants.usda",
]


@pytest.mark.assets
@pytest.mark.parametrize("name", REAL)
def test_real_stages_give_finite_reflectance(assets: Path, name: str) -> None:
    scene = read_scene(assets / name)
    rng = np.random.default_rng(0)
    triangle = rng.integers(0, len(scene.triangles.mesh), 2000)
    uv = rng.random((2000, 2))
    uv = np.where(uv.sum(1, keepdims=True) > 1, 1 - uv, uv)
    points = evaluate_surface(scene, triangle, uv)
    for field, value in vars(points).items():
        assert np.isfinite(value).all(), field
    for value in (points.f0, points.f90, points.opacity, points.presence):
        assert ((value >= 0) & (value <= 1)).all()
    assert np.linalg.norm(points.normal, axis=1) == pytest.approx(1, abs=1e-4)
    assert all("/" in w for w in scene.warnings), scene.warnings
    assert len(set(scene.warnings)) == len(scene.warnings)


@pytest.mark.assets
def test_a_copied_real_stage_without_its_textures_still_reads(assets: Path, tmp_path: Path) -> None:
    shutil.copy(assets / "avocado/avocado.usda", tmp_path / "avocado.usda")
    scene = read_scene(tmp_path / "avocado.usda")
    assert sum("cannot be found" in w for w in scene.warnings) == 3
