"""Review of a look layer: what it changes, from what, and what is wrong with it."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from kit.varying_floor import places, seen, stroke, write_floor
from pxr import Sdf

import usdslf
from usdslf.usd.stroke_layer import write_strokes

Run = Callable[..., tuple[int, str, str]]


@pytest.fixture
def shot_and_look(tmp_path: Path) -> tuple[Path, Path]:
    shot, look, strokes = write_floor(tmp_path), tmp_path / "look.usda", tmp_path / "strokes.usda"
    session = usdslf.open(str(shot), elements=400)
    session.add_stroke(stroke(seen(places(), (0.6, 0.2, 0.1))))
    write_strokes(strokes, session.strokes, session.stage)
    session.solve()
    session.author(look, strokes_path=strokes)
    return shot, look


def test_a_look_is_said_with_what_it_changes(shot_and_look: tuple[Path, Path], run: Run) -> None:
    code, out, err = run("review", *shot_and_look)
    assert code == 0, err
    assert "/World/mtl/floor: diffuse, from /SlfStrokes/stroke_0001; residual" in out and "findings: 0" in out
    code, out, _ = run("review", *shot_and_look, "--json")
    found = json.loads(out)
    (edit,) = found["edits"]
    assert code == 0 and (edit["prim"], edit["attribute"]) == ("/World/mtl/floor/surface", "inputs:diffuseColor")
    np.testing.assert_allclose(edit["before"], 0.4, atol=1e-6)
    np.testing.assert_allclose(edit["after"], (0.6, 0.2, 0.1), atol=0.02)
    assert found["materials"][0]["residual_after"] < found["materials"][0]["residual_before"]


def test_what_is_wrong_is_found_and_told_by_the_exit_code(shot_and_look: tuple[Path, Path], run: Run) -> None:
    shot, look = shot_and_look
    layer = Sdf.Layer.FindOrOpen(str(look))
    layer.GetAttributeAtPath("/World/mtl/floor/surface.inputs:diffuseColor").default = (1.5, 0.2, 0.1)
    Sdf.CreatePrimInLayer(layer, "/World/gone")
    Sdf.AttributeSpec(layer.GetPrimAtPath("/World/gone"), "inputs:x", Sdf.ValueTypeNames.Float).default = 1.0
    layer.Save()
    code, out, _ = run("review", shot, look, "--json")
    names = {f["name"] for f in json.loads(out)["findings"]}
    assert code == 1 and {"OutOfRange", "DanglingOver"} <= names
    code, out, _ = run("review", shot, look)
    assert code == 1 and "  OutOfRange: " in out


def test_what_is_no_look_is_refused(shot_and_look: tuple[Path, Path], run: Run, tmp_path: Path) -> None:
    shot, _ = shot_and_look
    code, _, err = run("review", shot, tmp_path / "strokes.usda")
    assert code == 2 and "is not a look layer of usdslf" in err
    code, _, err = run("review", shot, tmp_path / "nowhere.usda")
    assert code == 2 and "there is no look layer" in err and "usdslf solve" in err
