"""The stroke layer: round trip, readable without plugin, tolerant of gaps, strict about nonsense."""

from __future__ import annotations

import hashlib
import os
import subprocess
import sys
from dataclasses import fields, replace
from pathlib import Path

import numpy as np
import pytest
from pxr import Sdf, Usd, UsdGeom

from usdslf.errors import AuthorError, StrokeError
from usdslf.strokes.stroke import MODES, NORMS, SCOPES, SPACES, TOOLS, Stroke
from usdslf.usd.schema import API_SCHEMA, PROPERTIES
from usdslf.usd.stroke_layer import read_strokes, write_strokes


@pytest.fixture
def shot(tmp_path: Path) -> Usd.Stage:
    stage = Usd.Stage.CreateNew(str(tmp_path / "shot.usda"))
    stage.SetDefaultPrim(UsdGeom.Xform.Define(stage, "/World").GetPrim())
    UsdGeom.Sphere.Define(stage, "/World/ball")
    UsdGeom.SetStageUpAxis(stage, "Z")
    UsdGeom.SetStageMetersPerUnit(stage, 0.1)
    stage.SetStartTimeCode(1001)
    stage.SetTimeCodesPerSecond(30)
    stage.GetRootLayer().Save()
    return stage


def make_stroke(seed: int = 0, n: int = 7, **changes: object) -> Stroke:
    rng = np.random.default_rng(seed)

    def rows(*shape: int) -> np.ndarray:
        return rng.uniform(0.1, 1, shape).astype(np.float32)

    values: dict = {
        "name": f"stroke_{seed:04d}",
        "points": rows(n, 3),
        "widths": rows(n),
        "colors": rows(n, 3),
        "eye": rows(n, 3),
        "normals": rows(n, 3),
        "curve_counts": (3, n - 3),
        "surfaces": ("/World/ball", "/World/other"),
        "surface_index": (np.arange(n) % 2).astype(np.int32),
        "face": np.arange(n, dtype=np.int32),
        "barycentric": rows(n, 2),
    }
    return Stroke(**(values | changes))


def assert_same(a: Stroke, b: Stroke) -> None:
    for f in fields(Stroke):
        if f.name != "prim":
            np.testing.assert_array_equal(getattr(a, f.name), getattr(b, f.name), err_msg=f.name)


def test_every_value_survives_a_round_trip(shot: Usd.Stage, tmp_path: Path) -> None:
    path = tmp_path / "strokes.usda"
    strokes = [make_stroke(i, tool=tool) for i, tool in enumerate(TOOLS) if tool != "clone"]
    strokes[1] = replace(strokes[1], strength=0.25, frame=1003.5, choice="specular", active=False)
    strokes[1] = replace(strokes[1], eye=strokes[1].eye[:1].repeat(7, 0))
    strokes[2] = replace(strokes[2], colors=np.float32([[0.1, 0.2, 0.3]] * 7), mode=MODES[1], space=SPACES[1])
    strokes[3] = replace(strokes[3], norm=NORMS[0], scope=SCOPES[0])
    strokes.append(make_stroke(20, tool="clone", clone_offset=(0.5, 0.0, -1.0), film_normal=(0.0, -1.0, 0.0)))
    write_strokes(path, strokes, shot)
    back = read_strokes(path)
    assert [s.name for s in back] == [s.name for s in strokes]
    for a, b in zip(strokes, back):
        assert_same(a, b)


def test_an_offset_and_a_film_that_a_stroke_no_longer_has_are_gone(shot: Usd.Stage, tmp_path: Path) -> None:
    path = tmp_path / "strokes.usda"
    write_strokes(path, [make_stroke(tool="clone", clone_offset=(0.5, 0.0, -1.0), film_normal=(0.0, -1.0, 0.0))], shot)
    (stroke,) = read_strokes(path)
    without = replace(stroke, tool="replace", clone_offset=(0.0, 0.0, 0.0), film_normal=(0.0, 0.0, 0.0))
    write_strokes(path, [without], shot)
    assert_same(read_strokes(path)[0], without)
    assert "cloneOffset" not in path.read_text() and "filmNormal" not in path.read_text()


def test_order_of_strokes_is_the_order_of_prims_also_after_changes(shot: Usd.Stage, tmp_path: Path) -> None:
    path = tmp_path / "strokes.usda"
    a, b, c = (make_stroke(i) for i in range(3))
    write_strokes(path, [a, b, c], shot)
    write_strokes(path, [c, a], shot)
    assert [s.name for s in read_strokes(path)] == [c.name, a.name]


def test_same_strokes_give_the_same_bytes(shot: Usd.Stage, tmp_path: Path) -> None:
    one, two = tmp_path / "one.usda", tmp_path / "two.usda"
    strokes = [make_stroke(i) for i in range(3)]
    write_strokes(one, strokes, shot)
    write_strokes(two, strokes, shot)
    write_strokes(two, read_strokes(one), shot)
    assert one.read_bytes() == two.read_bytes()


