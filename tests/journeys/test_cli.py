"""The command line: results on stdout, one line for an error, the right exit code, no file lost."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from pxr import Gf, Sdf, Usd, UsdGeom, UsdLux, UsdShade, Vt

Run = Callable[..., tuple[int, str, str]]
CAMERA = "/world/camera"
SMALL = ("--elements", 300, "--bounces", 2)


@pytest.fixture(scope="session")
def shot(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A floor, a wall, a red ball, a light and a camera."""
    path = tmp_path_factory.mktemp("shot") / "shot.usda"
    stage = Usd.Stage.CreateNew(str(path))
    UsdGeom.SetStageUpAxis(stage, UsdGeom.Tokens.y)
    UsdGeom.SetStageMetersPerUnit(stage, 1.0)
    stage.SetDefaultPrim(UsdGeom.Xform.Define(stage, "/world").GetPrim())
    for name, color, corners in (
        ("floor", (0.6, 0.6, 0.6), [(-2, 0, 2), (2, 0, 2), (2, 0, -2), (-2, 0, -2)]),
        ("wall", (0.2, 0.5, 0.3), [(-2, 0, -2), (2, 0, -2), (2, 3, -2), (-2, 3, -2)]),
    ):
        mesh = UsdGeom.Mesh.Define(stage, f"/world/{name}")
        mesh.CreatePointsAttr(Vt.Vec3fArray([Gf.Vec3f(*c) for c in corners]))
        mesh.CreateFaceVertexCountsAttr([4])
        mesh.CreateFaceVertexIndicesAttr([0, 1, 2, 3])
        mesh.CreateSubdivisionSchemeAttr("none")
        bind(stage, mesh.GetPrim(), name, color)
    ball = UsdGeom.Sphere.Define(stage, "/world/ball")
    ball.CreateRadiusAttr(0.6)
    ball.AddTranslateOp().Set(Gf.Vec3d(0, 0.6, 0))
    bind(stage, ball.GetPrim(), "red", (0.6, 0.05, 0.05))
    light = UsdLux.RectLight.Define(stage, "/world/light")
    light.CreateIntensityAttr(12)
    light.AddTransformOp().Set(
        Gf.Matrix4d().SetLookAt(Gf.Vec3d(1, 3, 2), Gf.Vec3d(0, 0.5, 0), Gf.Vec3d(0, 1, 0)).GetInverse()
    )
    camera = UsdGeom.Camera.Define(stage, CAMERA)
    camera.CreateHorizontalApertureAttr(36)
    camera.CreateVerticalApertureAttr(24)
    camera.CreateFocalLengthAttr(50)
    camera.AddTranslateOp().Set(Gf.Vec3d(0, 0.8, 5))
    stage.Save()
    return path


def bind(stage: Usd.Stage, prim: Usd.Prim, name: str, color: tuple[float, float, float]) -> None:
    """Gives a prim a UsdPreviewSurface of one colour."""
    material = UsdShade.Material.Define(stage, f"/world/materials/{name}")
    shader = UsdShade.Shader.Define(stage, f"/world/materials/{name}/surface")
    shader.CreateIdAttr("UsdPreviewSurface")
    shader.CreateInput("diffuseColor", Sdf.ValueTypeNames.Color3f).Set(Gf.Vec3f(*color))
    material.CreateSurfaceOutput().ConnectToSource(shader.ConnectableAPI(), "surface")
    UsdShade.MaterialBindingAPI.Apply(prim).Bind(material)


@pytest.fixture
def strokes(shot: Path, tmp_path: Path, run: Run) -> Path:
    """A blue dab row on the ball."""
    path = tmp_path / "strokes.usda"
    code, _, err = run(
        "stroke", shot, path, "--camera", CAMERA, "--path", "0.44,0.55 0.5,0.6 0.56,0.55",
        "--color", "0.03,0.05,0.3",
    )  # fmt: skip
    assert code == 0, err
    return path


def assert_one_line(err: str) -> None:
    """An error is one line that names the program, and no traceback."""
    lines = [x for x in err.splitlines() if x.strip()]
    assert len(lines) == 1, err
    assert lines[0].startswith("usdslf: ")
    assert "internal error" not in err and "Traceback" not in err


