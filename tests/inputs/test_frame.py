"""A stroke that was painted at a frame is solved at it."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest
from pxr import Sdf

STAGE = "frame/s.usda"  # a dome of radiance 1, 2, 4 at the frames 1, 10, 20


def paint(run: Callable, shot: Path, strokes: Path, frame: int, path: str = "0.55,0.5 0.6,0.5") -> None:
    at = ("--frame", frame, "--color", ".6,.1,.1", "--camera", "/World/cam", "--path", path)
    assert run("stroke", shot, strokes, *at)[0] == 0


def diffuse(look: Path) -> tuple[float, ...]:
    layer = Sdf.Layer.FindOrOpen(str(look))
    value = layer.GetAttributeAtPath("/World/m/s.inputs:diffuseColor").default
    return tuple(value)


def test_its_own_frame_is_the_default(inputs: Path, tmp_path: Path, run: Callable) -> None:
    shot, strokes, look = inputs / STAGE, tmp_path / "strokes.usda", tmp_path / "look.usda"
    paint(run, shot, strokes, 10)
    code, _, err = run("solve", shot, strokes, "-o", look, "--elements", 800)
    assert code == 0, err
    assert diffuse(look) == pytest.approx((0.274, 0.014, 0.014), abs=0.01)
    assert Sdf.Layer.FindOrOpen(str(look)).customLayerData["usdslf"]["frame"] == 10


def test_another_frame_that_is_asked_for_is_said(inputs: Path, tmp_path: Path, run: Callable) -> None:
    shot, strokes, look = inputs / STAGE, tmp_path / "strokes.usda", tmp_path / "look.usda"
    paint(run, shot, strokes, 10)
    code, _, err = run("solve", shot, strokes, "-o", look, "--elements", 800, "--frame", 20)
    assert code == 0 and "painted at frame 10" in err and "frame 20" in err
    assert diffuse(look)[0] == pytest.approx((0.6 / 4 - 0.037) / 0.96, abs=0.03)


def test_strokes_of_several_frames_end_in_a_sentence(inputs: Path, tmp_path: Path, run: Callable) -> None:
    shot, strokes, look = inputs / STAGE, tmp_path / "strokes.usda", tmp_path / "look.usda"
    paint(run, shot, strokes, 10)
    paint(run, shot, strokes, 1, "0.47,0.5 0.53,0.5")
    code, _, err = run("solve", shot, strokes, "-o", look, "--elements", 800)
    assert code == 2 and "frame 10" in err and "frame 1" in err and "--frame" in err, (code, err)
    assert not look.exists()


def test_a_picture_of_similarity_is_of_the_strokes_frame(inputs: Path, tmp_path: Path, run: Callable) -> None:
    shot, strokes, png = inputs / STAGE, tmp_path / "strokes.usda", tmp_path / "s.png"
    paint(run, shot, strokes, 10)
    to = ("-o", png, "--strokes", strokes, "--aov", "similarity", "--size", "64x36", "--elements", 300)
    assert run("render", shot, *to)[0] == 0
    first = png.read_bytes()
    assert run("render", shot, *to, "--frame", 10)[0] == 0
    assert png.read_bytes() == first
    assert run("render", shot, *to, "--frame", 1)[0] == 0
    assert png.read_bytes() != first