def test_what_people_added_by_hand_is_kept(shot: Usd.Stage, tmp_path: Path) -> None:
    path = tmp_path / "strokes.usda"
    write_strokes(path, [make_stroke(0), make_stroke(1)], shot)
    stage = Usd.Stage.Open(str(path))
    note = stage.GetPrimAtPath("/SlfStrokes/stroke_0000").CreateAttribute("note", Sdf.ValueTypeNames.String)
    note.Set("keep")
    stage.DefinePrim("/SlfStrokes/notes", "Scope")
    stage.GetRootLayer().Save()
    write_strokes(path, [make_stroke(0), make_stroke(2)], shot)
    stage = Usd.Stage.Open(str(path))
    assert stage.GetPrimAtPath("/SlfStrokes/stroke_0000").GetAttribute("note").Get() == "keep"
    assert stage.GetPrimAtPath("/SlfStrokes/notes") and not stage.GetPrimAtPath("/SlfStrokes/stroke_0001")


def test_everything_is_authored_and_nothing_left_to_fallbacks(shot: Usd.Stage, tmp_path: Path) -> None:
    path = tmp_path / "strokes.usda"
    whole = make_stroke(0, tool="clone", clone_offset=(1.0, 0.0, 0.0), film_normal=(0.0, 0.0, 1.0))
    write_strokes(path, [whole], shot)
    stage = Usd.Stage.Open(str(path))
    prim = stage.GetPrimAtPath("/SlfStrokes/stroke_0000")
    for name in (*PROPERTIES, "purpose", "type", "curveVertexCounts", "points", "normals", "widths"):
        assert prim.GetProperty(name).IsAuthored(), name
        assert not prim.GetProperty(name).IsCustom(), name
    assert prim.HasAPI(API_SCHEMA)
    assert UsdGeom.Imageable(prim).ComputePurpose() == "guide"


def test_shot_metadata_is_copied_so_that_the_layers_fit(shot: Usd.Stage, tmp_path: Path) -> None:
    write_strokes(tmp_path / "strokes.usda", [make_stroke()], shot)
    stage = Usd.Stage.Open(str(tmp_path / "strokes.usda"))
    assert stage.GetDefaultPrim().GetName() == "SlfStrokes"
    assert UsdGeom.GetStageUpAxis(stage) == "Z" and UsdGeom.GetStageMetersPerUnit(stage) == 0.1
    assert stage.GetStartTimeCode() == 1001 and stage.GetTimeCodesPerSecond() == 30
    assert not stage.GetRootLayer().HasEndTimeCode()


MINIMAL = """#usda 1.0
def Scope "anything" {{
    def BasisCurves "mine" {{
        point3f[] points = [(0, 0, 1), (0, 1, 1)]
        float[] widths = [{width}]
        color3f[] primvars:displayColor = [(1, 0, 0)]
        point3f[] slf:eye = [(0, 0, 5)]
        uniform token slf:tool = "{tool}"
        {more}
    }}
}}
"""


def write_minimal(path: Path, width: str = "0.1", tool: str = "replace", more: str = "") -> Path:
    path.write_text(MINIMAL.format(width=width, tool=tool, more=more))
    return path


def test_only_five_properties_are_needed(tmp_path: Path) -> None:
    (stroke,) = read_strokes(write_minimal(tmp_path / "s.usda"))
    assert stroke.path == "/anything/mine" and not stroke.has_anchors and stroke.counts == (2,)
    assert (stroke.mode, stroke.strength, stroke.space) == ("direct", 1.0, "scene")
    assert (stroke.norm, stroke.scope, stroke.choice) == ("mixed", "material", "")
    assert np.isnan(stroke.frame) and stroke.eye.shape == (2, 3) and stroke.colors.shape == (2, 3)


def test_incomplete_anchors_are_dropped_with_a_word(tmp_path: Path) -> None:
    warnings: list[str] = []
    path = write_minimal(tmp_path / "s.usda", more="rel slf:surfaces = </a>\n int[] slf:face = [1]")
    (stroke,) = read_strokes(path, warnings)
    assert not stroke.has_anchors and len(warnings) == 1 and "/anything/mine" in warnings[0]


def test_a_stroke_prim_that_was_moved_moves_its_points(tmp_path: Path) -> None:
    more = 'double3 xformOp:translate = (0, 0, 2)\nuniform token[] xformOpOrder = ["xformOp:translate"]'
    (stroke,) = read_strokes(write_minimal(tmp_path / "s.usda", more=more))
    np.testing.assert_allclose(stroke.points, [[0, 0, 3], [0, 1, 3]])


