"""usdslf stylize: a look for the whole shot, the same bytes again, and one line for what cannot be."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from kit.stage_parts import StageBuilder, TextureInput, ball, checker, rectangle
from pxr import Sdf, Usd, UsdGeom, UsdShade
from scipy.ndimage import gaussian_filter

import usdslf
from usdslf.surfaces.surface_points import evaluate_surface

Run = Callable[..., tuple[int, str, str]]
SMALL = ("--elements", 600, "--bounces", 3)


@pytest.fixture(scope="module")
def shot(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A ball on a tiled floor before a wall, under a lamp; the wall's material is no UsdPreviewSurface."""
    b = StageBuilder(tmp_path_factory.mktemp("shot"))
    squares = TextureInput(b.image("tiles.png", checker((0.8, 0.75, 0.7), (0.25, 0.3, 0.35))))
    tiles = b.material("tiles", diffuseColor=squares, roughness=0.6)
    red = b.material("red", diffuseColor=(0.6, 0.08, 0.05), roughness=0.3)
    wall = b.material("wall", diffuseColor=(0.5, 0.5, 0.5))
    b.mesh("floor", rectangle((-1.5, 0, 1.5), (3, 0, 0), (0, 0, -3)), tiles)
    b.mesh("ball", ball(0.6), red)
    b.mesh("back", rectangle((-1.5, 0, -1.5), (3, 0, 0), (0, 2, 0)), wall)
    b.rect_light("lamp", (1, 3, 1.5), (0, 0, 0), 0.8, 0.8, (12, 12, 11))
    b.camera((0, 1.5, 4), (0, 0.5, 0))
    path = b.save()
    stage = Usd.Stage.Open(str(path))
    shader = next(p for p in stage.GetPrimAtPath(wall).GetChildren() if p.IsA(UsdShade.Shader))
    UsdShade.Shader(shader).GetIdAttr().Set("SomeOtherSurface")
    stage.Save()
    return path


@pytest.fixture(scope="module")
def look(shot: Path) -> Path:
    """The shot, stylized once."""
    from usdslf.cli.main import main

    path = shot.parent / "look.usda"
    given = ["stylize", shot, "-o", path, "--report", shot.parent / "report.json", "--quiet", *SMALL]
    assert main([str(x) for x in given]) == 0
    return path


def test_report_says_what_became_of_each_material(shot: Path, look: Path) -> None:
    report = json.loads((shot.parent / "report.json").read_text())
    assert report["stylize"]["amount"] == 1 and report["strokes"] == []
    assert [m["material"].rpartition("/")[2] for m in report["materials"]] == ["tiles", "red"]
    for m in report["materials"]:
        assert "diffuse" in m["inferred"] and m["representation"]
        assert m["residual_after"] < m["residual_before"]
        for side in ("before", "after"):
            values = [*m[side]["diffuse"], *m[side]["specular"], m[side]["roughness"]]
            assert min(values) >= 0 and max(values) <= 1
    assert all(e["wins"] for e in report["edits"])
    assert any("stays" in w and "/back" in w for w in report["warnings"])
    assert sum(report["seconds"].values()) < 60


def test_changes_vary_over_surfaces_and_textures_keep_their_detail(shot: Path, look: Path) -> None:
    before = usdslf.open(str(shot), elements=600)
    after = before.edited(look)
    report = json.loads((shot.parent / "report.json").read_text())
    shown = {m["material"].rpartition("/")[2]: m["representation"] for m in report["materials"]}
    assert "texture" in shown["tiles"]
    floor = np.flatnonzero(np.array([m.path.endswith("floor") for m in before.scene.meshes])[before.elements.mesh])
    e = before.elements
    old, new = (
        evaluate_surface(s.scene, e.triangle[floor], e.barycentric[floor]).diffuse.mean(1) for s in (before, after)
    )
    moved = new - old
    assert moved.std() > 0.01 and np.ptp(moved) > 0.05
    assert np.corrcoef(old, new)[0, 1] > 0.7  # the tiles are still there
    pictures = [s.render("/World/camera", (96, 72), samples=4)["color"].mean(-1) for s in (before, after)]
    detail = [float(np.abs(np.log(p + 0.01) - gaussian_filter(np.log(p + 0.01), 5)).mean()) for p in pictures]
    assert detail[1] > 1.05 * detail[0], detail
    assert 0.7 < pictures[1].mean() / pictures[0].mean() < 1.3


def test_the_look_is_sparse_and_leaves_what_it_may_not_edit(shot: Path, look: Path) -> None:
    layer = Sdf.Layer.FindOrOpen(str(look))
    text = look.read_text()
    assert "stylized by 1" in text and "wall" not in text.partition("customLayerData")[2].partition("defaultPrim")[2]
    assert layer.defaultPrim
    stage = Usd.Stage.Open(layer)
    assert not [p for p in stage.TraverseAll() if p.IsA(UsdGeom.Mesh) and p.HasAuthoredTypeName()]


def test_the_same_again_gives_the_same_bytes(shot: Path, look: Path, run: Run) -> None:
    first = look.read_bytes()
    files = sorted(p.name for p in look.with_suffix(".textures").iterdir())
    assert run("stylize", shot, "-o", look, *SMALL)[0] == 0
    assert look.read_bytes() == first
    assert sorted(p.name for p in look.with_suffix(".textures").iterdir()) == files  # named by their content


def test_no_amount_authors_nothing(shot: Path, tmp_path: Path, run: Run) -> None:
    path = tmp_path / "none.usda"
    code, out, _ = run("stylize", shot, "-o", path, "--amount", 0, *SMALL)
    assert code == 0 and "none" in out
    assert "inputs:" not in path.read_text() and "SlfMaterials" not in path.read_text()


@pytest.mark.parametrize(
    ("given", "says"),
    [
        (("--amount", -1), "amount -1 is not in 0 .. 10"),
        (("--amount", "much"), "--amount"),
        (("--amount", "nan"), "not in 0 .. 10"),
        (("--radius", 0), "radius 0 is not in 0 .. 1"),
        (("--radius", 2), "radius 2 is not in 0 .. 1"),
        (("--radius", 0.001, *SMALL), "larger radius or more elements"),
        (("--norm", "l7"), "--norm"),
    ],
)
def test_bad_numbers_are_one_line(shot: Path, tmp_path: Path, run: Run, given: tuple, says: str) -> None:
    code, out, err = run("stylize", shot, "-o", tmp_path / "look.usda", *given)
    assert code == 2 and out == ""
    assert says in err and err.count("\n") == 1
    assert not (tmp_path / "look.usda").exists()


def test_nothing_to_edit_is_one_line(shot: Path, tmp_path: Path, run: Run) -> None:
    stage = Usd.Stage.Open(str(shot))
    for prim in stage.TraverseAll():
        if prim.IsA(UsdShade.Shader) and UsdShade.Shader(prim).GetShaderId() == "UsdPreviewSurface":
            stage.GetPrimAtPath(prim.GetPath()).GetAttribute("info:id").Set("SomeOtherSurface")
    bare = tmp_path / "bare.usda"
    stage.Export(str(bare))
    code, out, err = run("stylize", bare, "-o", tmp_path / "look.usda", "--quiet", *SMALL)
    assert code == 6 and out == ""
    assert "can be stylized" in err and err.count("\n") == 1
    assert not (tmp_path / "look.usda").exists()
