"""The command line on bad input: one line that says what and where, the right exit code, no file lost."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import pytest
from kit.command_line import CAMERA, SMALL, Run, assert_one_line, environment, files_of, paint_ball, write_shot
from pxr import Gf, Sdf, Usd, UsdGeom, UsdLux, UsdShade


@pytest.fixture(scope="module")
def shot(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_shot(tmp_path_factory.mktemp("shot"))


@pytest.fixture
def strokes(shot: Path, tmp_path: Path, run: Run) -> Path:
    return paint_ball(shot, tmp_path, run)


def test_a_missing_stage(tmp_path: Path, run: Run) -> None:
    for command in (("info",), ("render", "-o", tmp_path / "a.exr"), ("solve", "-o", tmp_path / "l.usda")):
        more = (tmp_path / "strokes.usda",) if command[0] == "solve" else ()
        code, out, err = run(command[0], tmp_path / "missing.usda", *more, *command[1:])
        assert (code, out) == (2, "")
        assert_one_line(err)
    assert files_of(tmp_path) == {}


@pytest.mark.parametrize("name", ["text.usd", "text.usda", "text.usdc", "text.usdz"])
def test_a_text_file_named_as_a_stage(name: str, tmp_path: Path, run: Run) -> None:
    (tmp_path / name).write_text("these are no prims\n")
    code, out, err = run("info", tmp_path / name)
    assert (code, out) == (2, "")
    assert_one_line(err)
    assert name in err


@pytest.mark.parametrize("share", [0.0, 0.2, 0.9])
def test_a_truncated_crate(share: float, shot: Path, tmp_path: Path, run: Run) -> None:
    whole = tmp_path / "whole.usdc"
    Usd.Stage.Open(str(shot)).Export(str(whole))
    broken = tmp_path / "broken.usdc"
    broken.write_bytes(whole.read_bytes()[: int(share * whole.stat().st_size)])
    code, out, err = run("info", broken)
    assert (code, out) == (2, "")
    assert_one_line(err)


def test_a_stage_without_geometry(tmp_path: Path, run: Run) -> None:
    path = tmp_path / "empty.usda"
    stage = Usd.Stage.CreateNew(str(path))
    UsdLux.DomeLight.Define(stage, "/sky")
    stage.Save()
    code, out, err = run("info", path)
    assert (code, out) == (2, "")
    assert_one_line(err)
    assert "geometry" in err


def test_an_unreadable_texture_is_a_warning(shot: Path, tmp_path: Path, run: Run) -> None:
    path = tmp_path / "textured.usda"
    stage = Usd.Stage.CreateNew(str(path))
    stage.GetRootLayer().subLayerPaths.append(str(shot))
    shader = UsdShade.Shader.Get(stage, "/world/materials/red/surface")
    texture = UsdShade.Shader.Define(stage, "/world/materials/red/texture")
    texture.CreateIdAttr("UsdUVTexture")
    (tmp_path / "broken.png").write_bytes(b"\x89PNG\r\n\x1a\n, then nothing")
    texture.CreateInput("file", Sdf.ValueTypeNames.Asset).Set("./broken.png")
    texture.CreateOutput("rgb", Sdf.ValueTypeNames.Float3)
    shader.GetInput("diffuseColor").ConnectToSource(texture.ConnectableAPI(), "rgb")
    stage.Save()
    code, out, err = run("info", path, "--json")
    assert code == 0 and "usdslf:" not in err  # the PNG library itself says a word
    assert any("broken.png" in w or "/world/materials/red/texture" in w for w in json.loads(out)["warnings"])


def _set_point(path: Path, value: tuple[float, float, float]) -> None:
    stage = Usd.Stage.Open(str(path))
    curves = UsdGeom.BasisCurves(stage.GetPrimAtPath("/SlfStrokes/stroke_0001"))
    points = curves.GetPointsAttr().Get()
    points[0] = Gf.Vec3f(*value)
    curves.GetPointsAttr().Set(points)
    stage.Save()


def test_nan_points(shot: Path, strokes: Path, tmp_path: Path, run: Run) -> None:
    _set_point(strokes, (float("nan"), 0, 0))
    look = tmp_path / "look.usda"
    look.write_text("#usda 1.0\n")
    code, out, err = run("solve", shot, strokes, "-o", look, *SMALL)
    assert (code, out) == (2, "")
    assert_one_line(err)
    assert "/SlfStrokes/stroke_0001" in err
    assert look.read_text() == "#usda 1.0\n"


def test_a_stroke_off_every_surface(shot: Path, tmp_path: Path, run: Run) -> None:
    path = tmp_path / "strokes.usda"
    code, out, err = run("stroke", shot, path, "--camera", CAMERA, "--path", "0.01,0.01", "--color", "1,0,0")
    assert (code, out) == (2, "")
    assert_one_line(err)
    assert not path.exists()


def test_a_stroke_layer_of_another_stage(shot: Path, strokes: Path, tmp_path: Path, run: Run) -> None:
    other = tmp_path / "other.usda"
    stage = Usd.Stage.CreateNew(str(other))
    far = UsdGeom.Sphere.Define(stage, "/elsewhere")
    far.AddTranslateOp().Set(Gf.Vec3d(500, 0, 0))
    stage.Save()
    look = tmp_path / "look.usda"
    code, out, err = run("solve", other, strokes, "-o", look, *SMALL)
    assert (code, out) == (2, "")
    assert "usdslf: " in err and "internal error" not in err
    assert [x for x in err.splitlines() if x.startswith("usdslf: ")] == err.splitlines()[-1:]
    assert not look.exists()


@pytest.mark.parametrize("size", ["0x32", "32x0", "-4x8", "big", "32", "99999x2"])
def test_sizes_that_are_none(size: str, shot: Path, tmp_path: Path, run: Run) -> None:
    code, out, err = run("render", shot, "-o", tmp_path / "a.exr", "--size", size)
    assert (code, out) == (2, "")
    assert_one_line(err)


@pytest.mark.parametrize("radius", ["0", "-0.1", "nan", "wide"])
def test_brush_radii_that_are_none(radius: str, shot: Path, tmp_path: Path, run: Run) -> None:
    code, out, err = run(
        "stroke", shot, tmp_path / "s.usda", "--camera", CAMERA, "--path", "0.5,0.5", "--color", "1,0,0",
        "--radius", radius,
    )  # fmt: skip
    assert (code, out) == (2, "")
    assert_one_line(err)
    assert files_of(tmp_path) == {}


@pytest.mark.parametrize(
    "arguments",
    [
        ("--tool", "smudge"), ("--mode", "sideways"), ("--norm", "l7"), ("--scope", "all"), ("--strength", "2"),
        ("--path", "0.5;0.5"), ("--path", "nan,0.5"), ("--path", ""), ("--color", "1,2"), ("--color", "red"),
        ("--color-space", "no such space"), ("--camera", "/world/nobody"), ("--frame", "nan"), ("--nonsense",),
    ],
)  # fmt: skip
def test_stroke_values_that_are_none(arguments: tuple[str, ...], shot: Path, tmp_path: Path, run: Run) -> None:
    given = {"--camera": CAMERA, "--path": "0.5,0.5", "--color": "1,0,0"}
    given.update({arguments[0]: arguments[1]} if len(arguments) == 2 else {})
    flags = [x for pair in given.items() for x in pair] + list(arguments[:1] if len(arguments) == 1 else ())
    code, out, err = run("stroke", shot, tmp_path / "s.usda", *flags)
    assert (code, out) == (2, "")
    assert_one_line(err)
    assert files_of(tmp_path) == {}


def test_an_unknown_tool_in_a_layer(shot: Path, strokes: Path, tmp_path: Path, run: Run) -> None:
    stage = Usd.Stage.Open(str(strokes))
    stage.GetAttributeAtPath("/SlfStrokes/stroke_0001.slf:tool").Set("smudge")
    stage.Save()
    code, out, err = run("solve", shot, strokes, "-o", tmp_path / "look.usda", *SMALL)
    assert (code, out) == (2, "")
    assert_one_line(err)
    assert "smudge" in err


def test_an_unwritable_look(shot: Path, strokes: Path, tmp_path: Path, run: Run) -> None:
    for place in (tmp_path / "no folder" / "look.usda", tmp_path):
        code, out, err = run("solve", shot, strokes, "-o", place, *SMALL)
        assert (code, out) == (6, "")
        assert_one_line(err)


def test_the_shot_is_never_written_to(shot: Path, strokes: Path, run: Run) -> None:
    before = files_of(shot.parent)
    code, out, err = run("solve", shot, strokes, "-o", shot, *SMALL)
    assert (code, out) == (6, "")
    assert_one_line(err)
    code, out, err = run("stroke", shot, shot, "--camera", CAMERA, "--path", "0.5,0.5", "--color", "1,0,0")
    assert code in (2, 6)
    assert_one_line(err)
    assert files_of(shot.parent) == before


def test_unwritable_pictures_and_unknown_kinds(shot: Path, tmp_path: Path, run: Run) -> None:
    for place in (tmp_path / "no folder" / "a.exr", tmp_path / "a.gif", tmp_path / "a"):
        code, out, err = run("render", shot, "-o", place, "--size", "16x8", *SMALL)
        assert (code, out) == (2, "")
        assert_one_line(err)
    code, out, err = run("render", shot, "-o", tmp_path / "a.png", "--aov", "albedo")
    assert code == 2
    assert_one_line(err)
    code, out, err = run("render", shot, "-o", tmp_path / "a.exr", "--aov", "beauty", *SMALL)
    assert code == 2
    assert_one_line(err)
    assert files_of(tmp_path) == {}


def test_a_missing_or_broken_look(shot: Path, tmp_path: Path, run: Run) -> None:
    (tmp_path / "text.usda").write_text("nothing")
    for look in (tmp_path / "none.usda", tmp_path / "text.usda"):
        code, out, err = run("render", shot, "-o", tmp_path / "a.exr", "--edits", look, *SMALL)
        assert (code, out) == (2, "")
        assert_one_line(err)


def test_no_such_opencl_device(shot: Path, tmp_path: Path, run: Run) -> None:
    code, out, err = run("render", shot, "-o", tmp_path / "a.exr", "--device", "no such device", *SMALL)
    assert (code, out) == (4, "")
    assert_one_line(err)


def test_no_opencl_device_at_all(shot: Path, tmp_path: Path) -> None:
    # The loader finds its drivers by OCL_ICD_VENDORS; an empty folder means there are none.
    (tmp_path / "none").mkdir()
    without = environment() | {"OCL_ICD_VENDORS": str(tmp_path / "none"), "OCL_ICD_FILENAMES": ""}
    command = [sys.executable, "-c", NO_DEVICE, "render", str(shot), "-o", "a.exr", "--elements", "300"]
    done = subprocess.run(command, capture_output=True, text=True, cwd=tmp_path, env=without, check=False)
    assert (done.returncode, done.stdout) == (4, ""), done.stderr
    assert_one_line(done.stderr)


# pip's PoCL is found beside pyopencl whatever the environment says, so the platforms are taken away.
NO_DEVICE = """
import sys
import usdslf.gpu.device as gpu
gpu.cl.get_platforms = lambda: []
from usdslf.cli.main import main
sys.exit(main())
"""


@pytest.mark.parametrize("count", ["0", "-5", "3000000", "99999999"])
def test_element_counts_that_cannot_be(count: str, shot: Path, tmp_path: Path, run: Run) -> None:
    code, out, err = run("render", shot, "-o", tmp_path / "a.exr", "--size", "16x8", "--elements", count)
    assert (code, out) == (4 if count == "3000000" else 2, "")
    assert_one_line(err)


def test_an_ocio_config_that_is_none(shot: Path, tmp_path: Path, run: Run) -> None:
    code, out, err = run("info", shot, "--ocio", tmp_path / "none.ocio")
    assert (code, out) == (2, "")
    assert_one_line(err)


def test_usage(run: Run) -> None:
    for arguments in ((), ("paint",), ("info",), ("solve", "a.usda"), ("review", "a.usda", "b.usda")):
        code, _, err = run(*arguments)
        assert code == 2, arguments
        assert "Traceback" not in err
    assert run("--help")[0] == 0 and run("solve", "--help")[0] == 0
    assert run("demo", "no such scene")[0] == 2


@pytest.mark.parametrize(
    ("weights", "said"),
    [("1,5", "three factors"), ("1,-5,25", "negative"), ("grip=3", "grip"), ("group=x", "group"), ("a,b,c", "a,b,c"),
     ("dab_error=0", "above zero"), ("1,0,2", "above zero")],
)  # fmt: skip
def test_weights_that_weigh_nothing_are_refused(
    shot: Path, strokes: Path, tmp_path: Path, run: Run, weights: str, said: str
) -> None:
    code, _, err = run("solve", shot, strokes, "-o", tmp_path / "l.usda", "--weights", weights, *SMALL)
    assert code == 2 and said in err and len(err.strip().splitlines()) == 1
