"""Plans: shots x stroke layers x variants, names, and that nothing leads out of the output folder."""

from __future__ import annotations

import ast
import re
import time
from collections.abc import Callable
from pathlib import Path

import pytest

import usdslf.batch
from usdslf.batch import plan
from usdslf.batch.job import Job
from usdslf.batch.places import staged, why_outside
from usdslf.errors import AuthorError, InputError


@pytest.fixture
def manifest(tmp_path: Path) -> Callable[[str], Path]:
    """Writes shots 010 and 020 with strokes a and b, and a manifest beside them."""
    for shot in ("010", "020"):
        (tmp_path / "shots" / shot).mkdir(parents=True)
        for name in ("shot", "a", "b"):
            (tmp_path / "shots" / shot / f"{name}.usda").write_text("#usda 1.0\n")

    def write(text: str) -> Path:
        (tmp_path / "batch.toml").write_text(text)
        return tmp_path / "batch.toml"

    return write


JOBS = '[[jobs]]\nshots = ["shots/*/shot.usda"]\nstrokes = ["{dir}/[ab].usda"]\n'


def test_jobs_are_shots_by_strokes_by_variants(manifest: Callable[[str], Path]) -> None:
    text = 'name = "{folder}_{strokes}_{variant}"\n[options]\nelements = 100\n' + JOBS
    found = plan(manifest(text + 'variants = [{name = "x"}, {name = "y", options = {elements = 50}}]\n'))
    names = [f"{s}_{k}_{v}" for s in ("010", "020") for k in "ab" for v in "xy"]
    assert [j.name for j in found.jobs] == names
    assert [j.options["elements"] for j in found.jobs] == [100, 50] * 4
    assert found.jobs[0].strokes.endswith("shots/010/a.usda") and set(found.why.values()) == {"new"}
    assert Job.of_json(found.jobs[1].as_json()) == found.jobs[1]


def test_a_path_that_is_not_there_is_a_job_and_a_glob_that_matches_nothing_an_error(
    manifest: Callable[[str], Path],
) -> None:
    found = plan(manifest('[[jobs]]\nshots = ["none.usda"]\nstrokes = ["s.usda"]\n'))
    assert [j.name for j in found.jobs] == ["none"]
    with pytest.raises(InputError, match=r"line 2: 'none\*.usda' matches no file"):
        plan(manifest('[[jobs]]\nshots = ["none*.usda"]\nstrokes = ["s.usda"]\n'))


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (JOBS, "would both have the name 'shot'"),
        ('name = "../{stem}"\n' + JOBS, "leads out of the output folder"),
        ('name = "/tmp/{folder}_{strokes}"\n' + JOBS, "is an absolute path"),
        ('name = "{folder}/../../{strokes}"\n' + JOBS, "leads out"),
        ('name = ".{folder}"\n' + JOBS, "is no name of a folder"),
        ('name = "index.html"\n' + JOBS, "is a file of the summary"),
        ('name = "{nothing}"\n' + JOBS, r"names \{nothing\}; choose from \{folder\}"),
        ('name = "{folder.__class__}"\n' + JOBS, "choose from"),
        ('name = "{folder"\n' + JOBS, "is no template"),
        ('output = "../out"\n' + JOBS, "line 1: output = '../out' leads out"),
        ('output = "/tmp/out"\n' + JOBS, "leads out"),
        (JOBS + 'look = "l.usda"\n', "either strokes to solve or a look"),
        ('[[jobs]]\nshots = ["x.usda"]\nstrokes = ["s.usda"]\njoint = true\n', "joint jobs need a name"),
    ],
)
def test_names_that_cannot_be_meant_are_refused(manifest: Callable[[str], Path], text: str, words: str) -> None:
    with pytest.raises(InputError, match=words):
        plan(manifest(text))


def test_links_on_the_way_are_refused(manifest: Callable[[str], Path], tmp_path: Path) -> None:
    away = tmp_path / "away"
    away.mkdir()
    text = 'output = "out"\nname = "{folder}/{strokes}"\n' + JOBS
    (tmp_path / "out").mkdir()
    (tmp_path / "out/010").symlink_to(away)
    with pytest.raises(InputError, match="is a link"):
        plan(manifest(text))
    with pytest.raises(AuthorError, match="is a link"), staged(tmp_path / "out", "010/a"):
        pass
    (tmp_path / "out/010").unlink()
    (tmp_path / "out").rmdir()
    (tmp_path / "out").symlink_to(away)
    with pytest.raises(InputError, match="is a link"):
        plan(manifest(text))
    assert not list(away.iterdir())


def test_results_are_whole_or_not_there(tmp_path: Path) -> None:
    with staged(tmp_path, "a/b") as folder:
        (folder / "x").write_text("1")
    with pytest.raises(ValueError), staged(tmp_path, "a/b") as folder:
        (folder / "x").write_text("2")
        raise ValueError
    assert (tmp_path / "a/b/x").read_text() == "1"
    assert [p.name for p in (tmp_path / "a").iterdir()] == ["b"]  # nothing else is left
    assert why_outside(tmp_path, "a/b") == ""


def test_ten_thousand_jobs_are_planned_in_seconds(tmp_path: Path) -> None:
    for k in range(100):
        (tmp_path / f"{k:03d}").mkdir()
        (tmp_path / f"{k:03d}/shot.usda").touch()
    variants = ", ".join(f'{{name = "v{v}"}}' for v in range(100))
    text = 'name = "{folder}/{variant}"\n[[jobs]]\nshots = ["*/shot.usda"]\nstrokes = ["{dir}/s.usda"]\n'
    (tmp_path / "batch.toml").write_text(text + f"variants = [{variants}]\n")
    began = time.process_time()
    found = plan(tmp_path / "batch.toml")
    assert len(found.jobs) == len(found.to_run) == 10000
    assert time.process_time() - began < 10


def test_the_readme_says_what_can_be_run(tmp_path: Path) -> None:
    text = (Path(__file__).parents[2] / "README.md").read_text(encoding="utf-8")
    (block,) = re.findall(r"```toml\n(.*?)```", text, re.S)
    (tmp_path / "batch.toml").write_text(block)
    files = (
        "hdri/a.hdr",
        "shots/010/shot.usda",
        "shots/010/strokes_1.usda",
        "shots/020/shot.usda",
        "shots/020/strokes.usda",
    )
    for name in files:
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).touch()
    names = [j.name for j in plan(tmp_path / "batch.toml").jobs]
    assert names[:4] == ["010_strokes_1", "020_strokes", "accepted/010", "accepted/020"]
    assert names[4:6] == ["teapot/measure/set_day_strokes", "teapot/measure/set_night_strokes"]
    assert names[-1] == "teapot/shots/set_night_strokes" and "teapot/look" in names
    for code in re.findall(r"```python\n(.*?)```", text, re.S):
        imported = [n.name for t in ast.walk(ast.parse(code)) if isinstance(t, ast.ImportFrom) for n in t.names]
        assert set(imported) <= set(usdslf.batch.__all__) if "usdslf.batch" in code else True