@pytest.mark.parametrize(
    ("change", "word"),
    [
        ({"tool": "smudge"}, "tool"),
        ({"width": "0"}, "width"),
        ({"width": "-1"}, "width"),
        ({"width": "nan"}, "widths"),
        ({"width": "1, 2, 3"}, "widths"),
        ({"width": ""}, "widths"),
        ({"more": "point3f[] points = [(nan, 0, 0), (0, 0, 0)]"}, "points"),
        ({"more": "int[] curveVertexCounts = [5]"}, "curves"),
        ({"more": "int[] primvars:displayColor:indices = [7, 0]"}, "displayColor"),
        ({"more": "uniform float slf:strength = 9"}, "strength"),
    ],
)
def test_nonsense_is_one_sentence_that_names_the_stroke(tmp_path: Path, change: dict, word: str) -> None:
    if "points" in change.get("more", ""):
        path = write_minimal(tmp_path / "s.usda")
        path.write_text(path.read_text().replace("(0, 0, 1), (0, 1, 1)", "(nan, 0, 1), (0, 1, 1)"))
    else:
        path = write_minimal(tmp_path / "s.usda", **change)
    with pytest.raises(StrokeError, match=word) as error:
        read_strokes(path)
    assert "/anything/mine" in str(error.value) and "\n" not in str(error.value)


@pytest.mark.parametrize("content", [None, b"", b"not usd at all", b"#usda 1.0\n", b"PXR-USDC\x00\x00"])
def test_files_without_strokes_are_refused_in_one_line(tmp_path: Path, content: bytes | None) -> None:
    path = tmp_path / "s.usda"
    if content is not None:
        path.write_bytes(content)
    with pytest.raises(StrokeError, match=r"s\.usda") as error:
        read_strokes(path)
    assert "\n" not in str(error.value)


def test_a_stroke_layer_may_have_lost_all_its_strokes(shot: Usd.Stage, tmp_path: Path) -> None:
    write_strokes(tmp_path / "s.usda", [], shot)
    assert read_strokes(tmp_path / "s.usda") == []


def test_neither_the_shot_nor_a_strangers_file_is_overwritten(shot: Usd.Stage, tmp_path: Path) -> None:
    before = (tmp_path / "shot.usda").read_bytes()
    with pytest.raises(AuthorError, match="part of the shot"):
        write_strokes(tmp_path / "shot.usda", [make_stroke()], shot)
    assert (tmp_path / "shot.usda").read_bytes() == before
    other = tmp_path / "other.usda"
    other.write_text('#usda 1.0\ndef Xform "World" {}\n')
    with pytest.raises(StrokeError, match="not a stroke layer"):
        write_strokes(other, [make_stroke()], shot)
    assert "World" in other.read_text()


def test_an_interrupted_write_leaves_the_earlier_file(
    shot: Usd.Stage, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "strokes.usda"
    write_strokes(path, [make_stroke(0)], shot)
    digest = hashlib.sha256(path.read_bytes()).hexdigest()

    def killed(*_: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(Path, "replace", killed)
    with pytest.raises(KeyboardInterrupt):
        write_strokes(path, [make_stroke(1)], shot)
    assert hashlib.sha256(path.read_bytes()).hexdigest() == digest
    assert sorted(p.name for p in tmp_path.iterdir()) == ["shot.usda", "strokes.usda"]


@pytest.mark.parametrize("name", ["missing/strokes.usda", ".", "strokes.txt"])
def test_an_unwritable_output_is_one_line(shot: Usd.Stage, tmp_path: Path, name: str) -> None:
    with pytest.raises(AuthorError, match="cannot be written"):
        write_strokes(tmp_path / name, [make_stroke()], shot)


def test_two_strokes_of_one_name_are_refused(shot: Usd.Stage, tmp_path: Path) -> None:
    with pytest.raises(StrokeError, match="two strokes"):
        write_strokes(tmp_path / "s.usda", [make_stroke(), make_stroke()], shot)


PLAIN = """
import sys
from pxr import Usd, UsdGeom, UsdValidation
stage = Usd.Stage.Open(sys.argv[1])
assert "usdslf" not in sys.modules
assert not Usd.SchemaRegistry().FindAppliedAPIPrimDefinition("SlfStrokeAPI")
assert not stage.GetCompositionErrors()
prim = stage.GetPrimAtPath("/SlfStrokes/stroke_0000")
assert prim.IsA(UsdGeom.BasisCurves) and prim.GetAttribute("slf:tool").Get() == "replace"
assert UsdGeom.Imageable(prim).ComputePurpose() == "guide"
assert len(UsdGeom.BasisCurves(prim).GetPointsAttr().Get()) == 7
validators = UsdValidation.ValidationRegistry().GetOrLoadAllValidators()
for error in UsdValidation.ValidationContext(validators).Validate(stage):
    print(error.GetErrorAsString())
"""


def test_opens_clean_and_validates_in_plain_usd_without_the_plugin(shot: Usd.Stage, tmp_path: Path) -> None:
    path = tmp_path / "strokes.usda"
    write_strokes(path, [make_stroke(0), make_stroke(1)], shot)
    environment = {k: v for k, v in os.environ.items() if k not in ("PXR_PLUGINPATH_NAME", "PYTHONPATH")}
    command = [sys.executable, "-c", PLAIN, str(path)]
    done = subprocess.run(command, env=environment, cwd=tmp_path, capture_output=True, text=True)
    assert (done.returncode, done.stdout, done.stderr) == (0, "", "")
