"""The bench of starts: a first and a second one, as installed, of which the first alone finds nothing of the shot."""

from __future__ import annotations

import os
from pathlib import Path

import pytest
from kit.stage_parts import StageBuilder

from usdslf.cache import SWITCH
from usdslf.cli import bench_start
from usdslf.errors import UsdslfError
from usdslf.shot_cache import KINDS


@pytest.fixture
def stage(tmp_path: Path) -> str:
    b = StageBuilder(tmp_path)
    b.plane("floor", 4, 4, b.material("floor", diffuseColor=(0.5, 0.5, 0.5)))
    b.rect_light("lamp", (0, 3, 0), (0, 0, 0), 1, 1, (3, 3, 3))
    b.camera((0, 2, 4), (0, 0, 0))
    return str(b.save())


def test_a_second_start_finds_what_the_first_one_kept(stage: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PYTHONDONTWRITEBYTECODE", "1")
    plain, found = bench_start._seconds, []

    def noted(asked: list[str], environment: dict[str, str]) -> float:
        folder = Path(environment["XDG_CACHE_HOME"])
        kinds = {f.name.split("-")[0] for f in (folder / "usdslf").iterdir()} & set(KINDS)
        byte_code = any((folder / "byte_code").rglob("live/picture*.pyc"))
        found.append((environment[SWITCH], asked[1], bool(kinds), byte_code))
        return plain(asked, environment)

    monkeypatch.setattr(bench_start, "_seconds", noted)
    first, second = bench_start.start_steps(stage, 150, (32, 18), None)
    assert found == [
        ("weights", str(bench_start.FEW), False, False), ("all", "150", False, True), ("all", "150", True, True)
    ]  # fmt: skip
    assert first.seconds > second.seconds > 0 and second.limit_seconds == first.seconds / bench_start.AIM
    assert os.environ["PYTHONDONTWRITEBYTECODE"] == "1"


def test_a_start_that_fails_is_a_sentence(tmp_path: Path) -> None:
    with pytest.raises(UsdslfError, match=r"a start cannot be measured: .*does not exist"):
        list(bench_start.start_steps(str(tmp_path / "none.usda"), 150, (32, 18), None))
