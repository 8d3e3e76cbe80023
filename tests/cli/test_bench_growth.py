"""The bench of growth: exponents of known laws, sizes measured apart and kept, shots that grow along one axis."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from usdslf.cli import bench_growth, growth_point, growth_shots
from usdslf.cli.bench_growth import exponent, lines_of_growth, measure_growth
from usdslf.cli.growth_plot import plot_growth
from usdslf.errors import UsdslfError
from usdslf.usd.read.read import open_stage, read_scene

Run = Callable[..., tuple[int, str, str]]


def silent(step: str, share: float) -> None:
    """Hears nothing."""


@pytest.mark.parametrize("law", [0.0, 1.0, 2.0])
def test_the_exponent_is_that_of_the_largest_sizes(law: float) -> None:
    sizes = [1, 10, 100, 1000, 10000]
    values = [7.0, 7.0, *(3 * s**law for s in sizes[2:])]  # what does not grow hides the law at first
    assert exponent(sizes, values) == pytest.approx(law, abs=1e-9)
    assert np.isnan(exponent([5], [2.0]))


@pytest.mark.parametrize(
    ("axis", "of", "most"),
    [("triangles", 40000, 0.1), ("lights", 7, 0), ("instances", 30, 0), ("elements", 500, 0), ("strokes", 9, 0)],
)
def test_what_grows_is_what_is_asked_for(axis: str, of: int, most: float, tmp_path: Path) -> None:
    built = growth_shots.build_growing(axis, of, tmp_path)
    scene = read_scene(open_stage(str(built.stage)), None)
    found = {
        "triangles": len(scene.triangles.mesh), "lights": len(scene.lights), "elements": built.elements,
        "instances": sum("/boxes/" in m.path for m in scene.meshes), "strokes": built.strokes,
    }[axis]  # fmt: skip
    assert found == pytest.approx(of, rel=most)
    assert not scene.warnings


def test_sizes_are_kept_and_those_of_other_axes_stay(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def point(axis: str, size: int, device: str | None) -> dict:
        if size == 30:
            raise UsdslfError("out of memory")
        return {"seconds": {"read": 0.1, "light": 0.02 * size}, "memory": size << 20}

    monkeypatch.setattr(bench_growth, "_apart", point)
    folder = tmp_path / "found"
    measure_growth(("textures",), 25, folder, None, silent)
    with pytest.raises(UsdslfError):
        measure_growth(("lights",), None, folder, None, silent)
    found = json.loads((folder / "growth.json").read_text())
    assert {axis: [p["size"] for p in points] for axis, points in found.items()} == {
        "textures": [1, 5, 25], "lights": [1, 3, 10],
    }  # fmt: skip
    table = list(lines_of_growth(found))
    assert table[-1].split()[:2] == ["exponent", f"{exponent([1, 3, 10], [0.12, 0.16, 0.3]):.2f}"]
    assert 1000 < plot_growth(found, folder).stat().st_size < 200_000


def test_a_size_is_measured_from_the_stage_to_pictures(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(growth_point, "SIZE", (16, 9))
    monkeypatch.setattr(growth_point, "warm_up", lambda device, folder: None)
    monkeypatch.setattr(growth_shots, "FEW_ELEMENTS", 60)
    found = growth_point.measure_point(growth_shots.build_growing("strokes", 2, tmp_path))
    steps = ["read", "elements", "visibility", "light", "light field", "answers", "live, first frame", "picture"]
    assert list(found["seconds"]) == steps
    assert min(found["seconds"].values()) > 0 and found["memory"] > 1 << 26


def test_results_need_a_folder_and_an_axis_that_there_is(run: Run) -> None:
    code, _, err = run("bench", "--growth")
    assert code == 2 and "-o DIR" in err
    code, _, err = run("bench", "--growth", "cameras", "-o", "x")
    assert code == 2 and "elements" in err
