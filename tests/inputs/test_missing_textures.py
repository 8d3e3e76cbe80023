"""Textures that cannot be read: what stands for them is what the specifications say, and everything says so first."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from kit.stage_parts import StageBuilder, TextureInput, rectangle
from pxr import Gf, Sdf, UsdLux, UsdShade

import usdslf
from usdslf.errors import InputError
from usdslf.surfaces.surface_points import evaluate_surface
from usdslf.usd.read.read import read_scene

CAMERA = ("--camera", "/World/camera")
LEVEL, TINT = 50.0, (1.0, 0.9, 0.8)


def write_stage(folder: Path, ball: bool = True, dome: bool = True, fallback: tuple | None = None) -> Path:
    """A card whose colour is in a file that is not there, in a dome whose picture is not there."""
    b = StageBuilder(folder)
    color = TextureInput("cue_ball.png") if ball else (0.5, 0.5, 0.5)
    look = b.material("card", diffuseColor=color, roughness=0.6)
    if fallback:
        shader = UsdShade.Shader(b.stage.GetPrimAtPath(f"{look}/diffuseColor_texture"))
        shader.CreateInput("fallback", Sdf.ValueTypeNames.Float4).Set(Gf.Vec4f(*fallback))
    b.mesh("card", rectangle((-1, 0, 1), (2, 0, 0), (0, 0, -2)), look)
    b.camera((0, 3, 0.01), (0, 0, 0), 45)
    light = UsdLux.DomeLight.Define(b.stage, "/World/dome")
    light.CreateIntensityAttr(LEVEL)
    light.CreateColorAttr(Gf.Vec3f(*TINT))
    if dome:
        light.CreateTextureFileAttr("./sky.exr")
    return b.save()


def diffuse(stage: Path) -> np.ndarray:
    return evaluate_surface(read_scene(stage), np.array([0]), np.full((1, 2), 1 / 3)).diffuse[0]


def test_the_fallback_is_what_the_node_says_else_black(tmp_path: Path) -> None:
    (tmp_path / "own").mkdir()
    np.testing.assert_array_equal(diffuse(write_stage(tmp_path)), 0)  # UsdUVTexture: float4 fallback = (0, 0, 0, 1)
    np.testing.assert_allclose(diffuse(write_stage(tmp_path / "own", fallback=(0.9, 0.85, 0.7, 1))), (0.9, 0.85, 0.7))
    missing, light = read_scene(tmp_path / "own/stage.usda").missing
    assert (missing.prim, missing.file) == ("/World/mtl/card/diffuseColor_texture", "./cue_ball.png")
    assert missing.materials == ("/World/mtl/card",) and light.materials == ()
    assert missing.stands_for_it == "its fallback (0.9, 0.85, 0.7) is shown on /World/card"


def test_a_damaged_file_is_missing_too(tmp_path: Path) -> None:
    (tmp_path / "cue_ball.png").write_bytes(b"no picture")
    (missing,) = read_scene(write_stage(tmp_path, dome=False)).missing
    assert missing.file.endswith("cue_ball.png") and missing.why
    np.testing.assert_array_equal(diffuse(tmp_path / "stage.usda"), 0)


@pytest.mark.parametrize(
    ("choice", "radiance"), [("color", np.multiply(LEVEL, TINT)), ("white", (1, 1, 1)), ("ignore", None)]
)
def test_a_dome_without_its_picture_shines_as_was_chosen(tmp_path: Path, choice: str, radiance: object) -> None:
    shot = usdslf.open(str(write_stage(tmp_path, ball=False)), missing_dome=choice).shot
    lights = {x.path: x for x in shot.lights}
    (missing,) = shot.scene.missing
    assert missing.prim == "/World/dome" and missing.file == "./sky.exr"
    if radiance is None:
        assert set(lights) == {""} and "left out" in missing.sentence  # the stated light of a stage without any
        assert any("the stage has no light" in w for w in shot.warnings)
    else:
        np.testing.assert_allclose(lights["/World/dome"].radiance, radiance, rtol=1e-6)
    assert (choice == "color") == ("--missing-dome" in missing.sentence)


def test_what_is_no_choice_is_refused(run, tmp_path: Path) -> None:
    stage = write_stage(tmp_path)
    with pytest.raises(InputError, match="--missing-dome black is unknown"):
        usdslf.open(str(stage), missing_dome="black")
    assert run("info", stage, "--missing-dome", "black")[0] == 2


def test_info_says_it_in_its_first_lines(run, tmp_path: Path) -> None:
    stage = write_stage(tmp_path)
    code, out, _ = run("info", stage)
    first, second = out.splitlines()[:2]
    assert code == 0
    assert first.startswith("missing texture ./cue_ball.png of /World/mtl/card/diffuseColor_texture cannot be read (")
    assert first.endswith("its fallback (0, 0, 0) is shown on /World/card")
    assert second.startswith("missing texture ./sky.exr of /World/dome cannot be read (")
    assert "radiance (50, 45, 40)" in second
    found = json.loads(run("info", stage, "--json", "--missing-dome", "ignore")[1])
    assert [m["file"] for m in found["missing"]] == ["./cue_ball.png", "./sky.exr"]
    assert found["lights"] == []


def test_a_picture_says_it_first_also_where_it_is_quiet(run, tmp_path: Path) -> None:
    stage, picture = write_stage(tmp_path, ball=False), tmp_path / "out.exr"
    size = ("--size", "8x6", "--elements", "50", "--samples", "1", "--quiet")
    code, out, err = run("render", stage, "-o", picture, *CAMERA, *size, "--missing-dome", "white")
    assert code == 0 and out == f"{picture}\n"
    first = err.splitlines()[0]
    assert first.startswith("warning: missing texture ./sky.exr of /World/dome cannot be read (it cannot be found): ")
    assert first.endswith("it is taken as white, radiance 1")


def solved(run, folder: Path, **missing: bool) -> tuple[str, dict, str, list[dict]]:
    """What a dab on the card and its look say: on stdout, in the report, in the layer, in its review."""
    stage, strokes, look = write_stage(folder, **missing), folder / "strokes.usda", folder / "look.usda"
    assert run("stroke", stage, strokes, *CAMERA, "--path", "0.45,0.5 0.55,0.5", "--color", "20,5,5")[0] == 0
    code, out, err = run(
        "solve", stage, strokes, "-o", look, "--report", folder / "r.json", "--elements", 300, "--quiet"
    )
    assert code == 0, err
    review = json.loads(run("review", stage, look, "--json")[1])
    return out, json.loads((folder / "r.json").read_text()), look.read_text(), review["findings"]


def test_an_answer_on_a_missing_texture_says_so_everywhere(run, tmp_path: Path) -> None:
    out, report, layer, findings = solved(run, tmp_path)
    assert all(line.startswith("missing texture ./") for line in out.splitlines()[:2])
    (stroke,) = report["strokes"]
    assert stroke["stands_on"] == ["./cue_ball.png of /World/mtl/card/diffuseColor_texture", "./sky.exr of /World/dome"]
    assert "  it stands on a texture that cannot be read: ./sky.exr of /World/dome" in out.splitlines()
    assert [m["prim"] for m in report["missing"]] == ["/World/mtl/card/diffuseColor_texture", "/World/dome"]
    assert "string[] missing = [" in layer
    found = [f["message"] for f in findings if f["name"] == "MissingTexture"]
    assert len(found) == 2 and "./sky.exr of /World/dome" in found[1] and "solve again" in found[1]


def test_where_nothing_is_missing_nothing_is_said(run, tmp_path: Path) -> None:
    out, report, layer, findings = solved(run, tmp_path, ball=False, dome=False)
    assert report["missing"] == [] and "stands_on" not in report["strokes"][0]
    assert "cannot be read" not in out and "string[] missing" not in layer and findings == []
