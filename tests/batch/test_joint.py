"""One asset in several shots: what one lighting cannot decide is decided by two, and one look says it."""

from __future__ import annotations

import json
import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from kit.batch_shots import OPTIONS, bytes_below
from kit.joint_shots import AFTER, BEFORE, CASES, LAMPS, painted, ring, write_asset, write_shot
from pxr import Usd
from truth.run_joint import Shots, is_sure, meant

from usdslf.batch import Plan, Result, plan, run_job
from usdslf.inference.pooled import arrays_of, fit_jointly, join_tables, tables_of
from usdslf.inference.weights import Options
from usdslf.usd.stroke_layer import write_strokes


@pytest.fixture(scope="module")
def shots(tmp_path_factory: pytest.TempPathFactory) -> Shots:
    return Shots(tmp_path_factory.mktemp("joint"))


@pytest.mark.parametrize("case", CASES, ids="_".join)
def test_two_lights_decide_what_neither_does_alone(shots: Shots, case: tuple[str, str, str, str]) -> None:
    dabs, change, *lamps = case
    assert not any(is_sure(shots.alone(dabs, change, lamp), change) for lamp in lamps)
    found = shots.together(dabs, change, *lamps)
    assert is_sure(found, change)
    if meant(change) == "glossiness":
        return  # its value is fitted on finer levels: below
    parts = [shots.tables(dabs, change, lamp) for lamp in lamps]
    c, tables = fit_jointly(parts, found.chosen, Options(), True)
    diffuse, specular, _ = AFTER[change]
    assert c.diffuse_of(tables.diffuse) == pytest.approx(diffuse, abs=0.01)
    assert c.f0_of(tables.f0) == pytest.approx(specular, abs=0.01)


@pytest.mark.parametrize("change", ["diffuse", "glossiness"])
def test_what_is_painted_is_what_a_path_tracer_sees(shots: Shots, change: str) -> None:
    traced, stroke = shots.seen("ring4", change, "wide"), painted(ring("ring4"), LAMPS["wide"], AFTER[change])
    assert stroke.colors[::2] == pytest.approx(traced, rel=0.01)


def test_tables_are_files_and_light_has_no_unit(shots: Shots, tmp_path: Path) -> None:
    t = shots.tables("ring6", "diffuse", "high")
    with (tmp_path / "t.npz").open("wb") as file:
        np.savez(file, **arrays_of(t))
    with np.load(tmp_path / "t.npz") as arrays:
        again = tables_of(arrays)
    for name, value in arrays_of(t).items():
        assert np.array_equal(arrays_of(again)[name], value) and arrays_of(again)[name].dtype == value.dtype, name
    assert again.is_metal is t.is_metal and again.colored is t.colored
    other = shots.tables("ring6", "diffuse", "side")
    names = ("target", "scale", "noise", "factor_u", "factor_w", "factor_v")
    scaled = {name: 100 * getattr(other, name) for name in names}
    b = other.dabs
    bright = replace(other, **scaled, dabs=type(b)(100 * b.p, 100 * b.u, 100 * b.v, 100 * b.w))
    one, two = join_tables([t, other]), join_tables([t, bright])
    assert two.target == pytest.approx(one.target, rel=1e-9) and two.dabs.v == pytest.approx(one.dabs.v, rel=1e-9)
    assert two.noise == pytest.approx(one.noise, rel=1e-9) and one.noise.any()
    assert set(one.stroke) == {0, 1} and len(one.target) == 12
    for name, value in arrays_of(one).items():  # what counts dabs counts those of all shots
        assert len(value) == 12 if np.shape(arrays_of(t)[name])[:1] == (6,) else True, name


@pytest.fixture(scope="module")
def joint(tmp_path_factory: pytest.TempPathFactory) -> tuple[Plan, dict[str, Result]]:
    """All steps of a joint solve, in this process."""
    folder = tmp_path_factory.mktemp("steps")
    asset = write_asset(folder, BEFORE)
    for name in ("over", "wide"):
        shot = write_shot(folder / name, asset, LAMPS[name])
        stroke = painted(ring("ring6"), LAMPS[name], AFTER["glossiness"])
        write_strokes(folder / name / "strokes.usda", [stroke], Usd.Stage.Open(str(shot)))
    table = 'shots = ["over/shot.usda", "wide/shot.usda"]\nstrokes = ["{dir}/strokes.usda"]\njoint = true\n'
    (folder / "batch.toml").write_text(
        f'name = "{{folder}}"\npictures = false\n{OPTIONS}[[jobs]]\n{table}name = "thing"\n'
    )
    found = plan(folder / "batch.toml")
    return found, {job.name: run_job(job) for job in found.jobs}


def test_one_look_over_the_asset_and_each_shots_residual(joint: tuple[Plan, dict[str, Result]]) -> None:
    found, results = joint
    assert list(results) == [
        "thing/measure/over", "thing/measure/wide", "thing/choose", "thing/refine/over", "thing/refine/wide",
        "thing/look", "thing/shots/over", "thing/shots/wide",
    ]  # fmt: skip
    assert results["thing/choose"].lines == ("/World/mtl/paint: glossiness, by 2 shots",)
    folder = found.job("thing/look").folder
    assert roughness(folder / "asset.usda", "/World/mtl/paint/surface") == pytest.approx(0.45, abs=0.02)
    report = json.loads((folder / "report.json").read_text())
    assert [s["shot"] for s in report[0]["shots"]] == ["over", "wide"]
    for name in ("over", "wide"):
        each = results[f"thing/shots/{name}"].values["residuals"][0]
        assert each["before"] > 0.05 and each["after"] < 0.02, each
        look = found.job(f"thing/shots/{name}").folder / "look.usda"
        assert roughness(look, "/set/thing/mtl/paint/surface") == pytest.approx(0.45, abs=0.02)


def test_shipped_files_give_the_same_bytes(joint: tuple[Plan, dict[str, Result]], tmp_path: Path) -> None:
    """As a worker of a cluster does it, that has the files in a folder of its own, under their own names."""
    found, _ = joint
    home = Path(found.manifest).parent
    shutil.copytree(home, f"{tmp_path}{home}", ignore=shutil.ignore_patterns("batch"))
    for job in found.jobs:
        run_job(replace(job, root=str(tmp_path)))
    assert bytes_below(Path(f"{tmp_path}{found.output}")) == bytes_below(Path(found.output))


def roughness(file: Path, shader: str) -> float:
    stage = Usd.Stage.Open(str(file))
    return float(stage.GetPrimAtPath(shader).GetAttribute("inputs:roughness").Get())
