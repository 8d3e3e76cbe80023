"""`usdslf view` where no window can be shown ends in one sentence."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from usdslf.cli.main import main
from usdslf.viewing import DISPLAYS

ROOT = Path(__file__).resolve().parents[2]


def test_without_a_display(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    pytest.importorskip("PySide6.QtWidgets", exc_type=ImportError)
    for name in DISPLAYS:
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setattr(sys, "platform", "linux")
    assert main(["view", "shot.usda"]) == 2
    said = capsys.readouterr().err.strip()
    assert said.startswith("usdslf: there is no display") and "\n" not in said


def test_qt_that_cannot_be_loaded(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    monkeypatch.setitem(sys.modules, "PySide6.QtWidgets", None)
    assert main(["view", "shot.usda"]) == 2
    said = capsys.readouterr().err.strip()
    assert said.startswith("usdslf: the viewer cannot load Qt (") and "libegl1" in said and "\n" not in said


def test_the_viewer_by_itself_says_the_same() -> None:
    plain = {name: value for name, value in os.environ.items() if name not in DISPLAYS} | {"PYTHONPATH": str(ROOT)}
    ended = subprocess.run([sys.executable, "-m", "hydra_viewer"], env=plain, capture_output=True, text=True)
    assert ended.returncode == 2 and ended.stderr.count("\n") == 1, ended.stderr
    assert "no display" in ended.stderr or "cannot load Qt" in ended.stderr
