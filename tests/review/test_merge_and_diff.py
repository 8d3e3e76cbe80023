"""Two artists on one shot: their strokes as one layer with contradictions named, and two looks compared."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import jsonschema
import numpy as np
import pytest
from kit.reviewed_looks import RED, write_look
from kit.varying_floor import places, seen, stroke, write_floor

import usdslf
from usdslf.errors import InputError
from usdslf.review.diff import compare, diff_looks
from usdslf.review.merge import merge_strokes, write_merged
from usdslf.review.review import ReviewSettings
from usdslf.shot import Shot
from usdslf.strokes.stroke import Stroke
from usdslf.usd.review.accept import Wish, accept_look
from usdslf.usd.schema import schema_folder

Run = Callable[..., tuple[int, str, str]]
RED_PAINT, BLUE_PAINT = (0.6, 0.2, 0.1), (0.1, 0.2, 0.6)


@pytest.fixture(scope="module")
def floor(tmp_path_factory: pytest.TempPathFactory) -> Shot:
    return usdslf.open(str(write_floor(tmp_path_factory.mktemp("floor"))), elements=400).shot


def layer(shot: Shot, name: str, color: tuple[float, ...]) -> Path:
    file = Path(shot.path).parent / name
    usdslf.write_strokes(file, [stroke(seen(places(), color))], shot.source)
    return file


# ---- merge -------------------------------------------------------------------------------------------
def test_artists_who_agree_are_one_layer(floor: Shot, tmp_path: Path) -> None:
    same = [layer(floor, f"{name}.usda", RED_PAINT) for name in ("anna", "ben")]
    merged = merge_strokes(floor, same)
    assert merged.conflicts == ()
    assert [s.name for s in merged.strokes] == ["stroke_0001", "ben_stroke_0001"]
    assert merged.renamed == {f"{same[1]}:stroke_0001": "ben_stroke_0001"}
    write_merged(tmp_path / "both.usda", merged, floor)
    read = usdslf.read_strokes(tmp_path / "both.usda")
    assert [s.name for s in read] == [s.name for s in merged.strokes]
    np.testing.assert_allclose(read[1].colors, usdslf.read_strokes(same[1])[0].colors)


def test_artists_who_contradict_each_other_are_both_shown(floor: Shot) -> None:
    files = [layer(floor, "anna.usda", RED_PAINT), layer(floor, "carl.usda", BLUE_PAINT)]
    merged = merge_strokes(floor, files)
    (conflict,) = merged.conflicts
    assert conflict.material == "/World/mtl/floor" and "different values of diffuse" in conflict.why
    assert [Path(s.layer).name for s in conflict.said] == ["anna.usda", "carl.usda", ""]
    for said, color in zip(conflict.said, (RED_PAINT, BLUE_PAINT)):
        np.testing.assert_allclose(said.after["diffuse"], color, atol=0.03)
    json.dumps(merged.as_values())


def test_one_layer_is_nothing_to_merge(floor: Shot) -> None:
    with pytest.raises(InputError, match="name two or more"):
        merge_strokes(floor, [layer(floor, "anna.usda", RED_PAINT)])


def test_the_command_names_conflicts_and_ends_with_one(floor: Shot, run: Run, tmp_path: Path) -> None:
    files = [layer(floor, "anna.usda", RED_PAINT), layer(floor, "carl.usda", BLUE_PAINT)]
    out = tmp_path / "both.usda"
    code, said, err = run("merge", floor.path, *files, "-o", out, "--elements", 300)
    assert code == 1 and "conflict on /World/mtl/floor: they ask for different values of diffuse" in said, err
    assert "2 strokes, 1 conflicts" in said and len(usdslf.read_strokes(out)) == 2


def test_names_of_many_layers_stay_apart(floor: Shot) -> None:
    one: list[Stroke] = [stroke(seen(places(), RED_PAINT))]
    files = []
    for folder in ("a", "b", "c"):  # of one name each
        home = Path(floor.path).parent / folder
        home.mkdir(exist_ok=True)
        usdslf.write_strokes(home / "strokes.usda", [replace(s, active=folder != "c") for s in one], floor.source)
        files.append(home / "strokes.usda")
    names = [s.name for s in merge_strokes(floor, files).strokes]
    assert len(set(names)) == 3 and names[0] == "stroke_0001"


# ---- diff --------------------------------------------------------------------------------------------
def test_what_two_looks_say_otherwise(tmp_path: Path, run: Run) -> None:
    write_look(tmp_path)
    shot, look, half = (tmp_path / n for n in ("shot.usda", "look.usda", "half.usda"))
    accept_look(shot, look, half, Wish(but=(f"{RED}.inputs:roughness", "/World/one/mtl/paint")))
    found = diff_looks(shot, look, half, None)
    rows = {(r.prim, r.attribute): (r.a, r.b) for r in found.rows}
    assert set(rows) == {
        (f"{RED}/pbr", "inputs:roughness"), ("/World/one/mtl/paint/pbr", "inputs:diffuseColor"),
    }  # fmt: skip
    assert rows[(f"{RED}/pbr", "inputs:roughness")] == (pytest.approx(0.2), None)
    assert found.gprims_a == ("/World/one/body",) and found.gprims_b == () and found.same > 0
    assert diff_looks(shot, look, look, None).rows == ()
    code, said, _ = run("diff", shot, look, half, "--json")
    schema = json.loads((schema_folder() / "diff.schema.json").read_text())
    jsonschema.validate(json.loads(said), schema)
    assert code == 0 and len(json.loads(said)["rows"]) == 2


def test_the_page_of_a_comparison_has_one_look_on_each_side(floor: Shot, run: Run) -> None:
    home = Path(floor.path).parent
    looks = []
    for name, color in (("red", RED_PAINT), ("blue", BLUE_PAINT)):
        session = usdslf.Session(floor)
        session.add_stroke(stroke(seen(places(), color)))
        session.solve()
        session.author(home / f"{name}.usda")
        looks.append(home / f"{name}.usda")
    how = ReviewSettings(size=(64, 36), frames=1, held_out=1, quality={"elements": 300})
    found, review = compare(floor.path, *looks, how)
    assert {r.attribute for r in found.rows} == {"inputs:diffuseColor"}
    p = review.views[0].pictures
    shown = p.gprim == 0
    red, blue = (picture[shown].mean(0) for picture in (p.before, p.after))
    assert red[0] > 1.5 * red[2] and blue[2] > 1.5 * blue[0]
