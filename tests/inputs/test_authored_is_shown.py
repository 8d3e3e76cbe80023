"""What is painted is what the composed shot shows: by the command line, then read back, also by plain usd-core."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from pxr import Sdf, Usd, UsdGeom

import usdslf
from usdslf.edits.edits import Reflectance
from usdslf.edits.read_back import Asked, why_missing
from usdslf.errors import AuthorError
from usdslf.surfaces.surface_points import evaluate_surface
from usdslf.usd.author.read_back import scene_under
from usdslf.usd.author.whole import whole_or_as_before
from usdslf.usd.read.read import open_stage, read_scene

PAINTED = (0.066, 0.379, 0.014)  # of .1, .4, .05 in a dome of radiance 1
MIDDLE = "0.47,0.5 0.53,0.5"


class Shown:
    """A look over a stage: what its triangles show, and what usd-core composes."""

    def __init__(self, stage: Path, look: Path, frame: float | None) -> None:
        self.scene = scene_under(open_stage(str(stage)), look, frame)
        root = Sdf.Layer.CreateAnonymous(".usda")
        root.subLayerPaths = [str(look), str(stage)]
        self.composed = Usd.Stage.Open(root)
        self.time = Usd.TimeCode.Default() if frame is None else Usd.TimeCode(frame)

    def diffuse(self, triangle: int) -> np.ndarray:
        return evaluate_surface(self.scene, np.array([triangle]), np.full((1, 2), 1 / 3)).diffuse[0]

    def get(self, path: str) -> object:
        return self.composed.GetAttributeAtPath(path).Get(self.time)


def paint(run, folder: Path, stage: Path, *stroke: str, frame: float | None = None, color=".1,.4,.05", path=MIDDLE):
    """Paints and solves; returns what is shown, and what was said."""
    at = () if frame is None else ("--frame", frame)
    strokes, look = folder / "strokes.usda", folder / "look.usda"
    code, _, err = run(
        "stroke", stage, strokes, "--camera", "/World/cam", "--path", path, "--color", color, *stroke, *at
    )
    assert code == 0, err
    code, out, err = run("solve", stage, strokes, "-o", look, "--elements", 500, *at)
    assert code == 0, err
    return Shown(stage, look, frame), out + err


@pytest.mark.parametrize("name", ["m", "vertex_out", "uniform_in", "const_in"])
def test_primvars_of_instancers(run, inputs: Path, tmp_path: Path, name: str) -> None:
    shown, _ = paint(run, tmp_path, inputs / f"instancer_primvar/{name}.usda")
    assert shown.diffuse(2) == pytest.approx(PAINTED, abs=0.003)  # the instance in the middle
    if name != "const_in":  # which the prototype's own primvar may show
        instancer = next(p for p in shown.composed.Traverse() if p.IsA(UsdGeom.PointInstancer))
        values = UsdGeom.PrimvarsAPI(instancer).GetPrimvar(str(shown.get("/World/m/r.inputs:varname"))).Get()
        assert len(values) == 3 and values[1] == pytest.approx(PAINTED, abs=0.003)


@pytest.mark.parametrize("name", ["v", "primvar_constant", "r"])
def test_values_that_exist_in_time_samples_only(run, inputs: Path, tmp_path: Path, name: str) -> None:
    shown, said = paint(run, tmp_path, inputs / f"time_samples/{name}.usda", frame=1.0)
    assert shown.diffuse(0) == pytest.approx(PAINTED, abs=0.003)
    assert "is animated" in said


def test_a_scale_of_time_samples_is_multiplied_as_it_is_at_the_frame(run, inputs: Path, tmp_path: Path) -> None:
    shown, said = paint(run, tmp_path, inputs / "time_samples/s.usda", frame=1.0, color=".1,.2,.05")
    assert tuple(shown.get("/World/m/t.inputs:scale")) == pytest.approx((0.114, 0.295, 0.024, 1), abs=0.002)
    assert "inputs:scale is animated" in said


@pytest.mark.parametrize("name", ["part", "s"])
def test_faces_of_a_subset_of_time_samples(run, inputs: Path, tmp_path: Path, name: str) -> None:
    stage = inputs / f"timed_subset/{name}.usda"
    before = read_scene(str(stage), 1.0)
    right = evaluate_surface(before, np.array([2, 3]), np.full((2, 2), 1 / 3)).diffuse
    shown, _ = paint(
        run, tmp_path, stage, "--scope", "stroke", frame=1.0, path="0.3,0.45 0.35,0.55"
    )
    assert shown.diffuse(0) == pytest.approx(PAINTED, abs=0.003)
    assert [shown.diffuse(2), shown.diffuse(3)] == [pytest.approx(x) for x in right]


@pytest.mark.parametrize("name", ["vector3f", "point3f", "normal3f", "count"])
def test_primvars_of_roles_and_of_counts_that_do_not_fit(run, inputs: Path, tmp_path: Path, name: str) -> None:
    shown, _ = paint(run, tmp_path, inputs / f"primvar_roles/{name}.usda")
    assert shown.diffuse(0) == pytest.approx(PAINTED, abs=0.003)
    if name == "count":
        assert tuple(shown.get("/World/m/r.inputs:fallback")) == pytest.approx(PAINTED, abs=0.003)


@pytest.mark.parametrize("name", ["s", "borrowed"])
def test_nodes_that_others_read_stay_as_they_are(run, inputs: Path, tmp_path: Path, name: str) -> None:
    stage = inputs / f"shared_nodes/{name}.usda"
    options = {"color": ".3,.05,.05", "path": "0.25,0.4 0.32,0.6"}
    shown, _ = paint(run, tmp_path, stage, "--scope", "prim", **options)
    assert shown.diffuse(0) == pytest.approx((0.274, 0.014, 0.014), abs=0.003)
    assert shown.diffuse(2) == pytest.approx((0.305, 0.305, 0.305), abs=0.002)


@pytest.mark.parametrize("name", ["s", "borrowed"])
def test_a_change_of_a_shared_node_names_the_other_material(run, inputs: Path, tmp_path: Path, name: str) -> None:
    stage = inputs / f"shared_nodes/{name}.usda"
    options = {"color": ".3,.05,.05", "path": "0.25,0.4 0.32,0.6"}
    _, said = paint(run, tmp_path, stage, "--scope", "material", **options)
    assert any("/World/g" in line and "warning" in line for line in said.splitlines()), said


def test_an_input_shared_through_an_interface_is_cut_off(run, inputs: Path, tmp_path: Path) -> None:
    """A sibling: the constant of a node graph that two materials take."""
    layer = Sdf.Layer.CreateAnonymous(".usda")
    layer.TransferContent(Sdf.Layer.FindOrOpen(str(inputs / "shared_nodes/s.usda")))
    graph = layer.GetPrimAtPath("/World/TX")
    Sdf.AttributeSpec(graph, "inputs:tint", Sdf.ValueTypeNames.Color3f).default = (0.305, 0.305, 0.305)
    for material in "mg":
        port = layer.GetAttributeAtPath(f"/World/{material}/s.inputs:diffuseColor")
        port.connectionPathList.explicitItems = [Sdf.Path("/World/TX.inputs:tint")]
    stage = tmp_path / "shot.usda"
    layer.Export(str(stage))
    shown, _ = paint(
        run, tmp_path, stage, "--scope", "prim", color=".3,.05,.05", path="0.25,0.4 0.32,0.6"
    )
    assert shown.diffuse(0) == pytest.approx((0.274, 0.014, 0.014), abs=0.003)
    assert shown.diffuse(2) == pytest.approx((0.305, 0.305, 0.305), abs=0.002)
    assert tuple(shown.get("/World/m/s.inputs:diffuseColor")) == pytest.approx((0.274, 0.014, 0.014), abs=0.003)


# ---- reading back ------------------------------------------------------------------------------------------


def asked(after: tuple[float, float, float]) -> Asked:
    before = Reflectance(np.array([0.8, 0.1, 0.1]), np.full(3, 0.04), 0.5)
    new = Reflectance(np.array(after), np.full(3, 0.04), 0.5)
    return Asked("/World/m", np.array([0, 1]), np.full((2, 2), 1 / 3), before, new, ("diffuse",))


def test_a_change_that_nothing_shows_is_found(inputs: Path) -> None:
    shot = read_scene(str(inputs / "time_samples/v.usda"), 1.0)
    other = read_scene(str(inputs / "time_samples/v.usda"), 10.0)
    assert why_missing([asked((0.1, 0.1, 0.8))], shot, shot)[0].material == "/World/m"
    assert not why_missing([asked((0.1, 0.1, 0.8))], shot, other)
    assert not why_missing([asked((0.801, 0.1, 0.1))], shot, shot)  # too small to look for


def test_a_look_that_is_not_shown_is_refused(run, inputs: Path, tmp_path: Path, monkeypatch) -> None:
    """A writer that misses its place: one sentence, exit code 6, and the earlier look stays."""
    from usdslf.usd.author.change_writer import ChangeWriter

    monkeypatch.setattr(ChangeWriter, "write", lambda self, edit: [])
    stage, strokes, look = inputs / "primvar_roles/count.usda", tmp_path / "s.usda", tmp_path / "look.usda"
    run("stroke", stage, strokes, "--camera", "/World/cam", "--path", MIDDLE, "--color", ".1,.4,.05")
    code, _, err = run("solve", stage, strokes, "-o", look, "--elements", 500)
    assert code == 6 and "/World/m" in err and "Traceback" not in err
    assert not look.exists()


def test_a_refused_look_leaves_the_earlier_one(tmp_path: Path) -> None:
    look = tmp_path / "look.usda"
    look.write_text("earlier")
    with pytest.raises(AuthorError), whole_or_as_before(look):
        look.write_text("new")
        raise AuthorError("no")
    assert look.read_text() == "earlier"


def test_a_shot_in_memory_is_read_back_too(inputs: Path, tmp_path: Path) -> None:
    layer = Sdf.Layer.CreateAnonymous(".usda")
    layer.TransferContent(Sdf.Layer.FindOrOpen(str(inputs / "primvar_roles/vector3f.usda")))
    strokes = tmp_path / "look.usda"
    stage = Usd.Stage.Open(layer)
    empty = Sdf.Layer.CreateNew(str(strokes))
    empty.Save()
    shown = scene_under(stage, strokes, None)
    assert len(shown.triangles.mesh) == 2 and usdslf.open(stage).scene.meshes[0].path == "/World/card"
