"""What a stage asks for and does not get is said."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from usdslf.textures.images import write_image
from usdslf.usd.read.read import read_scene


def test_inputs_of_lights_by_their_old_names(inputs: Path) -> None:
    scene = read_scene(inputs / "weak/old_light_names.usda")
    assert [light.radiance[0] for light in scene.lights if light.kind == "dome"] == [1.0]
    said = [w for w in scene.warnings if "inputs:" in w]
    assert any("intensity" in w and "texture:file" in w and "/World/old" in w for w in said)
    assert any("angle" in w and "/World/old2" in w for w in said)


def test_the_exposure_of_a_camera(inputs: Path) -> None:
    (said,) = [w for w in read_scene(inputs / "weak/camera_exposure.usda").warnings if "exposure" in w]
    assert "/World/cam" in said and "factor of 4" in said


@pytest.mark.parametrize("axis", ["X", "W", "y"])
def test_an_up_axis_that_is_none(tmp_path: Path, axis: str, inputs: Path) -> None:
    text = (inputs / "weak/camera_exposure.usda").read_text().replace('upAxis = "Y"', f'upAxis = "{axis}"')
    (tmp_path / "s.usda").write_text(text)
    scene = read_scene(tmp_path / "s.usda")
    assert scene.up_axis == "Y" and any(f"'{axis}'" in w and "upAxis" in w for w in scene.warnings)


def test_a_look_that_finds_nothing(inputs: Path, tmp_path: Path, run: Callable) -> None:
    strokes, look = tmp_path / "strokes.usda", tmp_path / "look.usda"
    shots = inputs / "weak/shot_ab"
    brush = ("--path", "0.47,0.5 0.53,0.5", "--color", ".1,.4,.05", "--camera", "/World/cam")
    assert run("stroke", shots / "A.usda", strokes, *brush)[0] == 0
    assert run("solve", shots / "A.usda", strokes, "-o", look, "--elements", 500)[0] == 0
    to = ("-o", tmp_path / "p.exr", "--edits", look, "--size", "16x9", "--samples", 1, "--elements", 200)
    code, _, err = run("render", shots / "A.usda", *to)
    assert code == 0 and "/World/m" not in err
    code, _, err = run("render", shots / "B.usda", *to)
    assert code == 0 and "/World/m" in err and "look.usda" in err, err


def test_shaders_of_other_renderers_by_name(inputs: Path) -> None:
    said = " ".join(read_scene(inputs / "weak/realitykit_mdl.usda").warnings)
    assert "ND_realitykit_pbr_surfaceshader" in said and "OmniPBR" in said


@pytest.mark.parametrize(
    ("space", "blue", "says"),
    [
        ("lin_rec709_scene", 0.05, ()),
        ("lin_ap1_scene", 0.2, ("converted from lin_ap1_scene to lin_rec709_scene", "are negative", "the least -0.0")),
        ("lin_rec709_scene", -0.05, ("100.0% of its pixels are negative in lin_rec709_scene", "the least -0.05")),
    ],
)
def test_what_a_painted_picture_is_taken_as(
    inputs: Path, tmp_path: Path, run: Callable, space: str, blue: float, says: tuple[str, ...]
) -> None:
    image = write_image(tmp_path / "p.exr", np.full((9, 16, 3), (0.1, 0.4, blue)), space, half=False)
    brush = ("--path", "0.47,0.5 0.53,0.5", "--image", image, "--camera", "/World/cam")
    code, _, err = run("stroke", inputs / "frame/s.usda", tmp_path / "strokes.usda", *brush, "--frame", 1)
    said = [line for line in err.splitlines() if "p.exr" in line]
    assert code == 0 and bool(said) == bool(says), err
    assert all(words in " ".join(said) for words in says), said


def test_a_camera_where_there_is_none(inputs: Path, tmp_path: Path, run: Callable) -> None:
    text = (inputs / "frame/s.usda").read_text().replace("def Camera", "def Xform")
    (tmp_path / "s.usda").write_text(text)
    code, _, err = run("render", tmp_path / "s.usda", "-o", tmp_path / "p.png", "--camera", "/World/cam")
    assert code == 2 and "it has none at all: without --camera a view that sees everything is taken" in err


@pytest.mark.parametrize(
    ("line", "says"),
    [
        ("float horizontalAperture = 0", "horizontalAperture of camera /World/cam has no usable value: 20.955"),
        ("float verticalAperture = nan", "verticalAperture of camera /World/cam has no usable value"),
        ("float horizontalApertureOffset = nan", "horizontalApertureOffset of camera /World/cam has no usable value"),
        ('string focalLength = "long"', "focalLength of camera /World/cam has no usable value: 50 is taken"),
        ("float2 clippingRange = (5, 1)", "the clipping range of camera /World/cam is empty"),
    ],
)
def test_cameras_that_cannot_be(inputs: Path, tmp_path: Path, line: str, says: str) -> None:
    text = (inputs / "frame/s.usda").read_text()
    name = line.split()[1]
    kept = "\n".join(each for each in text.splitlines() if f" {name} =" not in each or "def " in each)
    kept = kept.replace("float focalLength = 50", "", 1) if name == "focalLength" else kept
    (tmp_path / "s.usda").write_text(kept.replace('def Camera "cam" {', f'def Camera "cam" {{ {line}\n', 1))
    scene = read_scene(tmp_path / "s.usda")
    assert [w for w in scene.warnings if says in w], scene.warnings
    (camera,) = scene.cameras
    assert np.isfinite([camera.horizontal_aperture, camera.horizontal_offset, camera.focal_length, camera.near]).all()


@pytest.mark.parametrize("option", ["--tool", "--mode", "--norm", "--scope"])
def test_each_choice_of_a_stroke_is_explained(run: Callable, option: str) -> None:
    words = " ".join(run("stroke", "--help")[1].split())
    said = words.split(f" {option} [", 1)[1].split(" --")[0]  # choices, what they do, the default
    assert len(said.split("]", 1)[1]) > 40, said


@pytest.mark.parametrize(
    ("prototypes", "says"),
    [
        ("</World/none>", "names prototypes that are not there"),
        ("</World/pi>", "instances itself"),
        ("</World/other>", "instances itself"),
    ],
)
def test_instancers_that_cannot_be(tmp_path: Path, inputs: Path, prototypes: str, says: str) -> None:
    """In processes of their own USD would end at some of these by a fault of memory."""
    one = "def PointInstancer \"{}\" {{\nint[] protoIndices = [0]\npoint3f[] positions = [(0, 0, 0)]\n"
    one += "rel prototypes = {}\n}}\n"
    made = one.format("pi", prototypes) + one.format("other", "</World/pi>")
    text = (inputs / "weak/camera_exposure.usda").read_text()
    (tmp_path / "s.usda").write_text(text.replace("def DomeLight", f"{made}def DomeLight", 1))
    scene = read_scene(tmp_path / "s.usda")
    assert any(says in w and "/World/" in w for w in scene.warnings), scene.warnings
    assert [m.path for m in scene.meshes] == ["/World/card"]


@pytest.mark.parametrize(
    ("light", "says"),
    [
        ('RectLight "x" { float inputs:width = nan', "inputs:width of light /World/x has no usable value: 1 is taken"),
        ('RectLight "x" { float inputs:width = 0', "light /World/x has no area, and gives no light"),
        ('SphereLight "x" { float inputs:radius = -1', "light /World/x has no area, and gives no light"),
        ('SphereLight "x" { float inputs:radius = 0\nbool treatAsPoint = 1', ""),
        ('DistantLight "x" { string inputs:intensity = "x"', "inputs:intensity of light /World/x has no usable value"),
        ('DistantLight "x" { color3f inputs:color = (1, nan, 1)', "inputs:color of light /World/x has no usable value"),
        ('DistantLight "x" { float inputs:exposure = 500', "inputs:exposure of light /World/x is more than 64 stops"),
        ('SphereLight "x" { float inputs:shaping:cone:angle = nan', "inputs:shaping:cone:angle of light /World/x"),
        ('DomeLight "x" { token inputs:texture:format = "cube"\nasset inputs:texture:file = @./t.png@',
         "texture:format cube of light /World/x is not known: latlong is taken"),
        ('Cylinder "x" { token axis = "Q"', "the axis Q of the Cylinder /World/x is none: Z is taken"),
        ('Mesh "x" { int[] faceVertexCounts = [3]\nint[] faceVertexIndices = [0, 1, 2]\n'
         "float2[] points = [(0, 0), (1, 0), (0, 1)]", "the mesh /World/x has no points"),
    ],
)  # fmt: skip
def test_numbers_that_are_none(tmp_path: Path, inputs: Path, light: str, says: str) -> None:
    text = (inputs / "weak/camera_exposure.usda").read_text()
    write_image(tmp_path / "t.png", np.full((2, 4, 3), 0.5))
    (tmp_path / "s.usda").write_text(text.replace("def DomeLight", f"def {light}\n}}\ndef DomeLight", 1))
    scene = read_scene(tmp_path / "s.usda")
    said = [w for w in scene.warnings if "/World/x" in w and "no material is bound" not in w]
    assert bool(said) == bool(says) and all(says in w for w in said), said
    assert all(np.isfinite(light.radiance).all() for light in scene.lights)
