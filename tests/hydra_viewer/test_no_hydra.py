"""Where there is no imaging the viewer says why and shows its own picture; the choice is made before pxr is loaded."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

from kit.displays import ROOT, has_hydra

WITHOUT = """
import pxr  # another program has loaded it: there is nothing to choose any more
from PySide6.QtWidgets import QApplication
from hydra_viewer.ui.application import make_application
from hydra_viewer.ui.viewports import viewport_kinds
from hydra_viewer.ui.window import Window
application = make_application()
kinds = viewport_kinds()
print(len(kinds), not kinds[0].why_not, kinds[0].name)
print(kinds[1].name, kinds[1].why_not)
window = Window()
for action in window.viewport_menu.actions():
    print(action.isEnabled(), action.isChecked(), "|", action.toolTip().splitlines()[0])
window.close()
"""
CHOSEN = """
import runpy, sys
sys.argv = ["hydra_viewer", "--help"]
try:
    runpy.run_module("hydra_viewer", run_name="__main__")
except SystemExit:
    pass
from usdslf import choose_pxr
choice = choose_pxr()
from pxr import Usd
print(choice.has_imaging, str(choice.folder) in Usd.__file__)
"""


def said(code: str, display: dict[str, str], folder: Path) -> list[str]:
    run = subprocess.run(
        [sys.executable, "-W", "error", "-c", code],
        env=display,
        capture_output=True,
        text=True,
        timeout=120,
        cwd=folder,
    )
    assert run.returncode == 0 and not run.stderr.strip(), run.stderr[-3000:]
    return run.stdout.splitlines()


def test_without_imaging_the_menu_says_why(display: dict[str, str], tmp_path: Path) -> None:
    kinds, hydra, *actions = said(WITHOUT, display, tmp_path)
    assert kinds == "2 True Built-in picture"
    assert hydra.startswith("Hydra the pxr of this process") and "has no UsdImagingGL" in hydra
    assert "built-in viewport" in hydra and "usdslf[hydra]" in hydra
    assert actions[0].startswith("True True | Built-in picture")
    assert actions[1] == f"False False | {hydra.removeprefix('Hydra ')}"


def test_the_viewer_chooses_before_anything_loads_pxr(display: dict[str, str], tmp_path: Path) -> None:
    *_, last = said(CHOSEN, display, tmp_path)
    assert last == f"{has_hydra()} True"


def test_the_engine_and_the_plugin_of_usdview_alone_import_pxr() -> None:
    importing = [
        str(f.relative_to(ROOT))
        for f in sorted((ROOT / "hydra_viewer").rglob("*.py"))
        if any(line.lstrip().startswith(("import pxr", "from pxr")) for line in f.read_text().splitlines())
    ]
    assert importing == ["hydra_viewer/hydra/engine.py", "hydra_viewer/usdview/container.py"]
