"""Which pxr a process uses, asked in processes of their own: packages of files that say who they are."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

PYTHON = f"python{sys.version_info.major}.{sys.version_info.minor}"
OF_BPY = f"bpy/9.1/python/lib/{PYTHON}/site-packages"
ROOT = Path(__file__).resolve().parents[2]
# Only the package path of the process is looked at, so that nothing that is really installed answers.
ASK = """
import sys
sys.path[:] = [p for p in sys.path if "site-packages" not in p] + {folders!r}
sys.path.insert(0, {root!r})
from importlib.util import module_from_spec, spec_from_file_location
spec = spec_from_file_location("which_pxr", {root!r} + "/usdslf/usd/which_pxr.py")
which = module_from_spec(spec); sys.modules["which_pxr"] = which; spec.loader.exec_module(which)
{before}
found = which.choose_pxr()
again = which.choose_pxr()
assert again == which.find_pxr() == found
print(found.origin, found.has_imaging, sum(isinstance(f, which._PxrOf) for f in sys.meta_path))
print(found.sentence)
try:
    import pxr; print(pxr.who)
except ImportError: print("no pxr")
try:
    import beside; print("beside was found")
except ImportError: print("nothing beside")
"""


def package(folder: Path, who: str, has_imaging: bool) -> None:
    (folder / "pxr").mkdir(parents=True)
    (folder / "pxr/__init__.py").write_text(f"who = {who!r}\n")
    if has_imaging:
        (folder / "pxr/UsdImagingGL").mkdir()
        (folder / "pxr/UsdImagingGL/__init__.py").write_text("")


def with_bpy(folder: Path, place: str = OF_BPY) -> None:
    package(folder / place, "bpy", True)
    (folder / place / "beside.py").write_text("")
    (folder / "bpy/__init__.py").write_text("raise SystemExit('bpy was imported')\n")


def ask(folder: Path, before: str = "") -> list[str]:
    code = ASK.format(folders=[str(folder)], root=str(ROOT), before=before)
    environment = {k: v for k, v in os.environ.items() if not k.startswith("PYTHON")}
    run = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, env=environment, timeout=60)
    assert run.returncode == 0, run.stderr
    return run.stdout.splitlines()


def test_an_installed_pxr_with_imaging_comes_before_that_of_bpy(tmp_path: Path) -> None:
    package(tmp_path, "studio", True)
    with_bpy(tmp_path)
    said = ask(tmp_path)
    assert said[0] == "installed True 0" and said[2:] == ["studio", "nothing beside"]


def test_the_pxr_of_bpy_stands_in_for_one_without_imaging_and_brings_nothing_else(tmp_path: Path) -> None:
    package(tmp_path, "usd-core", False)
    with_bpy(tmp_path)
    said = ask(tmp_path)
    assert said[0] == "bpy True 1" and said[2:] == ["bpy", "nothing beside"]
    assert "GPL-3" in said[1]


@pytest.mark.parametrize("has_pxr", [True, False])
def test_without_imaging_a_sentence_says_why_and_what_brings_it(tmp_path: Path, has_pxr: bool) -> None:
    if has_pxr:
        package(tmp_path, "usd-core", False)
    said = ask(tmp_path)
    assert said[0] == ("installed" if has_pxr else "none") + " False 0"
    assert "usdslf[hydra]" in said[1] and "built-in viewport" in said[1]
    assert said[2] == ("usd-core" if has_pxr else "no pxr")


def test_a_pxr_that_is_in_use_stays(tmp_path: Path) -> None:
    package(tmp_path, "usd-core", False)
    with_bpy(tmp_path)
    said = ask(tmp_path, "import pxr")
    assert said[0] == "installed False 0" and said[2] == "usd-core"
    assert "imported before" in said[1]


def test_a_bpy_for_another_python_is_left_alone(tmp_path: Path) -> None:
    with_bpy(tmp_path, OF_BPY.replace(PYTHON, "python3.1"))
    said = ask(tmp_path)
    assert said[0] == "none False 0" and "not for this Python" in said[1] and said[2] == "no pxr"
