"""The public names are documented, listed, and typed for those who install the program."""

from __future__ import annotations

import ast
import subprocess
import sys
import sysconfig
import venv
import zipfile
from pathlib import Path

import pytest
from public_api.docstrings import entries, gaps

import usdslf

ROOT = Path(__file__).resolve().parents[2]
SCRIPT = Path(__file__).with_name("user_script.py")


@pytest.fixture(scope="module")
def python(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The Python of an environment that the program's wheel is unpacked in; what it depends on comes from this one."""
    folder = tmp_path_factory.mktemp("installed")
    venv.create(folder / "env", with_pip=False, symlinks=True)
    code = f"import hatchling.build; print(hatchling.build.build_wheel({str(folder)!r}))"
    built = subprocess.run([sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, check=True)
    (site,) = (folder / "env/lib").glob("python*/site-packages")
    with zipfile.ZipFile(folder / built.stdout.split()[-1]) as wheel:
        wheel.extractall(site)
    # Beside it, not before it: an editable install there leads to the checkout.
    (site / "others.pth").write_text(sysconfig.get_path("purelib") + "\n")
    return folder / "env/bin/python"


def strict(python: Path, script: Path, folder: Path) -> str:
    """What mypy --strict says of a script, from a folder that is not the repository; it keeps what it read."""
    command = [
        sys.executable, "-m", "mypy", "--strict", "--config-file=", "--cache-dir", str(python.parent / "cache"),
        "--python-executable", str(python), str(script),
    ]  # fmt: skip
    return subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False).stdout


def test_a_script_with_every_public_name_is_right_by_mypy_strict(python: Path, tmp_path: Path) -> None:
    said = strict(python, SCRIPT, tmp_path)
    assert said.startswith("Success"), said
    used = {
        n.attr
        for n in ast.walk(ast.parse(SCRIPT.read_text(encoding="utf-8")))
        if isinstance(n, ast.Attribute) and isinstance(n.value, ast.Name) and n.value.id == "usdslf"
    }
    assert used == set(usdslf.__all__)


def test_what_is_wrong_in_a_users_script_is_found(python: Path, tmp_path: Path) -> None:
    """The types of the installed program are seen: it says that it has them."""
    lines = {
        "usdslf.nothing_of_the_kind": "attr-defined",
        "usdslf.read_strokes(1)": "arg-type",
        "usdslf.read_strokes('a')[0].tool + 1": "operator",
        "usdslf.open('shot.usda').scene.up_axis.nothing": "attr-defined",
        "usdslf.open('shot.usda').scene.nothing": "attr-defined",
    }
    script = tmp_path / "wrong.py"
    script.write_text("import usdslf\n" + "\n".join(lines) + "\n")
    said = strict(python, script, tmp_path).splitlines()
    for number, code in enumerate(lines.values(), start=2):
        assert any(line.startswith(f"wrong.py:{number}: error") and f"[{code}]" in line for line in said), said


def test_every_public_docstring_says_what_it_should() -> None:
    assert gaps(usdslf) == []


def test_names_are_there_once_and_listed() -> None:
    assert len(set(usdslf.__all__)) == len(usdslf.__all__)  # their order is ruff's
    assert set(usdslf.__all__) <= set(dir(usdslf))


# ---- what the check finds -----------------------------------------------------------------------------------
def test_entries_of_a_docstring() -> None:
    doc = """Does it.

    Args:
        a: (n, 3) one
            that goes on.
        b, c: both.

    Raises: nothing.
    """
    assert entries(doc) == {"a": "(n, 3) one that goes on.", "b": "both.", "c": "both."}


def test_gaps_are_named(monkeypatch: pytest.MonkeyPatch) -> None:
    from types import ModuleType

    from public_api import wanting

    module = ModuleType("wanting", "    told    in the list\n    shape   too\n    fails   too\n    Thing   too\n")
    module.__all__ = ["fails", "shape", "told", "untold", "Thing"]  # type: ignore[attr-defined]
    for name in module.__all__:
        setattr(module, name, getattr(wanting, name))
    assert set(gaps(module)) == {
        "untold: no docstring",
        "untold: not in the list of public names that wanting begins with",
        "shape: no shape of values",
        "shape: no shape of what it returns",
        "shape: nothing on the parameter other",
        "fails: raises UsdslfError and does not say so",
        "Thing: nothing on the attribute color",
        "Thing.radius: no unit or range",
        "Thing.solve: nothing on what it returns",
    }
