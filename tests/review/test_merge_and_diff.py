"""Two artists on one shot: their strokes as one layer with contradictions named, and two looks compared."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import jsonschema
import numpy as np
import pytest
from kit.look_stages import change_of
from kit.reviewed_looks import RED, write_look
from kit.varying_floor import places, seen, stroke, write_floor

import usdslf
from usdslf.errors import InputError
from usdslf.review.diff import compare, diff_looks
from usdslf.review.merge import merge_strokes, write_merged
from usdslf.review.review import ReviewSettings
from usdslf.shot import Shot
from usdslf.strokes.stroke import Stroke
from usdslf.usd.author.author import author_look
from usdslf.usd.review.accept import Wish, accept_look
from usdslf.usd.schema import schema_folder

Run = Callable[..., tuple[int, str, str]]
RED_PAINT, BLUE_PAINT = (0.6, 0.2, 0.1), (0.1, 0.2, 0.6)


@pytest.fixture(scope="module")
def floor(tmp_path_factory: pytest.TempPathFactory) -> Shot:
    return usdslf.open(str(write_floor(tmp_path_factory.mktemp("floor"))), elements=400).shot


def few(color: tuple[float, ...]) -> Stroke:
    """Eight dabs."""
    s = stroke(seen(places(), color))
    rows = np.arange(2 * len(places())).reshape(-1, 2)[::4].ravel()
    kept = {name: getattr(s, name)[rows] for name in ("points", "widths", "colors", "eye")}
    return replace(s, curve_counts=(2,) * (len(rows) // 2), **kept)


def layer(shot: Shot, folder: str, color: tuple[float, ...], **more: object) -> Path:
    home = Path(shot.path).parent / folder
    home.mkdir(exist_ok=True)
    usdslf.write_strokes(home / "strokes.usda", [replace(few(color), **more)], shot.source)
    return home / "strokes.usda"


# ---- merge -------------------------------------------------------------------------------------------
def test_artists_who_agree_are_one_layer(floor: Shot, tmp_path: Path) -> None:
    """Three layers of one file name each; one stroke is switched off."""
    files = [layer(floor, name, RED_PAINT) for name in ("anna", "ben")]
    files.append(layer(floor, "off", BLUE_PAINT, active=False))
    merged = merge_strokes(floor, files)
    assert merged.conflicts == () and any("no active stroke" in w for w in merged.warnings)
    names = [s.name for s in merged.strokes]
    assert names == ["stroke_0001", "strokes_stroke_0001", "strokes_stroke_0001_2"]
    assert merged.renamed == {f"{f}:stroke_0001": n for f, n in zip(files[1:], names[1:])}
    write_merged(tmp_path / "both.usda", merged, floor)
    read = usdslf.read_strokes(tmp_path / "both.usda")
    assert [(s.name, s.active) for s in read] == list(zip(names, (True, True, False)))
    np.testing.assert_allclose(read[1].colors, usdslf.read_strokes(files[1])[0].colors)


def test_artists_who_contradict_each_other_are_both_shown(floor: Shot, run: Run, tmp_path: Path) -> None:
    files = [layer(floor, "anna", RED_PAINT), layer(floor, "carl", BLUE_PAINT)]
    out = tmp_path / "both.usda"
    code, said, err = run("merge", floor.path, *files, "-o", out, "--elements", 300, "--json")
    assert code == 1, err
    (conflict,) = json.loads(said)["conflicts"]
    assert conflict["material"] == "/World/mtl/floor" and "different values of diffuse" in conflict["why"]
    assert [Path(s["layer"]).parent.name for s in conflict["said"]] == ["anna", "carl", ""]
    for each, color in zip(conflict["said"], (RED_PAINT, BLUE_PAINT)):
        np.testing.assert_allclose(each["after"]["diffuse"], color, atol=0.03)
    assert len(usdslf.read_strokes(out)) == 2


def test_one_layer_is_nothing_to_merge(floor: Shot) -> None:
    with pytest.raises(InputError, match="name two or more"):
        merge_strokes(floor, [layer(floor, "anna", RED_PAINT)])


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


def test_the_command_line_writes_pages_and_pictures(floor: Shot, run: Run, tmp_path: Path) -> None:
    home = Path(floor.path).parent
    looks = [home / "grey.usda", home / "green.usda"]
    for look, color in zip(looks, ((0.2, 0.2, 0.2), (0.1, 0.4, 0.1))):
        author_look(floor.source, [change_of(floor.source, "/World/floor", "diffuse", color)], look)
    small = ("--size", "32x18", "--frames", 1, "--elements", 64, "--bounces", 1, "--turntable", 2, "--pictures")
    page = tmp_path / "page.html"
    code, said, err = run("review", floor.path, looks[0], "-o", page, *small, tmp_path / "pictures", "--json")
    assert code == 0 and str(page) in err, err
    found = json.loads(said)
    jsonschema.validate(found, json.loads((schema_folder() / "review.schema.json").read_text()))
    kinds = [v["kind"] for v in found["views"]]
    assert kinds.count("turntable") == 2 and kinds.count("held out") == 2 and kinds[-1] == "light"
    files = {p.name for p in (tmp_path / "pictures").iterdir()}
    assert files == {
        f"view_{i:02d}_{name}.{end}"
        for i in range(len(kinds)) for name in ("before", "after", "difference") for end in ("exr", "png")
    }  # fmt: skip
    assert "Will it survive?" in page.read_text()
    code, _, err = run("diff", floor.path, *looks, "-o", page, *small[:-3])
    assert code == 0 and "green.usda" in page.read_text() and "Will it survive?" not in page.read_text(), err


def test_a_comparison_has_one_look_on_each_side(floor: Shot) -> None:
    home = Path(floor.path).parent
    looks = [home / "red.usda", home / "blue.usda"]
    for look, color in zip(looks, (RED_PAINT, BLUE_PAINT)):
        author_look(floor.source, [change_of(floor.source, "/World/floor", "diffuse", color)], look)
    how = ReviewSettings(size=(64, 36), frames=1, held_out=1, quality={"elements": 300})
    found, review = compare(floor.path, *looks, how)
    assert {r.attribute for r in found.rows} == {"inputs:diffuseColor"}
    p = review.views[0].pictures
    shown = p.gprim == 0
    red, blue = (picture[shown].mean(0) for picture in (p.before, p.after))
    assert red[0] > 1.5 * red[2] and blue[2] > 1.5 * blue[0]