def files_of(folder: Path) -> dict[str, bytes]:
    """Names and content of all files in a folder."""
    return {p.name: p.read_bytes() for p in sorted(folder.rglob("*")) if p.is_file()}


# ── what works ───────────────────────────────────────────────────────────────────────────────────


def test_info_lists_what_the_stage_holds(shot: Path, run: Run) -> None:
    code, out, err = run("info", shot, "--json")
    found = json.loads(out)
    assert (code, err) == (0, "")
    assert {m["prim"] for m in found["meshes"]} == {"/world/floor", "/world/wall", "/world/ball"}
    assert [m["prim"] for m in found["lights"]] == ["/world/light"]
    assert found["cameras"] == [CAMERA] and found["warnings"] == []
    red = next(m for m in found["materials"] if m["prim"].endswith("red"))
    assert red["inputs"]["diffuse_color"] == [0.6, 0.05, 0.05] and red["editable"]
    code, out, _ = run("info", shot)
    assert code == 0 and "/world/materials/red" in out


def test_options_stand_before_or_after_the_sub_command(shot: Path, run: Run) -> None:
    for arguments in (("--device", "no such", "doctor"), ("doctor", "--device", "no such")):
        code, out, err = run(*arguments)
        assert code == 4 and "no such" in out and "kernels" in out, arguments
        assert_one_line(err)


def test_doctor_names_versions_devices_colour_hydra_and_limits(run: Run) -> None:
    code, out, _ = run("doctor")
    assert code == 0
    for word in ("usd-core", "embreex", "pyopencl", "device 0", "GiB", "OpenColorIO", "hydra", "limits"):
        assert word in out


def test_render_live_writes_what_a_viewer_shows(shot: Path, tmp_path: Path, run: Run) -> None:
    import OpenImageIO as oiio

    pictures = []
    for name, options in (("final", ()), ("live", ("--live", 16))):
        code, out, err = run("render", shot, "-o", tmp_path / f"{name}.exr", "--size", "48x32", *options, *SMALL)
        assert code == 0, err
        pictures.append(oiio.ImageBuf(str(tmp_path / f"{name}.exr")).get_pixels(oiio.FLOAT))
    final, live = pictures
    assert np.abs(live - final).mean() < 0.12 * final.mean()  # 8 pixels of 48 are filtered over
    code, out, err = run("render", shot, "-o", tmp_path / "a.exr", "--live", 2, "--aov", "albedo", *SMALL)
    assert (code, out) == (2, "") and "--live has no further layers" in err


def test_render_writes_scene_linear_exr_with_layers(shot: Path, tmp_path: Path, run: Run) -> None:
    out_path = tmp_path / "picture.exr"
    code, out, err = run(
        "render", shot, "-o", out_path, "--size", "48x32", "--aov", "albedo", "depth", "--aov", "normal",
        *SMALL,
    )  # fmt: skip
    assert (code, out.strip()) == (0, str(out_path)), err
    import OpenImageIO as oiio

    picture = oiio.ImageBuf(str(out_path))
    names = list(picture.spec().channelnames)
    assert {"R", "G", "B", "albedo.R", "normal.B", "depth.Y"} <= set(names)
    pixels = picture.get_pixels(oiio.FLOAT)
    assert pixels.shape[:2] == (32, 48) and pixels[..., :3].max() > 0
    albedo = pixels[20, 24, [names.index(f"albedo.{c}") for c in "RGB"]]
    assert np.allclose(albedo, (0.6, 0.05, 0.05), atol=0.02)


def test_stroke_prints_its_prim_and_appends(shot: Path, strokes: Path, run: Run) -> None:
    code, out, _ = run(
        "stroke", shot, strokes, "--camera", CAMERA, "--path", "0.5,0.5", "--path", "0.52,0.52",
        "--color", "1,1,1",
    )  # fmt: skip
    assert (code, out.strip()) == (0, "/SlfStrokes/stroke_0002")
    stage = Usd.Stage.Open(str(strokes))
    first, second = stage.GetPrimAtPath("/SlfStrokes").GetChildren()
    assert first.GetName() == "stroke_0001"
    assert list(UsdGeom.BasisCurves(second).GetCurveVertexCountsAttr().Get()) == [2, 2]


