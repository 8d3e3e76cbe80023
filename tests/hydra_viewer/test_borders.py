"""Who imports what: the viewer takes public names alone, its model knows no Qt, and nobody else knows either."""

from __future__ import annotations

import ast
from collections.abc import Iterator
from pathlib import Path

import usdslf
import usdslf.review

ROOT = Path(__file__).resolve().parents[2]
PUBLIC = {"usdslf": set(usdslf.__all__), "usdslf.review": set(usdslf.review.__all__)}


def imported(file: Path) -> Iterator[tuple[str, tuple[str, ...]]]:
    """Modules that a file imports, with the names that it takes from each."""
    for node in ast.walk(ast.parse(file.read_text(encoding="utf-8"))):
        if isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{file}: a relative import"
            yield node.module or "", tuple(a.name for a in node.names)
        elif isinstance(node, ast.Import):
            yield from ((a.name, ()) for a in node.names)


def files(folder: str) -> list[Path]:
    found = sorted((ROOT / folder).rglob("*.py"))
    assert found
    return found


def test_the_viewer_uses_usdslf_by_its_public_names_only() -> None:
    taken = 0
    for file in files("hydra_viewer"):
        for module, names in imported(file):
            assert not module.startswith("usdslf.") or module in PUBLIC, f"{file.name} imports {module}"
            if module in PUBLIC:
                assert set(names) <= PUBLIC[module], f"{file.name} takes {sorted(names)}"
                taken += 1
    assert taken


def test_the_model_knows_no_qt() -> None:
    for file in files("hydra_viewer/model"):
        for module, _ in imported(file):
            assert not module.startswith(("PySide6", "hydra_viewer.ui")), f"{file.name} imports {module}"


def test_nothing_outside_the_viewer_knows_qt() -> None:
    for file in files("usdslf"):
        for module, _ in imported(file):
            assert not module.startswith("PySide6"), f"{file.name} imports {module}"
