"""Batches as Open Job Description: `openjd check` takes the template, `openjd run` does the jobs."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from kit.batch_shots import break_shot, bytes_below, write_manifest, write_shot
from kit.stage_textures import write_image
from pxr import Sdf, Usd, UsdGeom, UsdShade

from usdslf.batch import plan, run_job, task
from usdslf.batch.openjd import write_template
from usdslf.errors import InputError
from usdslf.usd.files_read import files_read

Run = Callable[..., tuple[int, str, str]]


def openjd(*arguments: object) -> subprocess.CompletedProcess[str]:
    command = Path(sys.executable).with_name("openjd")
    return subprocess.run([command, *map(str, arguments)], capture_output=True, text=True, timeout=300, check=False)


def test_openjd_takes_the_template_and_runs_it(tmp_path: Path) -> None:
    for name in ("one", "corrupt"):
        write_shot(tmp_path / "shots" / name)
    break_shot(tmp_path / "shots/corrupt", "corrupt")
    manifest = write_manifest(tmp_path, "seconds = 120\nmemory = 2.0")
    target = tmp_path / "farm.yaml"
    assert "2 tasks in 2 steps" in write_template(plan(manifest), target)
    checked = openjd("check", target)
    assert checked.returncode == 0, checked.stdout + checked.stderr
    ran = openjd("run", target)
    assert ran.returncode != 0 and "1 done, 1 failed" in ran.stdout, ran.stdout + ran.stderr  # the last step fails
    assert json.loads((tmp_path / "out/summary.json").read_text())["counts"] == {"done": 1, "failed": 1, "new": 0}
    run_job(plan(manifest, tmp_path / "here").job("one"))
    assert bytes_below(tmp_path / "out/one") == bytes_below(tmp_path / "here/one")


@pytest.mark.parametrize(("script", "code"), [("kill -9 $$", 0), ("exit 2", 2)])
def test_a_task_whose_process_is_killed_keeps_its_sentence(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, script: str, code: int, run: Run
) -> None:
    """It ends well, so that others go on; the last step fails.  What the program itself says is wrong fails at once."""
    write_shot(tmp_path / "shots/one")
    manifest, python = write_manifest(tmp_path), tmp_path / "python"
    python.write_text(f"#!/bin/sh\n{script}\n")
    python.chmod(0o700)
    monkeypatch.setattr(sys, "executable", str(python))
    assert task.main([str(manifest), str(tmp_path / "out"), "one"]) == code
    exit_code, said, _ = run("batch", manifest, "--collect")
    killed = "one: failed: the process of its task was ended by SIGKILL"
    assert exit_code == 1 and (killed if code == 0 else "1 not run") in said


def test_all_files_that_the_jobs_read_are_inputs(tmp_path: Path) -> None:
    write_shot(tmp_path / "shots/one")
    stage = Usd.Stage.Open(str(tmp_path / "shots/one/stage.usda"))
    for tile in (1001, 1002):
        write_image(tmp_path / f"tiles.{tile}.png", np.full((4, 4, 3), 0.5))
    texture = UsdShade.Shader.Define(stage, "/World/mtl/floor/tiles")
    texture.CreateIdAttr("UsdUVTexture")
    texture.CreateInput("file", Sdf.ValueTypeNames.Asset).Set("../../tiles.<UDIM>.png")
    moving = UsdGeom.Xform.Define(stage, "/World/moving").GetPrim()
    for k in (1, 2):
        clip = Usd.Stage.CreateNew(str(tmp_path / f"clip.{k}.usda"))
        prim = UsdGeom.Xform.Define(clip, "/moving").GetPrim()
        prim.CreateAttribute("x", Sdf.ValueTypeNames.Float).Set(float(k), k)
        clip.GetRootLayer().Save()
    clips = Usd.ClipsAPI(moving)
    clips.SetClipPrimPath("/moving")
    clips.SetClipAssetPaths([Sdf.AssetPath("../../clip.1.usda")])
    clips.SetClipTemplateAssetPath("../../clip.#.usda", "template")
    clips.SetClipPrimPath("/moving", "template")
    clips.SetClipTemplateStartTime(1, "template")
    clips.SetClipTemplateEndTime(2, "template")
    clips.SetClipTemplateStride(1, "template")
    stage.OverridePrim("/World/gone").GetReferences().AddReference("./gone.usda")
    stage.GetRootLayer().Save()
    found = files_read(Usd.Stage.Open(str(tmp_path / "shots/one/stage.usda")))
    names = {os.path.relpath(f, tmp_path) for f in found.found}
    assert names == {"shots/one/stage.usda", "tiles.1001.png", "tiles.1002.png", "clip.1.usda", "clip.2.usda"}
    assert [os.path.relpath(f, tmp_path) for f in found.missing] == ["shots/one/gone.usda"]
    assert [os.path.basename(p) for p in found.patterns] == ["clip.*.usda", "tiles.[0-9][0-9][0-9][0-9].png"]
    write_template(plan(write_manifest(tmp_path)), tmp_path / "farm.json")
    template = json.loads((tmp_path / "farm.json").read_text())
    inputs = next(p["default"] for p in template["parameterDefinitions"] if p["name"] == "Inputs")
    assert {os.path.relpath(f, tmp_path) for f in inputs} == names | {"batch.toml", "shots/one/strokes.usda"}


def test_a_template_has_a_name_of_one(tmp_path: Path) -> None:
    write_shot(tmp_path / "shots/one")
    with pytest.raises(InputError, match="is no template"):
        write_template(plan(write_manifest(tmp_path)), tmp_path / "farm.txt")
