"""A shot far from the world's origin is as the same one at it."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from pxr import Sdf, Usd, UsdGeom

from usdslf.session import Session
from usdslf.usd.read.read import read_scene
from usdslf.usd.stroke_layer import read_strokes

FAR = {"o1000000": (1e6, 1e6, 1e6), "utm": (456123.37, 5412876.81, 0.0)}


def offset_of(path: Path) -> np.ndarray:
    stage = Usd.Stage.Open(str(path))
    world = UsdGeom.XformCache().GetLocalToWorldTransform(stage.GetPrimAtPath("/World"))
    return np.array(world.ExtractTranslation())


def test_a_shot_near_the_origin_stays_as_it_was(inputs: Path) -> None:
    assert read_scene(inputs / "far_origin/o0.usda").origin == (0.0, 0.0, 0.0)


@pytest.mark.parametrize("name", FAR)
def test_positions_have_the_digits_that_they_have_at_the_origin(inputs: Path, name: str) -> None:
    near, far = (read_scene(inputs / f"far_origin/{n}.usda") for n in ("o0", name))
    moved = offset_of(inputs / f"far_origin/{name}.usda") - np.array(far.origin)
    assert np.abs(moved).max() < 200 and any(far.origin)
    for a, b in ((near.triangles.positions, far.triangles.positions), (near.triangles.normals, far.triangles.normals)):
        shift = moved if a is near.triangles.positions else 0
        assert np.abs(a + shift - b).max() < 2e-5
    for a, b in zip(near.lights, far.lights, strict=True):
        if a.kind != "dome":
            assert b.world_from_light[:3, 3] - moved == pytest.approx(a.world_from_light[:3, 3], abs=1e-6)
    assert far.cameras[0].world_from_camera[:3, 3] - moved == pytest.approx(
        near.cameras[0].world_from_camera[:3, 3], abs=1e-6
    )


def test_info_says_where_it_is_in_the_world(inputs: Path, run: Callable) -> None:
    near, far = (
        np.array(json.loads(run("info", inputs / f"far_origin/{n}.usda", "--json")[1])["bounds"]) for n in ("o0", "utm")
    )
    assert far - near == pytest.approx(np.tile(FAR["utm"], (2, 1)), abs=1e-4)


@pytest.mark.parametrize("name", FAR)
def test_the_same_stroke_gives_the_same_diffuse(inputs: Path, tmp_path: Path, run: Callable, name: str) -> None:
    found = []
    for n in ("o0", name):
        shot, strokes, look = inputs / f"far_origin/{n}.usda", tmp_path / f"{n}_s.usda", tmp_path / f"{n}.usda"
        brush = ("--path", "0.2,0.9 0.25,0.9", "--color", ".1,.4,.05", "--camera", "/World/cam")
        assert run("stroke", shot, strokes, *brush)[0] == 0
        code, _, err = run("solve", shot, strokes, "-o", look, "--elements", 1000)
        assert code == 0 and "moved" not in err, err
        layer = Sdf.Layer.FindOrOpen(str(look))
        found.append(np.array(layer.GetAttributeAtPath("/World/m/s.inputs:diffuseColor").default))
    assert found[1] == pytest.approx(found[0], rel=0.02)


def test_points_of_a_stroke_layer_are_in_the_world(inputs: Path, tmp_path: Path, run: Callable) -> None:
    seen = []
    for name in ("o0", "utm"):
        strokes = tmp_path / f"{name}.usda"
        brush = ("--path", "0.2,0.9 0.25,0.9", "--color", ".1,.4,.05", "--camera", "/World/cam")
        assert run("stroke", inputs / f"far_origin/{name}.usda", strokes, *brush)[0] == 0
        stage = Usd.Stage.Open(str(strokes))
        curves = UsdGeom.BasisCurves(stage.GetPrimAtPath("/SlfStrokes/stroke_0001"))
        world = np.array(curves.ComputeLocalToWorldTransform(Usd.TimeCode.Default()))
        seen.append(np.array(curves.GetPointsAttr().Get(), np.float64) @ world[:3, :3] + world[3, :3])
        (stroke,) = read_strokes(strokes)
        read = stroke.points.astype(np.float64) + stroke.origin
        assert read == pytest.approx(seen[-1], abs=1e-4)
        assert run("stroke", inputs / f"far_origin/{name}.usda", strokes, *brush)[0] == 0  # the first one is rewritten
        assert (read_strokes(strokes)[0].points == stroke.points).all()
    assert seen[1] - seen[0] == pytest.approx(np.tile(FAR["utm"], (len(seen[0]), 1)), abs=1e-3)


def test_a_picture_is_the_same(inputs: Path) -> None:
    shown = []
    for name in ("o0", "utm"):
        session = Session(inputs / f"far_origin/{name}.usda", elements=800)
        shown.append(session.render(session.camera(None), (48, 27), samples=16)["color"])
    assert np.abs(shown[0] - shown[1]).mean() < 0.03 * shown[0].mean()
