"""Manifests are checked by the published schema, and errors name their line."""

from __future__ import annotations

import json
import re
from pathlib import Path

import jsonschema
import pytest

from usdslf.batch import plan, write_template
from usdslf.batch.manifest import key_lines, read_manifest, schema
from usdslf.errors import InputError

GOOD = """# a comment with [brackets] and "quotes
output = "out"
[limits]
seconds = 9.5
[[jobs]]
shots = [
  "a[1]/*.usda",   # ]
  'b.usda',
]
strokes = ["{dir}/s.usda"]
[jobs.options]
elements = 300
[[jobs]]
name = '''
x
[y]'''
shots = ["c.usda"]
look = "look.usda"
variants = [{name = "n", options = {norm = "l0"}}]
"""


def write(folder: Path, text: str) -> Path:
    (folder / "batch.toml").write_text(text)
    return folder / "batch.toml"


def test_the_schema_is_one_and_takes_a_good_manifest(tmp_path: Path) -> None:
    jsonschema.Draft202012Validator.check_schema(schema())
    found = read_manifest(write(tmp_path, GOOD))
    assert found.values["jobs"][1]["variants"][0]["options"] == {"norm": "l0"}
    published = json.loads((Path(__file__).parents[2] / "schemas/batch.schema.json").read_text())
    assert published == schema()


def test_lines_of_keys_are_those_of_the_text() -> None:
    lines = key_lines(GOOD)
    text = GOOD.splitlines()
    for key, line in lines.items():
        last = next(k for k in reversed(key) if isinstance(k, str))
        assert last in text[line - 1], (key, line)
    assert lines["jobs", 0, "options", "elements"] == 12
    assert lines["jobs", 1, "shots"] == 17 and lines["jobs", 1] == 13
    assert ("y",) not in lines and ("x",) not in lines  # a text of several lines


@pytest.mark.parametrize(
    ("change", "line", "words"),
    [
        (("elements = 300", "elements = true"), 12, r"jobs\[1\]\.options\.elements = true is no integer"),
        (("elements = 300", "elemnts = 300"), 12, r"no key 'elemnts' .* choose from norm, .*elements"),
        (("seconds = 9.5", "seconds = 0"), 4, r"limits\.seconds = 0 is not above 0"),
        (('norm = "l0"', 'norm = "l3"'), 19, r"'?l3\"? is unknown; choose one of l2, l0, mixed"),
        (('shots = ["c.usda"]', "shots = []"), 17, r"has fewer than 1 items"),
        (('shots = ["c.usda"]', 'shot = ["c.usda"]'), 13, r"'?shot'?"),
        (('output = "out"', "output = out"), 2, r"no TOML"),
        (("seconds = 9.5", 'seconds = "9'), 4, r"no TOML"),
    ],
)
def test_errors_name_line_and_key(tmp_path: Path, change: tuple[str, str], line: int, words: str) -> None:
    with pytest.raises(InputError) as error:
        read_manifest(write(tmp_path, GOOD.replace(*change)))
    said = str(error.value)
    assert said.startswith(f"batch.toml, line {line}: ") and re.search(words, said), said
    assert "\n" not in said


def test_what_is_no_text_or_not_there_is_said(tmp_path: Path) -> None:
    (tmp_path / "batch.toml").write_bytes(b"a = '\xff'\n")
    with pytest.raises(InputError, match="not UTF-8 at byte 5"):
        read_manifest(tmp_path / "batch.toml")
    with pytest.raises(InputError, match="there is no manifest"):
        read_manifest(tmp_path / "none.toml")


def test_values_in_python_are_a_manifest_relative_to_the_current_folder(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    for name in ("a", "b"):
        (tmp_path / f"{name}.usda").write_text("#usda 1.0\n")
    values = {"output": "out", "limits": {"seconds": 9}, "jobs": ({"shots": [Path("?.usda")], "look": "look.usda"},)}
    found = plan(values)
    written = plan(
        write(tmp_path, 'output = "out"\n[limits]\nseconds = 9\n[[jobs]]\nshots = ["?.usda"]\nlook = "look.usda"\n')
    )
    assert found.jobs == written.jobs and (found.output, found.limits) == (written.output, written.limits)
    assert [j.shot for j in found.jobs] == [str(tmp_path / "a.usda"), str(tmp_path / "b.usda")]
    with pytest.raises(InputError, match="no file of one"):
        write_template(found, tmp_path / "farm.yaml")


@pytest.mark.parametrize(
    ("values", "words"),
    [
        ({"jobs": []}, "^manifest: jobs = \\[\\] has fewer than 1 items$"),
        (
            {"jobs": [{"shots": ["a.usda"], "strokes": ["s.usda"], "speed": 1}]},
            "^manifest: there is no key 'speed' in jobs",
        ),
        ({"jobs": [{"shots": {1, 2}}]}, "^manifest: .*set.*; give texts, numbers, lists and tables$"),
    ],
)
def test_wrong_values_in_python_are_named_without_a_line(values: dict[str, object], words: str) -> None:
    with pytest.raises(InputError, match=words):
        read_manifest(values)
