"""The command line: results on stdout, one line for an error, the right exit code, no file lost."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from kit.command_line import CAMERA, SMALL, Run, assert_one_line, environment, files_of, paint_ball, write_shot
from pxr import Sdf, Usd, UsdGeom


@pytest.fixture(scope="module")
def shot(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_shot(tmp_path_factory.mktemp("shot"))


@pytest.fixture
def strokes(shot: Path, tmp_path: Path, run: Run) -> Path:
    return paint_ball(shot, tmp_path, run)


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
    assert "built while the rest of Python goes on" in out


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
    done = subprocess.run(command, capture_output=True, text=True, cwd=tmp_path, env=environment(), check=False)
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


@pytest.mark.divided
def test_bench_prints_the_agreed_table(run: Run, monkeypatch: pytest.MonkeyPatch) -> None:
    from usdslf.cli import bench, bench_strokes, bench_timing

    for module in (bench_timing, bench_strokes):
        monkeypatch.setattr(module, "REPEATS", 1)
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
    first_frames = "live, first frame at half size", "live, first frame", "live, half size, camera turning"
    for name in (*first_frames, "live, one more frame"):
        assert "embreex" in rows[name]["limit"] and rows[name]["rays"] > 16 * 8, name
    assert rows["live, first frame"]["rays"] > 2 * rows["live, first frame at half size"]["rays"]
    assert rows["live, one more frame"]["moved_bytes"] == 0 < rows["live, first frame"]["moved_bytes"]
    for name in ("answer to live picture", "live, after a change of diffuse", "live, after one of roughness"):
        assert rows[name]["moved_bytes"] > 0
    assert rows["visibility"]["rays"] == elements * 1024
    first, second = rows["first start to first live frame"], rows["second start to first live frame"]
    assert second["limit_seconds"] == pytest.approx(first["seconds"] / 5) and "answer to live picture" in rows
    assert min(row["seconds"] for row in rows.values()) > 0 and found["total_seconds"] > 0
    assert found["memory_bytes"] > 0


def test_interrupt_leaves_the_earlier_file(shot: Path, tmp_path: Path) -> None:
    target = tmp_path / "a.exr"
    target.write_bytes(b"earlier")
    code = (
        "import sys, usdslf.render.picture as s\n"
        "def stop(*a, **k): raise KeyboardInterrupt\n"
        "s.render_bands = stop\n"
        "from usdslf.cli.main import main\n"
        "sys.exit(main())\n"
    )
    command = [sys.executable, "-c", code, "render", str(shot), "-o", str(target), "--size", "16x8"]
    done = subprocess.run(
        [*command, "--elements", "300"], capture_output=True, text=True, cwd=tmp_path, env=environment(), check=False
    )
    assert done.returncode == 130 and "Traceback" not in done.stderr
    assert target.read_bytes() == b"earlier"
    assert [p.name for p in tmp_path.iterdir()] == ["a.exr"]


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