def test_stroke_colour_of_a_named_space(shot: Path, tmp_path: Path, run: Run) -> None:
    path = tmp_path / "s.usda"
    code, _, err = run(
        "stroke", shot, path, "--camera", CAMERA, "--path", "0.5,0.5", "--color", "0.5,0.5,0.5",
        "--color-space", "srgb_rec709_scene",
    )  # fmt: skip
    assert code == 0, err
    stage = Usd.Stage.Open(str(path))
    curves = UsdGeom.BasisCurves(stage.GetPrimAtPath("/SlfStrokes/stroke_0001"))
    assert np.allclose(curves.GetDisplayColorAttr().Get()[0], 0.21404, atol=1e-3)


def test_solve_reports_and_writes_layers(shot: Path, strokes: Path, tmp_path: Path, run: Run) -> None:
    before = files_of(shot.parent)
    look, report, review = (tmp_path / n for n in ("look.usda", "report.json", "review.usda"))
    code, out, err = run(
        "solve", shot, strokes, "-o", look, "--report", report, "--review-root", review, *SMALL
    )
    assert code == 0, err
    assert files_of(shot.parent) == before
    found = json.loads(report.read_text())
    assert found["strokes"][0]["path"] == "/SlfStrokes/stroke_0001"
    assert found["strokes"][0]["material"] == "/world/materials/red"
    assert "diffuse" in found["strokes"][0]["inferred"] and found["edits"]
    assert str(look) in out and "/SlfStrokes/stroke_0001" in out
    stage = Usd.Stage.Open(str(review))
    color = stage.GetAttributeAtPath("/world/materials/red/surface.inputs:diffuseColor").Get()
    assert color[2] > color[0]
    first = look.read_bytes()
    assert run("solve", shot, strokes, "-o", look, *SMALL)[0] == 0
    assert look.read_bytes() == first


def test_nothing_but_the_result_when_piped(shot: Path, tmp_path: Path) -> None:
    command = [sys.executable, "-m", "usdslf", "info", str(shot), "--json"]
    done = subprocess.run(command, capture_output=True, text=True, cwd=tmp_path, env=_environment(), check=False)
    assert (done.returncode, done.stderr) == (0, "")
    assert json.loads(done.stdout)["cameras"] == [CAMERA]


def test_debug_alone_shows_a_traceback(shot: Path, tmp_path: Path, run: Run) -> None:
    code, _, err = run("info", tmp_path / "none.usda", "--debug")
    assert code == 2 and "Traceback" in err


def test_unexpected_errors_are_one_line(shot: Path, run: Run, monkeypatch: pytest.MonkeyPatch) -> None:
    def fail(*_: object, **__: object) -> None:
        raise ZeroDivisionError("a slip")

    monkeypatch.setattr("usdslf.usd.read.read.read_scene", fail)
    code, out, err = run("info", shot)
    assert (code, out) == (1, "")
    assert err.splitlines() == ["usdslf: internal error: ZeroDivisionError: a slip (--debug shows where)"]


def test_bench_prints_the_agreed_table(run: Run, monkeypatch: pytest.MonkeyPatch) -> None:
    from usdslf.cli import bench, bench_strokes

    monkeypatch.setattr(bench, "SIZE", (32, 16))
    monkeypatch.setattr(bench_strokes, "MANY_DABS", 18)
    code, out, err = run("bench", "--json", "--elements", 500)
    assert code == 0, err
    found = json.loads(out)
    rows = {row["step"]: row for row in found["rows"]}
    assert set(next(iter(rows.values()))) == {
        "step", "seconds", "limit", "limit_seconds", "ratio", "bytes", "moved_bytes", "paper_ms", "rays",
    }  # fmt: skip
    final = rows["picture 32 x 16"]
    assert final["rays"] > 32 * 16 * 4 * 4
    assert final["ratio"] == pytest.approx(final["seconds"] / final["limit_seconds"])
    assert rows["visibility"]["paper_ms"] == 870 and "embreex" in rows["visibility"]["limit"]
    assert rows["visibility"]["ratio"] == pytest.approx(
        rows["visibility"]["seconds"] / rows["visibility"]["limit_seconds"]
    )
    moved = rows["visibility, one object moved"]
    assert moved["ratio"] == pytest.approx(moved["seconds"] / moved["limit_seconds"])
    assert "everything" in moved["limit"]
    elements = found["elements"]
    assert rows["one bounce"]["moved_bytes"] == 8 * elements  # how far each changed, after it; nothing within
    new, again = rows["new stroke to answer, third one"], rows["three known strokes, all rounds"]
    assert 0 < again["moved_bytes"] < new["moved_bytes"]  # what is known is not gathered again
    assert rows["undo of the third"]["moved_bytes"] == 0
    assert {"another choice", "18 dabs on one material"} < set(rows)
    assert min(row["seconds"] for row in rows.values()) > 0 and found["total_seconds"] > 0
    assert found["memory_bytes"] > 0


