"""How the program is built stays what it was made to be; `python tests/structure.py` prints the measurements."""

from __future__ import annotations

import ast
from pathlib import Path

import pytest
from structure import (
    LONGEST_MODULE,
    ROOT,
    Module,
    Structure,
    circles,
    functions,
    imports_of,
    levels,
    measure,
    parameters,
    read_modules,
    unused,
)

import usdslf

# Called by programs that read the validators' plugin information, and by users' own scripts.
CALLED_FROM_OUTSIDE = ("register_validators",)


@pytest.fixture(scope="module")
def structure() -> Structure:
    return measure()


def test_nothing_goes_round_in_circles(structure: Structure) -> None:
    assert len(structure.modules) > 100 and len(structure.rooms) > 20  # there was something to look at
    assert structure.circles == []


def test_modules_and_functions_are_short_and_take_few_parameters(structure: Structure) -> None:
    assert structure.long_modules == []
    assert structure.long_functions == []
    assert structure.many_parameters == []


def test_nothing_in_the_program_is_there_for_tests_alone() -> None:
    assert unused(read_modules(), (*usdslf.__all__, *CALLED_FROM_OUTSIDE)) == []


def test_no_test_imports_another_one() -> None:
    for file in sorted((ROOT / "tests").rglob("*.py")):
        for node in ast.walk(ast.parse(file.read_text(encoding="utf-8"))):
            if isinstance(node, ast.ImportFrom):
                assert not (node.module or "").rsplit(".", 1)[-1].startswith("test_"), (file, node.lineno)


def test_files_of_tests_are_short_too() -> None:
    lines = {file: file.read_text(encoding="utf-8").count("\n") for file in (ROOT / "tests").rglob("*.py")}
    assert len(lines) > 200
    assert {str(file): n for file, n in lines.items() if n > LONGEST_MODULE} == {}


def test_tests_lie_in_the_folders_of_what_they_test() -> None:
    own = {"kit", "inputs", "reference", "truth", "journeys", "bench", "public_api"}
    for folder in sorted({f.parent.relative_to(ROOT / "tests") for f in (ROOT / "tests").rglob("test_*.py")}):
        assert folder.parts[:1] in ((), *((name,) for name in own)) or any(
            (ROOT / there / folder).is_dir() for there in ("usdslf", ".")
        ), folder


# ---- the measurements themselves --------------------------------------------------------------------------
def module(name: str, text: str) -> Module:
    return Module(name, text, ast.parse(text))


def test_circles_and_levels_of_known_graphs() -> None:
    line = {"a": {"b"}, "b": {"c"}, "c": set(), "d": {"c"}}
    assert circles(line) == [] and levels(line) == 3
    assert circles(line | {"c": {"a"}}) == [["a", "b", "c"]]
    assert circles({"a": {"b"}, "b": {"a"}, "c": {"d"}, "d": {"c", "a"}}) == [["a", "b"], ["c", "d"]]


def test_imports_are_found_wherever_they_run() -> None:
    names = ["p.a", "p.b", "p.c", "p.d", "p.e", "p"]
    text = """
from typing import TYPE_CHECKING
import p.a
from p import b
from p.c import thing
if TYPE_CHECKING:
    from p.e import other
def f():
    from p.d import late
"""
    assert imports_of(module("p.x", text), names) == {"p.a", "p.b", "p.c", "p.d"}


def test_parameters_are_those_that_a_call_can_give() -> None:
    text = """
class A:
    def method(self, a, b=1, *, c): ...
def plain(a, /, b, *rest, c, **more): ...
def none(): ...
"""
    found = {name.split(":")[1]: parameters(f) for name, f in functions(module("m", text))}
    assert found == {"A.method": 3, "plain": 5, "none": 0}


def test_what_nobody_refers_to_is_found() -> None:
    first = module("p.a", """
def used(): ...
def alone(): return alone()
def public(): ...
class A(Protocol):
    def called(self): ...
    def forgotten(self): ...
class B(elsewhere.Base):
    def called_there(self): ...
@main.command()
def typed(): ...
""")  # fmt: skip
    second = module("p.b", "from p.a import A, B, used\nA().called()\n")
    assert unused({"p.a": first, "p.b": second}, ["public"]) == ["p.a:A.forgotten", "p.a:alone"]


def test_the_program_is_read_whole(tmp_path: Path) -> None:
    (tmp_path / "usdslf/a").mkdir(parents=True)
    (tmp_path / "hydra_viewer").mkdir()
    (tmp_path / "usdslf/__init__.py").write_text("")
    (tmp_path / "usdslf/a/__init__.py").write_text("")
    (tmp_path / "usdslf/a/one.py").write_text("from usdslf.b import x\n" + "# a line\n" * 400)
    (tmp_path / "usdslf/b.py").write_text("def x(a, b, c, d, e, f, g, h, i): ...\nfrom usdslf.a.one import y\n")
    found = measure(tmp_path)
    assert found.rooms == {"usdslf": set(), "usdslf.a": {"usdslf.b"}, "usdslf.b": {"usdslf.a"}}
    assert found.circles == [["usdslf.a.one", "usdslf.b"], ["usdslf.a", "usdslf.b"]]
    assert found.long_modules == [(401, "usdslf.a.one")]
    assert found.many_parameters == [(9, "usdslf.b:x")]
