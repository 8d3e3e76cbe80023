"""The usdview plugin, found by USD's plugin registry as usdview finds it, in a stand-in for usdview."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
from kit.displays import ROOT
from kit.stage_parts import StageBuilder, box

PLUGIN = ROOT / "hydra_viewer/usdview"


@pytest.fixture(scope="module")
def shot(tmp_path_factory: pytest.TempPathFactory) -> Path:
    b = StageBuilder(tmp_path_factory.mktemp("usdview"))
    grey = b.material("grey", diffuseColor=(0.4, 0.4, 0.4))
    b.mesh("box", box(1, 1, 1), grey)
    b.mesh("hidden", box(1, 1, 1), grey, (2, 0, 0))
    b.distant_light("sun", (0, -1, -1), 1.0, 2.0)
    b.camera((0, 0, 3), (0, 0, 0))
    return b.save()


@pytest.fixture(scope="module")
def seen(shot: Path) -> dict[str, Any]:
    environment = dict(os.environ, PYTHONPATH=os.pathsep.join([str(ROOT), str(ROOT / "tests")]))
    environment |= {"PXR_PLUGINPATH_NAME": str(PLUGIN), "QT_QPA_PLATFORM": "offscreen"}
    command = [sys.executable, "-W", "error", str(ROOT / "tests/kit/usdview_stub.py"), str(shot)]
    run = subprocess.run(command, env=environment, capture_output=True, text=True, timeout=300)
    assert run.returncode == 0, run.stderr[-3000:]
    found: dict[str, Any] = json.loads(run.stdout.splitlines()[-1])
    return found


def test_its_menu_opens_the_painting_window(seen: dict[str, Any], shot: Path) -> None:
    assert seen["commands"] == ["UsdslfContainer.paint"]
    assert seen["menu"][0] == "usdslf" and len(seen["menu"]) == 2 and seen["menu"][1].startswith("Paint")
    assert seen["visible"] and seen["files"] == str(shot)


def test_the_window_shows_what_usdview_shows(seen: dict[str, Any]) -> None:
    assert seen["meshes"] == ["/World/box"]  # the other is hidden in the session layer
    assert seen["frame"] == 3.0
    assert seen["eye"] == [0.25, 0.5, 4.0] and seen["focal length"] == 42.0


def test_the_stage_of_usdview_stays_as_it_is(seen: dict[str, Any]) -> None:
    assert seen["session is the same"] and seen["stage is another"]


def test_a_closed_window_leaves_nothing_in_usdview(seen: dict[str, Any]) -> None:
    assert seen["left behind"] == [0, True, []]  # windows, whether Python frees cycles by itself, threads


def test_a_usdview_on_another_qt_says_so(seen: dict[str, Any]) -> None:
    (said,) = seen["other Qt"]
    assert "PySide6" in said