# ── bad input ────────────────────────────────────────────────────────────────────────────────────


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
    environment = _environment() | {"OCL_ICD_VENDORS": str(tmp_path / "none"), "OCL_ICD_FILENAMES": ""}
    command = [sys.executable, "-c", NO_DEVICE, "render", str(shot), "-o", "a.exr", "--elements", "300"]
    done = subprocess.run(command, capture_output=True, text=True, cwd=tmp_path, env=environment, check=False)
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


def test_interrupt_leaves_the_earlier_file(shot: Path, tmp_path: Path) -> None:
    target = tmp_path / "a.exr"
    target.write_bytes(b"earlier")
    code = (
        "import sys, usdslf.look as s\n"
        "def stop(*a, **k): raise KeyboardInterrupt\n"
        "s.render_bands = stop\n"
        "from usdslf.cli.main import main\n"
        "sys.exit(main())\n"
    )
    command = [sys.executable, "-c", code, "render", str(shot), "-o", str(target), "--size", "16x8"]
    done = subprocess.run(
        [*command, "--elements", "300"], capture_output=True, text=True, cwd=tmp_path, env=_environment(), check=False
    )
    assert done.returncode == 130 and "Traceback" not in done.stderr
    assert target.read_bytes() == b"earlier"
    assert [p.name for p in tmp_path.iterdir()] == ["a.exr"]


def _environment() -> dict[str, str]:
    root = str(Path(__file__).resolve().parents[2])
    return {**os.environ, "PYTHONPATH": root}


def test_phong_is_solved_said_and_measured(shot: Path, strokes: Path, tmp_path: Path, run: Run) -> None:
    look, report = tmp_path / "look.usda", tmp_path / "r.json"
    code, _, err = run(
        "solve", shot, strokes, "-o", look, "--report", report, "--model", "phong", "--weights", "1,5,25", *SMALL
    )
    assert code == 0, err
    assert "solved with phong" in err
    found = json.loads(report.read_text())
    (stroke,) = found["strokes"]
    assert found["model"] == "phong" and len(stroke["inferred"].split("+")) == 1
    assert np.isfinite(stroke["residual_as_preview_surface"])
    assert f"{stroke['residual_as_preview_surface']:.3f}" in err
    how = Sdf.Layer.FindOrOpen(str(look)).customLayerData["usdslf"]["solve"]
    assert how.startswith("phong,") and "factors 1, 5, 25" in how
    assert run("solve", shot, strokes, "-o", look, "--norm", "l2", "--report", report, *SMALL)[0] == 0
    found = json.loads(report.read_text())
    assert found["model"] == "preview_surface" and "residual_as_preview_surface" not in found["strokes"][0]
    assert found["strokes"][0]["inferred"] == "diffuse+specular+glossiness"
    how = Sdf.Layer.FindOrOpen(str(look)).customLayerData["usdslf"]["solve"]
    assert how.startswith("preview_surface,") and how.endswith("norm l2")


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


def test_the_models_render_differently(shot: Path, tmp_path: Path, run: Run) -> None:
    import OpenImageIO as oiio

    seen = {}
    for model in ("preview_surface", "phong"):
        path = tmp_path / f"{model}.exr"
        code, _, err = run("render", shot, "-o", path, "--size", "48x32", "--model", model, *SMALL)
        assert code == 0, err
        seen[model] = oiio.ImageBuf(str(path)).get_pixels(oiio.FLOAT)[..., :3]
    apart = np.abs(seen["phong"] - seen["preview_surface"]).mean() / seen["preview_surface"].mean()
    assert 0.005 < apart < 0.5
    assert run("render", shot, "-o", tmp_path / "a.png", "--model", "ward", *SMALL)[0] == 2
