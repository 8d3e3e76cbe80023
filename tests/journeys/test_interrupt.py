"""Ctrl-C in `usdslf solve`: exit 130, one line, no file half written, none left beside."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest
from pxr import Sdf

from usdslf.cli.main import main

ROOT = Path(__file__).resolve().parents[2]
SHOT = """#usda 1.0
(
    metersPerUnit = 1
    upAxis = "Y"
)
def Camera "cam"
{
    float horizontalAperture = 36
    float verticalAperture = 24
    double3 xformOp:translate = (0, 0, 5)
    uniform token[] xformOpOrder = ["xformOp:translate"]
}
def DomeLight "sky" {}
def Mesh "wall" (prepend apiSchemas = ["MaterialBindingAPI"])
{
    int[] faceVertexCounts = [4]
    int[] faceVertexIndices = [0, 1, 2, 3]
    point3f[] points = [(-2, -2, 0), (2, -2, 0), (2, 2, 0), (-2, 2, 0)]
    uniform token subdivisionScheme = "none"
    rel material:binding = </grey>
}
def Material "grey"
{
    token outputs:surface.connect = </grey/pbr.outputs:surface>
    def Shader "pbr"
    {
        uniform token info:id = "UsdPreviewSurface"
        color3f inputs:diffuseColor = (.5, .5, .5)
        token outputs:surface
    }
}
"""
# A real signal, sent by the program to itself at the place that the test is about.
AT_FIRST_PROGRESS = """
import signal, usdslf.progress as progress
progress.tell.__globals__["Progress"] = Told = type("Told", (progress.Progress,), {})
def made(self, step, share):
    print("told", step, flush=True)
    signal.raise_signal(signal.SIGINT)
Told.__init__ = made
"""
IN_THE_WRITE = """
import signal, usdslf.replacing as replacing
put = replacing.put_in_place
def interrupted(temporary, path):
    print("writes", path.name, temporary.is_file(), flush=True)
    signal.raise_signal(signal.SIGINT)
    put(temporary, path)
replacing.put_in_place = interrupted
"""
GO = "\nimport runpy\nrunpy.run_module('usdslf', run_name='__main__', alter_sys=True)\n"


@pytest.fixture(scope="module")
def solved(tmp_path_factory: pytest.TempPathFactory) -> list[str]:
    """The command line of a solve, whose look stands there already."""
    folder = tmp_path_factory.mktemp("interrupted")
    shot, strokes, look = folder / "shot.usda", folder / "strokes.usda", folder / "look.usda"
    shot.write_text(SHOT)
    paint = ("--camera", "/cam", "--path", "0.4,0.5 0.6,0.5", "--color", ".1,.3,.1")
    assert main(["stroke", str(shot), str(strokes), *paint]) == 0
    command = ["solve", str(shot), str(strokes), "-o", str(look), "--elements", "100", "--bounces", "1"]
    assert main(command) == 0
    return command


def interrupted(command: list[str], at: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, "-c", at + GO, *command], capture_output=True, text=True, check=False,
        env={**os.environ, "PYTHONPATH": str(ROOT)},
    )  # fmt: skip


def test_at_the_first_progress_the_earlier_look_stays(solved: list[str]) -> None:
    look = Path(solved[4])
    before, names = look.read_bytes(), sorted(os.listdir(look.parent))
    done = interrupted(solved, AT_FIRST_PROGRESS)
    assert done.stdout.count("told ") == 1
    assert (done.returncode, done.stderr) == (130, "usdslf: interrupted\n")
    assert look.read_bytes() == before and sorted(os.listdir(look.parent)) == names


def test_in_the_write_the_look_is_whole(solved: list[str]) -> None:
    """The rename that was begun is carried out, and the program ends behind it."""
    look, changed = Path(solved[4]), Sdf.Path("/grey/pbr.inputs:diffuseColor")
    names, before = sorted(os.listdir(look.parent)), look.stat().st_ino
    done = interrupted(solved, IN_THE_WRITE)
    assert done.stdout == "writes look.usda True\n"
    assert (done.returncode, done.stderr) == (130, "usdslf: interrupted\n")
    assert look.stat().st_ino != before
    assert Sdf.Layer.OpenAsAnonymous(str(look)).GetAttributeAtPath(changed)
    assert sorted(os.listdir(look.parent)) == names
